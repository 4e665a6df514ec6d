//! A fitted robot as one plane shows it, with all that judges it.

use crate::ball_angle::OtherReading;
use crate::coordinates::Coordinates;
use crate::covariance::correlation;
use crate::estimate::{Estimate, EstimateError, Status, Task};
use crate::log::{Finding, Run};
use crate::model::Robot;
use crate::parameter::{Choice, Parameter, Values};
use crate::poles::{Pole, linear_model, uncertain_poles};
use crate::published::{LinearRegression, regression};
use crate::residuals::{OutputResidual, ScoreTest, SegmentResidual, simulated, tests};
use crate::segments::{Split, Stretch};
use crate::structures::Compared;
use crate::suspects::Suspects;
use crate::validation::{Validation, validate};
use ballbot::{Ballbot, Consistency, Geometry, LinearParameters, limits};
use lpvmpc_design::{NORMAL_95, poles};
use nalgebra::{DMatrix, Vector3};

/// A robot as one plane of its logs shows it, and what speaks for and against it.
#[derive(Clone, Debug)]
pub struct Identification {
    /// Which plane it is of those that were fitted together, counted from 0.
    pub plane: usize,
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
    /// The best robot with the other reading of the ball angle, if the torque gain is not held.
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

/// The time of stretches, s.
fn time(runs: &[Run], stretches: &[Stretch]) -> f64 {
    let lengths = stretches.iter().map(|(run, rows)| runs[*run].length(rows));
    lengths.sum()
}

impl Identification {
    /// The fit of a plane, judged on the stretches that were held back.
    pub(crate) fn new(
        plane: usize,
        task: &Task<'_>,
        estimate: Estimate,
        split: &Split,
        floor: Vector3<f64>,
    ) -> Self {
        let simulated = simulated(task, &estimate);
        // Wheels stand on the body: what their angle is relative to is known.
        let other_reading = match task.tables.wheels {
            true => None,
            false => task.other_reading(&estimate, &split.fitted),
        };
        let validation = (!split.held_back.is_empty())
            .then(|| validate(task, &estimate.values, estimate.spread, &split.held_back));
        let (runs, spread) = (task.runs, estimate.spread);
        Self {
            plane,
            geometry: task.geometry,
            physical: task.physical,
            segment: task.segment,
            coordinates: Coordinates::new(&task.choices, task.geometry, task.torque_known),
            suspects: None,
            other_reading,
            torque_known: task.torque_known,
            columns_accepted: false,
            choices: task.choices,
            findings: Vec::new(),
            floor,
            residuals: tests(&simulated, spread, floor),
            simulated,
            scores: Vec::new(),
            covariance: estimate.covariance.clone(),
            poles: Vec::new(),
            validation,
            structures: Vec::new(),
            published: regression(runs, task.ball_angle),
            times: (time(runs, &split.fitted), time(runs, &split.held_back)),
            estimate,
        }
    }

    /// Sets the covariance that the intervals are from, and those of the poles with it.
    pub(crate) fn set_covariance(&mut self, covariance: DMatrix<f64>) {
        self.poles = uncertain_poles(&self.estimate, &covariance, self.geometry);
        self.covariance = covariance;
    }

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

    /// What the model's own error, with creep, adds to the variance of a parameter.
    pub(crate) fn model_variance(&self, parameter: Parameter) -> f64 {
        let values = &self.estimate.values;
        if self.estimate.status[parameter] != Status::Found {
            return 0.0;
        }
        let error = if Parameter::ROBOT.contains(&parameter) {
            self.creep_error() * values[parameter]
        } else if parameter == Parameter::Delay {
            // The torque drives the ball when the contacts have built up their force: after the part
            // of the creep's time that the wheels have of the inertia.
            self.creep_time() * values[Parameter::B2] / values[Parameter::B1]
        } else {
            0.0
        };
        error.powi(2)
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
        let fit = &self.estimate.fit;
        fit.initial.len() < 2 * fit.reduced.indices.len()
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
        correlation(self.covariance(), one.index(), other.index())
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
        Some(LinearParameters::of_matrices(&a, &b))
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
