//! Signs, units and columns that are wrong: a robot would explain the log if they were others.
//!
//! Gravity and the geometry tie ball angle, tilt and torque together: of the four factors p1, p3, p4
//! and p6 of the linear model the signs are those of every robot, and a torque, a ball angle or a
//! tilt with the other sign reverses two of them. So a log that no robot explains is fitted again as
//! it would be if one column were another, and what then explains it is named.

use crate::coordinates::Coordinates;
use crate::estimate::{Effort, EstimateError, Task, problem};
use crate::log::{BallAngle, Run};
use crate::miswiring::Miswiring;
use crate::parameter::Parameter;
use crate::segments::{Stretch, segments, spread};
use crate::words::number;
use lpvmpc_design::{ShootingFit, ShootingSettings};
use nalgebra::Vector3;
use std::f64::consts::{PI, TAU};
use std::fmt;

/// A mistake about the columns of a log that would explain it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Suspect {
    /// The torque has the other sign.
    TorqueSign,
    /// The ball angle has the other sign.
    BallSign,
    /// Tilt and rate have the other sign.
    TiltSign,
    /// The torque is too large by this factor.
    TorqueScale(f64),
    /// The ball angle is too large by this factor.
    BallScale(f64),
    /// The ball angle is that of a wheel, larger by this factor, r_b / r_w.
    WheelAngle(f64),
    /// Tilt and rate are too large by this factor.
    TiltScale(f64),
    /// The time, and with it nothing else, is too large by this factor.
    TimeScale(f64),
    /// The ball angle is relative to something else than was said.
    BallAngle(BallAngle),
    /// Ball angle and torque stand in each other's place.
    BallAndTorque,
    /// Ball angle and tilt stand in each other's place.
    BallAndTilt,
    /// Something between two planes.
    Planes(Miswiring),
}

/// Mistakes, each of which would explain a log; at least one.
#[derive(Clone, Debug, PartialEq)]
pub struct Suspects {
    /// The mistakes.
    pub mistakes: Vec<Suspect>,
    /// Where the configuration says what they are about.
    pub tables: Tables,
}

impl fmt::Display for Suspects {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words = self.mistakes.iter().map(|one| one.words(self.tables));
        let words: Vec<String> = words.collect();
        f.write_str(&words.join("; or if "))
    }
}

/// Where a configuration says what the columns of a plane are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tables {
    /// In `[log.y]`.
    pub second: bool,
    /// The ball angle is in `[log.wheels]`.
    pub wheels: bool,
    /// The torque is in `[log.wheels]`.
    pub motors: bool,
}

impl Tables {
    /// The table of a quantity of the plane.
    fn of(self, quantity: &str) -> String {
        match self.second {
            true => format!("[log.y.{quantity}]"),
            false => format!("[log.{quantity}]"),
        }
    }

    /// What gives the ball angle the other sign.
    fn ball_sign(self) -> String {
        match self.wheels {
            true => {
                "set the other sign for the factors of all encoders in [log.wheels], or, of one \
                     plane of two, see `ballbot wheels check`"
                    .to_owned()
            }
            false => format!("set factor = -1.0 in {}", self.of("phi")),
        }
    }

    /// What gives the torque the other sign.
    fn torque_sign(self) -> String {
        match self.motors {
            true => "set the other sign for the factors of all torques in [log.wheels]".to_owned(),
            false => format!("set factor = -1.0 in {}", self.of("torque")),
        }
    }
}

/// What the start of a suspect's fit may cost, and the fit. From a right start a robot is found in a
/// few steps.
const START: Effort = Effort {
    segments: 10,
    max_iterations: 12,
};
const SEGMENTS: usize = 10;
const SETTINGS: ShootingSettings = ShootingSettings {
    reduction_tolerance: 1e-2,
    max_iterations: 12,
};

/// Chance moves chi^2 per degree of freedom by less than 0.03 with that many segments.
const CHANCE: f64 = 0.1;

/// The log is explained if chi^2 per degree of freedom is below this.
const EXPLAINED: f64 = 1.0 + CHANCE;

/// Otherwise chi^2 must fall to this part of what it is as the columns are, and below what is left
/// of a robot that creeps.
const MUCH_BETTER: f64 = 0.1;
const CREEPING: f64 = 10.0;

/// A start whose segments, four times shorter than those of the fit, leave more than this leads to no
/// fit that would be named.
const HOPELESS: f64 = 10.0 * CREEPING;

impl Suspect {
    /// What is worth a try: `gear` is r_b / r_w, `rate` says that the tilt rate is measured, `torque`
    /// that the torque is in N m.
    fn all(ball_angle: BallAngle, gear: f64, rate: bool, torque: bool) -> Vec<Self> {
        const DEGREE: f64 = 180.0 / PI;
        let mut all = vec![
            Self::TorqueSign,
            Self::BallSign,
            Self::TiltSign,
            Self::BallAngle(ball_angle.other()),
            Self::BallAndTorque,
            Self::WheelAngle(gear),
        ];
        let units = [DEGREE, 1.0 / DEGREE, TAU, 1.0 / TAU, 1e3, 1e-3];
        all.extend(units.map(Self::BallScale));
        all.extend([DEGREE, 1.0 / DEGREE, 1e3, 1e-3].map(Self::TiltScale));
        if torque {
            all.extend([1e3, 1e-3].map(Self::TorqueScale));
        }
        if !rate {
            // With a rate, the tilt has been held against its integral.
            all.extend([1e3, 1e-3].map(Self::TimeScale));
            all.push(Self::BallAndTilt);
        }
        all
    }

    /// The run as it is if this is the mistake.
    fn corrected(self, run: &Run) -> Run {
        let mut run = run.clone();
        let outputs = run.outputs.iter_mut();
        match self {
            Self::TorqueSign => run.torque.iter_mut().for_each(|torque| *torque *= -1.0),
            Self::TorqueScale(by) => run.torque.iter_mut().for_each(|torque| *torque /= by),
            Self::TimeScale(by) => run.time.iter_mut().for_each(|time| *time /= by),
            Self::BallSign => outputs.for_each(|row| row[0] *= -1.0),
            Self::BallScale(by) | Self::WheelAngle(by) => {
                outputs.for_each(|row| row[0] /= by);
            }
            Self::TiltSign => outputs.for_each(|row| {
                row[1] *= -1.0;
                row[2] *= -1.0;
            }),
            Self::TiltScale(by) => outputs.for_each(|row| {
                row[1] /= by;
                row[2] /= by;
            }),
            Self::BallAngle(_) | Self::Planes(_) => {}
            Self::BallAndTorque => {
                let pairs = outputs.zip(&mut run.torque);
                pairs.for_each(|(row, torque)| std::mem::swap(&mut row[0], torque));
            }
            Self::BallAndTilt => outputs.for_each(|row| row.as_mut_slice().swap(0, 1)),
        }
        run
    }
}

/// What explains a log best of what was tried, each with its chi^2 per degree of freedom, if that is
/// much better than `own`, that of the log as it is.
pub(crate) fn explaining<T>(own: f64, tried: Vec<(T, f64)>) -> Vec<T> {
    let least = tried.iter().map(|(_, one)| *one).fold(own, f64::min);
    let explained = least < EXPLAINED && own > least + CHANCE;
    if !(explained || least < CREEPING.min(MUCH_BETTER * own)) {
        return Vec::new();
    }
    let alike = |one: f64| one <= least + CHANCE * least;
    let best = tried.into_iter().filter(|(_, one)| alike(*one));
    best.map(|(mistake, _)| mistake).collect()
}

impl Task<'_> {
    /// The mistakes under which a robot explains these stretches best, if that is much better than
    /// what a robot explains of the log as it is. More than one where the motion is the same: small
    /// angles of the ball and large ones of the body, say.
    pub fn suspects(&self, stretches: &[Stretch]) -> Option<Suspects> {
        let own = self.chi_square_of(self.runs, self.ball_angle, stretches);
        let (gear, rate) = (
            self.geometry.ball_radius / self.geometry.wheel_radius,
            self.measures_rate(),
        );
        let chi_squares: Vec<(Suspect, f64)> =
            Suspect::all(self.ball_angle, gear, rate, self.torque_known)
                .into_iter()
                .map(|suspect| (suspect, self.chi_square_if(suspect, stretches)))
                .collect();
        let mistakes = explaining(own, chi_squares);
        (!mistakes.is_empty()).then_some(Suspects {
            mistakes,
            tables: self.tables,
        })
    }

    /// Whether any run has a tilt rate.
    pub fn measures_rate(&self) -> bool {
        let mut rows = self.runs.iter().flat_map(|run| &run.outputs);
        rows.any(|row| !row[2].is_nan())
    }

    fn chi_square_if(&self, suspect: Suspect, stretches: &[Stretch]) -> f64 {
        let runs: Vec<Run> = self.runs.iter().map(|run| suspect.corrected(run)).collect();
        let ball_angle = match suspect {
            Suspect::BallAngle(other) => other,
            _ => self.ball_angle,
        };
        self.chi_square_of(&runs, ball_angle, stretches)
    }

    /// chi^2 per degree of freedom of a fit to other runs; infinite if there is none, or one that ends
    /// where no robot is.
    pub(crate) fn chi_square_of(
        &self,
        runs: &[Run],
        ball_angle: BallAngle,
        stretches: &[Stretch],
    ) -> f64 {
        let task = Task {
            runs,
            ball_angle,
            noise: [None; 3],
            ..self.clone()
        };
        let floor = crate::noise::floor(runs);
        match task.quick(stretches, floor) {
            Ok(Some(fit)) if !self.ends_at_limit(&fit.parameters) => {
                fit.chi_square / fit.degrees_of_freedom()
            }
            _ => f64::INFINITY,
        }
    }

    /// A fit to a few segments; none from a start that is hopeless.
    fn quick(
        &self,
        stretches: &[Stretch],
        floor: Vector3<f64>,
    ) -> Result<Option<ShootingFit<4>>, EstimateError> {
        let start = self.coarse(stretches, floor, START, &|_| {})?;
        if start.chi_square > HOPELESS {
            return Ok(None);
        }
        let start = start.values;
        let segments = segments(self.runs, stretches, self.segment, self.lead());
        let model = self.model(spread(&segments, SEGMENTS), floor);
        let unknowns = self.unknowns(&start, &model.coordinates);
        let priors = self.priors(&model.coordinates);
        let problem = problem(&model, &unknowns, &priors);
        let fit = problem.fit(model.initial_states(&start), &SETTINGS, &|_| {})?;
        Ok(Some(fit))
    }

    /// Whether a parameter that was fitted is where no robot is.
    fn ends_at_limit(&self, found: &[f64]) -> bool {
        let coordinates = Coordinates::new(&self.choices, self.geometry, self.torque_known);
        Parameter::ALL.into_iter().any(|parameter| {
            let coordinate = found[parameter.index()];
            self.choices[parameter].is_free() && coordinates.is_at_limit(parameter, coordinate)
        })
    }
}

impl Suspect {
    /// The mistake and what to do about it, in words, of a log that `tables` describe.
    pub(crate) fn words(&self, tables: Tables) -> String {
        let unit = |by: f64| -> &'static str {
            match by {
                _ if (by - 180.0 / PI).abs() < 1.0 => "it is in degrees and taken for radians",
                _ if (by * 180.0 / PI - 1.0).abs() < 0.1 => {
                    "it is in radians and taken for degrees"
                }
                _ if (by * TAU - 1.0).abs() < 0.1 => "it is in turns and taken for radians",
                _ if (by - TAU).abs() < 0.1 => "it is in radians and taken for turns",
                _ if by > 1.0 => "it is in thousandths of the unit that is said",
                _ => "it is in units a thousand times those that are said",
            }
        };
        match self {
            Self::TorqueSign => format!(
                "the torque has the other sign: {}. A positive torque turns the ball to positive phi and the body to negative theta",
                tables.torque_sign()
            ),
            Self::BallSign => format!(
                "the ball angle has the other sign: {}. The ball rolls by \
                 r_b phi to the side to which the body falls at a positive theta",
                tables.ball_sign()
            ),
            Self::TiltSign => format!(
                "tilt and tilt rate have the other sign: set factor = -1.0 in {} and {}. A body that leans to the side of positive phi has a positive theta",
                tables.of("theta"),
                tables.of("theta_dot")
            ),
            Self::TorqueScale(by) => format!("the torque has another unit: {}", unit(*by)),
            Self::BallScale(by) => format!("the ball angle has another unit: {}", unit(*by)),
            Self::WheelAngle(by) => format!(
                "the ball angle is the angle of a wheel: set factor = {} (r_w / r_b, over the gear's \
                 ratio for an encoder on the motor's shaft) for it",
                number(1.0 / by)
            ),
            Self::TiltScale(by) => format!("tilt and rate have another unit: {}", unit(*by)),
            Self::TimeScale(by) => format!("the time has another unit: {}", unit(*by)),
            Self::BallAngle(BallAngle::Inertial) => {
                "the ball angle is relative to the floor: set ball_angle = \"inertial\" in [log]"
                    .to_owned()
            }
            Self::BallAngle(BallAngle::RelativeToBody) => {
                "the ball angle is relative to the body: set ball_angle = \"relative_to_body\" in \
                 [log]"
                    .to_owned()
            }
            Self::BallAndTorque => {
                "the columns of ball angle and torque are interchanged".to_owned()
            }
            Self::Planes(miswiring) => miswiring.to_string(),
            Self::BallAndTilt => "the columns of ball angle and tilt are interchanged".to_owned(),
        }
    }
}
