//! The built-in scenarios against an independent program: `testdata/scenarios.json`.

use ballbot_scenario::{RunHooks, Scenario};
use lpvmpc_sim::{Termination, Trajectory};
use serde_json::Value;
use std::path::Path;

/// The reference's own statement of how close a correct implementation comes.
const TORQUE_NM: f64 = 1e-6;
const STATE: f64 = 1e-5;
/// J is a sum of about a hundred squares of size up to 1e4; relative.
const COST: f64 = 1e-6;

fn reference() -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/scenarios.json");
    let text = std::fs::read_to_string(path).expect("testdata is part of the repository");
    serde_json::from_str(&text).expect("the reference is JSON")
}

fn run(name: &str) -> Vec<Trajectory<4, 1>> {
    let scenario = Scenario::load(name).expect("built-in");
    let prepared = scenario.prepare(Path::new(".")).expect("valid");
    prepared.run(&RunHooks::NONE).expect("runs")
}

fn assert_agrees(name: &str, trajectory: &Trajectory<4, 1>, reference: &Value) {
    assert_eq!(trajectory.termination, Termination::Complete, "{name}");
    let column = |key: &str| reference[key].as_array().expect("an array").clone();
    let number = |value: &Value| value.as_f64().expect("a number");
    let (inputs, states, costs) = (column("u"), column("x"), column("J"));
    assert_eq!(trajectory.samples.len(), inputs.len(), "{name}: samples");
    for (k, (sample, u)) in trajectory.samples.iter().zip(&inputs).enumerate() {
        let difference = (sample.u[0] - number(u)).abs();
        assert!(
            difference <= TORQUE_NM,
            "{name}: u at sample {k} differs by {difference:e}"
        );
        let cost = number(&costs[k]);
        let difference = (sample.cost - cost).abs();
        assert!(
            difference <= COST * (1.0 + cost),
            "{name}: J at sample {k} differs by {difference:e} of {cost}"
        );
    }
    assert_eq!(trajectory.states().count(), states.len(), "{name}: states");
    for (k, (x, expected)) in trajectory.states().zip(&states).enumerate() {
        for (i, value) in x.iter().enumerate() {
            let difference = (value - number(&expected[i])).abs();
            assert!(
                difference <= STATE,
                "{name}: x[{i}] at sample {k} differs by {difference:e}"
            );
        }
    }
}

#[test]
fn every_built_in_scenario_of_the_paper_agrees_with_the_independent_closed_loop() {
    let reference = reference();
    let reference = |name: &str| &reference["scenarios"][name];
    for (name, planes) in [
        ("two-setpoints", vec!["1_two_setpoints_lpv"]),
        ("two-setpoints-linear", vec!["1_two_setpoints_linear"]),
        (
            "lissajous",
            vec!["2_lissajous_x_plane", "2_lissajous_y_plane"],
        ),
        (
            "single-setpoint-terminal",
            vec!["3_setpoint_pi_terminal_equality"],
        ),
        ("single-setpoint", vec!["3_setpoint_pi_terminal_cost"]),
    ] {
        let trajectories = run(name);
        assert_eq!(trajectories.len(), planes.len());
        for (trajectory, plane) in trajectories.iter().zip(planes) {
            assert_agrees(name, trajectory, reference(plane));
        }
    }
}

#[test]
fn scenario_1_shows_what_the_paper_describes() {
    let trajectory = &run("two-setpoints")[0];
    let phi_at = |t: f64| {
        let sample = trajectory.samples.iter().find(|s| (s.t - t).abs() < 1e-9);
        sample.expect("a sample at that time").x[0]
    };
    // "near the origin, positive virtual torque ... decrease the tilt angle ... move the
    // ballbot to the negative phi": the non-minimum phase.
    let first = trajectory
        .samples
        .iter()
        .find(|s| s.u[0].abs() > 1e-3)
        .expect("it moves");
    assert!(first.u[0] > 0.0);
    assert!(trajectory.states().any(|x| x[0] < -0.1));
    // "reaches 2 pi after about 1.3 s", faster than the linear controller.
    assert!(
        (phi_at(1.3) - std::f64::consts::TAU).abs() < 0.2,
        "{}",
        phi_at(1.3)
    );
    let linear = &run("two-setpoints-linear")[0];
    assert!(phi_at(1.2) > linear.samples[24].x[0]);
    // "theta being between ranges of 0 to 0.5 rad".
    assert!(trajectory.states().all(|x| x[1].abs() < 0.5));
    // No bound of the paper is active in this scenario.
    assert!(trajectory.samples.iter().all(|s| s.active_bounds == 0));
}

#[test]
fn other_horizons_and_sampling_times_run() {
    // (N, t_s): one of each compiled capacity, and both of its ends.
    for (horizon, t_s) in [
        (10, 0.05),
        (21, 0.05),
        (50, 0.02),
        (51, 0.02),
        (100, 0.01),
        (200, 0.005),
    ] {
        let mut scenario = Scenario::load("single-setpoint").expect("built-in");
        scenario.controller.horizon = horizon;
        scenario.controller.t_s = t_s;
        scenario.controller.predictor = None;
        scenario.controller.terminal = Default::default();
        let prepared = scenario.prepare(Path::new(".")).expect("valid");
        let trajectory = &prepared.run(&RunHooks::NONE).expect("runs")[0];
        assert_eq!(
            trajectory.termination,
            Termination::Complete,
            "N = {horizon}, t_s = {t_s}"
        );
        let end = trajectory.final_state[0];
        assert!(
            (end - std::f64::consts::PI).abs() < 0.05,
            "N = {horizon}, t_s = {t_s}: {end}"
        );
    }
}

#[test]
fn an_infeasible_problem_ends_the_run_and_keeps_what_was_recorded() {
    let mut scenario = Scenario::load("single-setpoint-terminal").expect("built-in");
    // The set point jumps away within the run, farther than the horizon can carry.
    scenario.reference = toml::from_str::<Scenario>(
        &ballbot_scenario::builtin::find("two-setpoints")
            .expect("built-in")
            .text
            .replace("phi_rad = 6.283185307179586", "phi_rad = 400.0"),
    )
    .expect("valid")
    .reference;
    let prepared = scenario.prepare(Path::new(".")).expect("valid");
    let trajectory = &prepared.run(&RunHooks::NONE).expect("runs")[0];
    let Termination::NoPlan { t, status } = &trajectory.termination else {
        panic!("expected no plan, got {:?}", trajectory.termination);
    };
    // The jump at 1 s comes into sight (x_N) at the first sample.
    assert_eq!(trajectory.samples.len(), (*t / 0.05).round() as usize);
    assert!(matches!(status, lpvmpc::Status::Infeasible(_)), "{status}");
    assert!(trajectory.conflict().is_some());
}
