//! Set points from afar within the bounds of `tight-bounds`, as a descent.

use ballbot::Controller;
use ballbot_scenario::{
    PointTable, Prepared, ReferenceTable, RunHooks, Scenario, StateBounds, TerminalTable,
};
use lpvmpc::{Iterations, Reference, Status};
use nalgebra::Vector4;
use std::path::Path;

/// `tight-bounds` with the default predictor and terminal cost, to `phi_rad` from rest.
fn way_to(phi_rad: f64, horizon: usize, state_bounds: StateBounds) -> Prepared {
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
    scenario.prepare(Path::new(".")).unwrap()
}

/// The largest tilt at a sample, and the samples without a plan.
fn tilt_on(way: &Prepared) -> (f64, usize) {
    let runs = way.run(&RunHooks::NONE).unwrap();
    let samples = || runs.iter().flat_map(|run| &run.samples);
    let tilt = samples().map(|sample| sample.x[1].abs());
    let without = samples().filter(|sample| !sample.status.is_solved());
    (tilt.fold(0.0, f64::max), without.count())
}

/// From 27 rad on and over 60 samples no plan was found, and with soft bounds the robot turned over.
#[test]
fn the_bounds_are_kept_and_there_is_always_a_plan() {
    for (horizon, phi_rad) in [(20, 83.0), (40, 33.0), (60, 28.0), (60, 60.0), (80, 83.0)] {
        let (tilt, without_plan) = tilt_on(&way_to(phi_rad, horizon, StateBounds::Hard));
        assert_eq!(without_plan, 0, "{horizon} {phi_rad}");
        // As far as the prediction is the plant.
        assert!(tilt < 0.3 + 1e-4, "{horizon} {phi_rad}: {tilt}");
        let (tilt, without_plan) = tilt_on(&way_to(phi_rad, horizon, StateBounds::Soft));
        assert_eq!(without_plan, 0, "{horizon} {phi_rad}");
        assert!(tilt < 0.3 + 1e-3, "{horizon} {phi_rad}: {tilt}");
    }
}

/// The program along the present state is one of those that a sample may have, and what it improves is improved; one that
/// does not bring the plan within hard bounds leaves it beyond them, and that is told.
#[test]
fn a_single_program_is_enough_for_an_improvement() {
    for (state_bounds, most) in [
        (StateBounds::Soft, 1),
        (StateBounds::Hard, 1),
        (StateBounds::Hard, 8),
    ] {
        let way = way_to(60.0, 60, state_bounds);
        let mut settings = way.settings;
        settings.iterations = Iterations::descent(Iterations::<f64>::TOLERANCE, most);
        let mut controller = Controller::<f64>::allocate(way.ballbot, settings).unwrap();
        let mut workspace = controller.workspace();
        let reference = Reference::constant(way.planes[0].state_reference(0.0));
        let plan = controller.step(&Vector4::zeros(), &reference, &mut workspace);
        let tilt = plan.x.iter().map(|x| x[1].abs()).fold(0.0, f64::max);
        match plan.status {
            // By a hundredth of the bounds' width of 0.6 rad.
            Status::Exceeded(_) => assert!(tilt > 0.306 && most == 1, "{most}: {tilt}"),
            status => {
                assert_eq!(status, Status::Improved);
                assert!(state_bounds == StateBounds::Soft || tilt < 0.306, "{tilt}");
            }
        }
        assert!(controller.problems() <= most);
    }
}
