//! Median times of a step: the ballbot's own controller beside the same one for a plant from data.
//!
//! ```text
//! cargo run --release -p lpvmpc-any --example time_step
//! ```

use ballbot::Ballbot;
use lpvmpc::{
    Bounds, Controller, ControllerSettings, Iterations, Reference, Rk4, TerminalIngredient, Weights,
};
use lpvmpc_any::{Limits, Mpc, MpcSettings, Preview, StateBounds, Terminal};
use lpvmpc_plant::{Plant, PlantData};
use nalgebra::{DMatrix, Matrix1, Matrix4, Vector1, Vector4};
use std::error::Error;
use std::time::Instant;

const SAMPLES: usize = 400;
const ROUNDS: usize = 9;

fn main() -> Result<(), Box<dyn Error>> {
    let robot = Ballbot::<f64>::paper();
    let plant = Plant::new(PlantData::of_embedding("ballbot", &robot))?;
    println!(
        "median of {} steps, us     own size   any size",
        SAMPLES * ROUNDS
    );
    for (name, iterations) in [
        ("one program", Iterations::Fixed(1)),
        ("descent", Iterations::default()),
    ] {
        let weights = Weights {
            q: Matrix4::from_diagonal(&Vector4::new(20.0, 0.1, 1.0, 1.0)),
            r: Matrix1::new(10.0),
        };
        let terminal = TerminalIngredient::Cost(Matrix4::identity() * 50.0);
        let torque = Vector1::new(0.6);
        let u = Bounds {
            lower: -torque,
            upper: torque,
        };
        let settings = ControllerSettings {
            iterations,
            ..ControllerSettings::new(0.05, 20, weights, terminal, u)
        };
        let any = MpcSettings {
            terminal: Terminal::Cost(DMatrix::identity(4, 4) * 50.0),
            state_bounds: StateBounds::Hard,
            u_bounds: Some(Limits {
                lower: vec![-0.6],
                upper: vec![0.6],
            }),
            iterations,
            ..MpcSettings::new(0.05, 20, &[20.0, 0.1, 1.0, 1.0], &[10.0])
        };
        let mut times = [Vec::new(), Vec::new()];
        for _ in 0..ROUNDS {
            let mut fixed = Controller::allocate(robot, settings)?;
            let mut workspace = fixed.workspace();
            let mut any = Mpc::new(&plant, &any)?;
            let mut x = Vector4::zeros();
            for k in 0..SAMPLES {
                let phi = if k / 100 % 2 == 0 { 3.0 } else { 0.0 };
                let preview = Preview::to(&[phi, 0.0, 0.0, 0.0]);
                let begin = Instant::now();
                any.step(x.as_slice(), &preview)?;
                times[1].push(begin.elapsed());
                let x_ref = Reference::constant(Vector4::new(phi, 0.0, 0.0, 0.0));
                let begin = Instant::now();
                let u = fixed.step(&x, &x_ref, &mut workspace).first_input();
                times[0].push(begin.elapsed());
                x = Rk4 { substeps: 1 }.advance(&robot, &x, &u, 0.05);
            }
        }
        let [own, any] = times.map(|mut times| {
            times.sort();
            1e6 * times[times.len() / 2].as_secs_f64()
        });
        println!("{name:26} {own:8.1} {any:10.1}");
    }
    Ok(())
}
