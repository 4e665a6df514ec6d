//! A plant about its steady state is its f, on every kind of number.

use lpvmpc::{Embedding, LpvModel, Number};
use lpvmpc_certificate::Interval;
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
const SMOOTH: [&str; 16] = [
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
];

const BASE: [f64; 3] = [0.4, 0.5, 0.45];

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
    let mut random = 1_u32;
    let mut next = || {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        0.3 * (f64::from(random) / f64::from(u32::MAX) * 2.0 - 1.0)
    };
    for operations in SMOOTH {
        let plant = plant(operations);
        let about = about(&plant, &BASE);
        let rest = plant.derivative(&BASE[..2], &BASE[2..]).unwrap();
        for point in 0..50 {
            let size = if point % 2 == 0 { 1.0 } else { 1e-5 };
            let way: [f64; 3] = std::array::from_fn(|_| size * next());
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
        (r#"["abs", 0]"#, "abs"),
        (r#"["log", 0]"#, "log"),
        (r#"["pow", 0, 1]"#, "pow"),
        (r#"["min", 0, 1]"#, "min"),
        (r#"["atan2", 0, 1]"#, "atan2"),
    ] {
        let ends = [(0.4, 0.4), (0.5, 0.5), (0.4, 0.4)];
        let refused = AboutEquilibrium::<2, 1, 3>::new(&plant(operation), &ends, 1.0);
        let message = refused.unwrap_err().to_string();
        let expected = format!("operations[4]: no proof can be had of `{name}` here");
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
