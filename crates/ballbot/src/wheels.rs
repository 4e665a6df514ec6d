//! From the three virtual torques to the three motors (eq. (6)), and back.

use crate::shares::PlaneTorques;
use crate::trigonometry::sin_cos;
use lpvmpc::Scalar;
use nalgebra::{Matrix3, Vector3, convert};

/// Three omniwheels, 120 degrees apart, each touching the ball at the same angle from the top.
///
/// Virtual torques are (tau_x, tau_y, tau_z) in N m: the planes' torques and yaw. Motor
/// torques are (tau_1, tau_2, tau_3) in N m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wheels<T> {
    /// Sine and cosine of the zenith angle.
    sin_cos: (T, T),
}

/// The zenith angle is not strictly between 0 and pi/2, where the torque map has an inverse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BadZenithAngle<T>(pub T);

impl<T: Scalar> core::fmt::Display for BadZenithAngle<T> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(
            f,
            "the zenith angle of the wheels is {} rad; it must be strictly between 0 and pi/2 rad \
             (the paper's robot has pi/4)",
            self.0
        )
    }
}

impl<T: Scalar> core::error::Error for BadZenithAngle<T> {}

impl<T: Scalar> Wheels<T> {
    /// Wheels whose contact points lie `zenith_angle` rad away from the top of the ball.
    ///
    /// # Errors
    /// [`BadZenithAngle`] outside the open interval from 0 to pi/2.
    pub fn new(zenith_angle: T) -> Result<Self, BadZenithAngle<T>> {
        if zenith_angle > T::zero() && zenith_angle < T::frac_pi_2() {
            Ok(Self {
                sin_cos: sin_cos(zenith_angle),
            })
        } else {
            Err(BadZenithAngle(zenith_angle))
        }
    }

    /// The paper's robot: pi/4.
    pub fn paper() -> Self {
        Self {
            sin_cos: sin_cos(T::frac_pi_4()),
        }
    }

    /// Angle of the wheels' contact points from the top of the ball, rad.
    pub fn zenith_angle(&self) -> T {
        let (sin, cos) = self.sin_cos;
        sin.atan2(cos)
    }

    /// The motors' torques for the virtual torques (tau_x, tau_y, tau_z).
    pub fn motors(&self, virtual_torques: &Vector3<T>) -> Vector3<T> {
        self.matrix() * virtual_torques
    }

    /// The virtual torques that the motors' torques amount to.
    pub fn virtual_torques(&self, motors: &Vector3<T>) -> Vector3<T> {
        let (sin, cos) = self.sin_cos;
        let half: T = convert(0.5);
        let root = half * convert::<f64, T>(3.0).sqrt();
        #[rustfmt::skip]
        let inverse = Matrix3::new(
            cos,  -cos * half, -cos * half,
            T::zero(), cos * root,  -cos * root,
            sin,  sin,         sin,
        );
        inverse * motors
    }

    /// What motors with the limit `motor` N m leave for the planes beside the yaw torque `yaw`
    /// N m, in every heading.
    pub fn plane_torques(&self, motor: T, yaw: T) -> PlaneTorques<T> {
        let matrix = self.matrix();
        let radii = matrix.row_iter().map(|row| {
            let planes = (row[0] * row[0] + row[1] * row[1]).sqrt();
            (motor - row[2].abs() * yaw.abs()) / planes
        });
        let least = |least: T, radius| least.min(radius);
        PlaneTorques::new(radii.fold(convert(f64::INFINITY), least))
    }

    /// The torque map of eq. (6), 3 x 3.
    pub fn matrix(&self) -> Matrix3<T> {
        let (sin, cos) = self.sin_cos;
        let third: T = convert(1.0 / 3.0);
        let tilt = third / cos;
        let side = tilt * convert::<f64, T>(3.0).sqrt();
        let yaw = third / sin;
        #[rustfmt::skip]
        let matrix = Matrix3::new(
            tilt * convert(2.0), T::zero(), yaw,
            -tilt,               side,      yaw,
            -tilt,               -side,     yaw,
        );
        matrix
    }
}
