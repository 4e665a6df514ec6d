//! Simulated worlds, and where plants stand.

use crate::plants::{CartPole, cart_pole};
use lpvmpc::AlongMotion;
use lpvmpc_any::{Push, Sensor, Tolerances, World, WorldSettings, steady_state};
use nalgebra::{Vector1, Vector4};

#[test]
fn a_plant_moves_as_one_of_its_own_size() {
    // Finer than what is asked of it: the first step depends on the number of places.
    let tolerances = Tolerances {
        relative: 1e-12,
        absolute: 1e-12,
    };
    let settings = WorldSettings {
        tolerances,
        ..WorldSettings::ideal(0.05)
    };
    let start = [0.1, 0.3, -0.2, 0.5];
    let mut world = World::new(&cart_pole(), &start, &settings).unwrap();
    let model = AlongMotion::<_, 5>(CartPole);
    let mut x = Vector4::from(start);
    for i in 0..40 {
        let u = (f64::from(i) * 0.3).sin();
        world.command(&[u]).unwrap();
        world.advance().unwrap();
        x = lpvmpc_sim::advance(&model, &x, &Vector1::new(u), 0.05, tolerances).unwrap();
        for (one, other) in world.state().iter().zip(&x) {
            assert!(
                (one - other).abs() <= 1e-10 * (1.0 + other.abs()),
                "{one} {other}"
            );
        }
    }
    assert!((world.time() - 2.0).abs() < 1e-12);
}

#[test]
fn a_load_moves_a_state_by_its_integral() {
    let load = Push::Load {
        from: 0.02,
        until: 0.07,
        load: vec![2.0, 0.0, 0.0, 0.0],
    };
    let jump = Push::Jump {
        time: 0.08,
        change: vec![0.5, 0.0, 0.0, 0.0],
    };
    let settings = WorldSettings {
        pushes: vec![load, jump],
        ..WorldSettings::ideal(0.05)
    };
    let mut world = World::new(&cart_pole(), &[0.0; 4], &settings).unwrap();
    for _ in 0..2 {
        world.advance().unwrap();
    }
    assert!((world.state()[0] - 0.6).abs() < 1e-9);
}

#[test]
fn a_sensor_reads_what_it_is_told_to() {
    let sensor = Sensor {
        bias: 0.25,
        ..Sensor::ideal(vec![1.0, 2.0, 0.0, 0.0])
    };
    let settings = WorldSettings {
        sensors: Some(vec![sensor]),
        ..WorldSettings::ideal(0.05)
    };
    let world = World::new(&cart_pole(), &[0.5, 0.1, 0.0, 0.0], &settings).unwrap();
    assert_eq!(world.readings().len(), 1);
    assert!((world.readings()[0].unwrap().value - 0.95).abs() < 1e-15);
}

#[test]
fn what_is_no_world_is_refused_by_its_place() {
    let said = |settings: WorldSettings| {
        let refused = World::new(&cart_pole(), &[0.0; 4], &settings);
        refused.unwrap_err().to_string()
    };
    let ideal = || WorldSettings::ideal(0.05);
    let sensors = Some(vec![Sensor::ideal(vec![1.0])]);
    let said_of_sensors = said(WorldSettings { sensors, ..ideal() });
    assert!(
        said_of_sensors.starts_with("sensors[0], row: it has 1 entries"),
        "{said_of_sensors}"
    );
    let delay = -1.0;
    assert!(said(WorldSettings { delay, ..ideal() }).contains("delay"));
    let actuators = Some(Vec::new());
    assert!(
        said(WorldSettings {
            actuators,
            ..ideal()
        })
        .contains("0 for 1 inputs")
    );
    let many = Some(vec![Sensor::ideal(vec![0.0; 4]); 17]);
    assert!(
        said(WorldSettings {
            sensors: many,
            ..ideal()
        })
        .contains("at most 16")
    );
    let mut world = World::new(&cart_pole(), &[0.0; 4], &ideal()).unwrap();
    assert!(world.command(&[f64::NAN]).is_err());
}

#[test]
fn a_cart_stands_where_it_is_told_to_and_its_pole_upright() {
    let found = steady_state(&cart_pole(), &[1.5, 0.2, 0.0, 0.0], &[1.0, 1.0, 1.0, 1.0]).unwrap();
    assert!(!found.reached && (found.x[0] - 1.5).abs() < 1e-9);
    assert!(found.x[1].abs() < 1e-9 && found.u[0].abs() < 1e-9);
    let refused = steady_state(&cart_pole(), &[0.0; 4], &[1.0, -1.0, 0.0, 0.0]);
    assert!(
        refused
            .unwrap_err()
            .to_string()
            .starts_with("weights: angle is -1")
    );
}
