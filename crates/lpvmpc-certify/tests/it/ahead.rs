//! The loop with a certified terminal set where references are known ahead, and behind an estimator.

use crate::controller::{EXACT, cart_pole_settings};
use crate::plants::{CART_POLE, p, random};
use lpvmpc::AlongMotion;
use lpvmpc_any::{
    Disturbance, EstimatorSettings, Limits, Mpc, MpcSettings, Plan, Preview, Push, Quantity,
    Sensor, World, WorldSettings,
};
use lpvmpc_plant::{Plant, SizedPlant};
use lpvmpc_sim::advance;
use nalgebra::{DVector, SVector, Vector4};

const HORIZON: usize = 20;

/// On a longer track than the one that was certified.
const TRACK: f64 = 3.0;

fn settings() -> MpcSettings {
    let infinite = f64::INFINITY;
    MpcSettings {
        x_bounds: Some(Limits {
            lower: vec![-TRACK, -0.4, -infinite, -infinite],
            upper: vec![TRACK, 0.4, infinite, infinite],
        }),
        ..cart_pole_settings()
    }
}

/// The cost of a sample.
fn stage(x: &Vector4<f64>, position: f64, u: f64) -> f64 {
    let e = x[0] - position;
    2.0 * e * e + 5.0 * x[1] * x[1] + 0.1 * (x[2] * x[2] + x[3] * x[3]) + 0.01 * u * u
}

/// A preview of these positions.
fn to_positions(positions: impl Iterator<Item = f64>) -> Preview {
    Preview {
        x_ref: positions
            .map(|position| DVector::from_vec(vec![position, 0.0, 0.0, 0.0]))
            .collect(),
        ..Preview::default()
    }
}

/// What the loop costs on the plant, integrated to 1e-12, with references told `told` stages ahead. Every sample has a
/// plan, bounds hold, and the plan's cost with that of its target falls by the stage cost wherever the end of what is told
/// stays.
fn drive(reference: &dyn Fn(usize) -> f64, told: usize, start: &Vector4<f64>) -> f64 {
    let (plant, certificate) = &*CART_POLE;
    let model = AlongMotion::<_, 5>(SizedPlant::<4, 1>::new(plant.clone()).unwrap());
    let mut mpc = Mpc::new(plant, &settings()).unwrap();
    let (mut x, mut cost) = (*start, 0.0);
    let mut before: Option<(f64, f64)> = None;
    // As far as the bounds leave the set room.
    let room = TRACK - certificate.state_limits[0].unwrap();
    for k in 0..110 {
        let preview = to_positions((k..=k + told).map(reference));
        let within = |position: f64| position.clamp(-room, room);
        let end = within(reference(k + told));
        let plan = mpc.step(x.as_slice(), &preview).unwrap();
        assert!(
            plan.decision.unwrap().is_guaranteed(),
            "{k}: {}",
            plan.status
        );
        let u = SVector::<f64, 1>::new(plan.u[(0, 0)]);
        assert!(u[0].abs() <= 10.0);
        let target = plan.target.clone().unwrap().x;
        let off = Vector4::from_row_slice(&target) - Vector4::new(end, 0.0, 0.0, 0.0);
        let worth = plan.cost + 10.0 * off.dot(&(p::<4>(certificate) * off));
        if let Some((bound, at)) = before
            && at == end
        {
            assert!(
                worth <= bound + 1e-4 * (1.0 + bound),
                "{k}: {worth} above {bound}"
            );
        }
        // What stage 0 of the plan was aimed at.
        let changes = (k..k + told).any(|stage| within(reference(stage)) != end);
        let aim = if changes {
            within(reference(k))
        } else {
            target[0]
        };
        before = Some((worth - stage(&x, aim, u[0]), end));
        cost += stage(&x, reference(k), u[0]);
        x = advance(&model, &x, &u, 0.05, EXACT).unwrap();
        assert!(x[0].abs() <= TRACK && x[1].abs() <= 0.4, "{k}: {x}");
    }
    assert!((x[0] - reference(110)).abs() < 0.03, "{x}");
    cost
}

/// Plans that know when the set point will change begin before it.
#[test]
fn what_is_told_ahead_costs_less() {
    let there = |k: usize| if k < 30 { -0.3 } else { 0.3 };
    let start = Vector4::new(-0.3, 0.0, 0.0, 0.0);
    let (late, early) = (drive(&there, 0, &start), drive(&there, HORIZON, &start));
    assert!(early < 0.6 * late, "{early} of {late}");
    // Seen for a part of the horizon it costs no more, either.
    let partly = drive(&there, 8, &start);
    assert!(
        early <= 1.01 * partly && partly < late,
        "{early}, {partly}, {late}"
    );
}

/// Changes at random samples, also several within one horizon, some to where the bounds leave no room.
#[test]
fn the_promise_is_kept_whatever_is_ahead() {
    let mut random = random();
    for _ in 0..2 {
        let mut positions = vec![0.0; 140];
        let mut k = 5;
        while k < 50 {
            positions[k..].fill(3.0 * random());
            k += 1 + (12.0 * (1.0 + random())) as usize;
        }
        positions[50..].fill(random());
        let start = Vector4::new(
            0.3 * random(),
            0.1 * random(),
            0.2 * random(),
            0.2 * random(),
        );
        drive(&|k| positions[k], HORIZON, &start);
    }
}

#[test]
fn what_is_ahead_without_a_meaning_is_refused() {
    let (plant, _) = &*CART_POLE;
    let mut mpc = Mpc::new(plant, &settings()).unwrap();
    let mut tilted = to_positions([0.0, 0.1, 0.2].into_iter());
    tilted.x_ref[2][1] = 0.1;
    let mut endless = to_positions([0.0, 0.1].into_iter());
    endless.x_ref[1][0] = f64::NAN;
    let with_input = Preview {
        u_ref: vec![DVector::zeros(1)],
        ..Preview::default()
    };
    let with_gust = Preview {
        disturbance: vec![DVector::zeros(4)],
        ..Preview::default()
    };
    for (preview, expected) in [
        (
            tilted,
            "x_ref, stage 2: angle is 0.1, and the certificate is about 0",
        ),
        (endless, "x_ref, stage 1: it must be 4 finite numbers"),
        (
            with_input,
            "u_ref: a controller with a certified terminal set takes references x_ref",
        ),
        (
            with_gust,
            "disturbance: a controller with a certified terminal set",
        ),
    ] {
        let message = mpc.step(&[0.0; 4], &preview).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
    // Where nothing leads into the set, what is told ahead does not hide it.
    let far = to_positions([0.0, 0.5].into_iter());
    let plan = mpc.step(&[0.0, 0.39, 0.0, 3.0], &far).unwrap();
    assert!(!plan.decision.unwrap().is_guaranteed());
    assert!(plan.status.starts_with("not guaranteed"), "{}", plan.status);
    assert!(plan.target.is_none() && plan.u.iter().all(|u| u.abs() <= 10.0));
}

fn estimator(disturbances: &[&str]) -> EstimatorSettings {
    let disturbance = |on: &&str| Disturbance {
        on: (*on).to_owned(),
        noise: 1.0,
        initial: 1.0,
    };
    EstimatorSettings {
        disturbances: disturbances.iter().map(disturbance).collect(),
        initial_state: vec![1e-4; 4],
        delay: 0.05,
        ..EstimatorSettings::new(
            &["position", "angle"],
            &[1e-6, 1e-6],
            &[1e-6, 1e-6, 1e-4, 1e-4],
        )
    }
}

/// Noisy readings of position and angle, a sample late, and a load as of `force` N at the upright: the plans, and the
/// positions.
fn behind_readings(
    plant: &Plant,
    estimator: &EstimatorSettings,
    force: f64,
    samples: usize,
) -> (Vec<Plan>, Vec<f64>) {
    let mut mpc = Mpc::new(plant, &settings()).unwrap();
    mpc.set_estimator(Some(estimator)).unwrap();
    let sensor = |i: usize| Sensor {
        noise: 1e-3,
        ..Sensor::ideal(Quantity::Row(
            (0..4).map(|j| f64::from(u8::from(i == j))).collect(),
        ))
    };
    let world = WorldSettings {
        sensors: Some(vec![sensor(0), sensor(1)]),
        delay: 0.05,
        pushes: vec![Push::Load {
            from: 1.0,
            until: f64::INFINITY,
            load: vec![0.0, 0.0, force, 2.0 * force],
        }],
        ..WorldSettings::ideal(0.05)
    };
    let mut world = World::new(plant, &[0.0; 4], &world).unwrap();
    let (mut plans, mut positions) = (Vec::new(), Vec::new());
    for k in 0..samples {
        let readings: Vec<Option<f64>> = { world.readings().iter() }
            .map(|reading| reading.map(|reading| reading.value))
            .collect();
        mpc.observe(world.time(), &readings).unwrap();
        // Told ahead: half a metre from 2 s on, as stage 0 is a sample later than the readings.
        let there = (k + 1..).take(HORIZON + 1);
        let preview = to_positions(there.map(|k| if k < 40 { 0.0 } else { 0.5 }));
        let plan = mpc.decide(&preview).unwrap();
        world.command(&plan.first_input()).unwrap();
        assert!(plan.u.iter().all(|u| u.abs() <= 10.0));
        plans.push(plan);
        world.advance().unwrap();
        positions.push(world.state()[0]);
    }
    (plans, positions)
}

/// The mean of the last second.
fn end(positions: &[f64]) -> f64 {
    positions[positions.len() - 20..].iter().sum::<f64>() / 20.0
}

/// With noise, a delay and a constant load it stands where it is to be, since the load is found and taken off; without the
/// disturbance in its model it stands aside.
#[test]
fn behind_an_estimator_it_tracks() {
    let (plant, _) = &*CART_POLE;
    let (plans, positions) = behind_readings(plant, &estimator(&["force"]), 1.0, 160);
    let guaranteed = { plans.iter() }
        .filter(|plan| plan.decision.unwrap().is_guaranteed())
        .count();
    assert!(guaranteed >= 155, "{guaranteed}");
    assert!((end(&positions) - 0.5).abs() < 0.01, "{}", end(&positions));
    // It has begun before 2 s, and what it heads for is held against the load.
    assert!(
        positions[39] < -0.01 || positions[39] > 0.01,
        "{}",
        positions[39]
    );
    let target = plans[159].target.clone().unwrap();
    assert!((target.u[0] + 1.0).abs() < 0.2, "{:?}", target.u);
    let (_, positions) = behind_readings(plant, &estimator(&[]), 1.0, 160);
    assert!((end(&positions) - 0.5).abs() > 0.05, "{}", end(&positions));
}

/// A load that the bounds leave nothing against is no model of which anything could be guaranteed.
#[test]
fn a_disturbance_beyond_the_bounds_leaves_no_guarantee() {
    let (plant, _) = &*CART_POLE;
    let (plans, _) = behind_readings(plant, &estimator(&["force"]), 12.0, 40);
    assert!(plans[10].decision.unwrap().is_guaranteed());
    let last = &plans[39];
    assert!(!last.decision.unwrap().is_guaranteed() && last.target.is_none());
    assert!(last.status.starts_with("not guaranteed"), "{}", last.status);
}

#[test]
fn an_estimator_that_the_certificate_is_not_for_is_refused() {
    let (plant, _) = &*CART_POLE;
    let mut mpc = Mpc::new(plant, &settings()).unwrap();
    let message = mpc.decide(&Preview::default()).unwrap_err().to_string();
    assert!(message.contains("there is none"), "{message}");
    let refused = mpc.set_estimator(Some(&estimator(&["speed"])));
    let message = refused.unwrap_err().to_string();
    let expected = "disturbances: speed is a state: a disturbance there moves the equilibrium that the certificate is about; \
                    with a certified terminal set it must be beside an input (force)";
    assert!(message.contains(expected), "{message}");
    assert!(mpc.estimate().is_none());
    // The same where the certificate comes later.
    let mut plain = settings();
    plain.terminal = lpvmpc_any::Terminal::Lqr;
    mpc.set_settings(&plain).unwrap();
    mpc.set_estimator(Some(&estimator(&["speed"]))).unwrap();
    let message = mpc.set_settings(&settings()).unwrap_err();
    assert!(
        message.to_string().contains("speed is a state"),
        "{message}"
    );
    // Before a reading there is no estimate to plan from.
    mpc.set_estimator(Some(&estimator(&["force"]))).unwrap();
    mpc.set_settings(&settings()).unwrap();
    let plan = mpc.decide(&Preview::default()).unwrap();
    assert!(
        plan.status.starts_with("not guaranteed: "),
        "{}",
        plan.status
    );
    assert!(plan.u.iter().all(|u| u.abs() <= 10.0));
}
