//! Steps the controller through the first samples of a scenario's first plane, for
//! `.ci/instructions.sh` to count the instructions of each step.
//!
//! ```sh
//! count_steps tight-bounds 80
//! ```

use ballbot::{Controller, Workspace};
use ballbot_scenario::{RunHooks, Scenario};
use lpvmpc::Reference;
use nalgebra::Vector4;
use std::hint::black_box;
use std::{env, error::Error, path::Path};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [name, samples] = arguments.as_slice() else {
        return Err("usage: count_steps SCENARIO SAMPLES".into());
    };
    let mut prepared = Scenario::load(name)?.prepare(Path::new("."))?;
    prepared.samples = samples.parse()?;
    prepared.planes.truncate(1);
    let trajectories = prepared.run(&RunHooks::NONE)?;
    let mut controller = Controller::allocate(prepared.ballbot, prepared.settings)?;
    let mut workspace = controller.workspace();
    let horizon = prepared.settings.horizon;
    for (plane, trajectory) in prepared.planes.iter().zip(&trajectories) {
        for (k, sample) in trajectory.samples.iter().enumerate() {
            let at = |i: usize| plane.state_reference((k + i) as f64 * prepared.settings.t_s);
            let stages: Vec<_> = (0..horizon).map(at).collect();
            let reference = Reference {
                stages: &stages,
                terminal: at(horizon),
            };
            counted_step(&mut controller, &sample.x, &reference, &mut workspace);
        }
    }
    Ok(())
}

/// The counter finds it by its name.
#[inline(never)]
fn counted_step(
    controller: &mut Controller<f64>,
    x: &Vector4<f64>,
    reference: &Reference<'_, f64, 4>,
    workspace: &mut Workspace<f64>,
) {
    black_box(controller.step(black_box(x), reference, workspace));
}
