//! Settings that change while a robot runs: what is known stays known.

use ballbot_scenario::{
    DisturbancesTable, EstimatorTable, PointTable, Prepared, ReferenceTable, Scenario, Session,
    TerminalTable, TorqueRateTable, WorldTable,
};
use std::path::Path;
use std::time::Duration;

fn prepared(scenario: &Scenario) -> Prepared {
    scenario.prepare(Path::new(".")).unwrap()
}

fn clock() -> Duration {
    Duration::ZERO
}

/// A robot with noise, late, missing and repeated readings, a delay, a dry drive with a lag, a push that
/// lasts, and one to come.
fn real_world() -> WorldTable {
    toml::from_str(
        r#"
        sensor_period_s = 0.01
        seed = 7
        [sensors.phi]
        noise_rad = 1e-3
        dropout = 0.2
        stale = 0.1
        [sensors.theta]
        noise_rad = 2e-3
        delay_s = 0.02
        [sensors.theta_dot]
        noise_rad_s = 1e-2
        delay_s = 0.01
        [actuator]
        lag_s = 0.002
        bias_nm = 0.02
        [delay]
        computation_s = 0.004
        transport_s = 0.012
        [[pushes]]
        force = { plane = "x", from_s = 0.3, until_s = 1.1, force_m_s2 = 0.05, height_m = 0.2 }
        [[pushes]]
        rates = { plane = "x", time_s = 0.9, phi_dot_rad_s = 0.0, theta_dot_rad_s = 0.2 }
        "#,
    )
    .unwrap()
}

fn with_estimator(scenario: &mut Scenario) {
    scenario.controller.estimator = Some(EstimatorTable::default());
    scenario.controller.delay_s = 0.016;
    scenario.world = Some(real_world());
}

fn variants() -> Vec<(String, Scenario)> {
    let mut variants = Vec::new();
    for name in [
        "two-setpoints",
        "two-setpoints-linear",
        "single-setpoint-terminal",
        "tight-bounds",
        "lissajous",
        "far-setpoints",
    ] {
        variants.push((name.to_owned(), Scenario::load(name).unwrap()));
    }
    // 2.5 m at once, where a plan is a long way from its end for many samples.
    let mut far = Scenario::load("one-metre").unwrap();
    far.reference = ReferenceTable::SetPoints {
        points: vec![PointTable {
            time_s: 0.0,
            phi_rad: 2.5 / 0.12,
        }],
    };
    variants.push(("2.5 m at once".to_owned(), far));
    for name in ["two-setpoints", "far-setpoints"] {
        let mut scenario = Scenario::load(name).unwrap();
        scenario.controller.terminal = TerminalTable::DiscreteRiccati;
        let mut late = scenario.clone();
        late.controller.delay_s = 0.016;
        late.world = Some(real_world());
        variants.push((format!("{name}, on the readings, with delay"), late));
        with_estimator(&mut scenario);
        variants.push((format!("{name}, with estimator"), scenario.clone()));
        scenario.controller.torque_rate = Some(TorqueRateTable {
            limit_nm_s: 20.0,
            weight: 0.01,
        });
        variants.push((format!("{name}, in ramps"), scenario));
    }
    variants
}

/// The same settings once more: nothing happened, to the last bit.
#[test]
fn identical_settings_are_an_identity_on_the_run() {
    for (name, mut scenario) in variants() {
        scenario.duration_s = 2.0;
        let mut alone = Session::new(prepared(&scenario)).unwrap();
        let mut changed = Session::new(prepared(&scenario)).unwrap();
        let samples = (1.5 / scenario.controller.t_s) as usize;
        for k in 0..samples {
            if k % 3 == 2 {
                changed = changed.reconfigured(prepared(&scenario)).unwrap();
            }
            if k == samples / 2 {
                for session in [&mut alone, &mut changed] {
                    session.set_targets(&[1.0, 0.5]).unwrap();
                    session.push(0, 0.0, 0.1).unwrap();
                }
            }
            assert_eq!(alone.time(), changed.time(), "{name}, sample {k}");
            assert_eq!(
                alone.step(&clock),
                changed.step(&clock),
                "{name}, sample {k}"
            );
            assert_eq!(
                alone.observations(),
                changed.observations(),
                "{name}, sample {k}"
            );
            for (a, b) in alone.samples().iter().zip(changed.samples()) {
                assert!(a.x.iter().all(|x| x.is_finite()));
                // NaN where there is no cost.
                assert_eq!(a.cost.to_bits(), b.cost.to_bits(), "{name}, sample {k}");
                assert_eq!((a.t, a.x, a.u), (b.t, b.x, b.u), "{name}, sample {k}");
                assert_eq!(a.estimate, b.estimate, "{name}, sample {k}");
                assert_eq!((a.status, a.gap), (b.status, b.gap), "{name}, sample {k}");
            }
        }
        assert!(alone.samples()[0].t > 1.0, "{name}: {:?}", alone.phase());
    }
}

/// At rest after two turns of the ball the estimator was thrown away, and took phi for zero: the
/// robot jerked by 1.08 rad.
#[test]
fn a_robot_at_rest_far_from_zero_stays_there_whatever_is_set() {
    let turns = 4.0 * std::f64::consts::PI;
    let mut scenario = Scenario::load("far-setpoints").unwrap();
    scenario.controller.terminal = TerminalTable::DiscreteRiccati;
    scenario.initial_state.phi_rad = turns;
    with_estimator(&mut scenario);
    scenario.world.as_mut().unwrap().pushes.clear();
    let settled = || {
        let mut session = Session::new(prepared(&scenario)).unwrap();
        session.set_targets(&[turns]).unwrap();
        while session.time() < 6.0 {
            assert!(session.step(&clock));
        }
        session
    };
    // Where the noise moves it.
    let farthest = |session: &mut Session| {
        let end = session.time() + 2.0;
        let mut most = 0.0_f64;
        while session.time() < end {
            assert!(session.step(&clock));
            most = most.max((session.states().next().unwrap()[0] - turns).abs());
        }
        most
    };
    let undisturbed = farthest(&mut settled());
    assert!(undisturbed < 0.1, "{undisturbed}");
    let after = |change: &dyn Fn(&mut Scenario)| {
        let mut scenario = scenario.clone();
        change(&mut scenario);
        farthest(&mut settled().reconfigured(prepared(&scenario)).unwrap())
    };
    for (name, moved) in [
        ("nothing", after(&|_| ())),
        (
            "weights",
            after(&|s| s.controller.r = s.controller.r.map(|r| 2.0 * r)),
        ),
        ("horizon", after(&|s| s.controller.horizon += 7)),
        ("shorter horizon", after(&|s| s.controller.horizon -= 5)),
        (
            "filter",
            after(&|s| s.controller.estimator.as_mut().unwrap().phi_noise_rad = 2e-3),
        ),
        ("delay", after(&|s| s.controller.delay_s = 0.02)),
        (
            "ramp",
            after(&|s| {
                s.controller.torque_rate = Some(TorqueRateTable {
                    limit_nm_s: 20.0,
                    weight: 0.01,
                });
            }),
        ),
    ] {
        // Another controller answers the noise in its own way.
        assert!(
            moved < 2.0 * undisturbed,
            "{name}: {moved}, {undisturbed} without"
        );
    }
    // The disturbances have to be found anew, or are found no more: a bias of 0.02 N m.
    let without = after(&|s| {
        s.controller.estimator.as_mut().unwrap().disturbances = DisturbancesTable::None;
    });
    assert!(without < 0.3, "{without}");
}

/// The readings have been late for the old settings, and are for the new ones.
#[test]
fn another_sampling_time_or_sensor_period_leaves_time_and_state() {
    let mut scenario = Scenario::load("two-setpoints").unwrap();
    with_estimator(&mut scenario);
    let mut session = Session::new(prepared(&scenario)).unwrap();
    while session.time() < 1.0 {
        assert!(session.step(&clock));
    }
    scenario.controller.t_s = 0.025;
    scenario.world.as_mut().unwrap().sensor_period_s = Some(0.005);
    let mut changed = session.reconfigured(prepared(&scenario)).unwrap();
    assert_eq!(session.time(), changed.time());
    assert_eq!(session.states().next(), changed.states().next());
    assert!(changed.step(&clock));
    assert!((changed.time() - session.time() - 0.025).abs() < 1e-12);
    while changed.time() < 6.0 {
        assert!(changed.step(&clock));
    }
    let phi = changed.states().next().unwrap()[0];
    assert!(phi.abs() < 0.1, "{phi}");
}
