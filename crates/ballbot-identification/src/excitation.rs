//! A torque that identifies the parameters of a stabilised robot, and how well it will identify them.

mod check;
mod error;

pub use error::ExcitationError;

use crate::config::{Config, ConfigError};
use crate::covariance::{inverse, of_parameters};
use crate::estimate::{Task, problem};
use crate::log::{BallAngle, Run, Torque};
use crate::model::{Robot, steps};
use crate::parameter::{Choice, Parameter, Values};
use crate::parameter_file::Identified;
use crate::poles::linear_model;
use crate::segments::segments;
use crate::suspects::Tables;
use ballbot::Geometry;
use lpvmpc_design::lqr_continuous;
use nalgebra::{DMatrix, DVector, Vector3, Vector4};
use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;

/// What is asked of an excitation.
#[derive(Clone, Debug)]
pub struct ExcitationTask {
    /// What the robot is taken for.
    pub robot: Values,
    /// Lengths and gravity.
    pub geometry: Geometry<f64>,
    /// What is to be found from the log.
    pub choices: Values<Choice>,
    /// Lowest and highest frequency, Hz.
    pub band: (f64, f64),
    /// Number of harmonics, at most; at least 2.
    pub harmonics: usize,
    /// Largest torque of the excitation wanted, N m.
    pub amplitude: f64,
    /// Length, s.
    pub duration: f64,
    /// Largest tilt allowed, rad.
    pub tilt_limit: f64,
    /// Rows per second of the log, and of the loop.
    pub rate: f64,
    /// Noise of ball angle, tilt and tilt rate.
    pub noise: Vector3<f64>,
    /// Gains of the loop that holds the robot, u = -K x + excitation; an LQR of the robot if `None`.
    pub gain: Option<Vector4<f64>>,
    /// Length of a segment of the fit, s.
    pub segment: f64,
    /// Whether there is a gyroscope. Without one its bias is held.
    pub gyroscope: bool,
}

/// An excitation, and what it is expected to do.
#[derive(Clone, Debug)]
pub struct Excitation {
    /// Times, s.
    pub time: Vec<f64>,
    /// Torque to be added to that of the loop, N m, held from each time to the next.
    pub torque: Vec<f64>,
    /// Frequencies, Hz.
    pub frequencies: Vec<f64>,
    /// Largest torque of the excitation, N m. Less than was wanted if the tilt limited it.
    pub amplitude: f64,
    /// Largest tilt expected, rad.
    pub tilt: f64,
    /// Largest torque of loop and excitation expected, N m.
    pub total_torque: f64,
    /// How far the ball is expected to roll to either side, m.
    pub travel: f64,
    /// Expected standard deviation of each parameter (the Cramer-Rao bound); zero if it is held.
    pub standard_deviations: Values,
    /// The gains that held the robot.
    pub gain: Vector4<f64>,
}

impl Excitation {
    /// The text of a CSV file with the torque over time, as scenarios read it.
    pub fn csv(&self) -> String {
        let mut text = "t_s,torque_excitation_nm\n".to_owned();
        for (time, torque) in self.time.iter().zip(&self.torque) {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{time},{torque}");
        }
        text
    }
}

/// The tilt is brought to within this part of its limit.
const MARGIN: f64 = 0.95;

/// A robot that leans so far has fallen, rad.
const FALLEN: f64 = 1.5;

/// If less than this part of the torque is left, of a usual one if more was asked for, something is wrong.
const LEAST_LEFT: f64 = 0.02;

/// Fading in and out, s: no jump of the torque.
const FADE: f64 = 1.0;

/// The noise of an ordinary inertial unit and encoder, where the configuration does not know it:
/// ball angle and tilt, rad, and rate, rad/s.
const ORDINARY_NOISE: [f64; 3] = [1e-3, 1e-3, 5e-3];

impl ExcitationTask {
    /// A usual band, Hz.
    pub const BAND: (f64, f64) = (0.2, 6.0);
    /// A usual number of harmonics.
    pub const HARMONICS: usize = 15;
    /// A usual torque, N m.
    pub const AMPLITUDE: f64 = 1.0;
    /// A usual length, s.
    pub const DURATION: f64 = 20.0;
    /// A usual limit of the tilt, degrees.
    pub const TILT_LIMIT_DEG: f64 = 10.0;
    /// A usual rate of loop and log, Hz.
    pub const RATE: f64 = 200.0;

    /// A usual task for the robot that a configuration expects, or that was `identified` before, and for
    /// a log with the configuration's sensors.
    ///
    /// # Errors
    /// As [`Config::choices`]; or the configuration gives other lengths than the robot was identified with.
    pub fn of(config: &Config, identified: Option<&Identified>) -> Result<Self, ConfigError> {
        let config = match identified {
            Some(identified) => &identified.configured(config)?,
            None => config,
        };
        let choices = config.choices()?;
        let geometry = config.geometry();
        let mut robot = Values::expected(&choices, &geometry);
        for (parameter, value) in identified.iter().flat_map(|robot| &robot.parameters) {
            robot[*parameter] = *value;
        }
        let noise = config.noise();
        Ok(Self {
            robot,
            geometry,
            choices,
            band: Self::BAND,
            harmonics: Self::HARMONICS,
            amplitude: Self::AMPLITUDE,
            duration: Self::DURATION,
            tilt_limit: Self::TILT_LIMIT_DEG.to_radians(),
            rate: Self::RATE,
            noise: Vector3::from_fn(|i, _| noise[i].unwrap_or(ORDINARY_NOISE[i])),
            gain: None,
            segment: config.fit.segment_s,
            gyroscope: !config.log.theta_dot.column.is_empty(),
        })
    }

    /// The parameters that the log is to tell.
    pub fn told(&self) -> impl Iterator<Item = Parameter> {
        let choices = self.choices();
        let all = Parameter::ALL.into_iter();
        all.filter(move |parameter| choices[*parameter].is_free())
    }

    /// Designs the torque, shrinks it until the tilt stays within its limit, and computes the
    /// Fisher information of the log that it will give.
    ///
    /// # Errors
    /// [`ExcitationError`].
    pub fn design(&self) -> Result<Excitation, ExcitationError> {
        self.check()?;
        let gain = self.gain.map_or_else(|| self.regulator(), Ok)?;
        self.check_loop(&gain)?;
        let frequencies = self.frequencies();
        let shape = self.shape(&frequencies);
        let mut amplitude = self.amplitude;
        for _ in 0..30 {
            let torque: Vec<f64> = shape.iter().map(|value| amplitude * value).collect();
            let motion = self.simulate(&gain, &torque);
            if amplitude < LEAST_LEFT * self.amplitude.min(Self::AMPLITUDE) {
                return Err(ExcitationError::Useless {
                    left: amplitude,
                    wanted: self.amplitude,
                    limit: self.tilt_limit,
                });
            }
            if motion.tilt <= self.tilt_limit {
                let standard_deviations = self.standard_deviations(&motion);
                self.check_precision(&standard_deviations)?;
                let most = |values: &mut dyn Iterator<Item = f64>| {
                    values.fold(0.0_f64, |most, value| most.max(value.abs()))
                };
                return Ok(Excitation {
                    total_torque: most(&mut motion.run.torque.iter().copied()),
                    travel: self.geometry.ball_radius
                        * most(&mut motion.states.iter().map(|state| state[0])),
                    time: motion.run.time,
                    torque,
                    frequencies,
                    amplitude,
                    tilt: motion.tilt,
                    standard_deviations,
                    gain,
                });
            }
            // In proportion, but never to nothing for one that fell.
            amplitude *= (MARGIN * self.tilt_limit / motion.tilt).max(0.3);
        }
        Err(ExcitationError::Unstable {
            limit: self.tilt_limit,
        })
    }

    /// What is done with each parameter: what no sensor tells is held.
    pub fn choices(&self) -> Values<Choice> {
        self.choices.with_sensors(self.gyroscope)
    }

    /// Rows of the whole length.
    fn rows(&self) -> usize {
        (self.duration * self.rate).round() as usize
    }

    /// An LQR of this robot that reacts in about a second.
    fn regulator(&self) -> Result<Vector4<f64>, ExcitationError> {
        let linear = linear_model(&self.robot, self.geometry);
        let (a, b) = linear.ok_or(ExcitationError::NoLinearModel)?;
        let a = DMatrix::from_column_slice(4, 4, a.as_slice());
        let b = DMatrix::from_column_slice(4, 1, b.as_slice());
        let q = DMatrix::from_diagonal(&DVector::from_vec(vec![2.0, 100.0, 1.0, 10.0]));
        // A torque costs per body mass: heavy and light robots are held alike.
        let r = (10.0 * self.robot[Parameter::TorqueGain]).powi(2);
        let lqr = lqr_continuous(&a, &b, &q, &DMatrix::from_element(1, 1, r))?;
        Ok(Vector4::new(lqr.k[0], lqr.k[1], lqr.k[2], lqr.k[3]))
    }

    /// Harmonics of the whole length, evenly spread over the band on a logarithmic scale.
    fn frequencies(&self) -> Vec<f64> {
        let (low, high) = self.band;
        let last = (self.harmonics - 1) as f64;
        let places = (0..self.harmonics).map(|i| i as f64 / last);
        let frequencies = places.map(|place| low * (high / low).powf(place));
        let numbers = frequencies.map(|frequency| (frequency * self.duration).round().max(1.0));
        let mut numbers: Vec<f64> = numbers.collect();
        numbers.dedup();
        numbers
            .iter()
            .map(|number| number / self.duration)
            .collect()
    }

    /// The sum of the harmonics with phases that keep its peaks low (Schroeder 1970), faded in and
    /// out; its largest value is 1.
    fn shape(&self, frequencies: &[f64]) -> Vec<f64> {
        let rows = self.rows();
        let count = frequencies.len() as f64;
        let values = (0..rows).map(|row| {
            let time = row as f64 / self.rate;
            let harmonics = frequencies.iter().enumerate().map(|(k, frequency)| {
                let k = k as f64;
                (TAU * frequency * time - PI * k * (k + 1.0) / count).cos()
            });
            let edge = (time.min(self.duration - time) / FADE).clamp(0.0, 1.0);
            harmonics.sum::<f64>() * 0.5 * (1.0 - (PI * edge).cos())
        });
        let values: Vec<f64> = values.collect();
        let most = values
            .iter()
            .fold(0.0_f64, |most, value| most.max(value.abs()));
        values.iter().map(|value| value / most).collect()
    }

    /// The robot in its loop, without noise.
    fn simulate(&self, gain: &Vector4<f64>, excitation: &[f64]) -> Motion {
        let robot = Robot::new(self.robot, self.geometry);
        let interval = 1.0 / self.rate;
        let steps = steps(interval);
        let late = (self.robot[Parameter::Delay] * self.rate).round() as usize;
        let mut x = Vector4::zeros();
        let mut motion = Motion {
            run: Run {
                name: "excitation".to_owned(),
                time: Vec::new(),
                outputs: Vec::new(),
                torque: Vec::new(),
                stretches: Vec::new(),
                torque_kind: Torque::Applied,
            },
            states: Vec::new(),
            tilt: 0.0,
        };
        for (row, excitation) in excitation.iter().enumerate() {
            motion.run.time.push(row as f64 * interval);
            motion
                .run
                .outputs
                .push(robot.outputs(&x, BallAngle::Inertial));
            motion.run.torque.push(excitation - gain.dot(&x));
            motion.states.push(x);
            motion.tilt = motion.tilt.max(x[1].abs());
            if !x[1].is_finite() || motion.tilt > FALLEN {
                motion.tilt = FALLEN;
                break;
            }
            let acting = row
                .checked_sub(late)
                .map_or(0.0, |row| motion.run.torque[row]);
            for _ in 0..steps as usize {
                x = robot.step(&x, acting, interval / steps);
            }
        }
        let rows = 0..motion.run.time.len();
        motion.run.stretches.push(rows);
        motion
    }

    /// The Cramer-Rao bound of the fit that [`Task::estimate`] will make.
    fn standard_deviations(&self, motion: &Motion) -> Values {
        let mut run = motion.run.clone();
        if !self.gyroscope {
            run.outputs.iter_mut().for_each(|row| row[2] = f64::NAN);
        }
        let runs = std::slice::from_ref(&run);
        let choices = self.choices();
        let task = Task {
            runs,
            ball_angle: BallAngle::Inertial,
            geometry: self.geometry,
            choices,
            physical: false,
            segment: self.segment,
            torque_known: true,
            noise: [0, 1, 2].map(|output| Some(self.noise[output])),
            tables: Tables::default(),
        };
        let stretch = [(0, 0..motion.run.time.len())];
        let segments = segments(runs, &stretch, self.segment, task.lead());
        let model = task.model(segments, self.noise);
        let unknowns = task.unknowns(&self.robot, &model.coordinates);
        let priors = task.priors(&model.coordinates);
        let problem = problem(&model, &unknowns, &priors);
        let starts = model.segments.iter();
        let initial: Vec<Vector4<f64>> = starts.map(|s| motion.states[s.first]).collect();
        let indices: Vec<usize> = Parameter::ALL
            .into_iter()
            .filter(|parameter| choices[*parameter].is_free())
            .map(Parameter::index)
            .collect();
        let coordinates = model.coordinates.of(&self.robot);
        let reduced = problem.reduced(&coordinates, &initial, &indices);
        let covariance = inverse(&reduced.information);
        let covariance = of_parameters(&covariance, &indices, &model.coordinates.jacobian());
        Values(Parameter::ALL.map(|parameter| {
            let index = parameter.index();
            covariance[(index, index)].sqrt()
        }))
    }
}

struct Motion {
    run: Run,
    states: Vec<Vector4<f64>>,
    tilt: f64,
}

impl Values {
    /// What a robot is taken for before there is a log: what the builder says of each parameter,
    /// otherwise that of a middling robot of these lengths.
    pub fn expected(choices: &Values<Choice>, geometry: &Geometry<f64>) -> Self {
        let mut values = crate::start::typical(geometry, 0.0);
        for parameter in Parameter::ALL {
            match choices[parameter] {
                Choice::Fixed(value)
                | Choice::Free { start: Some(value) }
                | Choice::Prior { mean: value, .. } => values[parameter] = value,
                Choice::Free { start: None } => {}
            }
        }
        values
    }
}
