//! What is the ball angle relative to? Where the body's mass is found from the log, a log whose ball
//! angle is relative to the body is nearly explained by another robot whose ball angle is relative to
//! the floor, and the other way round: four factors of a linear model make four parameters, whatever
//! the reading. What is left to tell the readings apart is what the parameters may be (friction that
//! takes energy away, inertias of a rigid body), how the coupling changes with the tilt, and what was
//! known of the robot beforehand.

use crate::estimate::{Effort, Estimate, EstimateError, Task};
use crate::joint::Joint;
use crate::log::BallAngle;
use crate::parameter::{Parameter, Values};
use crate::segments::{Stretch, spread};

/// The best robot with the other reading of the ball angle, beside the one that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OtherReading {
    /// The other reading.
    pub ball_angle: BallAngle,
    /// The robot that fits best with it.
    pub values: Values,
    /// By how much chi^2, what was known beforehand included, is lower than with the reading that was
    /// said, in units of chi^2 per degree of freedom; negative where it is higher.
    pub better_by: f64,
}

/// The difference of chi^2 that decides, five standard deviations.
pub(crate) const DECIDES: f64 = 25.0;

/// Segments of each fit; a few parameters need no more.
const SEGMENTS: usize = 60;

const START: Effort = Effort {
    segments: 20,
    max_iterations: 20,
};

impl OtherReading {
    /// Whether the log speaks for it.
    pub fn is_better(&self) -> bool {
        self.better_by > DECIDES
    }

    /// Whether the log speaks against it.
    pub fn is_worse(&self) -> bool {
        self.better_by < -DECIDES
    }
}

impl Task<'_> {
    /// The fit with the other reading, where both readings have a robot: not where the torque gain is
    /// held. One of which something is known beforehand is not: a log moves it by many standard
    /// deviations. `None` too where no robot explains the log with it at all.
    pub(crate) fn other_reading(
        &self,
        estimate: &Estimate,
        stretches: &[Stretch],
    ) -> Option<OtherReading> {
        if !self.choices[Parameter::TorqueGain].is_free() {
            return None;
        }
        let noise = estimate.noise;
        let fit = |ball_angle, start: Option<Values>| -> Result<Estimate, EstimateError> {
            let task = Task {
                ball_angle,
                noise: [0, 1, 2].map(|output| Some(noise[output])),
                ..self.clone()
            };
            let start = match start {
                Some(start) => start,
                None => task.coarse(stretches, noise, START, &|_| {})?.values,
            };
            let segments = spread(&estimate.segments, SEGMENTS);
            let joint = Joint::alone(task);
            let fit = joint.estimate_from(&[start], vec![segments], &[noise], &|_| {})?;
            Ok(fit.first())
        };
        let ball_angle = self.ball_angle.other();
        let own = fit(self.ball_angle, Some(estimate.values)).ok()?.fit;
        let other = fit(ball_angle, None).ok()?;
        let scale = (own.chi_square / own.degrees_of_freedom()).max(1.0);
        Some(OtherReading {
            ball_angle,
            values: other.values,
            better_by: (own.chi_square - other.fit.chi_square) / scale,
        })
    }
}
