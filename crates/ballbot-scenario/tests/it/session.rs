//! A scenario run step by step is the run at once, and a person can take part in it.

use ballbot_scenario::{
    Phase, PlaneName, PointTable, Prepared, PushTable, ReferenceTable, RunHooks, Scenario,
    ScenarioError, Session, ShapingTable, TerminalTable, TorqueRateTable, WithoutPlan, WorldTable,
};
use std::path::Path;
use std::time::Duration;

fn prepared(scenario: &Scenario) -> Result<Prepared, ScenarioError> {
    scenario.prepare(Path::new("."))
}

fn clock() -> Duration {
    Duration::ZERO
}

/// Steps a session until `time` (s) or until nothing moves any more.
fn run_until(session: &mut Session, time: f64) {
    while session.time() < time - 1e-9 && session.step(&clock) {}
}

#[test]
fn step_by_step_is_the_run_at_once() {
    for name in ["two-setpoints", "tight-bounds", "lissajous"] {
        let mut scenario = Scenario::load(name).unwrap();
        scenario.duration_s = scenario.duration_s.min(5.0);
        let at_once = prepared(&scenario).unwrap();
        let runs = at_once.run(&RunHooks::NONE).unwrap();
        let mut session = Session::new(prepared(&scenario).unwrap()).unwrap();
        for k in 0..at_once.samples {
            assert!(session.step(&clock));
            for (sample, run) in session.samples().iter().zip(&runs) {
                assert_eq!(sample, &run.samples[k], "{name}, sample {k}");
            }
        }
        for (state, run) in session.states().zip(&runs) {
            assert_eq!(state, &run.final_state, "{name}");
        }
    }
}

#[test]
fn a_target_is_reached_from_where_the_robot_is() {
    let scenario = Scenario::load("single-setpoint").unwrap();
    let mut session = Session::new(prepared(&scenario).unwrap()).unwrap();
    run_until(&mut session, 1.0);
    session.set_targets(&[-1.0]).unwrap();
    run_until(&mut session, 6.0);
    let phi = session.states().next().unwrap()[0];
    assert!((phi + 1.0).abs() < 0.01, "{phi}");
}

#[test]
fn new_settings_leave_state_and_time_alone() {
    let mut scenario = Scenario::load("two-setpoints").unwrap();
    let mut session = Session::new(prepared(&scenario).unwrap()).unwrap();
    run_until(&mut session, 1.1);
    let (time, state) = (session.time(), *session.states().next().unwrap());
    scenario.controller.t_s = 0.02;
    scenario.controller.horizon = 60;
    let mut session = session.reconfigured(prepared(&scenario).unwrap()).unwrap();
    assert_eq!(session.time(), time);
    assert_eq!(*session.states().next().unwrap(), state);
    // The scenario's second set point still comes at 3 s of the whole.
    run_until(&mut session, 2.5);
    assert!((session.states().next().unwrap()[0] - std::f64::consts::TAU).abs() < 0.05);
    run_until(&mut session, 5.0);
    assert!(session.states().next().unwrap()[0].abs() < 0.05);
}

#[test]
fn a_push_that_cannot_be_held_ends_on_the_floor_with_its_reason() {
    let scenario = Scenario::load("tight-bounds").unwrap();
    let mut session = Session::new(prepared(&scenario).unwrap()).unwrap();
    run_until(&mut session, 0.2);
    assert_eq!(session.fall_in_words(), None);
    session.push(0, 0.0, 4.0).unwrap();
    run_until(&mut session, 10.0);
    assert!(
        matches!(session.phase(), Phase::Down(_)),
        "{:?}",
        session.phase()
    );
    let words = session.fall_in_words().unwrap();
    assert!(words.contains("no plan at t = 0.250 s"), "{words}");
    assert!(words.contains("bound of"), "{words}");
    let theta = session.states().next().unwrap()[1];
    assert!(theta.abs() > std::f64::consts::FRAC_PI_2, "{theta}");
    assert!(!session.step(&clock), "nothing moves any more");
}

#[test]
fn where_the_torque_moves_in_ramps_it_and_its_rate_have_their_names() {
    let mut scenario = Scenario::load("single-setpoint").unwrap();
    scenario.controller.terminal = TerminalTable::DiscreteRiccati;
    scenario.controller.torque_rate = Some(TorqueRateTable {
        limit_nm_s: 5.0,
        weight: 0.01,
    });
    let mut session = Session::new(prepared(&scenario).unwrap()).unwrap();
    session.set_targets(&[20.0]).unwrap();
    assert!(session.step(&clock));
    let active = session.active_bounds_in_words(0);
    assert!(
        active.contains("torque rate upper 0.00 s ahead"),
        "{active}"
    );
    session.push(0, 0.0, 6.0).unwrap();
    run_until(&mut session, 10.0);
    let words = session.fall_in_words().unwrap();
    assert!(words.contains("infeasible"), "{words}");
    for number in ["state 4", "input 0", "input 1"] {
        assert!(!words.contains(number), "{words}");
    }
}

/// Steps until nothing moves any more; the times of all samples.
fn times_until_down(session: &mut Session) -> Vec<f64> {
    let mut times = Vec::new();
    while session.step(&clock) {
        let now: Vec<f64> = session.samples().iter().map(|sample| sample.t).collect();
        assert_eq!(now.len(), session.planes().len());
        assert!(now.iter().all(|t| *t == now[0]), "{now:?}");
        times.push(now[0]);
        assert!(times.len() < 1000);
    }
    times
}

#[test]
fn a_fall_has_one_sample_per_period_in_every_plane() {
    for (name, plane, push) in [
        ("tight-bounds", 0, 8.0),
        ("lissajous", 0, 20.0),
        ("lissajous", 1, 20.0),
    ] {
        let scenario = Scenario::load(name).unwrap();
        let t_s = scenario.controller.t_s;
        let mut session = Session::new(prepared(&scenario).unwrap()).unwrap();
        session.push(plane, 0.0, push).unwrap();
        let times = times_until_down(&mut session);
        assert!(times.len() > 2, "{name}: {times:?}");
        for (k, t) in times.iter().enumerate() {
            assert!((t - k as f64 * t_s).abs() < 1e-9, "{name}, sample {k}: {t}");
        }
    }
}

/// Who pushes a robot in an ideal world writes a world into the file.
#[test]
fn a_world_that_ends_without_a_plan_has_the_run_of_an_ideal_one() {
    let mut scenario = Scenario::load("tight-bounds").unwrap();
    let mut by_hand = Session::new(prepared(&scenario).unwrap()).unwrap();
    by_hand.push(0, 0.0, 8.0).unwrap();
    let times = times_until_down(&mut by_hand);
    let mut from_file = |without_plan| {
        scenario.world = Some(WorldTable {
            without_plan,
            pushes: vec![PushTable::Rates {
                plane: PlaneName::X,
                time_s: 0.0,
                phi_dot_rad_s: 0.0,
                theta_dot_rad_s: 8.0,
            }],
            ..WorldTable::default()
        });
        Session::new(prepared(&scenario).unwrap()).unwrap()
    };
    let mut ending = from_file(WithoutPlan::End);
    assert_eq!(times_until_down(&mut ending), times);
    assert_eq!(ending.fall_in_words(), by_hand.fall_in_words());
    let mut going_on = from_file(WithoutPlan::Apply);
    times_until_down(&mut going_on);
    assert_ne!(going_on.fall_in_words(), by_hand.fall_in_words());
}

#[test]
fn a_robot_whose_settings_change_while_it_falls_is_still_seen() {
    let scenario = Scenario::load("tight-bounds").unwrap();
    let mut session = Session::new(prepared(&scenario).unwrap()).unwrap();
    run_until(&mut session, 0.2);
    session.push(0, 0.0, 4.0).unwrap();
    while *session.phase() == Phase::Running {
        assert!(session.step(&clock));
    }
    assert!(matches!(session.phase(), Phase::Falling(_)));
    let mut session = session.reconfigured(prepared(&scenario).unwrap()).unwrap();
    assert!(times_until_down(&mut session).len() > 1);
}

/// The same orders by hand and in a file are the same run.
#[test]
fn targets_become_smooth_moves_where_the_scenario_asks_for_them() {
    let mut scenario = Scenario::load("single-setpoint").unwrap();
    scenario.controller.shaping = Some(ShapingTable {
        tilt_rad: 0.05,
        phi_dot_rad_s: 3.0,
    });
    scenario.controller.preview = false;
    let points = |points: &[(f64, f64)]| {
        let points = points
            .iter()
            .map(|&(time_s, phi_rad)| PointTable { time_s, phi_rad });
        ReferenceTable::SetPoints {
            points: points.collect(),
        }
    };
    scenario.reference = points(&[(0.0, 0.0)]);
    let mut by_hand = Session::new(prepared(&scenario).unwrap()).unwrap();
    run_until(&mut by_hand, 1.0);
    assert_eq!(by_hand.set_targets(&[2.0]).unwrap(), [0]);
    run_until(&mut by_hand, 1.5);
    // The second one waits for the first move's end, the third takes its place.
    assert_eq!(by_hand.set_targets(&[5.0]).unwrap(), [0]);
    run_until(&mut by_hand, 1.6);
    assert_eq!(by_hand.set_targets(&[-1.0]).unwrap(), [1]);
    scenario.reference = points(&[(0.0, 0.0), (1.0, 2.0), (1.6, -1.0)]);
    let mut from_file = Session::new(prepared(&scenario).unwrap()).unwrap();
    run_until(&mut from_file, 1.6);
    while by_hand.time() < 8.0 {
        assert!(by_hand.step(&clock) && from_file.step(&clock));
        let (hand, file) = (&by_hand.samples()[0], &from_file.samples()[0]);
        assert!((hand.x - file.x).amax() < 1e-9, "{hand:?} and {file:?}");
        assert!((hand.x_ref[0] - file.x_ref[0]).abs() < 1e-12);
    }
    let phi = by_hand.states().next().unwrap()[0];
    assert!((phi + 1.0).abs() < 0.05, "{phi}");
    // New settings leave the order as it is.
    let before = by_hand.targets().next().unwrap();
    let after = by_hand.reconfigured(prepared(&scenario).unwrap()).unwrap();
    assert_eq!(after.targets().next().unwrap(), before);
    assert!(by_hand.set_targets(&[f64::NAN]).is_err());
}

#[test]
fn a_reference_rests_outside_its_pieces() {
    let mut scenario = Scenario::load("single-setpoint").unwrap();
    scenario.controller.terminal = TerminalTable::DiscreteRiccati;
    scenario.controller.shaping = Some(ShapingTable {
        tilt_rad: 0.1,
        phi_dot_rad_s: 8.0,
    });
    let mut session = Session::new(prepared(&scenario).unwrap()).unwrap();
    run_until(&mut session, 1.0);
    session.set_targets(&[3.0]).unwrap();
    let reference = &session.planes()[0].reference;
    let knots = reference.knots(1.0);
    let (first, last) = (knots[0], knots[knots.len() - 1]);
    assert!(knots.is_sorted() && last > 1.0, "{knots:?}");
    assert_eq!(reference.at(first), reference.at(first - 1.0));
    assert_eq!(reference.at(last), 3.0);
    let lissajous = prepared(&Scenario::load("lissajous").unwrap()).unwrap();
    assert_eq!(lissajous.planes[1].reference.knots(7.0), [0.0, 7.0]);
}

#[test]
fn the_first_order_drops_the_set_points_whose_moves_wait() {
    let mut scenario = Scenario::load("single-setpoint").unwrap();
    scenario.controller.shaping = Some(ShapingTable {
        tilt_rad: 0.05,
        phi_dot_rad_s: 3.0,
    });
    let points = [(0.0, 0.0), (0.1, 3.0), (0.2, -2.0), (0.3, 1.0)];
    scenario.reference = ReferenceTable::SetPoints {
        points: points
            .map(|(time_s, phi_rad)| PointTable { time_s, phi_rad })
            .to_vec(),
    };
    let mut session = Session::new(prepared(&scenario).unwrap()).unwrap();
    run_until(&mut session, 0.5);
    assert_eq!(session.set_targets(&[2.0]).unwrap(), [2]);
}

#[test]
fn a_push_outlives_a_change_of_the_settings_before_the_next_sample() {
    let scenario = Scenario::load("two-setpoints").unwrap();
    let begun = || {
        let mut session = Session::new(prepared(&scenario).unwrap()).unwrap();
        run_until(&mut session, 0.5);
        session
    };
    let changed = |session: &Session| session.reconfigured(prepared(&scenario).unwrap()).unwrap();
    let tilt_rate = |mut session: Session| {
        assert!(session.step(&clock));
        session.states().next().unwrap()[3]
    };
    let alone = tilt_rate(changed(&begun()));
    let mut pushed = begun();
    pushed.push(0, 0.0, 1.0).unwrap();
    let outlived = tilt_rate(changed(&pushed));
    assert!(outlived - alone > 0.3, "{outlived} and {alone}");
}

#[test]
fn a_push_that_is_no_number_is_refused() {
    let scenario = Scenario::load("two-setpoints").unwrap();
    let mut session = Session::new(prepared(&scenario).unwrap()).unwrap();
    assert!(session.push(0, 0.0, f64::NAN).is_err());
    run_until(&mut session, 0.5);
    assert_eq!(session.phase(), &Phase::Running);
}
