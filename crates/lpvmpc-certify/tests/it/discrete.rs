//! Plants in discrete time: what is claimed, looked at by the map itself.

use crate::plants::{edge, random, signal};
use lpvmpc::{Dynamics, Number};
use lpvmpc_any::{Mpc, MpcSettings, Preview, Terminal};
use lpvmpc_certify::{Certificate, CertifyError, CertifySettings, certify, verify};
use lpvmpc_plant::{Plant, PlantData};
use nalgebra::{Vector1, Vector2, Vector3};
use std::sync::LazyLock;

const PERIOD: f64 = 0.05;

/// A pendulum (angle from upright in rad, rate in rad/s) and the motor that lags behind its command (N m), by Euler's
/// method with the new rate.
struct Pendulum;

impl Dynamics<3, 1> for Pendulum {
    fn period(&self) -> Option<f64> {
        Some(PERIOD)
    }

    fn f<N: Number>(&self, x: &Vector3<N>, u: &Vector1<N>) -> Vector3<N> {
        let h = N::constant(PERIOD);
        let rate = x[1] + h * (N::constant(9.81) * x[0].sin() + x[2]);
        let motor = N::constant(0.2) * x[2] + N::constant(0.8) * u[0];
        Vector3::new(x[0] + h * rate, rate, motor)
    }
}

/// Ricker's salmon, the young of the year and the grown up, with a catch; thousands.
struct Salmon;

impl Dynamics<2, 1> for Salmon {
    fn period(&self) -> Option<f64> {
        Some(1.0)
    }

    fn f<N: Number>(&self, x: &Vector2<N>, u: &Vector1<N>) -> Vector2<N> {
        let number = N::constant;
        let young = number(5.0) * x[1] * (number(-0.01) * x[1]).exp();
        let grown = number(0.5) * x[0] + number(0.6) * x[1] - u[0];
        Vector2::new(young, grown)
    }
}

fn pendulum() -> Plant {
    Plant::new(PlantData {
        states: vec![
            signal("angle", "rad", Some((-0.8, 0.8))),
            signal("rate", "rad/s", None),
            signal("torque", "N m", None),
        ],
        inputs: vec![signal("command", "N m", Some((-8.0, 8.0)))],
        ..PlantData::of_dynamics("pendulum", &Pendulum)
    })
    .unwrap()
}

fn salmon() -> Plant {
    Plant::new(PlantData {
        states: vec![
            signal("young", "", Some((40.0, 300.0))),
            signal("grown", "", Some((40.0, 200.0))),
        ],
        inputs: vec![signal("catch", "", Some((0.0, 120.0)))],
        ..PlantData::of_dynamics("salmon", &Salmon)
    })
    .unwrap()
}

static PENDULUM: LazyLock<(Plant, Certificate)> = LazyLock::new(|| {
    let plant = pendulum();
    let settings = CertifySettings::new(PERIOD, &[5.0, 0.5, 0.01], &[0.05]);
    let certificate = certify(&plant, &settings, &|_| ()).unwrap();
    (plant, certificate)
});

static SALMON: LazyLock<(Plant, Certificate)> = LazyLock::new(|| {
    let plant = salmon();
    // With 100 grown up, 500/e young and the rest caught.
    let catch = 250.0 / 1_f64.exp() - 40.0;
    let settings = CertifySettings {
        equilibrium: Some((vec![183.94, 100.0], vec![(catch * 1e3).round() / 1e3])),
        ..CertifySettings::new(1.0, &[0.1, 1.0], &[1.0])
    };
    let certificate = certify(&plant, &settings, &|_| ()).unwrap();
    (plant, certificate)
});

/// From the edge of the set and from inside, by the map, to rest.
fn check<const N: usize>((plant, certificate): &(Plant, Certificate)) {
    let mut random = random();
    let (center, at_rest) = (&certificate.equilibrium.x, certificate.equilibrium.u[0]);
    for run in 0..300 {
        let share = [1.0, 0.5, 1e-3][run % 3];
        let edge = edge::<N>(certificate, &mut random);
        let mut x: Vec<f64> = (0..N)
            .map(|i| center[i] + share * (edge[i] - center[i]))
            .collect();
        for _ in 0..200 {
            let e: Vec<f64> = (0..N).map(|i| x[i] - center[i]).collect();
            let v = -(0..N).map(|i| certificate.k[0][i] * e[i]).sum::<f64>();
            let mut limits = e.iter().zip(&certificate.state_limits);
            assert!(limits.all(|(e, limit)| e.abs() <= limit.unwrap()));
            assert!(v.abs() <= certificate.input_limits[0].unwrap());
            let stage: f64 = (0..N).map(|i| certificate.q[i][i] * e[i] * e[i]).sum();
            let stage = stage + certificate.r[0][0] * v * v;
            let before = certificate.value(&x);
            x = plant.next(&x, &[at_rest + v]).unwrap();
            let bound = (1.0 - certificate.contraction) * before - stage;
            let after = certificate.value(&x);
            assert!(
                after <= bound + 1e-9 * before + 1e-24,
                "{after} above {bound}"
            );
        }
        assert!(certificate.value(&x) < 1e-9 * certificate.level);
    }
}

#[test]
fn maps_are_certified() {
    check::<3>(&PENDULUM);
    check::<2>(&SALMON);
    let (plant, certificate) = &*PENDULUM;
    verify(certificate, plant, &|_| ()).unwrap();
    assert!(certificate.state_limits[0].unwrap() > 0.5);
    let (plant, certificate) = &*SALMON;
    verify(certificate, plant, &|_| ()).unwrap();
    // Where the young are most, the map is bent; the equilibrium was rounded, and is enclosed.
    assert!(certificate.state_limits[1].unwrap() > 20.0);
    let within = &certificate.equilibrium.within;
    assert!(within.iter().any(|within| *within > 0.0) && within.iter().all(|w| *w < 1e-10));
    let stands = plant
        .next(&certificate.equilibrium.x, &certificate.equilibrium.u)
        .unwrap();
    assert!((stands[0] - certificate.equilibrium.x[0]).abs() < 1e-10);
}

type Forge = fn(&mut Certificate);

#[test]
fn false_claims_about_maps_are_found_out() {
    let (plant, certificate) = &*PENDULUM;
    let cases: [(Forge, &str, bool); 5] = [
        (|c| c.level *= 30.0, "the set reaches", true),
        (|c| c.contraction = 0.9, "x'Px is false", true),
        (
            |c| c.k[0].iter_mut().for_each(|k| *k = -*k),
            "x'Px is false",
            true,
        ),
        (
            |c| c.equilibrium.u[0] += 0.5,
            "torque never stands still",
            true,
        ),
        (
            |c| c.t_s = 0.1,
            "t_s: it is 0.1 s; the plant is in discrete time with a period of 0.05 s",
            false,
        ),
    ];
    for (forge, expected, is_false) in cases {
        let mut forged = certificate.clone();
        forge(&mut forged);
        let error: CertifyError = verify(&forged, plant, &|_| ()).unwrap_err();
        let message = error.to_string();
        assert!(
            message.contains(expected) && error.is_false() == is_false,
            "{message}"
        );
    }
    let settings = CertifySettings::new(0.1, &[1.0; 3], &[1.0]);
    let message = certify(plant, &settings, &|_| ()).unwrap_err().to_string();
    assert!(message.contains("with a period of 0.05 s"), "{message}");
}

/// From outside of the set: once there is a plan, there is one, bounds hold, and the cost falls by the stage cost, exactly.
#[test]
fn the_guaranteed_loop_of_a_map_keeps_its_promise() {
    let (plant, certificate) = &*PENDULUM;
    let set = certificate.terminal_set(plant).unwrap();
    let settings = MpcSettings {
        terminal: Terminal::Certified(Box::new(set)),
        ..MpcSettings::new(PERIOD, 15, &[5.0, 0.5, 0.01], &[0.05])
    };
    let mut random = random();
    let mut outside = 0;
    for _ in 0..25 {
        let mut mpc = Mpc::new(plant, &settings).unwrap();
        let mut x = vec![0.79 * random(), 4.0 * random(), 20.0 * random()];
        let is_outside = !certificate.contains(&x);
        let mut before: Option<f64> = None;
        for _ in 0..60 {
            let plan = mpc.step(&x, &Preview::default()).unwrap();
            let u = plan.u[(0, 0)];
            assert!(u.abs() <= 8.0);
            let guaranteed = plan.decision.unwrap().is_guaranteed();
            assert!(guaranteed || before.is_none(), "{}", plan.status);
            // From some starts nothing holds the pendulum.
            if !guaranteed {
                break;
            }
            outside += usize::from(before.is_none() && is_outside);
            let bound = before.unwrap_or(f64::INFINITY);
            let slack = 1e-9 * bound + 1e-12;
            assert!(plan.cost <= bound + slack, "{} above {bound}", plan.cost);
            let state = 5.0 * x[0] * x[0] + 0.5 * x[1] * x[1] + 0.01 * x[2] * x[2];
            before = Some(plan.cost - state - 0.05 * u * u);
            x = plant.next(&x, &[u]).unwrap();
            assert!(x[0].abs() <= 0.8, "{x:?}");
        }
        assert!(before.is_none() || x[0].abs() < 1e-2, "{x:?}");
    }
    assert!(outside >= 3, "{outside}");
}
