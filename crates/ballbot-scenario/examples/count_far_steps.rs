//! Drives the guaranteed loop of `far-setpoints`, with one program per sample, to set points that are far apart,
//! for `.ci/instructions.sh` to count the instructions of each step. Another horizon, in samples, may be given, and
//! after it a tilt, a speed and a tilt rate: then it is the first step from there alone.

use ballbot::{GuaranteedController, GuaranteedWorkspace};
use ballbot_scenario::Scenario;
use lpvmpc::{GuaranteedIterations, Rk4};
use nalgebra::Vector4;
use std::hint::black_box;
use std::{error::Error, path::Path};

/// Each wanted for so many samples, rad.
const SET_POINTS: [f64; 5] = [100.0, -50.0, 200.0, -200.0, 0.0];
const SAMPLES: usize = 80;

fn main() -> Result<(), Box<dyn Error>> {
    let prepared = Scenario::load("far-setpoints")?.prepare(Path::new("."))?;
    let mut settings = *prepared.guaranteed().ok_or("no guaranteed loop")?;
    settings.iterations = GuaranteedIterations {
        known: 1,
        ..settings.iterations
    };
    let mut arguments = std::env::args().skip(1);
    if let Some(horizon) = arguments.next() {
        settings.horizon = horizon.parse()?;
    }
    let start: Vec<f64> = arguments
        .map(|number| number.parse())
        .collect::<Result<_, _>>()?;
    let plant = Rk4 { substeps: 24 };
    let mut controller = GuaranteedController::allocate(prepared.ballbot, settings)?;
    let mut workspace = controller.workspace();
    let mut x = Vector4::zeros();
    if let [theta, phi_dot, theta_dot] = start[..] {
        x = Vector4::new(0.0, theta, phi_dot, theta_dot);
        counted_step(&mut controller, &x, 0.0, &mut workspace);
        return Ok(());
    }
    for wanted in SET_POINTS {
        for _ in 0..SAMPLES {
            let u = counted_step(&mut controller, &x, wanted, &mut workspace);
            x = plant.advance(&prepared.ballbot, &x, &u, settings.t_s);
        }
    }
    Ok(())
}

/// The counter finds it by its name.
#[inline(never)]
fn counted_step(
    controller: &mut GuaranteedController<f64>,
    x: &Vector4<f64>,
    wanted: f64,
    workspace: &mut GuaranteedWorkspace<f64>,
) -> nalgebra::Vector1<f64> {
    controller.step(black_box(x), wanted, workspace).u
}
