//! From logs to a judged robot: the whole way.

use crate::ball_angle::OtherReading;
use crate::config::Config;
use crate::coordinates::Coordinates;
use crate::estimate::{Estimate, EstimateError, Progress, Status, Task};
use crate::log::{Finding, Log, Run};
use crate::model::Robot;
use crate::noise;
use crate::parameter::{Choice, Parameter, Values};
use crate::poles::{Pole, linear_model, uncertain_poles};
use crate::published::{LinearRegression, regression};
use crate::residuals::{OutputResidual, ScoreTest, SegmentResidual, score_tests, simulated, tests};
use crate::segments::Split;
use crate::structures::{Compared, compare};
use crate::suspects::Suspects;
use crate::validation::{Validation, validate};
use crate::verdict::Weight;
use ballbot::{Ballbot, Consistency, Geometry, LinearParameters, limits};
use lpvmpc_design::{NORMAL_95, poles};
use nalgebra::{DMatrix, Vector3};
use std::ops::Range;

/// A robot found from logs, and what speaks for and against it.
#[derive(Clone, Debug)]
pub struct Identification {
    /// Lengths and gravity, as they were given.
    pub geometry: Geometry<f64>,
    /// Whether mechanics was imposed.
    pub physical: bool,
    /// Length of a segment that was asked for, s.
    pub segment: f64,
    /// The fit's coordinates, which have its limits.
    pub coordinates: Coordinates,
    /// What is wrong with the columns, if no robot explains them as they are.
    pub suspects: Option<Suspects>,
    /// The best robot with the other reading of the ball angle, if the body's mass is not known.
    pub other_reading: Option<OtherReading>,
    /// Whether the torque is in N m.
    pub torque_known: bool,
    /// The builder insists on the columns as they are.
    pub columns_accepted: bool,
    /// What was done with each parameter.
    pub choices: Values<Choice>,
    /// What is odd about each log.
    pub findings: Vec<(String, Vec<Finding>)>,
    /// The fit.
    pub estimate: Estimate,
    /// Noise of the sensors, from the logs alone.
    pub floor: Vector3<f64>,
    /// Measured and simulated outputs of the fitted segments.
    pub simulated: Vec<SegmentResidual>,
    /// The residuals of each measured output.
    pub residuals: Vec<OutputResidual>,
    /// What the residuals say about the parameters that were held.
    pub scores: Vec<ScoreTest>,
    /// The covariance that the intervals are from.
    covariance: DMatrix<f64>,
    /// Poles at the upright position.
    pub poles: Vec<Pole>,
    /// On held-back data, if any were held back; or why it could not be judged there.
    pub validation: Option<Result<Validation, EstimateError>>,
    /// Structures of friction compared on held-back data, those that could be fitted; empty if none
    /// were held back.
    pub structures: Vec<Compared>,
    /// The published way to p, to compare with.
    pub published: Option<LinearRegression>,
    /// Time that was fitted and time that was held back, s.
    pub times: (f64, f64),
}

/// Identifies one robot from all of the logs.
///
/// # Errors
/// There is too little to fit, or the robot cannot be simulated.
pub fn identify(
    logs: Vec<Log>,
    config: &Config,
    choices: Values<Choice>,
    progress: Progress<'_>,
) -> Result<Identification, EstimateError> {
    let (runs, findings): (Vec<Run>, Vec<_>) = logs
        .into_iter()
        .map(|log| {
            let name = log.run.name.clone();
            (log.run, (name, log.findings))
        })
        .unzip();
    let mut task = Task {
        runs: &runs,
        ball_angle: config.log.ball_angle_read(),
        geometry: config.geometry(),
        choices,
        physical: config.fit.physical,
        segment: config.fit.segment_s,
        torque_known: config.log.torque_known(),
        noise: config.noise(),
    };
    task.choices = choices.with_sensors(task.measures_rate());
    let split = Split::new(&runs, config.fit.held_back);
    let floor = noise::floor(&runs);
    let estimate = task.estimate(&split.fitted, floor, progress);
    let estimate = estimate.map_err(|error| task.explained(error, &split))?;
    let task = Task {
        segment: estimate.segment,
        ..task
    };
    let simulated = simulated(&task, &estimate);
    // Wheels stand on the body: what their angle is relative to is known.
    let other_reading = match config.log.wheels {
        Some(_) => None,
        None => task.other_reading(&estimate, &split.fitted),
    };
    let (validation, structures) = held_back(&task, &estimate, &split, progress);
    let mut identification = Identification {
        geometry: task.geometry,
        physical: task.physical,
        segment: config.fit.segment_s,
        coordinates: Coordinates::new(&task.choices, task.geometry, task.torque_known),
        suspects: None,
        other_reading,
        torque_known: task.torque_known,
        columns_accepted: config.log.accept_suspicious_units,
        choices: task.choices,
        findings,
        floor,
        residuals: tests(&simulated, estimate.spread, floor),
        simulated,
        scores: score_tests(&task, &estimate),
        covariance: DMatrix::zeros(0, 0),
        poles: Vec::new(),
        validation,
        structures,
        published: regression(&runs, task.ball_angle),
        times: (time(&runs, &split.fitted), time(&runs, &split.held_back)),
        estimate,
    };
    identification.covariance = identification.widened();
    // Their intervals are from the covariance that the residuals decide on.
    identification.poles = uncertain_poles(
        &identification.estimate,
        identification.covariance(),
        identification.geometry,
    );
    let verdicts = identification.verdicts();
    if verdicts.iter().any(|one| one.weight() >= Weight::Warning) {
        identification.suspects = task.suspects(&split.fitted);
    }
    Ok(identification)
}

impl Task<'_> {
    /// Why there is no estimate, with what is wrong with the columns if that is why.
    fn explained(&self, error: EstimateError, split: &Split) -> EstimateError {
        let suspects = match error {
            EstimateError::NoSegments { .. } => None,
            _ => self.suspects(&split.fitted),
        };
        match suspects {
            Some(suspects) => EstimateError::Suspect {
                suspects,
                error: Box::new(error),
            },
            None => error,
        }
    }
}

/// The fit on the data that were held back, and other structures of friction beside it.
fn held_back(
    task: &Task<'_>,
    estimate: &Estimate,
    split: &Split,
    progress: Progress<'_>,
) -> (Option<Result<Validation, EstimateError>>, Vec<Compared>) {
    if split.held_back.is_empty() {
        return (None, Vec::new());
    }
    let validation = validate(task, &estimate.values, estimate.spread, &split.held_back);
    let structures = compare(task, estimate, &split.held_back, progress);
    (Some(validation), structures)
}

/// The time of stretches, s.
fn time(runs: &[Run], stretches: &[(usize, Range<usize>)]) -> f64 {
    let lengths = stretches.iter().map(|(run, rows)| runs[*run].length(rows));
    lengths.sum()
}

impl Identification {
    /// Whether all residuals are white noise.
    pub fn is_white(&self) -> bool {
        self.residuals.iter().all(OutputResidual::is_white)
    }

    /// The covariance that the intervals are from: that of the information, or, where the residuals
    /// are not white and there are enough segments, that of their scatter; with creep, of the model's
    /// own error, too.
    pub fn covariance(&self) -> &DMatrix<f64> {
        &self.covariance
    }

    fn widened(&self) -> DMatrix<f64> {
        let mut covariance = if self.is_white() || self.has_few_segments() {
            self.estimate.covariance.clone()
        } else {
            self.estimate.scatter_covariance.clone()
        };
        let error = self.creep_error();
        for parameter in Parameter::ROBOT {
            let (index, value) = (parameter.index(), self.estimate.values[parameter]);
            if self.estimate.status[parameter] == Status::Found {
                covariance[(index, index)] += (error * value).powi(2);
            }
        }
        if self.estimate.status[Parameter::Delay] == Status::Found {
            // The torque drives the ball when the contacts have built up their force: after the part
            // of the creep's time that the wheels have of the inertia.
            let values = &self.estimate.values;
            let late = self.creep_time() * values[Parameter::B2] / values[Parameter::B1];
            let index = Parameter::Delay.index();
            covariance[(index, index)] += late.powi(2);
        }
        covariance
    }

    /// How far the ball angle runs ahead per rate of the ball, s: as it was found, or, where creep was
    /// held and the residuals ask for it, as they do.
    fn creep_time(&self) -> f64 {
        let creep = Parameter::CreepBall;
        let asked = self.scores.iter().find(|score| score.parameter == creep);
        match asked {
            Some(score) if score.is_alarm() => score.change,
            _ => self.estimate.values[creep],
        }
    }

    /// The relative error of a robot whose contacts creep: the model has what the sensors see of it,
    /// and neglects that the contacts relax, which is of the order of the creep's time times the
    /// robot's fastest pole. Zero without creep.
    pub(crate) fn creep_error(&self) -> f64 {
        let Some((a, _)) = linear_model(&self.estimate.values, self.geometry) else {
            return 0.0;
        };
        let found = poles(&DMatrix::from_column_slice(4, 4, a.as_slice()));
        let fastest = found.map_or(0.0, |poles| {
            poles
                .iter()
                .fold(0.0_f64, |most, pole| most.max(pole.re.abs()))
        });
        (self.creep_time() * fastest).abs()
    }

    /// Whether there are fewer than two segments per parameter: their scatter then tells nothing.
    pub fn has_few_segments(&self) -> bool {
        self.estimate.segments.len() < 2 * self.estimate.fit.reduced.indices.len()
    }

    /// Standard deviation of a parameter; zero if it was held.
    pub fn standard_deviation(&self, parameter: Parameter) -> f64 {
        let index = parameter.index();
        self.covariance()[(index, index)].sqrt()
    }

    /// 95 % interval of a parameter.
    pub fn interval(&self, parameter: Parameter) -> (f64, f64) {
        let value = self.estimate.values[parameter];
        let half = NORMAL_95 * self.standard_deviation(parameter);
        (value - half, value + half)
    }

    /// Correlation of two parameters; zero if one was held.
    pub fn correlation(&self, one: Parameter, other: Parameter) -> f64 {
        let covariance = self.covariance();
        let (i, j) = (one.index(), other.index());
        let scale = (covariance[(i, i)] * covariance[(j, j)]).sqrt();
        if scale > 0.0 {
            covariance[(i, j)] / scale
        } else {
            0.0
        }
    }

    /// The plant in the project's own form, whose torque is in N m: the torque gain is part of the
    /// virtual wheel's radius, r_w / gain, since torque enters by r_b / r_w alone. Delay and
    /// biases are not part of it.
    pub fn ballbot(&self) -> Ballbot<f64> {
        ballbot(&self.estimate.values, self.geometry)
    }

    /// The fitted inertias and friction against mechanics.
    pub fn consistency(&self) -> Consistency<f64> {
        self.ballbot().consistency(limits::THETA)
    }

    /// p of the fitted robot, its drive friction included.
    pub fn linear_parameters(&self) -> Option<LinearParameters<f64>> {
        let (a, b) = linear_model(&self.estimate.values, self.geometry)?;
        Some(LinearParameters {
            p1: a[(2, 1)],
            p2: a[(2, 2)],
            p3: b[2],
            p4: a[(3, 1)],
            p5: a[(3, 2)],
            p6: b[3],
        })
    }

    /// The residuals' spread over the noise that the sensors have by themselves.
    pub fn normalised_residual(&self) -> f64 {
        let squares = self.residuals.iter().map(|one| one.normalised().powi(2));
        (squares.sum::<f64>() / self.residuals.len().max(1) as f64).sqrt()
    }
}

/// See [`Identification::ballbot`].
pub fn ballbot(values: &Values, geometry: Geometry<f64>) -> Ballbot<f64> {
    let plant = Robot::new(*values, geometry).plant;
    Ballbot {
        geometry: Geometry {
            wheel_radius: geometry.wheel_radius / values[Parameter::TorqueGain],
            ..geometry
        },
        ..plant
    }
}
