//! A robot whose contacts give way in proportion to their force, as soft contacts do.
//!
//! Four bodies: the ball's centre x, its turning phi, the body's tilt theta, the wheel's turning psi
//! against the body. At floor and wheel the surfaces slide against each other at the compliance
//! times the force; without compliance it is the planar ballbot.

use crate::laboratory::{csv, healthy, normal};
use ballbot_identification::log::{Run, Torque};
use ballbot_identification::{Config, Identification, Parameter, Weight, identify, log};
use nalgebra::{SVector, Vector3};
use std::f64::consts::TAU;

type State = SVector<f64, 8>;

struct Creeping {
    /// m/(N s).
    compliance: f64,
}

const MASS: f64 = 10.0;
const INERTIA: f64 = 0.4;
const BALL_MASS: f64 = 2.0;
const BALL_INERTIA: f64 = 0.0115;
const WHEEL_INERTIA: f64 = 0.02;
const LEVER: f64 = 0.2978;
const BALL: f64 = 0.12;
const WHEEL: f64 = 0.05;
const ROLLING: f64 = 0.1;
const DRIVE: f64 = 0.3;
const GRAVITY: f64 = 9.81;

/// b1, b2, b3 of the robot without compliance.
fn truth() -> [f64; 3] {
    let b2 = (BALL / WHEEL).powi(2) * WHEEL_INERTIA;
    let b1 = b2 + BALL_INERTIA + (MASS + BALL_MASS) * BALL * BALL;
    let b3 = b2 + INERTIA + MASS * LEVER * LEVER;
    [b1 / MASS, b2 / MASS, b3 / MASS]
}

impl Creeping {
    fn f(&self, s: &State, torque: f64) -> State {
        let [_, _, theta, _, x_dot, phi_dot, theta_dot, psi_dot] = (*s).into();
        let (sin, cos) = theta.sin_cos();
        let floor = -(x_dot - BALL * phi_dot) / self.compliance;
        let wheel = (WHEEL * psi_dot - BALL * (phi_dot - theta_dot)) / self.compliance;
        let drag = DRIVE * (phi_dot - theta_dot);
        let phi_ddot = (BALL * (wheel - floor) - ROLLING * phi_dot - drag) / BALL_INERTIA;
        let psi_ddot = (torque - WHEEL * wheel) / WHEEL_INERTIA;
        let (a, b) = (MASS + BALL_MASS, MASS * LEVER * cos);
        let c = INERTIA + MASS * LEVER * LEVER;
        let along = floor + MASS * LEVER * theta_dot * theta_dot * sin;
        let about = MASS * GRAVITY * LEVER * sin - BALL * wheel + drag;
        let determinant = a * c - b * b;
        State::from([
            x_dot,
            phi_dot,
            theta_dot,
            psi_dot,
            (c * along - b * about) / determinant,
            phi_ddot,
            (a * about - b * along) / determinant,
            psi_ddot,
        ])
    }

    /// 20 s at 200 Hz in the loop of the healthy robot, excited, with noise and 10 ms of delay.
    fn log(&self, seed: u64) -> String {
        // The stiffest mode is that of the ball between its contacts.
        let substeps = ((8e-3 / self.compliance).ceil() as usize).max(50);
        let step = 5e-3 / substeps as f64;
        let late = 2 * substeps;
        let mut rng = fastrand::Rng::with_seed(seed);
        let gain = healthy().gain();
        let phases: Vec<f64> = (0..15).map(|_| TAU * rng.f64()).collect();
        let excitation = |t: f64| {
            let harmonics = phases.iter().enumerate().map(|(i, phase)| {
                let frequency = 0.2 * 30.0_f64.powf(i as f64 / 14.0);
                (TAU * frequency * t + phase).sin()
            });
            0.27 * t.min(1.0) * harmonics.sum::<f64>()
        };
        let mut record = crate::laboratory::Record {
            run: Run {
                name: "creeping".to_owned(),
                time: Vec::new(),
                outputs: Vec::new(),
                torque: Vec::new(),
                stretches: Vec::new(),
                torque_kind: Torque::Applied,
            },
            commanded: Vec::new(),
            largest_tilt: 0.0,
        };
        let (mut s, mut waiting) = (
            State::zeros(),
            std::collections::VecDeque::from(vec![0.0; late]),
        );
        for row in 0..4000 {
            let t = f64::from(row) * 5e-3;
            // The encoder sees the wheel.
            let phi = s[3] * WHEEL / BALL + s[2];
            let clean = Vector3::new(phi, s[2] + 0.01, s[6] + 0.02);
            let noise = Vector3::new(1e-3, 1e-3, 5e-3).map(|sigma| sigma * normal(&mut rng));
            let outputs = clean + noise;
            let speed = s[7] * WHEEL / BALL + s[6];
            let state = nalgebra::Vector4::new(outputs[0], outputs[1], speed, outputs[2]);
            let torque = excitation(t) - gain.dot(&state);
            record.run.time.push(t);
            record.run.outputs.push(outputs);
            record.run.torque.push(torque);
            record.commanded.push(torque);
            for _ in 0..substeps {
                waiting.push_back(torque);
                let acting = waiting.pop_front().unwrap();
                let half = s + self.f(&s, acting) * (0.5 * step);
                s += self.f(&half, acting) * step;
            }
        }
        csv(&record)
    }
}

fn identified(compliance: f64, config: &str) -> Identification {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    std::fs::write(&path, Creeping { compliance }.log(4)).unwrap();
    let config = Config::parse(config).unwrap();
    let recording = log::recording(&path, &config.log, &|_| ()).unwrap();
    let choices = config.choices().unwrap();
    let robot = identify(vec![recording], &config, choices, &|_| {}).unwrap();
    robot.first().clone()
}

/// Relative errors of b1, b2, b3, and the errors over their standard deviations.
fn errors(found: &Identification) -> [(f64, f64); 3] {
    let inertias = [Parameter::B1, Parameter::B2, Parameter::B3];
    std::array::from_fn(|i| {
        let error = found.estimate.values[inertias[i]] - truth()[i];
        (
            error / truth()[i],
            error / found.standard_deviation(inertias[i]),
        )
    })
}

/// The error of the delay of 10 ms over its standard deviation.
fn delay_deviations(found: &Identification) -> f64 {
    let error = found.estimate.values[Parameter::Delay] - 0.01;
    error / found.standard_deviation(Parameter::Delay)
}

const WEIGHED: &str = "[body]\nbody_mass_kg = 10.0\n";
const FREE: &str = "[parameters]\ncreep_phi_s = \"free\"\ncreep_theta_s = \"free\"\n";

#[test]
fn a_stiff_robot_has_no_creep_and_loses_nothing_by_asking() {
    let found = identified(2e-5, FREE);
    for (relative, _) in errors(&found) {
        assert!(relative.abs() < 0.03, "{:?}", errors(&found));
    }
    let creep = found.estimate.values[Parameter::CreepBall];
    assert!(creep.abs() < 2e-3, "{creep}");
}

#[test]
fn creep_is_found_out_and_its_parameters_mend_it() {
    let found = identified(5e-4, "");
    let said: Vec<String> = found.verdicts().iter().map(ToString::to_string).collect();
    let said = said.join("\n");
    assert!(said.contains("creep_phi_s = \"free\""), "{said}");
    assert!(said.contains("weigh the body"), "{said}");
    // What made things worse is not advised.
    assert!(
        !said.contains("set drive_coulomb_m2_s2 = \"free\", and"),
        "{said}"
    );
    let before = errors(&found)[1].0.abs();

    let found = identified(5e-4, &format!("{WEIGHED}{FREE}"));
    for (relative, deviations) in errors(&found) {
        assert!(relative.abs() < 0.05, "{:?}", errors(&found));
        assert!(deviations.abs() < 2.0, "{:?}", errors(&found));
    }
    assert!(errors(&found)[1].0.abs() < before, "{before}");
    // The contacts build up their force first.
    assert!(delay_deviations(&found).abs() < 2.0);
    // (m + m_k) times the compliance is 6 ms.
    let creep = found.estimate.values[Parameter::CreepBall];
    assert!((4e-3..12e-3).contains(&creep), "{creep}");
    assert!(found.normalised_residual() < 1.2);
}

#[test]
fn intervals_hold_on_a_robot_that_creeps_much() {
    let found = identified(2e-3, &format!("{WEIGHED}{FREE}"));
    for (relative, deviations) in errors(&found) {
        assert!(relative.abs() < 0.1, "{:?}", errors(&found));
        assert!(deviations.abs() < 2.0, "{:?}", errors(&found));
    }
    assert!(delay_deviations(&found).abs() < 2.0);
}

#[test]
fn a_small_misfit_is_a_note() {
    let found = identified(1e-4, WEIGHED);
    let verdicts = found.verdicts();
    let warning = verdicts.iter().find(|one| one.weight() >= Weight::Warning);
    assert!(warning.is_none(), "{warning:?}");
    for (relative, _) in errors(&found) {
        assert!(relative.abs() < 0.05, "{:?}", errors(&found));
    }
}
