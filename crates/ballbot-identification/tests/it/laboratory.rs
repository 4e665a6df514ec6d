//! A robot in a loop, with the sensors of a real one. Its equations of motion are written down once
//! more, from the mass matrix, and integrated in steps of 0.25 ms.

use ballbot::{Ballbot, CREEP_SPEED, DriveFriction, Geometry, LinearParameters};
use ballbot_identification::log::{BallAngle, Run, Torque};
use fastrand::Rng;
use lpvmpc_design::{linearize, lqr_continuous};
use nalgebra::{DMatrix, SVector, Vector2, Vector3, Vector4};
use std::f64::consts::TAU;
use std::fmt::Write as _;

/// A robot with its drive, its sensors, and the loop that holds it upright.
#[derive(Clone, Debug)]
pub struct Laboratory {
    pub plant: Ballbot<f64>,
    /// Viscous friction on phi_dot - theta_dot, m^2/s.
    pub drive_friction: f64,
    /// Coulomb friction, m^2/s^2.
    pub coulomb: f64,
    /// 1/kg.
    pub torque_gain: f64,
    /// s.
    pub delay: f64,
    /// rad.
    pub tilt_offset: f64,
    /// rad/s.
    pub gyro_bias: f64,
    /// Standard deviations of ball angle, tilt and rate, rad and rad/s.
    pub noise: Vector3<f64>,
    /// Rows per second; the loop runs at that rate, too.
    pub rate: f64,
    /// s.
    pub duration: f64,
    /// Root of the mean square of the excitation, N m, times the root of two.
    pub amplitude: f64,
    /// Largest torque that the motors give, N m.
    pub limit: f64,
    pub ball_angle: BallAngle,
    /// When, and by how much the tilt rate jumps, s and rad/s.
    pub push: Option<(f64, f64)>,
}

/// What the robot did.
#[derive(Clone)]
pub struct Record {
    pub run: Run,
    /// What was asked for, N m; `run.torque` is what acted.
    pub commanded: Vec<f64>,
    pub largest_tilt: f64,
}

/// A rigid robot: a body of 10 kg on a ball of 2 kg.
pub fn healthy() -> Laboratory {
    Laboratory {
        plant: Ballbot {
            b1: 0.02 + 1.3 * 0.0144,
            b2: 0.02,
            b3: 0.02 + 0.2978 * 0.2978 + 0.04,
            b4: 0.01,
            drive: DriveFriction::none(),
            geometry: Geometry::paper(),
        },
        drive_friction: 0.03,
        coulomb: 0.0,
        torque_gain: 0.1,
        delay: 0.0,
        tilt_offset: 0.0,
        gyro_bias: 0.0,
        // An inertial unit with its filter, an encoder of 2048 steps behind a gear.
        noise: Vector3::new(1e-3, 1e-3, 5e-3),
        rate: 200.0,
        duration: 20.0,
        amplitude: 1.0,
        limit: 20.0,
        ball_angle: BallAngle::Inertial,
        push: None,
    }
}

pub fn normal(rng: &mut Rng) -> f64 {
    let (u, v) = (1.0 - rng.f64(), rng.f64());
    (-2.0 * u.ln()).sqrt() * (TAU * v).cos()
}

impl Laboratory {
    fn f(&self, x: &Vector4<f64>, torque: f64) -> Vector4<f64> {
        let slip = x[2] - x[3];
        let gear = self.plant.geometry.ball_radius / self.plant.geometry.wheel_radius;
        let drive = gear * self.torque_gain * torque
            - self.drive_friction * slip
            - self.coulomb * slip / slip.hypot(CREEP_SPEED);
        // B~ tau - C - D - G of eq. (1).
        let Geometry {
            centre_of_mass: l,
            ball_radius: r_b,
            gravity: g,
            ..
        } = self.plant.geometry;
        let force = Vector2::new(
            drive + l * r_b * x[1].sin() * x[3] * x[3] - self.plant.b4 * x[2],
            l * g * x[1].sin() - drive,
        );
        let acceleration = self.plant.mass(x[1]).try_inverse().unwrap() * force;
        Vector4::new(x[2], x[3], acceleration[0], acceleration[1])
    }

    fn advance(&self, x: &Vector4<f64>, torque: f64, h: f64) -> Vector4<f64> {
        let k1 = self.f(x, torque);
        let k2 = self.f(&(x + k1 * (h / 2.0)), torque);
        let k3 = self.f(&(x + k2 * (h / 2.0)), torque);
        let k4 = self.f(&(x + k3 * h), torque);
        x + (k1 + (k2 + k3) * 2.0 + k4) * (h / 6.0)
    }

    /// The paper's parameters, which belong to no rigid body, in a loop.
    pub fn of_the_paper() -> Self {
        Self {
            plant: Ballbot::paper(),
            drive_friction: 0.0,
            torque_gain: 1.0,
            amplitude: 0.1,
            ..healthy()
        }
    }

    fn linear(&self) -> (DMatrix<f64>, DMatrix<f64>) {
        let f = |x: &Vector4<f64>, u: &SVector<f64, 1>| self.f(x, u[0]);
        let upright = linearize(f, &Vector4::zeros(), &SVector::zeros()).unwrap();
        let a = DMatrix::from_column_slice(4, 4, upright.a.as_slice());
        (a, DMatrix::from_column_slice(4, 1, upright.b.as_slice()))
    }

    /// The pole with the largest real part, 1/s.
    pub fn unstable_pole(&self) -> f64 {
        lpvmpc_design::poles(&self.linear().0)
            .unwrap()
            .last()
            .unwrap()
            .re
    }

    pub fn linear_parameters(&self) -> LinearParameters<f64> {
        let (a, b) = self.linear();
        LinearParameters::of_matrices(
            &a.fixed_view::<4, 4>(0, 0).into(),
            &b.fixed_view::<4, 1>(0, 0).into(),
        )
    }

    /// u = -K x that holds the robot.
    pub fn gain(&self) -> Vector4<f64> {
        let (a, b) = self.linear();
        let q = DMatrix::from_diagonal(&nalgebra::dvector![2.0, 100.0, 1.0, 10.0]);
        let r = DMatrix::from_element(1, 1, (10.0 * self.torque_gain).powi(2));
        let k = lqr_continuous(&a, &b, &q, &r).unwrap().k;
        Vector4::new(k[0], k[1], k[2], k[3])
    }

    /// Twelve harmonics from 0.2 Hz to 6 Hz.
    fn excitation(&self, rng: &mut Rng) -> impl Fn(f64) -> f64 + use<> {
        let phases: Vec<f64> = (0..12).map(|_| TAU * rng.f64()).collect();
        let amplitude = self.amplitude / 6.0_f64.sqrt() / 2.0_f64.sqrt();
        move |t| {
            let harmonics = phases.iter().enumerate();
            let sum: f64 = harmonics
                .map(|(i, phase)| {
                    let frequency = 0.2 * 30.0_f64.powf(i as f64 / 11.0);
                    (TAU * frequency * t + phase).sin()
                })
                .sum();
            amplitude * sum
        }
    }

    pub fn record(&self, seed: u64) -> Record {
        let mut rng = Rng::with_seed(seed);
        let excitation = self.excitation(&mut rng);
        let rows = (self.duration * self.rate) as usize;
        let torque: Vec<f64> = (0..rows)
            .map(|row| excitation(row as f64 / self.rate))
            .collect();
        self.play(&torque, &self.gain(), &mut rng)
    }

    /// The robot under this torque, one value per row, added to that of the loop.
    pub fn play(&self, excitation: &[f64], gain: &Vector4<f64>, rng: &mut Rng) -> Record {
        let (interval, fine) = (1.0 / self.rate, 2.5e-4);
        let steps = (interval / fine).round() as usize;
        let rows = excitation.len();
        let late = (self.delay / fine).round() as usize;
        let mut waiting = std::collections::VecDeque::from(vec![0.0; late]);
        let mut x = Vector4::zeros();
        let mut record = Record {
            run: Run {
                name: "simulated".to_owned(),
                time: Vec::new(),
                outputs: Vec::new(),
                torque: Vec::new(),
                stretches: std::iter::once(0..rows).collect(),
                torque_kind: Torque::Applied,
            },
            commanded: Vec::new(),
            largest_tilt: 0.0,
        };
        for (row, excitation) in excitation.iter().enumerate() {
            let time = row as f64 * interval;
            if let Some((when, rate)) = self.push
                && (time - when).abs() < 0.5 * interval
            {
                x[3] += rate;
            }
            let noise = self.noise.map(|sigma| sigma * normal(rng));
            let phi = match self.ball_angle {
                BallAngle::Inertial => x[0],
                BallAngle::RelativeToBody => x[0] - x[1],
            };
            let clean = Vector3::new(phi, x[1] + self.tilt_offset, x[3] + self.gyro_bias);
            let outputs = clean + noise;
            // The loop has the measured values, and the ball's speed from an observer.
            let speed = x[2];
            let ball = if self.ball_angle == BallAngle::Inertial {
                outputs[0]
            } else {
                outputs[0] + outputs[1]
            };
            let measured = Vector4::new(ball, outputs[1], speed, outputs[2]);
            let commanded = excitation - gain.dot(&measured);
            let torque = commanded.clamp(-self.limit, self.limit);
            record.run.time.push(time);
            record.run.outputs.push(outputs);
            record.run.torque.push(torque);
            record.commanded.push(commanded);
            for _ in 0..steps {
                waiting.push_back(torque);
                let acting = waiting.pop_front().unwrap();
                x = self.advance(&x, acting, fine);
                record.largest_tilt = record.largest_tilt.max(x[1].abs());
            }
        }
        record
    }
}

/// The log as `ballbot simulate --log` writes it.
pub fn csv(record: &Record) -> String {
    let mut text =
        "t_s,phi_rad,theta_rad,theta_dot_rad_s,torque_commanded_nm,torque_applied_nm\n".to_owned();
    for (row, time) in record.run.time.iter().enumerate() {
        let outputs = record.run.outputs[row];
        writeln!(
            text,
            "{time},{},{},{},{},{}",
            outputs[0], outputs[1], outputs[2], record.commanded[row], record.run.torque[row]
        )
        .unwrap();
    }
    text
}
