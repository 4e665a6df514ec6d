//! A cart-pole under LPV MPC and under linear MPC: the pole starts tilted and at rest over the
//! middle of the track, the force and the track are bounded.
//!
//! ```text
//! cargo run --release -p lpvmpc --example cart_pole
//! ```
//!
//! `plant.rs` is all that the method must know of a plant, `regulator.rs` sets the controller
//! up, `closed_loop.rs` runs it on the nonlinear plant.

mod closed_loop;
mod plant;
mod regulator;

use lpvmpc::riccati::BadPivot;
use lpvmpc::{Controller, Scheduling};
use nalgebra::{Vector2, Vector4};
use plant::CartPole;
use std::error::Error;

/// Tilt in degrees, end of the track in m from its middle. From 25 degrees without the end at
/// 0.8 m the cart would go to 0.87 m.
const STARTS: [(f64, f64); 5] = [
    (10.0, 2.4),
    (20.0, 2.4),
    (25.0, 0.8),
    (30.0, 2.4),
    (35.0, 2.4),
];

fn main() -> Result<(), Box<dyn Error>> {
    println!("                           prediction                    samples");
    println!(
        "tilt    track  controller  error of theta  largest |s|   not solved  stands     cost"
    );
    for (degrees, track) in STARTS {
        line(degrees, track, "LPV MPC", Scheduling::Predicted)?;
        let upright = Scheduling::Held(Vector2::zeros());
        line(degrees, track, "linear MPC", upright)?;
    }
    Ok(())
}

/// Runs one closed loop of 5 s and prints its line of the table.
fn line(
    degrees: f64,
    track: f64,
    name: &str,
    scheduling: Scheduling<f64, 2>,
) -> Result<(), Box<dyn Error>> {
    let plant = CartPole::laboratory();
    let settings = regulator::settings(&plant, track, scheduling)
        .map_err(|BadPivot(pivot)| format!("the Riccati recursion met the pivot {pivot}"))?;
    let mut controller = Controller::allocate(plant, settings)?;
    let start = Vector4::new(0.0, degrees.to_radians(), 0.0, 0.0);
    let samples = closed_loop::run(&plant, &mut controller, start, 100);

    // A millimetre beyond a plan that goes to the end: the prediction is not exact.
    let stands = closed_loop::stands(&samples, track + 1e-3);
    let unsolved = samples.iter().filter(|s| !s.status.is_solved()).count();
    println!(
        "{degrees:2.0} deg  {track:3.1} m  {name:10}  {:10.4} deg  {:9.3} m  {unsolved:11}  {:6} {:8.1}",
        closed_loop::prediction_error(&samples)[1].to_degrees(),
        closed_loop::farthest(&samples),
        if stands { "yes" } else { "no" },
        closed_loop::cost(&samples, &settings.weights),
    );
    Ok(())
}
