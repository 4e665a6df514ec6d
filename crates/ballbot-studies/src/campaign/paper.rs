//! The negative control: the paper's scheme to the letter.

use super::run::{Record, SetPoints, has_fallen};
use ballbot_scenario::{Prepared, ScenarioError};
use lpvmpc::{Controller, Reference};
use nalgebra::Vector4;

/// Runs the controller of `prepared` until it has no plan, for then the scheme has no torque.
pub(super) fn run(
    prepared: &Prepared,
    start: Vector4<f64>,
    wanted: &SetPoints,
    samples: usize,
) -> Result<Record, ScenarioError> {
    let controller = Controller::allocate(prepared.ballbot, prepared.settings);
    let mut controller = controller.map_err(ScenarioError::from)?;
    let mut workspace = controller.workspace();
    let mut record = Record::default();
    let mut x = start;
    let mut before: Option<(f64, f64)> = None;
    for wanted in wanted.points().iter().take(samples) {
        record.look_at(&x, prepared);
        let reference = Reference::constant(Vector4::new(*wanted, 0.0, 0.0, 0.0));
        let plan = controller.step(&x, &reference, &mut workspace);
        if !plan.status.is_solved() {
            record.infeasible += 1;
            return Ok(record);
        }
        let u = plan.u[0];
        record.samples += 1;
        record.largest_gap = record.largest_gap.max(controller.gap().amax());
        let cost = controller.tracking_cost(&x, &reference);
        if let Some((same, earlier)) = before
            && same == *wanted
        {
            record.compare(earlier, 0.0, cost);
        }
        before = Some((*wanted, cost));
        let moved = lpvmpc_sim::advance(
            &prepared.ballbot,
            &x,
            &u,
            prepared.settings.t_s,
            prepared.tolerances,
        );
        match moved {
            Ok(next) if !has_fallen(&next) => x = next,
            _ => {
                record.fell = true;
                return Ok(record);
            }
        }
    }
    record.look_at(&x, prepared);
    Ok(record)
}
