//! The ballbot where it really stands: on a slope, with its mass off centre, pushed.

use crate::dynamics::Attitude;
use crate::parameters::Ballbot;
use lpvmpc::{Number, Scalar};
use nalgebra::{Vector2, Vector4};

/// A ballbot on a floor that may be inclined, whose centre of mass may lie off its axis.
///
/// theta stays the tilt of the body's axis from the vertical, r_b phi the way along the floor.
/// The equations are those of Lagrange, with gravity turned by the slope; on a level floor with
/// the mass on the axis they are eq. (1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disturbed<T> {
    /// The robot.
    pub ballbot: Ballbot<T>,
    /// Inclination of the floor, rad; positive where it rises towards positive phi.
    pub slope: T,
    /// Mass of ball and body over that of the body, from 1. What a slope pulls at.
    pub total_mass: T,
    /// Angle at the ball's centre from the body's axis to its centre of mass, rad; positive
    /// towards positive theta.
    pub tilt_offset: T,
}

impl<T: Scalar + Number> Disturbed<T> {
    /// `ballbot` on a level floor, well balanced.
    pub fn level(ballbot: Ballbot<T>) -> Self {
        Self {
            ballbot,
            slope: T::zero(),
            total_mass: T::one(),
            tilt_offset: T::zero(),
        }
    }

    /// x_dot = f(x, u, load): `x` = (phi, theta, phi_dot, theta_dot) in rad and rad/s, `torque`
    /// in N m. `load` is a force along the floor through the ball's centre (N per kg of body
    /// mass, positive towards positive phi) and a torque on the body (N m per kg of body mass,
    /// positive towards positive theta). A horizontal push f at the height h above the ball's
    /// centre is (f, f h cos(theta)).
    pub fn f(&self, x: &Vector4<T>, torque: T, load: &Vector2<T>) -> Vector4<T> {
        let Self { ballbot, .. } = self;
        let geometry = &ballbot.geometry;
        let lean = x[1] + self.tilt_offset;
        // Between the body's axis and the normal of the floor.
        let (sin_normal, cos_normal) = Number::sin_cos(lean + self.slope);
        let attitude = Attitude {
            sin_lean: Number::sin(lean),
            sin_normal,
            cos_normal,
        };
        let drive = ballbot.driving_force(torque, x[2] - x[3]);
        let [force_phi, force_theta] = ballbot.forces(&attitude, x, drive);
        let downhill =
            self.total_mass * geometry.gravity * geometry.ball_radius * Number::sin(self.slope);
        let [phi_ddot, theta_ddot] = ballbot.accelerate(
            ballbot.coupling(cos_normal),
            force_phi - downhill + geometry.ball_radius * load[0],
            force_theta + load[1],
        );
        Vector4::new(x[2], x[3], phi_ddot, theta_ddot)
    }

    /// The state and torque at which the robot rests at `phi` (rad) on its slope without load:
    /// ((phi, theta, 0, 0), torque in N m); `None` if the slope is too steep for that.
    pub fn rest(&self, phi: T) -> Option<(Vector4<T>, T)> {
        let geometry = &self.ballbot.geometry;
        let downhill = self.total_mass * geometry.ball_radius * Number::sin(self.slope);
        // drive = downhill g on the ball, and l g sin(lean) on the body.
        let sin_lean = downhill / geometry.centre_of_mass;
        let (zero, one) = (T::zero(), T::one());
        (-one..=one).contains(&sin_lean).then(|| {
            let theta = sin_lean.asin() - self.tilt_offset;
            let torque = downhill * geometry.gravity / self.ballbot.gear();
            (Vector4::new(phi, theta, zero, zero), torque)
        })
    }
}
