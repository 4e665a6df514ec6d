//! What is known of the plant's state.

use super::{MeasuredState, Measurement};
use crate::delay::DelayLine;
use crate::estimator::{Estimator, Observation};
use crate::model::{LpvModel, Scalar};
use crate::predictor::Rk4;
use nalgebra::SVector;

/// Where the state comes from.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub enum Belief<
    P,
    T: 'static,
    const NX: usize,
    const NU: usize,
    const NS: usize,
    const NY: usize,
    const ND: usize,
> {
    /// From the readings themselves, which are those of all states in their order.
    Measured {
        /// Carries the state on through the delay.
        model: P,
        /// Longest Runge-Kutta step of that, s.
        longest_step: T,
        /// The readings.
        state: MeasuredState<T, NX>,
    },
    /// From the filter.
    Estimated(Estimator<P, T, NX, NU, NS, NY, ND>),
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize, const NY: usize, const ND: usize>
    Belief<P, T, NX, NU, NS, NY, ND>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// The readings themselves: `NY` must be `NX`. The `model` carries the state on through a
    /// delay, in Runge-Kutta steps of at most `longest_step` s.
    pub fn measured(model: P, longest_step: T) -> Self {
        const { assert!(NY == NX, "all states must be measured") };
        Self::Measured {
            model,
            longest_step,
            state: MeasuredState::new(),
        }
    }

    /// The state as the sensors see it.
    pub(super) fn state(&self) -> SVector<T, NX> {
        match self {
            Self::Measured { state, .. } => *state.state(),
            Self::Estimated(filter) => filter.state(),
        }
    }

    /// The state in the model's coordinates.
    fn model_state(&self) -> SVector<T, NX> {
        match self {
            Self::Measured { state, .. } => *state.state(),
            Self::Estimated(filter) => *filter.model_state(),
        }
    }

    /// What acts on the plant besides the commanded input, in input units.
    pub(super) fn disturbance(&self) -> SVector<T, NU> {
        match self {
            Self::Measured { .. } => SVector::zeros(),
            Self::Estimated(filter) => filter.input_disturbance(),
        }
    }

    /// The state, in the model's coordinates, after `duration` s under the inputs in `commands`.
    pub(super) fn ahead(&self, commands: &DelayLine<T, NU>, duration: T) -> SVector<T, NX> {
        let mut z = self.model_state();
        commands.for_each(duration, |duration, u| {
            z = match self {
                Self::Measured {
                    model,
                    longest_step,
                    ..
                } => Rk4::with_steps_up_to(*longest_step, duration).advance(model, &z, u, duration),
                Self::Estimated(filter) => filter.predict(&z, u, duration),
            }
        });
        z
    }

    /// Takes in a measurement after the inputs in `commands`, which elapse.
    pub(super) fn observe(
        &mut self,
        measurement: &Measurement<T, NY>,
        commands: &mut DelayLine<T, NU>,
    ) -> Observation<NY> {
        match self {
            Self::Measured { state, .. } => {
                let (elapsed, observation) = state.observe(measurement);
                commands.elapse(elapsed);
                observation
            }
            Self::Estimated(filter) => {
                filter.observe(measurement.t, commands, &measurement.readings)
            }
        }
    }

    /// Stamp of the last measurement, s.
    pub(super) fn time(&self) -> Option<f64> {
        match self {
            Self::Measured { state, .. } => state.time(),
            Self::Estimated(filter) => filter.time(),
        }
    }

    /// Whether there is no state to decide for: before the first measurement, too.
    pub(super) fn is_lost(&self) -> bool {
        match self {
            Self::Measured { state, .. } => state.time().is_none(),
            Self::Estimated(filter) => filter.time().is_none() || filter.is_lost(),
        }
    }

    pub(super) fn take_over(&mut self, previous: &Self) {
        match (self, previous) {
            (Self::Estimated(filter), Self::Estimated(before)) => filter.take_over(before),
            (Self::Estimated(filter), before) => filter.begin_at(before.time(), before.state()),
            (Self::Measured { state, .. }, before) => {
                *state = MeasuredState::known(before.state(), before.time());
            }
        }
    }
}
