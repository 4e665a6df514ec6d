//! Plants in the places of a compiled controller.

use crate::reference::plant;
use lpvmpc_plant::{SizedEmbedding, SizedPlant};

#[test]
fn what_does_not_fit_is_refused() {
    let error = SizedPlant::<3, 1>::new(plant("cart-pole")).unwrap_err();
    assert_eq!(error.to_string(), "states: there are 4, and places for 3");
    let error = SizedPlant::<3, 1>::new(plant("functions")).unwrap_err();
    assert_eq!(error.to_string(), "inputs: there are 2, and places for 1");
    let error = SizedEmbedding::<4, 1, 1>::new(plant("cart-pole")).unwrap_err();
    assert_eq!(
        error.to_string(),
        "embedding.scheduling: there are 2, and places for 1"
    );
    let error = SizedEmbedding::<4, 2, 1>::new(plant("functions")).unwrap_err();
    assert_eq!(
        error.to_string(),
        "embedding: this plant has none of its own"
    );
}

#[test]
fn bounds_and_equilibrium_are_those_of_the_file() {
    let cart_pole = SizedPlant::<5, 2>::new(plant("cart-pole")).unwrap();
    let u = cart_pole.u_bounds();
    assert_eq!((u.lower[0], u.upper[0]), (-15.0, 15.0));
    assert_eq!((u.lower[1], u.upper[1]), (f64::NEG_INFINITY, f64::INFINITY));
    assert!(
        cart_pole
            .x_bounds()
            .lower
            .iter()
            .all(|bound| *bound == f64::NEG_INFINITY)
    );
    let (x, u) = cart_pole.equilibrium().unwrap();
    assert_eq!((x.amax(), u.amax()), (0.0, 0.0));
}

#[test]
fn an_operation_of_which_there_is_no_proof_has_a_name() {
    assert_eq!(plant("cart-pole").first_jump(), None);
    let (index, name) = plant("functions").first_jump().unwrap();
    assert_eq!(name, plant("functions").data().operations[index].name());
    assert!(["sign", "floor", "lt", "le", "eq", "if_else_zero"].contains(&name));
}

#[test]
fn parameters_are_set_all_at_once_or_not_at_all() {
    let mut cart_pole = plant("cart-pole");
    let before = cart_pole.parameters().to_vec();
    let error = cart_pole.set_parameters(&before[1..]).unwrap_err();
    assert_eq!(error.to_string(), "parameters: 4 values for 5");
    let mut values = before.clone();
    values[1] = f64::NAN;
    let error = cart_pole.set_parameters(&values).unwrap_err();
    assert_eq!(
        error.to_string(),
        "parameter \"pole_mass\": NaN is not finite"
    );
    assert_eq!(cart_pole.parameters(), before);
    values[1] = 0.4;
    cart_pole.set_parameters(&values).unwrap();
    let mut other = plant("cart-pole");
    other.set_parameter("pole_mass", 0.4).unwrap();
    assert_eq!(cart_pole, other);
    let point = ([0.1, 0.4, -0.3, 1.2], [2.0]);
    assert_eq!(
        cart_pole.derivative(&point.0, &point.1).unwrap(),
        other.derivative(&point.0, &point.1).unwrap()
    );
}
