//! What the fit changes: coordinates in which mechanics is a bound on each alone.

use crate::parameter::{Choice, Parameter, Values};
use ballbot::Geometry;
use nalgebra::DMatrix;

/// The fit's coordinates. They are the parameters, but for b1 and b3 where those are free: there
/// they are what exceeds the least that a rigid body needs, b1 - b2 - r_b^2 and b3 - b2 - l^2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coordinates {
    /// Lengths and gravity.
    pub geometry: Geometry<f64>,
    /// b1 is represented by its excess.
    ball_excess: bool,
    /// b3 is represented by its excess.
    body_excess: bool,
}

/// The least inertia that counts as positive, m^2: that of a body of a millimetre.
const SMALLEST_INERTIA: f64 = 1e-6;

/// The longest delay that is looked for, s.
pub const LONGEST_DELAY: f64 = 0.1;

/// The smallest torque gain that counts as positive, 1/kg: that of a body of a hundred tonnes.
const SMALLEST_GAIN: f64 = 1e-5;

impl Coordinates {
    /// The coordinates for a robot of which `choices` are made.
    pub fn new(choices: &Values<Choice>, geometry: Geometry<f64>) -> Self {
        Self {
            geometry,
            ball_excess: choices[Parameter::B1].is_free(),
            body_excess: choices[Parameter::B3].is_free(),
        }
    }

    fn least(&self) -> (f64, f64) {
        (
            self.geometry.ball_radius.powi(2),
            self.geometry.centre_of_mass.powi(2),
        )
    }

    /// The parameters at these coordinates.
    pub fn values(&self, coordinates: &[f64]) -> Values {
        let mut values = Values([0.0; Parameter::ALL.len()]);
        values.0.copy_from_slice(coordinates);
        let (b2, (ball, body)) = (values[Parameter::B2], self.least());
        if self.ball_excess {
            values[Parameter::B1] += b2 + ball;
        }
        if self.body_excess {
            values[Parameter::B3] += b2 + body;
        }
        values
    }

    /// The coordinates of these parameters.
    pub fn of(&self, values: &Values) -> Vec<f64> {
        let mut coordinates = values.0.to_vec();
        let (b2, (ball, body)) = (values[Parameter::B2], self.least());
        if self.ball_excess {
            coordinates[Parameter::B1.index()] -= b2 + ball;
        }
        if self.body_excess {
            coordinates[Parameter::B3.index()] -= b2 + body;
        }
        coordinates
    }

    /// Derivative of the parameters by the coordinates, square.
    pub fn jacobian(&self) -> DMatrix<f64> {
        let n = Parameter::ALL.len();
        let mut jacobian = DMatrix::identity(n, n);
        let b2 = Parameter::B2.index();
        if self.ball_excess {
            jacobian[(Parameter::B1.index(), b2)] = 1.0;
        }
        if self.body_excess {
            jacobian[(Parameter::B3.index(), b2)] = 1.0;
        }
        jacobian
    }

    /// What mechanics and the fit allow of each coordinate. `physical`: a positive mass matrix and
    /// friction that takes energy away, by construction.
    pub fn bounds(&self, values: &Values, physical: bool) -> Values<(f64, f64)> {
        let mut bounds = Values([(f64::NEG_INFINITY, f64::INFINITY); Parameter::ALL.len()]);
        // A negative gain is a wrong sign of the torque, which is to be found out, not fitted.
        bounds[Parameter::TorqueGain].0 = SMALLEST_GAIN;
        bounds[Parameter::Delay] = (0.0, LONGEST_DELAY);
        if physical {
            let (ball, body) = self.least();
            bounds[Parameter::B2].0 = SMALLEST_INERTIA;
            if self.ball_excess {
                bounds[Parameter::B1].0 = SMALLEST_INERTIA;
            } else {
                bounds[Parameter::B2].1 = values[Parameter::B1] - ball;
            }
            if self.body_excess {
                bounds[Parameter::B3].0 = SMALLEST_INERTIA;
            } else {
                let most = &mut bounds[Parameter::B2].1;
                *most = most.min(values[Parameter::B3] - body);
            }
            for friction in [
                Parameter::RollingFriction,
                Parameter::DriveFriction,
                Parameter::DriveCoulomb,
            ] {
                bounds[friction].0 = 0.0;
            }
        }
        bounds
    }

    /// What a change of each coordinate is measured in.
    pub fn scales(&self) -> Values {
        let (ball, body) = self.least();
        let weight = self.geometry.gravity * self.geometry.centre_of_mass;
        let mut scales = Values([1.0; Parameter::ALL.len()]);
        scales[Parameter::B1] = ball;
        scales[Parameter::B2] = ball;
        scales[Parameter::B3] = body;
        scales[Parameter::RollingFriction] = ball;
        scales[Parameter::DriveFriction] = ball;
        scales[Parameter::DriveCoulomb] = 0.01 * weight;
        scales[Parameter::TorqueGain] = 0.1;
        scales[Parameter::Delay] = 0.01;
        scales[Parameter::TiltOffset] = 0.01;
        scales[Parameter::GyroBias] = 0.01;
        scales[Parameter::TorqueBias] = 0.01;
        scales
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_and_parameters_are_inverse_and_differentiated() {
        let mut choices = Values::usual();
        choices[Parameter::B3] = Choice::Fixed(0.2);
        let coordinates = Coordinates::new(&choices, Geometry::paper());
        let values = Values(std::array::from_fn(|i| 0.3 + 0.1 * i as f64));
        let z = coordinates.of(&values);
        for (back, value) in coordinates.values(&z).0.iter().zip(values.0) {
            assert!((back - value).abs() < 1e-15);
        }
        // The map is affine, so differences are exact.
        let jacobian = coordinates.jacobian();
        for column in 0..z.len() {
            let mut moved = z.clone();
            moved[column] += 1.0;
            let moved = coordinates.values(&moved);
            for row in 0..z.len() {
                let difference = moved.0[row] - values.0[row];
                assert!((difference - jacobian[(row, column)]).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn the_bounds_keep_the_mass_matrix_positive() {
        let coordinates = Coordinates::new(&Values::usual(), Geometry::paper());
        let start = Values([0.0; 11]);
        let bounds = coordinates.bounds(&start, true);
        let corner: Vec<f64> = bounds.0.iter().map(|(lower, _)| lower.max(-1.0)).collect();
        let values = coordinates.values(&corner);
        let plant = crate::model::Robot::new(values, Geometry::paper()).plant;
        assert!(
            plant.consistency(1.5).is_physical(),
            "{}",
            plant.consistency(1.5)
        );
    }
}
