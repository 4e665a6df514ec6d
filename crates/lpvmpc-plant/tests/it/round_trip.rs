//! What is written is read as the same plant.

use crate::reference::plant;
use lpvmpc_plant::{Binary, Equilibrium, Operation, Parameter, Plant, PlantData, Signal};
use proptest::prelude::*;

#[test]
fn a_plant_is_read_as_it_was_written() {
    for name in ["cart-pole", "functions"] {
        let plant = plant(name);
        let text = plant.to_json();
        let again = Plant::from_json(&text).unwrap();
        assert_eq!(again, plant);
        assert_eq!(again.to_json(), text);
        let path = std::env::temp_dir().join(format!("lpvmpc-plant-{}-{name}", std::process::id()));
        plant.save(&path).unwrap();
        let loaded = Plant::load(&path);
        std::fs::remove_file(&path).unwrap();
        assert_eq!(loaded.unwrap(), plant);
    }
}

/// x_dot = `constant` + `parameter`.
pub fn drift(constant: f64, parameter: f64) -> PlantData {
    PlantData {
        name: "drift".into(),
        states: vec![Signal {
            lower: Some(-2.5),
            ..Signal::new("x", "m")
        }],
        parameters: vec![Parameter {
            name: "p".into(),
            unit: "m/s".into(),
            value: parameter,
        }],
        operations: vec![
            Operation::Constant(constant),
            Operation::Parameter(0),
            Operation::Binary(Binary::Add, 0, 1),
        ],
        derivative: vec![2],
        ..PlantData::default()
    }
}

proptest! {
    /// Every finite number comes back to the bit, -0 and subnormal ones, too.
    #[test]
    fn every_number_comes_back(constant: u64, parameter: u64) {
        let (constant, parameter) = (f64::from_bits(constant), f64::from_bits(parameter));
        prop_assume!(constant.is_finite() && parameter.is_finite());
        let plant = Plant::new(drift(constant, parameter)).unwrap();
        let again = Plant::from_json(&plant.to_json()).unwrap();
        let Operation::Constant(found) = again.data().operations[0] else { unreachable!() };
        prop_assert_eq!(found.to_bits(), constant.to_bits());
        prop_assert_eq!(again.parameters()[0].to_bits(), parameter.to_bits());
        prop_assert_eq!(again.data(), plant.data());
    }
}

#[test]
fn the_smallest_and_the_largest_numbers_come_back() {
    for value in [
        -0.0,
        5e-324,
        f64::MIN_POSITIVE,
        f64::MAX,
        0.1,
        1.0 / 3.0,
        9007199254740993.0,
    ] {
        let plant = Plant::new(drift(value, -value)).unwrap();
        let again = Plant::from_json(&plant.to_json()).unwrap();
        let Operation::Constant(found) = again.data().operations[0] else {
            unreachable!()
        };
        assert_eq!(found.to_bits(), value.to_bits());
        assert_eq!(again.parameters()[0].to_bits(), (-value).to_bits());
    }
}

#[test]
fn a_parameter_can_be_set_and_is_saved_as_it_is() {
    let mut plant = Plant::new(drift(1.0, 2.0)).unwrap();
    plant.set_parameter("p", 5.0).unwrap();
    assert_eq!(plant.derivative(&[0.0], &[]).unwrap(), [6.0]);
    let again = Plant::from_json(&plant.to_json()).unwrap();
    assert_eq!(again.parameters(), [5.0]);
    assert_eq!(again, plant);
    assert_ne!(again, Plant::new(drift(1.0, 2.0)).unwrap());
    let error = plant.set_parameter("q", 5.0).unwrap_err();
    assert_eq!(error.to_string(), "parameter \"q\": there are p");
    let error = plant.set_parameter("p", f64::NAN).unwrap_err();
    assert_eq!(error.to_string(), "parameter \"p\": NaN is not finite");
    assert_eq!(plant.parameters(), [5.0]);
}

/// height_dot = speed + wind, speed_dot = thrust / mass - 9.81.
fn hovering() -> Plant {
    let hovering = r#"{
        "schema": 1,
        "name": "hovering",
        "states": [{"name": "height"}, {"name": "speed"}],
        "inputs": [{"name": "thrust", "upper": 20}],
        "parameters": [{"name": "mass", "value": 1}, {"name": "wind", "value": 0}],
        "operations": [
            ["state", 1], ["parameter", 1], ["add", 0, 1], ["input", 0], ["parameter", 0], ["div", 3, 4],
            ["constant", 9.81], ["sub", 5, 6]
        ],
        "derivative": [2, 7],
        "equilibrium": {"x": [3, 0], "u": [9.81]}
    }"#;
    Plant::from_json(hovering).unwrap()
}

/// What was written had the new parameters beside the old equilibrium, and was refused.
#[test]
fn an_equilibrium_goes_along_with_the_parameters() {
    let given = hovering();
    let at = |mass: f64, wind: f64| {
        let mut plant = given.clone();
        plant.set_parameters(&[mass, wind]).unwrap();
        let again = Plant::from_json(&plant.to_json()).unwrap();
        assert_eq!(again, plant);
        assert_eq!(again.equilibrium(), plant.equilibrium());
        assert_eq!(again.to_json(), plant.to_json());
        plant.equilibrium().cloned()
    };
    let found = at(1.1, 0.0).unwrap();
    assert_eq!(found.x, [3.0, 0.0]);
    assert!((found.u[0] - 1.1 * 9.81).abs() < 1e-14);
    // No thrust holds a speed of 0 against the wind.
    let found = at(1.1, 0.5).unwrap();
    assert_eq!(found.x, [3.0, -0.5]);
    assert!((found.u[0] - 1.1 * 9.81).abs() < 1e-14);
    // More than the largest thrust.
    assert_eq!(at(2.5, 0.0), None);
    assert_eq!(at(1.0, 0.0), given.data().equilibrium);
    let mut still = Plant::new(PlantData {
        equilibrium: Some(Equilibrium {
            x: vec![0.0],
            u: vec![],
        }),
        ..drift(1.0, -1.0)
    })
    .unwrap();
    assert!(still.equilibrium().is_some());
    still.set_parameter("p", 0.0).unwrap();
    assert_eq!(still.equilibrium(), None);
    assert_eq!(Plant::from_json(&still.to_json()).unwrap(), still);
}

#[test]
fn an_equilibrium_must_be_one() {
    let at = |x: f64| {
        let mut data = drift(1.0, -1.0 + x);
        data.equilibrium = Some(Equilibrium {
            x: vec![0.0],
            u: vec![],
        });
        Plant::new(data)
    };
    assert!(at(1e-9).is_ok());
    let error = at(1e-3).unwrap_err();
    assert!(
        error
            .to_string()
            .starts_with("equilibrium: it is none: the derivative of x is 0.001"),
        "{error}"
    );
}
