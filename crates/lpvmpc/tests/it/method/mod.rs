//! The method's parts and the controller made of them: the predictor, the Riccati kernel,
//! Algorithm 2, and a cart-pole as a second plant beside the ballbot.

mod cart_pole;
mod controller;
mod direction;
mod discrete;
mod guaranteed;
mod horizon;
mod plants;
mod predictor;
mod predictor_kinds;
mod ray;
mod riccati;
mod runge_kutta;

#[path = "../../../examples/cart_pole/closed_loop.rs"]
mod closed_loop;
#[path = "../../../examples/cart_pole/plant.rs"]
mod plant;
#[path = "../../../examples/cart_pole/regulator.rs"]
mod regulator;
