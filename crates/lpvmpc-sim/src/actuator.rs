//! What an actuator makes of its command: limit, dead zone, lag, friction.

use nalgebra::SVector;

/// One input of the plant. In this order: the command is limited, loses the dead zone, and is
/// followed with a lag; friction acts on what comes out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Actuator<const NX: usize> {
    /// Largest magnitude, in input units; infinite for none.
    pub limit: f64,
    /// Commands of this magnitude or less have no effect, larger ones lose it; input units.
    pub dead_zone: f64,
    /// Time constant of a first-order lag, s; 0 for none.
    pub lag: f64,
    /// Dry friction.
    pub friction: Option<CoulombFriction<NX>>,
}

/// Dry friction of a drive, `level` tanh(speed / `creep`), against the motion.
///
/// The jump of Coulomb's law at speed zero is rounded off, so that the motion can be
/// integrated: below `creep` the drive creeps where a real one sticks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoulombFriction<const NX: usize> {
    /// Magnitude, in input units.
    pub level: f64,
    /// The drive's speed is `speed`' x, in rad/s or m/s, positive where the input is.
    pub speed: SVector<f64, NX>,
    /// Width of the rounded jump, in units of speed, positive.
    pub creep: f64,
}

impl<const NX: usize> Default for Actuator<NX> {
    /// One that delivers what is commanded, at once.
    fn default() -> Self {
        Self {
            limit: f64::INFINITY,
            dead_zone: 0.0,
            lag: 0.0,
            friction: None,
        }
    }
}

impl<const NX: usize> Actuator<NX> {
    /// Where the output tends to under a constant command, in input units.
    pub(crate) fn target(&self, command: f64) -> f64 {
        let limited = command.clamp(-self.limit, self.limit);
        if self.dead_zone > 0.0 {
            limited.signum() * (limited.abs() - self.dead_zone).max(0.0)
        } else {
            limited
        }
    }

    /// The output `after` seconds, from `start` on its way to `target`.
    pub(crate) fn output(&self, start: f64, target: f64, after: f64) -> f64 {
        if self.lag > 0.0 {
            target + (start - target) * (-after / self.lag).exp()
        } else {
            target
        }
    }

    /// The integral of [`Self::output`] from 0 to `duration` seconds.
    pub(crate) fn integral(&self, start: f64, target: f64, duration: f64) -> f64 {
        let lost = if self.lag > 0.0 {
            -(start - target) * self.lag * (-duration / self.lag).exp_m1()
        } else {
            0.0
        };
        target * duration + lost
    }

    /// What friction leaves of the output `u` at the state `x`.
    pub fn after_friction(&self, u: f64, x: &SVector<f64, NX>) -> f64 {
        match &self.friction {
            Some(friction) => u - friction.level * (friction.speed.dot(x) / friction.creep).tanh(),
            None => u,
        }
    }

    /// What makes no sense about it: the quantity, its value, and what would be right.
    pub(crate) fn mistake(&self) -> Option<(&'static str, f64, &'static str)> {
        let size = |value: f64| value.is_finite() && value >= 0.0;
        let sizes = "it must be finite and not negative";
        if !(self.limit > 0.0) {
            return Some(("limit", self.limit, "it must be positive"));
        }
        if !size(self.dead_zone) {
            return Some(("dead zone", self.dead_zone, sizes));
        }
        if !size(self.lag) {
            return Some(("lag", self.lag, sizes));
        }
        let friction = self.friction.as_ref()?;
        if !size(friction.level) {
            return Some(("friction", friction.level, sizes));
        }
        if !(friction.creep > 0.0 && friction.creep.is_finite()) {
            return Some((
                "friction's creep speed",
                friction.creep,
                "it must be positive",
            ));
        }
        let entry = friction.speed.iter().find(|entry| !entry.is_finite())?;
        Some(("friction's speed", *entry, "its entries must be finite"))
    }
}
