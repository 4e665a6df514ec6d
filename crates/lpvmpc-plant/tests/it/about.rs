//! A plant about its steady state is its f, on every kind of number.

use lpvmpc::{Embedding, LpvModel, Number};
use lpvmpc_certificate::{Interval, TaylorModel};
use lpvmpc_plant::{AboutEquilibrium, Plant};
use nalgebra::{SVector, Vector3, Vector5};

/// Two states and an input; `["state", 0]`, `["state", 1]`, `["input", 0]` and 0.7 are the results 0 to 3, and
/// `operations` follow, of which the last one drives the second state.
fn plant(operations: &str) -> Plant {
    let count = operations.matches('[').count();
    let text = format!(
        r#"{{"schema": 1, "name": "test", "states": [{{"name": "a"}}, {{"name": "b"}}],
            "inputs": [{{"name": "u"}}], "parameters": [{{"name": "p", "value": 1.3}}],
            "operations": [["state", 0], ["state", 1], ["input", 0], ["parameter", 0], {operations}],
            "derivative": [1, {}]}}"#,
        3 + count
    );
    Plant::from_json(&text).unwrap()
}

/// Each with every component in it, and values near 0.4 where roots and powers need them positive.
const SMOOTH: [&str; 27] = [
    r#"["add", 0, 1], ["sub", 4, 2]"#,
    r#"["mul", 0, 1], ["mul", 4, 2]"#,
    r#"["add", 1, 3], ["div", 0, 4], ["div", 2, 4], ["mul", 5, 6]"#,
    r#"["sq", 0], ["inv", 1], ["neg", 5], ["add", 4, 6]"#,
    r#"["mul", 0, 0], ["mul", 3, 4], ["mul", 5, 1]"#,
    r#"["mul", 0, 2], ["sin", 4], ["cos", 1], ["mul", 5, 6]"#,
    r#"["tan", 0], ["tanh", 1], ["mul", 4, 5]"#,
    r#"["add", 0, 1], ["exp", 4], ["expm1", 2], ["add", 5, 6]"#,
    r#"["sinh", 0], ["cosh", 1], ["add", 4, 5]"#,
    r#"["mul", 0, 1], ["sqrt", 4]"#,
    r#"["constant", 3], ["pow", 0, 4], ["constant", -2], ["pow", 1, 6], ["add", 5, 7]"#,
    r#"["constant", 0.5], ["pow", 0, 4], ["constant", -1.5], ["pow", 1, 6], ["add", 5, 7]"#,
    r#"["constant", 0], ["pow", 0, 4], ["constant", 1], ["pow", 1, 6], ["add", 5, 7]"#,
    r#"["div", 3, 0], ["exp", 4], ["mul", 5, 1]"#,
    r#"["constant", 0.3], ["mul", 3, 4], ["sin", 5], ["mul", 6, 0]"#,
    r#"["constant", 2.5], ["div", 0, 4], ["sub", 5, 5], ["add", 6, 1]"#,
    r#"["mul", 0, 1], ["log", 4], ["log1p", 2], ["mul", 5, 6]"#,
    r#"["constant", 6], ["mul", 4, 0], ["atan", 5], ["sub", 1, 2], ["atan", 7], ["add", 6, 8]"#,
    r#"["asin", 0], ["acos", 1], ["mul", 4, 5], ["atanh", 2], ["add", 6, 7]"#,
    r#"["asinh", 0], ["add", 1, 3], ["acosh", 5], ["mul", 4, 6]"#,
    // In the three half-planes where it does not jump.
    r#"["atan2", 0, 1], ["sub", 2, 3], ["atan2", 1, 5], ["add", 4, 6]"#,
    r#"["sub", 0, 3], ["sub", 1, 2], ["atan2", 4, 5], ["atan2", 5, 3], ["mul", 6, 7]"#,
    r#"["constant", 1.7], ["pow", 0, 4], ["constant", -0.3], ["pow", 1, 6], ["mul", 5, 7]"#,
    r#"["pow", 0, 1], ["pow", 3, 2], ["pow", 1, 3], ["add", 4, 5], ["add", 6, 7]"#,
    // Of a base below zero.
    r#"["constant", 33], ["sub", 0, 3], ["pow", 5, 4], ["constant", 18], ["pow", 1, 7], ["add", 6, 8]"#,
    r#"["constant", -3], ["sub", 0, 3], ["pow", 5, 4], ["constant", 5], ["pow", 5, 7], ["add", 6, 8]"#,
    r#"["sq", 0], ["add", 4, 3], ["sqrt", 5], ["div", 0, 6], ["atan", 7], ["sin", 8]"#,
];

const BASE: [f64; 3] = [0.4, 0.5, 0.45];

/// Numbers from -1 to 1.
fn random() -> impl FnMut() -> f64 {
    let mut random = 1_u32;
    move || {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(random) / f64::from(u32::MAX) * 2.0 - 1.0
    }
}

fn about(plant: &Plant, base: &[f64]) -> AboutEquilibrium<3, 2, 5> {
    let ends: Vec<(f64, f64)> = base.iter().map(|value| (*value, *value)).collect();
    AboutEquilibrium::new(plant, &ends, 2.0).unwrap()
}

/// (A x + B u) in places for three states and two inputs.
fn product<N: Number>(about: &AboutEquilibrium<3, 2, 5>, way: [N; 3]) -> Vector3<N> {
    let zero = N::constant(0.0);
    let s = Vector5::new(way[0], way[1], zero, way[2], zero);
    let (a, b) = Embedding::matrices(about, &s);
    SVector::from_fn(|i, _| a[(i, 0)] * way[0] + a[(i, 1)] * way[1] + b[(i, 0)] * way[2])
}

#[test]
fn the_factors_are_the_difference_of_f() {
    let mut next = random();
    for operations in SMOOTH {
        let plant = plant(operations);
        let about = about(&plant, &BASE);
        let rest = plant.derivative(&BASE[..2], &BASE[2..]).unwrap();
        for point in 0..50 {
            let size = if point % 2 == 0 { 1.0 } else { 1e-5 };
            let way: [f64; 3] = std::array::from_fn(|_| 0.3 * size * next());
            let at: Vec<f64> = way.iter().zip(BASE).map(|(way, base)| base + way).collect();
            let rates = plant.derivative(&at[..2], &at[2..]).unwrap();
            let found = product(&about, way);
            for i in 0..2 {
                let error = (found[i] - (rates[i] - rest[i])).abs();
                assert!(
                    error < 2e-15 * (10.0 + rates[i].abs()),
                    "{operations}: {error:e}"
                );
            }
            // Where the interval has one number, it has what the plain numbers have, and is not wide.
            let enclosed = product(&about, way.map(Interval::point));
            for i in 0..2 {
                let within = enclosed[i].lower <= found[i] && found[i] <= enclosed[i].upper;
                let narrow = enclosed[i].upper - enclosed[i].lower < 1e-10 * (1.0 + found[i].abs());
                assert!(
                    within && narrow,
                    "{operations}: {} in {:?}",
                    found[i],
                    enclosed[i]
                );
            }
        }
    }
}

/// The value of a model's polynomial at z.
fn polynomial(model: &TaylorModel<3>, z: [f64; 3]) -> f64 {
    let mut sum = model.middle;
    for i in 0..3 {
        sum += model.slopes()[i] * z[i];
        for j in i..3 {
            sum += model.squares()[i][j] * z[i] * z[j];
        }
    }
    sum
}

/// f(x_r + x, u_r + u) over the box about `centre`, as a Taylor model.
fn over_box(plant: &Plant, centre: [f64; 3], half_width: f64) -> TaylorModel<3> {
    let way = std::array::from_fn(|i| TaylorModel::symbol(centre[i], half_width, i));
    product(&about(plant, &BASE), way)[1]
}

/// Taylor models of the factors contain the difference of f in every box, and their error falls with the third power
/// of its width.
#[test]
fn the_factors_over_a_box_enclose_the_difference_of_f() {
    let mut next = random();
    for operations in SMOOTH {
        let plant = plant(operations);
        let rest = plant.derivative(&BASE[..2], &BASE[2..]).unwrap()[1];
        for _ in 0..20 {
            let centre: [f64; 3] = std::array::from_fn(|_| 0.2 * next());
            let half_width = 0.08;
            let model = over_box(&plant, centre, half_width);
            for corner in 0..50 {
                let z: [f64; 3] = std::array::from_fn(|i| match corner {
                    0..8 => [-1.0, 1.0][(corner >> i) & 1],
                    _ => next(),
                });
                let at: [f64; 3] = std::array::from_fn(|i| BASE[i] + centre[i] + half_width * z[i]);
                let found = plant.derivative(&at[..2], &at[2..]).unwrap()[1] - rest;
                let error = (polynomial(&model, z) - found).abs();
                let rounding = 1e-14 * (1.0 + found.abs());
                assert!(
                    error <= model.error + rounding,
                    "{operations}: {error:e} above {:e} at {at:?}",
                    model.error
                );
            }
            let half = over_box(&plant, centre, 0.5 * half_width);
            let tiny = 1e-12 * (1.0 + model.middle.abs());
            assert!(
                half.error <= 0.2 * model.error + tiny,
                "{operations}: {:e} after {:e}",
                half.error,
                model.error
            );
        }
    }
}

/// With kinks at the steady state, near it, and on a surface through the box.
const KINKED: [&str; 7] = [
    r#"["constant", 0.4], ["sub", 0, 4], ["abs", 5]"#,
    r#"["constant", 0.45], ["sub", 0, 4], ["abs", 5], ["mul", 6, 1]"#,
    r#"["constant", 0.4], ["sub", 0, 4], ["abs", 5], ["mul", 5, 6]"#,
    r#"["sub", 0, 1], ["abs", 4], ["mul", 5, 2]"#,
    r#"["min", 0, 1], ["max", 4, 2]"#,
    r#"["constant", 0.3], ["constant", 0.5], ["max", 0, 4], ["min", 6, 5], ["sin", 7]"#,
    r#"["abs", 3], ["mul", 4, 0]"#,
];

/// The same holds of formulas with kinks, but that no box across one has a small error.
#[test]
fn the_factors_of_kinks_enclose_the_difference_of_f() {
    let mut next = random();
    for operations in KINKED {
        let plant = plant(operations);
        let about = about(&plant, &BASE);
        let rest = plant.derivative(&BASE[..2], &BASE[2..]).unwrap()[1];
        for point in 0..200 {
            let size = [1.0, 1e-5][point % 2];
            let way: [f64; 3] = std::array::from_fn(|_| 0.3 * size * next());
            let at: Vec<f64> = way.iter().zip(BASE).map(|(way, base)| base + way).collect();
            let difference = plant.derivative(&at[..2], &at[2..]).unwrap()[1] - rest;
            let found = product(&about, way)[1];
            assert!(
                (found - difference).abs() < 2e-14,
                "{operations}: {found} for {difference}"
            );
            let enclosed = product(&about, way.map(Interval::point))[1];
            let rounding = 1e-15;
            let within =
                enclosed.lower <= difference + rounding && difference - rounding <= enclosed.upper;
            assert!(within, "{operations}: {difference} in {enclosed:?}");
        }
        for _ in 0..20 {
            let centre: [f64; 3] = std::array::from_fn(|_| 0.2 * next());
            let half_width = 0.08;
            let model = over_box(&plant, centre, half_width);
            assert!(model.error.is_finite(), "{operations}");
            for _ in 0..50 {
                let z: [f64; 3] = std::array::from_fn(|_| next());
                let at: [f64; 3] = std::array::from_fn(|i| BASE[i] + centre[i] + half_width * z[i]);
                let found = plant.derivative(&at[..2], &at[2..]).unwrap()[1] - rest;
                let error = (polynomial(&model, z) - found).abs();
                assert!(
                    error <= model.error + 1e-14,
                    "{operations}: {error:e} at {at:?}"
                );
            }
        }
    }
}

#[test]
fn where_a_function_ends_or_jumps_nothing_is_known() {
    for (operations, centre) in [
        (r#"["log", 0]"#, [-0.38, 0.0, 0.0]),
        (r#"["log1p", 0]"#, [-1.38, 0.0, 0.0]),
        (r#"["asin", 0]"#, [0.58, 0.0, 0.0]),
        (r#"["acos", 0]"#, [0.58, 0.0, 0.0]),
        (r#"["atanh", 0]"#, [-1.38, 0.0, 0.0]),
        (r#"["pow", 0, 3]"#, [-0.38, 0.0, 0.0]),
        // The cut, and the origin.
        (r#"["sub", 1, 3], ["atan2", 0, 4]"#, [-0.42, 0.0, 0.0]),
        (r#"["atan2", 0, 1]"#, [-0.38, -0.52, 0.0]),
    ] {
        let model = over_box(&plant(operations), centre, 0.05);
        assert!(!model.error.is_finite(), "{operations}: {model:?}");
    }
}

#[test]
fn at_the_steady_state_the_factors_are_the_derivatives() {
    for operations in SMOOTH {
        let plant = plant(operations);
        let about = about(&plant, &BASE);
        let (a, b) = LpvModel::<f64, 3, 2, 5>::matrices(&about, &SVector::zeros());
        for column in 0..3 {
            let h = 1e-5;
            let moved = |h: f64| {
                let mut at = BASE;
                at[column] += h;
                plant.derivative(&at[..2], &at[2..]).unwrap()
            };
            let (more, less) = (moved(h), moved(-h));
            for i in 0..2 {
                let slope = (more[i] - less[i]) / (2.0 * h);
                let found = if column < 2 {
                    a[(i, column)]
                } else {
                    b[(i, 0)]
                };
                let scale = 1.0 + slope.abs();
                assert!(
                    (found - slope).abs() < 1e-7 * scale,
                    "{operations}: {found} for {slope}"
                );
            }
        }
        // The place left over decays, and nothing else.
        assert_eq!(
            (a[(2, 2)], a[(2, 0)], a[(0, 2)], b[(2, 1)], b[(0, 1)]),
            (-2.0, 0.0, 0.0, 0.0, 0.0)
        );
    }
}

/// The factors over a box of steady states contain those about each of them.
#[test]
fn an_enclosed_steady_state_is_enclosed() {
    let width = 1e-3;
    for operations in SMOOTH {
        let plant = plant(operations);
        let ends: Vec<(f64, f64)> = BASE.iter().map(|v| (v - width, v + width)).collect();
        let wide = about(&plant, &BASE).about(&ends).unwrap();
        let way = [0.05, -0.1, 0.2];
        let enclosed = product(&wide, way.map(Interval::point));
        for corner in 0..8 {
            let base: [f64; 3] = std::array::from_fn(|i| {
                BASE[i]
                    + if (corner >> i) & 1 == 1 {
                        width
                    } else {
                        -width
                    }
            });
            let found = product(&about(&plant, &base), way);
            assert!(
                (0..2).all(|i| enclosed[i].contains(Interval::point(found[i]))),
                "{operations}"
            );
        }
    }
}

#[test]
fn what_has_no_form_is_refused_by_its_place() {
    for (operation, name) in [
        (r#"["sign", 0]"#, "`sign`: it jumps"),
        (r#"["sign", 3]"#, "`sign`: it jumps"),
        (r#"["floor", 0]"#, "`floor`: it jumps"),
        (r#"["if_else_zero", 0, 1]"#, "`if_else_zero`: it jumps"),
        (r#"["lt", 0, 1]"#, "`lt`: it jumps"),
        (
            r#"["sinc", 0]"#,
            "`sinc`: no exact difference of it is known",
        ),
        // Of zero and zero it is zero; as a slope any number from -1 to 1 would do.
        (
            r#"["mean_sign", 3, 3]"#,
            "`mean_sign`: no exact difference of it is known",
        ),
    ] {
        let ends = [(0.4, 0.4), (0.5, 0.5), (0.4, 0.4)];
        let refused = AboutEquilibrium::<2, 1, 3>::new(&plant(operation), &ends, 1.0);
        let message = refused.unwrap_err().to_string();
        let expected = format!("operations[4]: no proof can be had of {name}");
        assert_eq!(message, expected);
    }
    let plant = plant(r#"["add", 0, 1]"#);
    for ends in [
        vec![],
        vec![(1.0, 0.0); 3],
        vec![(f64::NAN, 0.0); 3],
        vec![(0.0, f64::INFINITY); 3],
    ] {
        assert!(AboutEquilibrium::<2, 1, 3>::new(&plant, &ends, 1.0).is_err());
    }
    assert!(AboutEquilibrium::<1, 1, 2>::new(&plant, &[(0.0, 0.0); 3], 1.0).is_err());
}

#[test]
fn a_state_that_the_motion_never_reads_can_be_moved() {
    for (operations, expected) in [
        (r#"["mul", 1, 2]"#, [true, false]),
        (r#"["mul", 0, 1]"#, [false, false]),
        // Read by a formula that the motion does not need.
        (r#"["mul", 0, 1], ["mul", 2, 3]"#, [true, false]),
        (
            r#"["sin", 0], ["mul", 4, 2], ["add", 5, 1]"#,
            [false, false],
        ),
    ] {
        let plant = plant(operations);
        assert_eq!(plant.data().is_invariant_along(), expected, "{operations}");
        // Then the motion is the same wherever it stands.
        let [here, there] = [0.3, 7.0].map(|a| plant.derivative(&[a, 0.5], &[0.45]).unwrap());
        assert_eq!(here == there, expected[0], "{operations}");
    }
}
