//! Set points from afar within the bounds of `tight-bounds`, as a descent and as one program per sample.

use ballbot_scenario::{
    PointTable, ReferenceTable, RunHooks, Scenario, StateBounds, TerminalTable,
};
use std::path::Path;

/// The largest tilt at a sample, and the samples without a plan, of `tight-bounds` with the default predictor and
/// terminal cost on the way from rest to `phi_rad`.
fn way_to(phi_rad: f64, horizon: usize, state_bounds: StateBounds) -> (f64, usize) {
    let mut scenario = Scenario::load("tight-bounds").unwrap();
    scenario.controller.predictor = None;
    scenario.controller.terminal = TerminalTable::default();
    scenario.controller.horizon = horizon;
    scenario.controller.state_bounds = Some(state_bounds);
    let point = PointTable {
        time_s: 0.0,
        phi_rad,
    };
    scenario.reference = ReferenceTable::SetPoints {
        points: vec![point],
    };
    let prepared = scenario.prepare(Path::new(".")).unwrap();
    let runs = prepared.run(&RunHooks::NONE).unwrap();
    let samples = || runs.iter().flat_map(|run| &run.samples);
    let tilt = samples().map(|sample| sample.x[1].abs());
    let without = samples().filter(|sample| !sample.status.is_solved());
    (tilt.fold(0.0, f64::max), without.count())
}

/// From 27 rad on and over 60 samples no plan was found, and with soft bounds the robot turned over.
#[test]
fn the_bounds_are_kept_and_there_is_always_a_plan() {
    for (horizon, phi_rad) in [(20, 83.0), (40, 33.0), (60, 28.0), (60, 60.0), (80, 83.0)] {
        let (tilt, without_plan) = way_to(phi_rad, horizon, StateBounds::Hard);
        assert_eq!(without_plan, 0, "{horizon} {phi_rad}");
        // As far as the prediction is the plant.
        assert!(tilt < 0.3 + 1e-4, "{horizon} {phi_rad}: {tilt}");
        let (tilt, without_plan) = way_to(phi_rad, horizon, StateBounds::Soft);
        assert_eq!(without_plan, 0, "{horizon} {phi_rad}");
        assert!(tilt < 0.3 + 1e-3, "{horizon} {phi_rad}: {tilt}");
    }
}
