//! How far identified parameters may be off, and robots drawn from that.

use crate::error::ScenarioError;
use ballbot::{Ballbot, limits};
use nalgebra::{SMatrix, SVector};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use serde::Deserialize;

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

/// The part of `[identification]` that is needed.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct IdentificationTable {
    torque_gain_1_kg: EntryTable,
    covariance: CovarianceTable,
}

#[derive(Clone, Debug, Deserialize)]
struct EntryTable {
    value: f64,
}

#[derive(Clone, Debug, Deserialize)]
struct CovarianceTable {
    parameters: Vec<String>,
    matrix: Vec<Vec<f64>>,
}

/// The errors of a robot's parameters: normally distributed around them.
#[derive(Clone, Debug, PartialEq)]
pub struct Uncertainty {
    /// F with F F' the covariance of b1, b2, b3, b4, the drive's viscous and Coulomb friction, and
    /// the torque gain relative to its value.
    factor: SMatrix<f64, N, N>,
}

impl Uncertainty {
    /// # Errors
    /// The table is no covariance.
    pub(crate) fn new(table: &IdentificationTable) -> Result<Self, ScenarioError> {
        let covariance = &table.covariance;
        let gain = table.torque_gain_1_kg.value;
        let refused = |value: String, expected: &str| {
            ScenarioError::value("identification.covariance.matrix", value, expected)
        };
        let size = covariance.parameters.len();
        if covariance.matrix.len() != size || covariance.matrix.iter().any(|row| row.len() != size)
        {
            let expected = "it needs a row and a column for each of the parameters";
            return Err(refused("(given)".to_owned(), expected));
        }
        // What is not listed was held.
        let place = |key: &str| covariance.parameters.iter().position(|name| name == key);
        let places = KEYS.map(place);
        let scale = |i: usize| if KEYS[i] == GAIN { gain } else { 1.0 };
        let known = SMatrix::<f64, N, N>::from_fn(|i, j| match (places[i], places[j]) {
            (Some(row), Some(column)) => covariance.matrix[row][column] / (scale(i) * scale(j)),
            _ => 0.0,
        });
        if let Some(entry) = known.iter().find(|entry| !entry.is_finite()) {
            let expected = "the log did not tell all parameters; hold some, or excite more";
            return Err(refused(entry.to_string(), expected));
        }
        // As correlations, so that the sizes of the parameters do not matter.
        let deviations = known.diagonal().map(f64::sqrt);
        let correlations = SMatrix::<f64, N, N>::from_fn(|i, j| {
            let scale = deviations[i] * deviations[j];
            if scale > 0.0 {
                known[(i, j)] / scale
            } else {
                0.0
            }
        });
        let parts = (0.5 * (correlations + correlations.transpose())).symmetric_eigen();
        let smallest = parts.eigenvalues.min();
        // Negated, so that what is not a number fails.
        if !(smallest > -1e-6 && correlations.amax() < 1.0 + 1e-6) {
            return Err(refused(
                format!("(smallest eigenvalue of the correlations {smallest})"),
                "a covariance is symmetric and positive semidefinite",
            ));
        }
        let roots = parts.eigenvalues.map(|value| value.max(0.0).sqrt());
        let factor = parts.eigenvectors * SMatrix::from_diagonal(&roots);
        Ok(Self {
            factor: SMatrix::from_diagonal(&deviations) * factor,
        })
    }

    /// The robot that this `seed` draws from the distribution around `ballbot`. One that mechanics
    /// forbids is drawn again, unless `ballbot` itself is none that mechanics allows.
    ///
    /// # Errors
    /// No such robot within the uncertainty.
    pub fn draw(&self, ballbot: &Ballbot<f64>, seed: u64) -> Result<Ballbot<f64>, ScenarioError> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let physical = |robot: &Ballbot<f64>| robot.consistency(limits::THETA).is_physical();
        let wanted = physical(ballbot);
        for _ in 0..MOST_DRAWS {
            let normal = SVector::<f64, N>::from_fn(|_, _| StandardNormal.sample(&mut random));
            let drawn = with(ballbot, &(values(ballbot) + self.factor * normal));
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
