//! Prediction and nonlinear rollout: how far they are apart, and the iteration that closes the
//! gap, on the ballbot with the paper's terminal equality (scenario 3).

use ballbot::{Ballbot, Controller, ControllerSettings};
use ballbot_scenario::{Prepared, Scenario};
use lpvmpc::{
    Bounds, Iterations, Predictor, Reference, Rk4, Solution, Status, TerminalIngredient,
    kkt_residual,
};
use nalgebra::Vector4;
use std::path::Path;

const N: usize = 20;
const FINE: Rk4 = Rk4 { substeps: 2 };

type Loop = Controller<f64>;

fn scenario_3() -> Prepared {
    let scenario = Scenario::load("single-setpoint-terminal").unwrap();
    scenario.prepare(Path::new(".")).unwrap()
}

/// Scenario 3's settings with another predictor; phi without bounds, for far set points.
fn settings(predictor: Predictor, iterations: Iterations<f64>) -> ControllerSettings<f64> {
    let mut settings = ControllerSettings {
        predictor,
        iterations,
        ..scenario_3().settings
    };
    settings.x.lower[0] = f64::NEG_INFINITY;
    settings.x.upper[0] = f64::INFINITY;
    settings
}

/// The first plan from rest towards `phi` rad.
fn plan(settings: ControllerSettings<f64>, phi: f64) -> (Loop, Solution<f64, 4, 1>) {
    let mut controller = Loop::allocate(Ballbot::paper(), settings).unwrap();
    let target = Reference::constant(Vector4::new(phi, 0.0, 0.0, 0.0));
    let mut workspace = controller.workspace();
    let solution = controller
        .step(&Vector4::zeros(), &target, &mut workspace)
        .clone();
    if solution.status == Status::Solved {
        let residual = kkt_residual(workspace.ocp(), &solution);
        assert!(residual.largest() < 1e-8, "{residual:?}");
    }
    (controller, solution)
}

/// The paper's predictor ends 0.97 rad and 0.37 rad beside the nonlinear model at the first
/// sample of scenario 3, and hundreds of milliradians beside it however often it is repeated.
#[test]
fn the_frozen_predictor_keeps_its_gap() {
    let frozen = Predictor::FrozenRk4(Rk4 { substeps: 1 });
    let (once, _) = plan(settings(frozen, Iterations::Fixed(1)), std::f64::consts::PI);
    let gap = once.gap().abs();
    assert!((gap[0] - 0.97).abs() < 0.005, "{gap}");
    assert!((gap[1] - 0.37).abs() < 0.005, "{gap}");
    let (often, _) = plan(
        settings(frozen, Iterations::Fixed(100)),
        std::f64::consts::PI,
    );
    assert!(often.gap().amax() > 0.2, "{}", often.gap());
}

/// A descent with the stage-consistent predictor, until nothing is left to gain.
fn converging(most: usize) -> ControllerSettings<f64> {
    let tolerance = 1e-5;
    let descent = Iterations::descent(tolerance, most);
    settings(Predictor::StageConsistent(FINE), descent)
}

/// A plan is a nonlinear rollout, so the terminal equality holds for the nonlinear model, and every
/// stage agrees, not only the last. At pi the last digits go to and fro and the plan does not call
/// itself converged.
#[test]
fn a_plan_of_many_programs_ends_in_the_set_point() {
    for phi in [0.01, 0.1, 1.0, 2.0, std::f64::consts::PI] {
        let (controller, solution) = plan(converging(200), phi);
        let converged = solution.status == Status::Converged;
        assert!(converged || phi > 3.0, "{phi} rad: {}", solution.status);
        assert!(solution.status.is_solved());
        let mut x = Vector4::zeros();
        for (u, planned) in solution.u.iter().zip(controller.rollout()) {
            x = FINE.advance(&Ballbot::<f64>::paper(), &x, u, 0.05);
            assert!((x - planned).amax() < 1e-8);
        }
        assert!((x - Vector4::new(phi, 0.0, 0.0, 0.0)).amax() < 1e-5, "{x}");
    }
}

/// A small move is nearly linear.
#[test]
fn a_small_move_needs_few_programs() {
    let programs = |phi: f64| plan(converging(60), phi).0.problems();
    assert!(programs(0.01) <= 4, "{}", programs(0.01));
}

/// Full steps oscillate and grow from a move of 4 rad on (40 programs at pi, none suffice at 4
/// rad); a descent converges, at 8 rad for a robot whose torque is not bounded.
#[test]
fn far_set_points_converge() {
    for (phi, bounded) in [(4.0, true), (6.0, true), (8.0, false)] {
        let mut far = converging(400);
        if !bounded {
            (far.x, far.u) = (Bounds::none(), Bounds::none());
        }
        let (controller, solution) = plan(far, phi);
        let end = controller.rollout()[N - 1] - Vector4::new(phi, 0.0, 0.0, 0.0);
        assert!(
            solution.status.is_solved(),
            "{phi} rad: {}",
            solution.status
        );
        assert!(end.amax() < 1e-6, "{phi} rad: {end}");
    }
}

/// Without an end to reach, one program per sample closes the gap while the robot moves.
#[test]
fn one_program_per_sample_closes_the_gap_along_the_loop() {
    let design = scenario_3();
    let mut settings = settings(Predictor::StageConsistent(FINE), Iterations::Fixed(1));
    settings.terminal = TerminalIngredient::Equality;
    let mut controller = Loop::allocate(design.ballbot, settings).unwrap();
    let mut workspace = controller.workspace();
    let target = Reference::constant(Vector4::new(1.0, 0.0, 0.0, 0.0));
    let mut x = Vector4::zeros();
    for _ in 0..30 {
        let u = controller.step(&x, &target, &mut workspace).u[0];
        x = FINE.advance(&design.ballbot, &x, &u, settings.t_s);
    }
    assert!(controller.gap().amax() < 1e-6, "{}", controller.gap());
    assert!((x[0] - 1.0).abs() < 1e-3, "{x}");
}

/// A set point that is no number is told, not taken for 0, where the robot would drive to.
#[test]
fn a_set_point_that_is_no_number_is_no_set_point() {
    let scenario = Scenario::load("single-setpoint").unwrap();
    let prepared = scenario.prepare(Path::new(".")).unwrap();
    for iterations in [Iterations::Fixed(1), Iterations::default()] {
        let settings = ControllerSettings {
            iterations,
            ..prepared.settings
        };
        for (place, value) in [(0, f64::NAN), (0, f64::INFINITY), (2, f64::NAN)] {
            let mut controller = Loop::allocate(prepared.ballbot, settings).unwrap();
            let mut workspace = controller.workspace();
            let mut wanted = Vector4::zeros();
            wanted[place] = value;
            let x = Vector4::new(5.0, 0.0, 0.0, 0.0);
            let told = Reference::constant(wanted);
            let solution = controller.step(&x, &told, &mut workspace);
            let status = solution.status;
            assert!(!status.is_solved(), "{wanted:?}, {iterations:?}: {status}");
            assert!(solution.u.iter().all(|u| u[0].is_finite()));
            assert_eq!(controller.target(), None);
        }
    }
}
