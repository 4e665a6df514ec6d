//! The guaranteed loop from a scenario: far set points, and certificates that do not fit.

use ballbot::GuaranteedController;
use ballbot_scenario::{
    CertifiedTable, IterationsTable, Parameters, PointTable, ReferenceTable, RunHooks, Scenario,
    ScenarioError, TerminalTable, TorqueRateTable, builtin,
};
use lpvmpc::{Rk4, share_of_bounds};
use lpvmpc_sim::{Termination, Trajectory};
use nalgebra::Vector4;
use std::path::Path;

fn run(scenario: &Scenario) -> Trajectory<4, 1> {
    let prepared = scenario.prepare(Path::new(".")).unwrap();
    prepared.run(&RunHooks::NONE).unwrap().remove(0)
}

/// Set points 100 rad away, and others before they are reached: every input is backed, no bound
/// is violated, the cost never grows between two jumps, and the robot arrives. It stands at the
/// first one for 20 s, after which the controller once could not leave it: its trust region had
/// been halved at every sample in which there was nothing to improve.
#[test]
fn far_set_points_are_reached_with_every_bound_kept() {
    let scenario = Scenario::load("far-setpoints").unwrap();
    let prepared = scenario.prepare(Path::new(".")).unwrap();
    let trajectory = run(&scenario);
    assert_eq!(trajectory.termination, Termination::Complete);
    for x in trajectory.states() {
        assert!(prepared.settings.x.contains(x, 0.0), "{x}");
    }
    for pair in trajectory.samples.windows(2) {
        let [before, after] = pair else { continue };
        assert!(after.guarantee.unwrap().decision.is_guaranteed());
        assert!(prepared.settings.u.contains(&after.u, 0.0));
        // What is wanted at the end of the horizon, and beyond.
        let end = |t: f64| prepared.planes[0].state_reference(t + 1.0);
        if end(before.t) == end(after.t) {
            assert!(after.cost <= before.cost * (1.0 + 1e-12) + 1e-9);
        }
    }
    for (time, set_point) in [(29.0, 100.0), (61.0, -20.0), (79.0, 0.0)] {
        let sample = &trajectory.samples[(time / 0.05) as usize];
        assert!((sample.x[0] - set_point).abs() < 1e-4, "{}", sample.x);
    }
}

/// One program per sample keeps the guarantee, too, and drives as fast as three. It once took twice as
/// long: proposals were rolled out without feedback and refused.
#[test]
fn one_program_per_sample_arrives_as_early_as_three() {
    let arrival = |programs: usize| {
        let mut scenario = Scenario::load("far-setpoints").unwrap();
        scenario.duration_s = 20.0;
        scenario.controller.iterations = Some(IterationsTable::Fixed(programs));
        let trajectory = run(&scenario);
        let samples = &trajectory.samples;
        assert!(
            samples
                .iter()
                .all(|s| s.guarantee.unwrap().decision.is_guaranteed())
        );
        let near = samples.iter().find(|s| (s.x[0] - 100.0).abs() < 1.0);
        near.unwrap().t
    };
    let (one, three) = (arrival(1), arrival(3));
    assert!(one.max(three) < 4.5, "{three} s against {one} s");
}

/// At the bound of its speed the robot drives with one program per sample almost as smoothly as with
/// eight. Plans repeated from sample to sample once crept into the room that a new plan must leave; at
/// every fifth sample or so the next program then began anew, from a plan of another shape, with a kink
/// in the tilt rate of more than 0.1 rad/s, and the tilt rate went up and down half as much again.
#[test]
fn cruising_with_one_program_is_smooth() {
    let scenario = Scenario::load("far-setpoints").unwrap();
    let prepared = scenario.prepare(Path::new(".")).unwrap();
    let settings = *prepared.guaranteed().unwrap();
    // Variation of the tilt rate per sample, and the part of the samples with a kink.
    let cruise = |programs: usize| {
        let (mut variation, mut kinks, mut count) = (0.0, 0.0, 0.0);
        for set_point in (60..130).step_by(6) {
            let mut settings = settings;
            settings.iterations.known = programs;
            let mut controller =
                GuaranteedController::allocate(prepared.ballbot, settings).unwrap();
            let mut workspace = controller.workspace::<5>();
            let mut x = Vector4::zeros();
            let mut states = Vec::new();
            for _ in 0..100 {
                states.push(x);
                let step = controller.step(&x, f64::from(set_point), &mut workspace);
                x = Rk4 { substeps: 24 }.advance(&prepared.ballbot, &x, &step.u, settings.t_s);
            }
            for states in states.windows(3) {
                if states.iter().all(|x| x[2].abs() > 30.0) {
                    let [before, here, after] = [0, 1, 2].map(|i| states[i][3]);
                    count += 1.0;
                    variation += (after - here).abs();
                    kinks += f64::from((after - 2.0 * here + before).abs() > 0.1);
                }
            }
        }
        (variation / count, kinks / count)
    };
    let (one, eight) = (cruise(1), cruise(8));
    assert!(eight.1 < 0.05, "{eight:?}");
    assert!(one.1 < 0.12, "{one:?}");
    assert!(one.0 < 1.45 * eight.0, "{one:?}, {eight:?}");
}

/// A plant that is off the rollout by as much as the integration error may be, in the direction that
/// changes at random: there is a plan at every sample, all bounds are kept, and the cost falls by the
/// stage cost but for epsilon, which goes to zero at rest.
#[test]
fn errors_as_large_as_assumed_break_nothing() {
    let scenario = Scenario::load("far-setpoints").unwrap();
    let prepared = scenario.prepare(Path::new(".")).unwrap();
    let mut random = fastrand::Rng::with_seed(3);
    for (horizon, programs) in [(5, 1), (12, 1), (20, 3), (20, 0), (60, 1)] {
        let mut settings = *prepared.guaranteed().unwrap();
        (settings.horizon, settings.iterations.known) = (horizon, programs);
        let mut controller = GuaranteedController::allocate(prepared.ballbot, settings).unwrap();
        let mut workspace = controller.workspace::<5>();
        let (mut x, mut wanted) = (Vector4::new(0.0, 0.2, 1.0, -0.3), 40.0);
        let mut before: Option<(f64, f64)> = None;
        for k in 0..200 {
            if k == 25 {
                (wanted, before) = (-3.0, None);
            }
            let step = controller.step(&x, wanted, &mut workspace);
            assert!(step.decision.is_guaranteed(), "{horizon}, {k}: {step:?}");
            assert!(settings.x.contains(&x, 0.0), "{horizon}, {k}: {x}");
            if let Some((most, cost)) = before {
                let rounding = 1e-12 * cost + 1e-9;
                assert!(step.cost <= most + rounding, "{horizon}, {k}: {step:?}");
            }
            let error = x - Vector4::x() * step.set_point;
            let stage = (settings.weights.q * error).dot(&error)
                + (settings.weights.r * step.u).dot(&step.u);
            let epsilon = controller.epsilon();
            before = Some((step.cost - stage + epsilon, step.cost));
            assert!(epsilon <= 2e-3 * step.cost, "{horizon}, {k}: {step:?}");
            let moving = x.component_mul(&Vector4::new(0.0, 1.0, 1.0, 1.0));
            let share = share_of_bounds(&moving, &settings.x, &step.u, &settings.u);
            let sign = |random: &mut fastrand::Rng| if random.bool() { 1.0 } else { -1.0 };
            let corner = Vector4::from_fn(|_, _| share * sign(&mut random));
            let off = settings.rollout.error * corner;
            x = settings
                .rollout
                .rk4
                .advance(&prepared.ballbot, &x, &step.u, settings.t_s)
                + off;
        }
        // Without programs the robot is in no hurry.
        let arrived = (x[0] - wanted).abs() < 1e-2;
        assert!(programs == 0 || arrived, "{horizon}: {x}");
    }
}

/// The set point jumps by hundreds of radians while the robot cruises: the known plan is at the bound of the speed and has
/// less room there than programs ask for. Then these had no answer, up to 23 of them in a row and 71 of 400, and the
/// robot followed the rests of its plans meanwhile. After one without an answer they ask for no more room than the plan
/// has, and it is one of their points.
#[test]
fn programs_along_a_plan_with_little_room_have_an_answer() {
    let mut scenario = Scenario::load("far-setpoints").unwrap();
    scenario.duration_s = 20.0;
    scenario.controller.horizon = 30;
    scenario.controller.iterations = Some(IterationsTable::Fixed(1));
    let jumps = [200.0, -100.0, 400.0, -400.0, 0.0];
    let points = jumps.iter().enumerate().map(|(i, phi_rad)| PointTable {
        time_s: 4.0 * i as f64,
        phi_rad: *phi_rad,
    });
    scenario.reference = ReferenceTable::SetPoints {
        points: points.collect(),
    };
    let trajectory = run(&scenario);
    let unanswered: Vec<usize> = (0..trajectory.samples.len())
        .filter(|k| !trajectory.samples[*k].status.is_solved())
        .collect();
    assert!(unanswered.len() <= 10, "{unanswered:?}");
    let in_a_row = unanswered.windows(2).any(|pair| pair[1] == pair[0] + 1);
    assert!(!in_a_row, "{unanswered:?}");
    let decisions = trajectory.samples.iter().filter_map(|s| s.guarantee);
    assert!({ decisions }.all(|guarantee| guarantee.decision.is_guaranteed()));
}

/// Short and long horizons, in memories of either size: every input is backed and the set point is
/// reached.
#[test]
fn every_horizon_keeps_the_promise() {
    for horizon in [5, 20, 21, 60, 100] {
        let mut scenario = Scenario::load("far-setpoints").unwrap();
        scenario.reference = ReferenceTable::SetPoints {
            points: vec![PointTable {
                time_s: 0.0,
                phi_rad: 3.0,
            }],
        };
        scenario.duration_s = 10.0;
        scenario.controller.horizon = horizon;
        let trajectory = run(&scenario);
        assert_eq!(trajectory.termination, Termination::Complete);
        let mut guarantees = trajectory.samples.iter().map(|s| s.guarantee.unwrap());
        assert!(guarantees.all(|guarantee| guarantee.decision.is_guaranteed()));
        let off = trajectory.final_state - Vector4::new(3.0, 0.0, 0.0, 0.0);
        assert!(off.amax() < 1e-2, "{horizon}: {off}");
    }
}

/// Large memories, in a thread with the stack that a thread has. The robot stands, since fifteen
/// seconds of an unstable plant in one piece are beyond what numbers can follow.
#[test]
fn long_horizons_fit_a_thread() {
    const LONG: usize = 300;
    let mut ramped = Scenario::load("far-setpoints").unwrap();
    let prepared = ramped.prepare(Path::new(".")).unwrap();
    let mut settings = *prepared.guaranteed().unwrap();
    settings.horizon = LONG;
    GuaranteedController::allocate(prepared.ballbot, settings).unwrap();
    settings.horizon = 0;
    let refused = GuaranteedController::allocate(prepared.ballbot, settings);
    let refused = refused.err().unwrap().to_string();
    assert!(refused.contains("from 1 to 65535 samples"), "{refused}");
    ramped.reference = ReferenceTable::SetPoints {
        points: vec![PointTable {
            time_s: 0.0,
            phi_rad: 0.0,
        }],
    };
    ramped.controller.terminal = TerminalTable::DiscreteRiccati;
    let mut plain = ramped.clone();
    ramped.controller.torque_rate = Some(TorqueRateTable {
        limit_nm_s: 20.0,
        weight: 1.0,
    });
    for scenario in [&mut ramped, &mut plain] {
        scenario.controller.horizon = LONG;
        scenario.duration_s = 0.15;
        let trajectory = run(scenario);
        assert_eq!(trajectory.samples.len(), 3, "{:?}", trajectory.termination);
    }
}

/// A reference beyond the bounds of phi: the robot stops at the nearest admissible set point,
/// which leaves room for the terminal set.
#[test]
fn an_unreachable_set_point_is_approached_as_far_as_the_bounds_allow() {
    let mut scenario = Scenario::load("far-setpoints").unwrap();
    scenario.bounds.phi_rad = [-10.0, 10.0];
    scenario.duration_s = 10.0;
    let [_, upper] = scenario
        .prepare(Path::new("."))
        .unwrap()
        .guaranteed()
        .unwrap()
        .set_points;
    assert!(upper < 10.0 && upper > 7.0, "{upper}");
    let end = run(&scenario).final_state;
    assert!((end[0] - upper).abs() < 1e-3, "{end} instead of {upper}");
}

#[track_caller]
fn refused(change: impl Fn(&mut Scenario), words: &[&str]) {
    let mut scenario = Scenario::load("far-setpoints").unwrap();
    change(&mut scenario);
    let said = match scenario.prepare(Path::new(".")) {
        Ok(_) => panic!("accepted: {words:?}"),
        Err(error) => error.to_string(),
    };
    for word in words {
        assert!(said.contains(word), "no `{word}` in: {said}");
    }
}

#[test]
fn a_certificate_of_something_else_is_refused() {
    refused(
        |s| {
            if let Parameters::Table(robot) = &mut s.parameters {
                robot.b1_m2 *= 1.01;
            }
        },
        &["another robot", "certify"],
    );
    refused(|s| s.controller.t_s = 0.04, &["controller.t_s", "0.05 s"]);
    refused(
        |s| s.controller.q = Some([300.0, 1.0, 0.1, 0.1]),
        &["controller.q", "200.0"],
    );
    refused(|s| s.controller.r = Some(2000.0), &["controller.r", "1000"]);
    refused(
        |s| s.bounds.theta_rad = [-0.05, 0.05],
        &["bounds.theta_rad", "reaches"],
    );
    refused(
        |s| s.bounds.torque_nm = [-0.05, 1.5],
        &["bounds.torque_nm", "reaches"],
    );
    refused(
        |s| s.bounds.phi_rad = [0.0, 1.0],
        &["bounds.phi_rad", "fit"],
    );
    refused(
        |s| s.controller.horizon = 1001,
        &["controller.horizon", "1 to 1000"],
    );
    refused(
        |s| {
            let substeps = Some(8);
            s.controller.terminal = TerminalTable::Certified(CertifiedTable {
                substeps,
                ..Default::default()
            });
        },
        &["certified.substeps", "8", "needs 10"],
    );
    refused(
        |s| s.bounds.theta_dot_rad_s = [f64::NEG_INFINITY, f64::INFINITY],
        &["bounds.theta_dot_rad_s", "finite"],
    );
}

/// The certificate's digest is looked at, so that a patched number does not pass unseen.
#[test]
fn a_changed_certificate_is_refused() {
    let folder = std::env::temp_dir().join(format!("ballbot-certificate-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let changed = builtin::TERMINAL_CERTIFICATE.replacen("1999.998", "9999.998", 1);
    std::fs::write(folder.join("changed.json"), changed).unwrap();
    let text = builtin::find("far-setpoints").unwrap().text;
    let table = "[controller.terminal.certified]\n";
    let text = text.replacen(
        table,
        &format!("{table}certificate = \"changed.json\"\n"),
        1,
    );
    let scenario = Scenario::parse(&text, "far.toml").unwrap();
    let error = scenario.prepare(folder.as_path()).unwrap_err();
    std::fs::remove_dir_all(&folder).unwrap();
    assert!(matches!(error, ScenarioError::Value { .. }));
    assert!(error.to_string().contains("digest"), "{error}");
}

/// A jump of 2 pi that is known a second before costs, guaranteed, what it costs without the guarantee
/// (12 822.1 for the plain loop with two Runge-Kutta steps). Without preview it costs 16 times as much.
#[test]
fn preview_costs_no_more_than_without_the_guarantee() {
    let mut scenario = Scenario::load("two-setpoints").unwrap();
    scenario.controller.predictor = None;
    scenario.controller.terminal = TerminalTable::Certified(Default::default());
    let prepared = scenario.prepare(Path::new(".")).unwrap();
    let trajectory = run(&scenario);
    let weights = prepared.settings.weights;
    let mut cost = 0.0;
    for sample in &trajectory.samples {
        assert!(sample.guarantee.unwrap().decision.is_guaranteed());
        let error = sample.x - sample.x_ref;
        cost += (weights.q * error).dot(&error) + (weights.r * sample.u).dot(&sample.u);
    }
    assert!(cost < 1.02 * 12_822.1, "{cost}");
}

/// Several programs per sample close the gap that one leaves at the first sample of a jump.
#[test]
fn iterations_are_a_key_of_the_scenario() {
    let text = builtin::find("single-setpoint").unwrap().text;
    let key = "descent = { tolerance = 1e-7, most = 60 }";
    let text = text.replacen(
        "[controller.predictor.rk4]\nsubsteps = 1",
        &format!("[controller.iterations]\n{key}\n[controller.predictor.stage_consistent]"),
        1,
    );
    let converged = run(&Scenario::parse(&text, "my.toml").unwrap());
    let once = run(&Scenario::parse(&text.replacen(key, "fixed = 1", 1), "my.toml").unwrap());
    let gap = |run: &Trajectory<4, 1>| run.samples[0].gap.amax();
    assert!(gap(&once) > 1e-2, "{}", gap(&once));
    assert!(gap(&converged) < 1e-5, "{}", gap(&converged));
}
