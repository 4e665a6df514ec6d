//! How far identified parameters may be off, and robots drawn from that.

use crate::error::ScenarioError;
use crate::prepare::problem::dynamic;
use ballbot::{Ballbot, limits};
use lpvmpc_sim::Random;
use nalgebra::{SMatrix, SVector};
use serde::Deserialize;
use std::fmt;

/// What of an identified robot is uncertain: its plant, in the order of [`values`]. Delay and
/// biases of the sensors are the world's.
const KEYS: [&str; 7] = [
    "b1_m2",
    "b2_m2",
    "b3_m2",
    "b4_m2_s",
    "drive_friction_m2_s",
    "drive_coulomb_m2_s2",
    GAIN,
];
const GAIN: &str = "torque_gain_1_kg";
const N: usize = KEYS.len();

/// Draws until one is a robot of the same kind as the identified one.
const MOST_DRAWS: usize = 1000;

/// Rounding that a correlation may show.
const TOLERANCE: f64 = 1e-6;

/// Robots around a known one.
// An object, so that a page, which reads no such files, does not have to load how they are drawn.
pub trait RobotDistribution: fmt::Debug {
    /// The robot that this `seed` draws from the distribution around `ballbot`. One that mechanics
    /// forbids is drawn again, unless `ballbot` itself is none that mechanics allows.
    ///
    /// # Errors
    /// The distribution is none, or there is no such robot in it.
    fn draw(&self, ballbot: &Ballbot<f64>, seed: u64) -> Result<Ballbot<f64>, ScenarioError>;
}

/// The errors of a robot's identified parameters: normally distributed around them. It is what
/// `[identification]` of a `parameters.toml` says of it.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Uncertainty {
    torque_gain_1_kg: EntryTable,
    covariance: CovarianceTable,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
struct EntryTable {
    value: f64,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
struct CovarianceTable {
    parameters: Vec<String>,
    matrix: Vec<Vec<f64>>,
}

fn refused(value: String, expected: &str) -> ScenarioError {
    ScenarioError::value("identification.covariance.matrix", value, expected)
}

impl Uncertainty {
    /// The covariance of [`values`].
    fn covariance(&self) -> Result<SMatrix<f64, N, N>, ScenarioError> {
        let CovarianceTable { parameters, matrix } = &self.covariance;
        let size = parameters.len();
        if matrix.len() != size || matrix.iter().any(|row| row.len() != size) {
            let expected = "it needs a row and a column for each of the parameters";
            return Err(refused("(given)".to_owned(), expected));
        }
        let place = |key: &str| parameters.iter().position(|name| name == key);
        let places = KEYS.map(place);
        let gain = self.torque_gain_1_kg.value;
        let scale = |i: usize| if KEYS[i] == GAIN { gain } else { 1.0 };
        let known = SMatrix::<f64, N, N>::from_fn(|i, j| match (places[i], places[j]) {
            (Some(row), Some(column)) => matrix[row][column] / (scale(i) * scale(j)),
            // What is not listed was held.
            _ => 0.0,
        });
        match known.iter().find(|entry| !entry.is_finite()) {
            None => Ok(known),
            Some(entry) => Err(refused(
                entry.to_string(),
                "the log did not tell all parameters; hold some, or excite more",
            )),
        }
    }

    /// F with F F' the covariance of [`values`].
    fn factor(&self) -> Result<SMatrix<f64, N, N>, ScenarioError> {
        let covariance = self.covariance()?;
        // As correlations, so that the sizes of the parameters do not matter.
        let deviations = covariance.diagonal().map(f64::sqrt);
        let correlations = SMatrix::<f64, N, N>::from_fn(|i, j| {
            let scale = deviations[i] * deviations[j];
            if scale == 0.0 {
                0.0
            } else {
                covariance[(i, j)] / scale
            }
        });
        let variances = covariance.diagonal();
        let real = variances.iter().all(|variance| *variance >= 0.0);
        if !real || (correlations - correlations.transpose()).amax() > TOLERANCE {
            let expected = "a covariance is symmetric, and has no negative variances";
            return Err(refused("(given)".to_owned(), expected));
        }
        let parts = dynamic(&correlations).symmetric_eigen();
        let smallest = parts.eigenvalues.min();
        // Negated, so that NaN fails.
        if !(smallest >= -TOLERANCE) {
            return Err(refused(
                format!("(smallest eigenvalue of the correlations {smallest:.3})"),
                "a covariance is positive semidefinite",
            ));
        }
        Ok(SMatrix::from_fn(|i, j| {
            let root = parts.eigenvalues[j].max(0.0).sqrt();
            deviations[i] * parts.eigenvectors[(i, j)] * root
        }))
    }
}

impl RobotDistribution for Uncertainty {
    fn draw(&self, ballbot: &Ballbot<f64>, seed: u64) -> Result<Ballbot<f64>, ScenarioError> {
        let factor = self.factor()?;
        let mut random = Random::new(seed, 0);
        let physical = |robot: &Ballbot<f64>| robot.consistency(limits::THETA).is_physical();
        let wanted = physical(ballbot);
        for _ in 0..MOST_DRAWS {
            let normal = SVector::<f64, N>::from_fn(|_, _| random.normal());
            let drawn = with(ballbot, &(values(ballbot) + factor * normal));
            let invertible = drawn.consistency(limits::THETA).mass_invertible;
            if drawn.geometry.wheel_radius > 0.0 && invertible && physical(&drawn) == wanted {
                return Ok(drawn);
            }
        }
        Err(ScenarioError::value(
            "world.draw",
            seed,
            format!(
                "none of {MOST_DRAWS} robots drawn from the covariance can exist; record with more \
                 excitation"
            ),
        ))
    }
}

/// b1, b2, b3, b4, the drive's viscous and Coulomb friction, and the torque gain relative to that of
/// the robot.
fn values(ballbot: &Ballbot<f64>) -> SVector<f64, N> {
    let Ballbot {
        b1,
        b2,
        b3,
        b4,
        drive,
        ..
    } = *ballbot;
    SVector::from([b1, b2, b3, b4, drive.viscous, drive.coulomb, 1.0])
}

/// The robot with these values; the gain is in the wheel's radius.
fn with(ballbot: &Ballbot<f64>, values: &SVector<f64, N>) -> Ballbot<f64> {
    let mut robot = *ballbot;
    robot.b1 = values[0];
    robot.b2 = values[1];
    robot.b3 = values[2];
    robot.b4 = values[3];
    robot.drive.viscous = values[4];
    robot.drive.coulomb = values[5];
    robot.geometry.wheel_radius /= values[6];
    robot
}
