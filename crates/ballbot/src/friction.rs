//! Friction in the drive, between body and ball.

use lpvmpc::Number;

/// The drive's friction against phi_dot - theta_dot, per unit of body mass. Like the torque it
/// acts on ball and body through [1, -1], in the generalised forces of eq. (1). The paper's robot
/// has none.
///
/// ```text
/// F(v) = viscous v + coulomb v / sqrt(v^2 + creep^2),    v = phi_dot - theta_dot
/// ```
///
/// The second term is Coulomb's law with its jump at rest rounded off, so that the motion can be
/// integrated and predicted: the drive creeps where a real one sticks. F(v) = coefficient(v) v
/// holds exactly, which is what the LPV embedding needs, and costs one root.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveFriction<T> {
    /// Viscous friction, m^2/s; positive when it takes energy away.
    pub viscous: T,
    /// Coulomb friction, m^2/s^2; positive when it takes energy away. Divided by r_b / r_w it is
    /// a torque of the virtual wheel in N m, as far as that is.
    pub coulomb: T,
}

/// Speed phi_dot - theta_dot at which Coulomb friction has reached 71 % of its value, rad/s; at
/// 0.25 rad/s it has 98 %.
pub const CREEP_SPEED: f64 = 0.05;

impl<T: Number> DriveFriction<T> {
    /// A drive without friction.
    pub fn none() -> Self {
        Self {
            viscous: T::constant(0.0),
            coulomb: T::constant(0.0),
        }
    }

    /// Whether there is none: such robots pay for this question alone.
    #[inline(always)]
    pub(crate) fn is_none(&self) -> bool {
        self.viscous == T::constant(0.0) && self.coulomb == T::constant(0.0)
    }

    /// F(v)/v at the speed `speed` = phi_dot - theta_dot in rad/s: m^2/s.
    // Neither inlined nor expected, and by value, so that robots without friction keep their
    // registers and what was read from memory.
    #[cold]
    #[inline(never)]
    pub fn coefficient(self, speed: T) -> T {
        if self.coulomb == T::constant(0.0) {
            return self.viscous;
        }
        self.viscous + self.coulomb / Self::rounded(speed)
    }

    /// sqrt(v^2 + creep^2): the speed without its sign, its kink at rest rounded off, rad/s.
    #[inline(always)]
    pub(crate) fn rounded(speed: T) -> T {
        let creep = T::constant(CREEP_SPEED);
        (speed * speed + creep * creep).sqrt()
    }

    /// dF/dv at the speed `speed` in rad/s: m^2/s.
    #[inline(always)]
    pub(crate) fn slope(self, speed: T) -> T {
        if self.coulomb == T::constant(0.0) {
            return self.viscous;
        }
        // d/dv of v / sqrt(v^2 + c^2) is c^2 / sqrt(v^2 + c^2)^3.
        let (root, creep) = (Self::rounded(speed), T::constant(CREEP_SPEED));
        self.viscous + self.coulomb * creep * creep / (root * root * root)
    }
}
