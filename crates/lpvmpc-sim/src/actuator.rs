//! What an actuator makes of its command: limit, dead zone, lag.

/// One input of the plant. In this order: the command is limited, loses the dead zone, and is
/// followed with a lag. Friction is the plant's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Actuator {
    /// Largest magnitude, in input units; infinite for none.
    pub limit: f64,
    /// Commands of this magnitude or less have no effect, larger ones lose it; input units.
    pub dead_zone: f64,
    /// Time constant of a first-order lag, s; 0 for none.
    pub lag: f64,
}

impl Default for Actuator {
    /// One that delivers what is commanded, at once.
    fn default() -> Self {
        Self {
            limit: f64::INFINITY,
            dead_zone: 0.0,
            lag: 0.0,
        }
    }
}

impl Actuator {
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
        None
    }
}
