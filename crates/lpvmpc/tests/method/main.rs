//! The method's parts and the controller made of them: the predictor, the Riccati kernel,
//! Algorithm 2, and a cart-pole as a second plant beside the ballbot.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on must fail, in its support functions too"
)]

mod cart_pole;
mod controller;
mod direction;
mod guarded;
mod horizon;
mod plants;
mod predictor;
mod predictor_kinds;
mod riccati;

#[path = "../../examples/cart_pole/closed_loop.rs"]
mod closed_loop;
#[path = "../../examples/cart_pole/plant.rs"]
mod plant;
#[path = "../../examples/cart_pole/regulator.rs"]
mod regulator;

#[allow(dead_code, reason = "the tests of the solver use more of it")]
#[path = "../it/support/rng.rs"]
mod rng;
mod runge_kutta;
