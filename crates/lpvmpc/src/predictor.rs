//! The discrete-time predictor under zero-order hold: from the continuous-time LPV model to
//! x_{k+1} = A_d x_k + B_d u_k.
//!
//! Along the scheduling of an expected trajectory the model is linear and becomes a pair of
//! matrices (lines 2 to 8 of Algorithm 1); with the scheduling read off the state it is the
//! nonlinear map of the rollout (eq. (5), step 4 of Algorithm 2).

mod exact_hold;
mod rk4;
mod sampled;

use crate::model::{LpvModel, Scalar};
use crate::small_matrix::product;
use exact_hold::exact_hold;
use nalgebra::{SMatrix, SVector};
pub use rk4::Rk4;
pub(crate) use sampled::{over_periods, periods};

/// A prediction over more steps than this is not worth its time.
const MOST_STEPS: usize = 1_000;

/// How a sample of the model becomes a pair of matrices. Each kind carries the Runge-Kutta steps
/// of the nonlinear rollout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Predictor {
    /// The paper's: Runge-Kutta steps with the scheduling frozen at the sample's beginning. The
    /// prediction differs from the rollout of the same inputs as far as the scheduling moves
    /// within a sample, however often the problem is solved again.
    FrozenRk4(Rk4),
    /// The exact pair (matrix exponential) of the scheduling frozen at the sample's beginning.
    FrozenExact(Rk4),
    /// Runge-Kutta steps with the scheduling that the expected trajectory has at every stage of
    /// every step: for the expected input the pair reproduces the nonlinear rollout to rounding,
    /// so that a plan which repeats itself *is* its rollout.
    StageConsistent(Rk4),
}

impl Predictor {
    /// The Runge-Kutta steps of the nonlinear rollout.
    pub fn rk4(self) -> Rk4 {
        match self {
            Self::FrozenRk4(rk4) | Self::FrozenExact(rk4) | Self::StageConsistent(rk4) => rk4,
        }
    }

    /// (A_d, B_d) over a sample of `t_s` seconds that is expected to begin at `x` with the input
    /// `u`. Of a model with an affine term, [`offset`](Self::offset) is the rest.
    #[inline(always)]
    pub fn linearize<T, P, const NX: usize, const NU: usize, const NS: usize>(
        self,
        model: &P,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
        t_s: T,
    ) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>)
    where
        T: Scalar,
        P: LpvModel<T, NX, NU, NS>,
    {
        self.linearize_along(model, None, x, u, t_s)
    }

    /// The same where the scheduling may be `held`, whatever the state.
    #[inline(always)]
    pub(crate) fn linearize_along<T, P, const NX: usize, const NU: usize, const NS: usize>(
        self,
        model: &P,
        held: Option<&SVector<T, NS>>,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
        t_s: T,
    ) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>)
    where
        T: Scalar,
        P: LpvModel<T, NX, NU, NS>,
    {
        if let (Self::StageConsistent(rk4), None) = (self, held) {
            return rk4.linearize(model, x, u, t_s);
        }
        let scheduling = held.copied().unwrap_or_else(|| model.scheduling(x, u));
        let (a, b) = model.matrices(&scheduling);
        if let Some(period) = model.period() {
            return over_periods(&a, &b, periods(period, t_s));
        }
        match self {
            Self::FrozenRk4(rk4) | Self::StageConsistent(rk4) => {
                rk4.discretize_with(|a, v| model.a_times(a, v), &a, &b, t_s)
            }
            Self::FrozenExact(_) => exact_hold(&a, &b, t_s),
        }
    }

    /// c_d of x_{k+1} = A_d x_k + B_d u_k + c_d over the sample that [`linearize`](Self::linearize) takes
    /// to the `pair` (A_d, B_d), in state units; `None` where the model has no affine term.
    pub fn offset<T, P, const NX: usize, const NU: usize, const NS: usize>(
        self,
        model: &P,
        (x, u): (&SVector<T, NX>, &SVector<T, NU>),
        t_s: T,
        pair: &(SMatrix<T, NX, NX>, SMatrix<T, NX, NU>),
    ) -> Option<SVector<T, NX>>
    where
        T: Scalar,
        P: LpvModel<T, NX, NU, NS>,
    {
        self.offset_along(model, None, (x, u), t_s, pair)
    }

    /// The same where the scheduling may be `held`, whatever the state.
    #[inline(always)]
    pub(crate) fn offset_along<T, P, const NX: usize, const NU: usize, const NS: usize>(
        self,
        model: &P,
        held: Option<&SVector<T, NS>>,
        (x, u): (&SVector<T, NX>, &SVector<T, NU>),
        t_s: T,
        (a_d, b_d): &(SMatrix<T, NX, NX>, SMatrix<T, NX, NU>),
    ) -> Option<SVector<T, NX>>
    where
        T: Scalar,
        P: LpvModel<T, NX, NU, NS>,
    {
        if !model.has_offset() {
            return None;
        }
        if let (Self::StageConsistent(rk4), None) = (self, held) {
            // The pair is exact at the sample's own beginning.
            return Some(rk4.advance(model, x, u, t_s) - product(a_d, x) - product(b_d, u));
        }
        let scheduling = held.copied().unwrap_or_else(|| model.scheduling(x, u));
        let c = model.offset(&scheduling)?;
        // It acts as an input of 1 does.
        let (a, _) = model.matrices(&scheduling);
        if let Some(period) = model.period() {
            return Some(over_periods(&a, &c, periods(period, t_s)).1);
        }
        let (_, c_d) = self.discretize(&a, &c, t_s);
        Some(c_d)
    }

    /// (A_d, B_d) over a sample of `t_s` seconds, for the constant continuous-time pair.
    #[inline(always)]
    pub fn discretize<T: Scalar, const NX: usize, const NU: usize>(
        self,
        a: &SMatrix<T, NX, NX>,
        b: &SMatrix<T, NX, NU>,
        t_s: T,
    ) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>) {
        match self {
            Self::FrozenRk4(rk4) | Self::StageConsistent(rk4) => rk4.discretize(a, b, t_s),
            Self::FrozenExact(_) => exact_hold(a, b, t_s),
        }
    }
}
