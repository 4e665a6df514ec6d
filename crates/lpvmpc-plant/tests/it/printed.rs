//! Plants that were printed as Rust have the values of their files, to the last bit.

// Made by `print_rust`, the example of this crate.
#[rustfmt::skip]
pub mod cart_pole;
#[rustfmt::skip]
pub mod functions;

use crate::reference::{plant, points};
use crate::round_trip::drift;
use lpvmpc::{Dual, Dynamics, Embedding, Number};
use lpvmpc_certificate::{Interval, TaylorModel};
use lpvmpc_plant::{Plant, Signal, SizedEmbedding, SizedPlant};
use nalgebra::SVector;

#[test]
fn what_is_printed_is_what_is_compiled_here() {
    for (name, source) in [
        ("cart-pole", include_str!("printed/cart_pole.rs")),
        ("functions", include_str!("printed/functions.rs")),
    ] {
        assert_eq!(plant(name).to_rust(), source, "print {name}.json again");
    }
}

/// On one kind of number. NaN is NaN.
fn compare<N: Number>(lift: impl Fn(f64, usize) -> N, same: impl Fn(N, N) -> bool) {
    let cart_pole = SizedEmbedding::<4, 1, 2>::new(plant("cart-pole")).unwrap();
    let printed = cart_pole::CartPole::default();
    for point in points("cart-pole") {
        let x = SVector::from_fn(|i, _| lift(point.x[i], i));
        let u = SVector::from_fn(|i, _| lift(point.u[i], 4 + i));
        let f = printed.f(&x, &u);
        assert!(
            f.iter()
                .zip(&cart_pole.f(&x, &u))
                .all(|(a, b)| same(*a, *b))
        );
        let s = printed.scheduling(&x, &u);
        assert!(
            s.iter()
                .zip(&cart_pole.scheduling(&x, &u))
                .all(|(a, b)| same(*a, *b))
        );
        let ((a, b), (file_a, file_b)) = (printed.matrices(&s), cart_pole.matrices(&s));
        assert!(a.iter().zip(&file_a).all(|(a, b)| same(*a, *b)));
        assert!(b.iter().zip(&file_b).all(|(a, b)| same(*a, *b)));
        let y = cart_pole.plant().output::<N, 2>(&x, &u).unwrap();
        assert!(
            printed
                .output(&x, &u)
                .iter()
                .zip(&y)
                .all(|(a, b)| same(*a, *b))
        );
    }
    let functions = SizedPlant::<3, 2>::new(plant("functions")).unwrap();
    let printed = functions::Functions::default();
    for point in points("functions") {
        let x = SVector::from_fn(|i, _| lift(point.x[i], i));
        let u = SVector::from_fn(|i, _| lift(point.u[i], 3 + i));
        let f = printed.f(&x, &u);
        assert!(
            f.iter()
                .zip(&functions.f(&x, &u))
                .all(|(a, b)| same(*a, *b))
        );
    }
}

#[test]
fn a_printed_plant_has_the_same_numbers_to_the_last_bit() {
    compare(|value, _| value, |a, b| a.to_bits() == b.to_bits());
    compare(|value, _| value as f32, |a, b| a.to_bits() == b.to_bits());
    let variable = |value, i: usize| {
        let mut variable = Dual::<f64, 5>::fixed(value);
        variable.slopes[i] = 1.0;
        variable
    };
    let bits = |a: Dual<f64, 5>| (a.value.to_bits(), a.slopes.map(f64::to_bits));
    compare(variable, |a, b| bits(a) == bits(b));
    compare(|value, _| Interval::around(value, 0.01), |a, b| a == b);
    compare(
        |value, i| TaylorModel::<5>::symbol(value, 0.01, i),
        |a, b| a == b,
    );
}

#[test]
fn a_changed_parameter_is_printed() {
    let mut plant = plant("cart-pole");
    plant.set_parameter("pole_mass", 0.1 + 0.2).unwrap();
    let source = plant.to_rust();
    assert!(
        source.contains("            pole_mass: 0.30000000000000004,\n"),
        "{source}"
    );
}

/// The source of a plant called "number" was no Rust: it has a trait of that name.
#[test]
fn the_type_of_a_plant_has_no_name_that_its_source_has_from_elsewhere() {
    for like in ["cart-pole", "functions"] {
        let mut data = plant(like).data().clone();
        let source = plant(like).to_rust();
        let imports = source.lines().filter(|line| line.starts_with("use "));
        let words = imports.flat_map(|line| line.split(|c: char| !c.is_ascii_alphanumeric()));
        let types = words.filter(|word| word.starts_with(|c: char| c.is_ascii_uppercase()));
        for name in types.chain(["Default", "Option"]) {
            data.name = name.into();
            let source = Plant::new(data.clone()).unwrap().to_rust();
            assert!(
                source.contains(&format!("pub struct Plant{name} {{")),
                "{source}"
            );
        }
    }
}

/// Whatever the names are, they become names of Rust, each once.
#[test]
fn any_name_becomes_a_name_of_rust() {
    let mut data = drift(1.0, 2.0);
    let parameter = data.parameters[0].clone();
    let names = [
        "self",
        "Länge",
        "L nge",
        "2nd",
        "*/ }",
        "fn",
        "p_fn",
        "",
        "x\u{202e}y",
    ];
    data.name = "3 `tanks`".into();
    data.parameters = names[..7]
        .iter()
        .chain(&names[8..])
        .map(|name| lpvmpc_plant::Parameter {
            name: (*name).into(),
            ..parameter.clone()
        })
        .collect();
    data.states[0] = Signal::new("x | `y`", "");
    let source = Plant::new(data).unwrap().to_rust();
    for field in [
        "p_self", "l_nge", "l_nge_", "p_2nd", "p_____", "p_fn", "p_fn_", "x_y",
    ] {
        assert!(
            source.contains(&format!("    pub {field}: f64,\n")),
            "{field}: {source}"
        );
    }
    assert!(source.contains("pub struct Plant3Tanks {"), "{source}");
    assert!(
        source.contains("//! | x\\[0\\] | `x _ _y_` | no unit |"),
        "{source}"
    );
    assert!(!source.contains('\u{202e}'), "{source}");
}
