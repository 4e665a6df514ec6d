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
    /// The gain is the inverse of a mass that is to be found: that of a body of this size, whatever
    /// is known of it beforehand.
    gain_limited: bool,
}

/// The least inertia that counts as positive, m^2: that of a body of a millimetre.
const SMALLEST_INERTIA: f64 = 1e-6;

/// The longest delay that is looked for, s.
pub const LONGEST_DELAY: f64 = 0.1;

/// Mass of a body over the cube of its centre of mass' height, kg/m^3, from the lightest to the
/// heaviest body of that size. Robots that were built have 150 to 5000; a torque that is in mN m and
/// taken for N m, or the other way round, puts the mass outside.
const DENSITIES: (f64, f64) = (10.0, 5e4);

/// A body that leans so far upright is mounted askew, rad.
const LARGEST_TILT_OFFSET: f64 = 0.35;

/// Gyroscopes that were never calibrated have less, rad/s.
const LARGEST_GYRO_BIAS: f64 = 0.5;

/// Contacts that creep more slip, s.
const LARGEST_CREEP: f64 = 0.2;

/// No friction brings a ball to rest faster, 1/s.
const FASTEST_FRICTION: f64 = 1000.0;

/// What a robot of these lengths can have of a parameter, from the least to the most.
pub fn range(parameter: Parameter, geometry: Geometry<f64>, physical: bool) -> (f64, f64) {
    let free = Values([Choice::FREE; Parameter::ALL.len()]);
    let coordinates = Coordinates::new(&free, geometry, false);
    let bounds = coordinates.bounds(&Values([0.0; Parameter::ALL.len()]), physical);
    // No parameter falls when a coordinate grows.
    let [least, most] = [
        bounds.0.map(|(least, _)| least),
        bounds.0.map(|(_, most)| most),
    ];
    let value = |ends: &[f64]| coordinates.values(ends)[parameter];
    (value(&least), value(&most))
}

impl Coordinates {
    /// The coordinates for a robot of which `choices` are made. `torque_known`: the torque is in N m.
    pub fn new(choices: &Values<Choice>, geometry: Geometry<f64>, torque_known: bool) -> Self {
        Self {
            geometry,
            ball_excess: choices[Parameter::B1].is_free(),
            body_excess: choices[Parameter::B3].is_free(),
            gain_limited: torque_known && choices[Parameter::TorqueGain].is_free(),
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

    /// The lightest and the heaviest body of this size, kg.
    pub fn masses(&self) -> (f64, f64) {
        let volume = self.geometry.centre_of_mass.powi(3);
        (DENSITIES.0 * volume, DENSITIES.1 * volume)
    }

    /// What any robot of these lengths can have of each coordinate, whatever mechanics says of
    /// their signs. A fit that ends there has found no robot.
    pub fn limits(&self) -> Values<(f64, f64)> {
        let (ball, body) = self.least();
        let (lightest, heaviest) = self.masses();
        let lever = self.geometry.gravity * self.geometry.centre_of_mass;
        let either = |limit: f64| (-limit, limit);
        Values(Parameter::ALL.map(|parameter| match parameter {
            // A ball that weighs six times the body; rotors that weigh as much as it.
            Parameter::B1 => either(10.0 * ball),
            Parameter::B2 => either(100.0 * ball),
            // A radius of gyration of ten times the height of the centre of mass.
            Parameter::B3 => either(100.0 * body),
            Parameter::RollingFriction | Parameter::DriveFriction => {
                either(FASTEST_FRICTION * ball)
            }
            // It would hold the body level.
            Parameter::DriveCoulomb => either(lever),
            // A negative gain is a wrong sign of the torque, which is to be found out, not fitted.
            Parameter::TorqueGain if self.gain_limited => (1.0 / heaviest, 1.0 / lightest),
            Parameter::TorqueGain => (f64::MIN_POSITIVE, f64::INFINITY),
            Parameter::Delay => (f64::NEG_INFINITY, LONGEST_DELAY),
            Parameter::TiltOffset => either(LARGEST_TILT_OFFSET),
            Parameter::GyroBias => either(LARGEST_GYRO_BIAS),
            Parameter::CreepBall | Parameter::CreepTilt => either(LARGEST_CREEP),
            Parameter::TorqueBias => either(LARGEST_TILT_OFFSET * lever * heaviest),
        }))
    }

    /// Whether the coordinate of a parameter is at a limit, but for rounding.
    pub fn is_at_limit(&self, parameter: Parameter, coordinate: f64) -> bool {
        let (least, most) = self.limits()[parameter];
        [least, most]
            .into_iter()
            .any(|limit| limit.is_finite() && (coordinate - limit).abs() <= 1e-9 * limit.abs())
    }

    /// What mechanics and [`Coordinates::limits`] allow of each coordinate. `physical`: a positive
    /// mass matrix and friction that takes energy away, by construction.
    pub fn bounds(&self, values: &Values, physical: bool) -> Values<(f64, f64)> {
        let mut bounds = self.limits();
        bounds[Parameter::Delay].0 = 0.0;
        if physical {
            let (ball, body) = self.least();
            bounds[Parameter::B2].0 = SMALLEST_INERTIA;
            if self.ball_excess {
                bounds[Parameter::B1].0 = SMALLEST_INERTIA;
            } else {
                let most = &mut bounds[Parameter::B2].1;
                *most = most.min(values[Parameter::B1] - ball);
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
        scales[Parameter::CreepBall] = 0.01;
        scales[Parameter::CreepTilt] = 0.01;
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
        let coordinates = Coordinates::new(&choices, Geometry::paper(), true);
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
        let coordinates = Coordinates::new(&Values::usual(), Geometry::paper(), true);
        let start = Values([0.0; Parameter::ALL.len()]);
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
