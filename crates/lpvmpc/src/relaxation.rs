//! The step rule of the iteration within a sample.
//!
//! A quadratic program built along the inputs u answers with inputs F(u); a plan that repeats
//! itself is a fixed point. Full steps u <- F(u) contract for small moves only: with a terminal
//! equality from rest, the ballbot's oscillate and grow from about 3.5 rad on. The plan they
//! look for is between two of them, so the step is relaxed, u <- u + w (F(u) - u), with Aitken's
//! estimate of the w that would cancel the last change of the residual (Irons and Tuck, A version
//! of the Aitken accelerator for computer iteration, 1969).

use crate::model::Scalar;
use nalgebra::{SVector, convert};

/// The step length and the residual that it was chosen for.
pub(crate) struct Relaxation<T, const NU: usize, const N: usize> {
    step: T,
    /// F(u) - u of the last iteration, if there was one.
    residual: Option<[SVector<T, NU>; N]>,
}

impl<T: Scalar, const NU: usize, const N: usize> Relaxation<T, NU, N> {
    pub fn new() -> Self {
        Self {
            step: T::one(),
            residual: None,
        }
    }

    /// Moves `inputs` towards the `answer`; returns the largest change that the answer asks for.
    pub fn advance(&mut self, inputs: &mut [SVector<T, NU>; N], answer: &[SVector<T, NU>; N]) -> T {
        let mut residual = *answer;
        for (r, u) in residual.iter_mut().zip(inputs.iter()) {
            *r -= u;
        }
        if let Some(last) = &self.residual {
            self.step = self.aitken(last, &residual);
        }
        for (u, r) in inputs.iter_mut().zip(&residual) {
            *u += r * self.step;
        }
        let largest = residual.iter().fold(T::zero(), |m, r| m.max(r.amax()));
        self.residual = Some(residual);
        largest
    }

    /// Aitken's step, from a tenth to one, smoothed over the iterations: taken as it is, it
    /// jumps, and the iteration takes up to half as long again.
    fn aitken(&self, last: &[SVector<T, NU>; N], residual: &[SVector<T, NU>; N]) -> T {
        let (mut along, mut square) = (T::zero(), T::zero());
        for (last, r) in last.iter().zip(residual) {
            let change = last - r;
            along += last.dot(&change);
            square += change.dot(&change);
        }
        let shortest: T = convert(0.1);
        let wanted = self.step * along / square;
        // Negated, so that an estimate that is no number counts as none: nothing has changed.
        let wanted = if !(wanted > shortest) {
            shortest
        } else {
            wanted.min(T::one())
        };
        let smoothing: T = convert(0.3);
        self.step + (wanted - self.step) * smoothing
    }
}
