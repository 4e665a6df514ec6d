//! From the three virtual torques to the three motors, for wheels wherever they stand, and back.
//! Eq. (6) of the paper is a special case.

use crate::shares::PlaneTorques;
use lpvmpc::{Number, Scalar};
use nalgebra::{Matrix3, RealField, SVector, Vector2, Vector3, convert};

/// Where a wheel stands, and which way it turns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wheel<T> {
    /// From the robot's x axis to the wheel's contact point, counter-clockwise seen from above,
    /// rad.
    pub azimuth: T,
    /// Whether a positive angle of the motor turns the ball clockwise, seen from above, where
    /// three equal wheels turn it about the vertical.
    pub reversed: bool,
}

/// Three omniwheels whose contact points have the same angle from the top of the ball, and whose
/// axles point, from the side, at the ball's vertical axis: a wheel drives the ball along its
/// parallel of latitude and slides freely along the meridian.
///
/// Virtual torques are (tau_x, tau_y, tau_z) in N m: the planes' torques (positive: the ball rolls
/// along +x or +y) and yaw (positive: the ball turns counter-clockwise, seen from above, and the
/// body the other way). Motor torques are (tau_1, tau_2, tau_3) in N m, in the order of the wheels.
///
/// Wheel i at the azimuth beta_i, the angle alpha from the top, touches the ball at r_b n with
/// n = (sin alpha cos beta, sin alpha sin beta, cos alpha). A motor that is not reversed pushes the
/// surface along t = (-sin beta, cos beta, 0) with tau_i / r_w, so it turns the ball with the torque
/// r_b n x t tau_i / r_w. A ball that rolls along x turns about y, and one that rolls along y about
/// -x; hence, s_i = 1 or, reversed, -1,
///
/// ```text
/// tau_x = sum s_i (-cos alpha sin beta_i) tau_i
/// tau_y = sum s_i ( cos alpha cos beta_i) tau_i
/// tau_z = sum s_i   sin alpha             tau_i
/// ```
///
/// The torque map W is the inverse of this, and by virtual work the motors' angles m against the
/// body give the virtual wheels' angles W'm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wheels<T> {
    /// Sine and cosine of the zenith angle.
    sin_cos: (T, T),
    /// s_i (cos beta_i, sin beta_i, 1).
    directions: [Vector3<T>; 3],
    /// W.
    matrix: Matrix3<T>,
}

/// Wheels whose torque map has no inverse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BadWheels<T> {
    /// The zenith angle (rad) is not strictly between 0 and pi/2.
    ZenithAngle(T),
    /// The azimuths (rad) are not finite, or the wheels stand at one place, or nearly.
    Azimuths([T; 3]),
}

impl<T: Scalar> core::fmt::Display for BadWheels<T> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::ZenithAngle(angle) => write!(
                f,
                "the zenith angle of the wheels is {angle} rad; it must be strictly between 0 and \
                 pi/2 rad (the paper's robot has pi/4)"
            ),
            Self::Azimuths([a, b, c]) => write!(
                f,
                "the azimuths of the wheels are {a}, {b} and {c} rad; they must be finite and apart \
                 from each other (the paper's robot has -pi/2, pi/6 and 5 pi/6)"
            ),
        }
    }
}

impl<T: Scalar> core::error::Error for BadWheels<T> {}

/// The least volume of the wheels' directions, of 3 sqrt(3)/2 at most: below, two wheels stand
/// within a degree or so.
const LEAST_VOLUME: f64 = 0.05;

/// Azimuths of the wheels of eq. (6), degrees: where the robot's x axis is that of its x plane.
pub const AZIMUTHS_OF_PAPER_DEG: [f64; 3] = [-90.0, 30.0, 150.0];

impl<T: Scalar + Number> Wheels<T> {
    /// Wheels whose contact points lie `zenith_angle` rad away from the top of the ball.
    ///
    /// # Errors
    /// [`BadWheels`] names the angle that leaves the torque map without an inverse.
    pub fn new(zenith_angle: T, wheels: [Wheel<T>; 3]) -> Result<Self, BadWheels<T>> {
        let azimuths = wheels.map(|wheel| wheel.azimuth);
        if !azimuths.iter().all(|azimuth| azimuth.is_finite()) {
            return Err(BadWheels::Azimuths(azimuths));
        }
        let directions = wheels.map(|wheel| {
            let (sin, cos) = Number::sin_cos(wheel.azimuth);
            let sense = if wheel.reversed { -T::one() } else { T::one() };
            Vector3::new(cos, sin, T::one()) * sense
        });
        if !(volume(&directions).abs() > convert(LEAST_VOLUME)) {
            return Err(BadWheels::Azimuths(azimuths));
        }
        check(zenith_angle).map(|angle| Self::along(angle, directions))
    }

    /// The arrangement of eq. (6) of the paper, at any zenith angle (rad): the wheels stand at -90,
    /// 30 and 150 degrees, none reversed. A ball that rolls along +x turns the first one most.
    ///
    /// # Errors
    /// [`BadWheels::ZenithAngle`] outside the open interval from 0 to pi/2.
    pub fn of_paper(zenith_angle: T) -> Result<Self, BadWheels<T>> {
        check(zenith_angle).map(|angle| Self::along(angle, directions_of_paper()))
    }

    /// The paper's robot: the arrangement of eq. (6) at pi/4.
    pub fn paper() -> Self {
        Self::along(T::frac_pi_4(), directions_of_paper())
    }

    fn along(zenith_angle: T, directions: [Vector3<T>; 3]) -> Self {
        let [a, b, c] = directions;
        let volume = volume(&directions);
        let (sin, cos) = Number::sin_cos(zenith_angle);
        // Rows of the inverse of a matrix with the columns a, b, c: their cross products.
        let row = |cross: Vector3<T>| {
            let [x, y, z] = (cross / volume).into();
            // tau_x is along -sin beta, tau_y along cos beta.
            Vector3::new(-y / cos, x / cos, z / sin).transpose()
        };
        Self {
            sin_cos: (sin, cos),
            directions,
            matrix: Matrix3::from_rows(&[row(b.cross(&c)), row(c.cross(&a)), row(a.cross(&b))]),
        }
    }

    /// Angle of the wheels' contact points from the top of the ball, rad.
    pub fn zenith_angle(&self) -> T {
        let (sin, cos) = self.sin_cos;
        RealField::atan2(sin, cos)
    }

    /// Where each wheel stands, with azimuths from -pi to pi rad, and which way it turns.
    pub fn arrangement(&self) -> [Wheel<T>; 3] {
        self.directions.map(|direction| {
            let sense = direction.z;
            Wheel {
                azimuth: RealField::atan2(direction.y * sense, direction.x * sense),
                reversed: sense < T::zero(),
            }
        })
    }

    /// The motors' torques for the virtual torques (tau_x, tau_y, tau_z).
    pub fn motors(&self, virtual_torques: &Vector3<T>) -> Vector3<T> {
        self.matrix * virtual_torques
    }

    /// The virtual torques that the motors' torques amount to.
    pub fn virtual_torques(&self, motors: &Vector3<T>) -> Vector3<T> {
        let (sin, cos) = self.sin_cos;
        let pairs = self.directions.iter().zip(motors.iter());
        pairs.fold(Vector3::zeros(), |sum, (direction, torque)| {
            let turned = Vector3::new(-direction.y * cos, direction.x * cos, direction.z * sin);
            sum + turned * *torque
        })
    }

    /// How far the motors turn against the body, rad (at the wheel, after the gear) per rad of a ball
    /// that turns against the body: rolling along x, rolling along y, and about the vertical,
    /// counter-clockwise seen from above, 3 x 3. `gear` is r_b / r_w.
    pub fn motor_angles(&self, gear: T) -> Matrix3<T> {
        let unit = |axis: usize| {
            let mut one = SVector::zeros();
            one[axis] = gear;
            one
        };
        Matrix3::from_rows(&[0, 1, 2].map(|motor| {
            // Virtual work: the motor's angle is to the ball's what the ball's torque is to the motor's.
            self.virtual_torques(&unit(motor)).transpose()
        }))
    }

    /// What motors with the limit `motor` N m leave for the planes beside the yaw torque `yaw`
    /// N m, in every heading.
    pub fn plane_torques(&self, motor: T, yaw: T) -> PlaneTorques<T> {
        let radii = self.matrix.row_iter().map(|row| {
            let planes = Vector2::new(row[0], row[1]).norm();
            (motor - row[2].abs() * yaw.abs()) / planes
        });
        // A motor that is NaN makes all of them NaN, which must not be passed over.
        let least = |least: T, radius: T| if least <= radius { least } else { radius };
        PlaneTorques::new(radii.fold(convert(f64::INFINITY), least))
    }

    /// The torque map W from (tau_x, tau_y, tau_z) to the motors, 3 x 3; eq. (6) for the paper's
    /// arrangement.
    pub fn matrix(&self) -> Matrix3<T> {
        self.matrix
    }
}

/// A zenith angle at which the torque map has an inverse.
fn check<T: Scalar>(zenith_angle: T) -> Result<T, BadWheels<T>> {
    if zenith_angle > T::zero() && zenith_angle < T::frac_pi_2() {
        Ok(zenith_angle)
    } else {
        Err(BadWheels::ZenithAngle(zenith_angle))
    }
}

/// (cos beta, sin beta, 1) of the wheels of eq. (6).
fn directions_of_paper<T: Scalar>() -> [Vector3<T>; 3] {
    let (one, half): (T, T) = (T::one(), convert(0.5));
    let root = half * convert::<f64, T>(3.0).sqrt();
    [
        Vector3::new(T::zero(), -one, one),
        Vector3::new(root, half, one),
        Vector3::new(-root, half, one),
    ]
}

/// The determinant of the matrix with these columns.
fn volume<T: Scalar>([a, b, c]: &[Vector3<T>; 3]) -> T {
    a.dot(&b.cross(c))
}
