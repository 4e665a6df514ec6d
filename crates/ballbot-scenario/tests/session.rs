//! A scenario run step by step is the run at once, and a person can take part in it.

use ballbot_scenario::{
    Phase, Prepared, Scenario, ScenarioError, Session, Surroundings, TerminalTable, TorqueRateTable,
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
        let runs = at_once
            .run(&Surroundings {
                clock: &clock,
                progress: &|_| (),
            })
            .unwrap();
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
    session.set_targets(&[-1.0]);
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
    session.set_targets(&[20.0]);
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

#[test]
fn a_push_that_is_no_number_is_refused() {
    let scenario = Scenario::load("two-setpoints").unwrap();
    let mut session = Session::new(prepared(&scenario).unwrap()).unwrap();
    assert!(session.push(0, 0.0, f64::NAN).is_err());
    run_until(&mut session, 0.5);
    assert_eq!(session.phase(), &Phase::Running);
}
