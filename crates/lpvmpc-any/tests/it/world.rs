//! Simulated worlds, and where plants stand.

use crate::plants::{CartPole, cart_pole};
use lpvmpc::AlongMotion;
use lpvmpc_any::{
    Actuator, Push, Quantity, Sensor, Tolerances, World, WorldSettings, steady_state,
};
use lpvmpc_plant::{Matrices, Plant, PlantData};
use nalgebra::{Vector1, Vector4, dmatrix, dvector};

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
        ..Sensor::ideal(Quantity::Row(vec![1.0, 2.0, 0.0, 0.0]))
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
    let sensors = Some(vec![Sensor::ideal(Quantity::Row(vec![1.0]))]);
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
    let many = Some(vec![Sensor::ideal(Quantity::Row(vec![0.0; 4])); 17]);
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

/// A plant in discrete time, two of whose steps are one sample, whose output is not linear and whose input comes late and
/// through an actuator: as by hand.
#[test]
fn a_plant_in_discrete_time_moves_in_its_own_steps() {
    let matrices = Matrices {
        a: dmatrix![1.0, 0.1; -0.2, 0.9],
        b: dmatrix![0.0; 0.1],
        c: Some(dmatrix![2.0, -1.0]),
        period: Some(0.1),
        ..Matrices::default()
    };
    let plant = Plant::new(PlantData::of_matrices("linear", &matrices).unwrap()).unwrap();
    let settings = WorldSettings {
        delay: 0.1,
        pushes: vec![Push::Load {
            from: 0.25,
            until: 0.55,
            load: vec![0.0, 0.3],
        }],
        sensors: Some(vec![Sensor {
            bias: 0.5,
            ..Sensor::ideal(Quantity::Output("y0".to_owned()))
        }]),
        ..WorldSettings::ideal(0.2)
    };
    let mut world = World::new(&plant, &[1.0, 0.0], &settings).unwrap();
    let (mut x, mut acting) = (dvector![1.0, 0.0], 0.0);
    for k in 0..6 {
        let u = f64::from(k) - 2.0;
        world.command(&[u]).unwrap();
        for step in [2 * k, 2 * k + 1] {
            // It arrives with the second step; the load acts on the steps at 0.3, 0.4 and 0.5 s.
            acting = if step % 2 == 1 { u } else { acting };
            let load = f64::from(u8::from((3..=5).contains(&step))) * dvector![0.0, 0.3];
            x = &matrices.a * &x + matrices.b.column(0) * acting + load;
        }
        world.advance().unwrap();
        for (one, other) in world.state().iter().zip(&x) {
            assert!((one - other).abs() < 1e-14, "{k}: {one} {other}");
        }
        let reading = world.readings()[0].unwrap().value;
        assert!((reading - (2.0 * x[0] - x[1] + 0.5)).abs() < 1e-13);
    }
    let uneven = World::new(&plant, &[1.0, 0.0], &WorldSettings::ideal(0.25));
    assert_eq!(
        uneven.unwrap_err().to_string(),
        "world: the period of the sensors is 0.25 s; it must be a whole number of the plant's periods of 0.1 s"
    );
}

#[test]
fn what_is_wrong_with_a_sensor_or_an_actuator_is_said_with_its_name() {
    let noisy = |coefficients: &[f64]| Sensor {
        noise: -1.0,
        ..Sensor::ideal(Quantity::Row(coefficients.to_vec()))
    };
    for (sensors, actuators, said) in [
        (
            Some(vec![noisy(&[0.0, 1.0, 0.0, 0.0])]),
            None,
            "sensors[0] (angle): the noise is -1; it must be finite and not negative",
        ),
        (
            Some(vec![noisy(&[1.0, 1.0, 0.0, 0.0])]),
            None,
            "sensors[0]: the noise is -1; it must be finite and not negative",
        ),
        (
            None,
            Some(vec![Actuator {
                lag: f64::INFINITY,
                ..Actuator::default()
            }]),
            "actuators[0] (force): the lag is inf; it must be finite and not negative",
        ),
    ] {
        let settings = WorldSettings {
            sensors,
            actuators,
            ..WorldSettings::ideal(0.05)
        };
        let refused = World::new(&cart_pole(), &[0.0; 4], &settings).unwrap_err();
        assert_eq!(refused.to_string(), said);
    }
    let late = WorldSettings {
        delay: -1.0,
        ..WorldSettings::ideal(0.05)
    };
    let refused = World::new(&cart_pole(), &[0.0; 4], &late).unwrap_err();
    assert_eq!(
        refused.to_string(),
        "world: the delay is -1; it must be finite and not negative"
    );
}

#[test]
fn a_sensor_of_an_output_is_refused_where_there_is_none() {
    let said = |name: &str| {
        let settings = WorldSettings {
            sensors: Some(vec![Sensor::ideal(Quantity::Output(name.to_owned()))]),
            ..WorldSettings::ideal(0.05)
        };
        let refused = World::new(&cart_pole(), &[0.0; 4], &settings);
        refused.unwrap_err().to_string()
    };
    assert!(said("tip").starts_with("sensors[0]: \"tip\" is no state or output; there are "));
}
