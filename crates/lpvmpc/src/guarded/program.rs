//! The quadratic program of a guarded sample.
//!
//! Its state is (x, z) with the set point z, which stays as it is. Two stages are added to the
//! horizon: at the first, whose input is z, the state is given its set point; at the last, the
//! state becomes y = L'(x_N - z d) with P = L L', so that the terminal cost is |y|^2 and the
//! terminal set the ball |y|^2 <= level. The program asks for the cube |y_i| <= sqrt(level / NX)
//! inside that ball; the acceptance test asks for the ball.

use super::GuardedController;
use super::plan::{Plan, shrunk, width};
use crate::model::{LpvModel, Scalar};
use crate::ocp::{Bounds, Ocp, Penalty, Stage};
use crate::solution::{BoundId, Solution};
use nalgebra::{Cholesky, Const, SMatrix, SVector, convert};

impl<
    P,
    T,
    const NX: usize,
    const NU: usize,
    const NS: usize,
    const N: usize,
    const NA: usize,
    const NP: usize,
> GuardedController<P, T, NX, NU, NS, N, NA, NP>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// The program along the plan `along`.
    pub(super) fn pose(
        &self,
        x0: &SVector<T, NX>,
        wanted: T,
        along: &Plan<T, NX, NU, N>,
        ocp: &mut Ocp<T, NA, NU, NP>,
    ) {
        // The last stage of the horizon follows its samples.
        ocp.horizon = self.settings.horizon + 2;
        ocp.x0 = augmented(x0, T::zero());
        let bounds = shrunk(&self.settings.x, self.settings.margin);
        let states = core::iter::once(x0).chain(&along.x);
        let samples = states.zip(&along.u).take(self.settings.horizon);
        let mut stages = ocp.stages.iter_mut();
        if let Some(first) = stages.next() {
            *first = self.set_point_stage(wanted, along.set_point);
        }
        for ((i, (x, u)), stage) in samples.enumerate().zip(&mut stages) {
            *stage = self.sample_stage(x, u);
            // The measured state is as it is; x_1 and later are bounded.
            if i > 0 {
                stage.x = self.augmented_bounds(&bounds);
            }
        }
        if let Some(last) = stages.next() {
            *last = self.terminal_stage();
            last.x = self.augmented_bounds(&bounds);
        }
        self.pose_end(ocp);
    }

    /// (x, 0) becomes (x, z): the first input is z, with the offset cost.
    fn set_point_stage(&self, wanted: T, along: T) -> Stage<T, NA, NU> {
        let mut stage = Stage::<T, NA, NU>::new();
        stage.a = SMatrix::identity();
        stage.b = SMatrix::zeros();
        stage.b[(NX, 0)] = T::one();
        stage.r = SMatrix::identity();
        stage.r[(0, 0)] = self.settings.offset_weight;
        stage.linear_u[0] = -self.settings.offset_weight * wanted;
        let [lower, upper] = self.settings.set_points;
        stage.u.lower[0] = lower.max(along - self.reach);
        stage.u.upper[0] = upper.min(along + self.reach);
        stage
    }

    /// One sample of the plant, linearised along (x, u).
    fn sample_stage(&self, x: &SVector<T, NX>, u: &SVector<T, NU>) -> Stage<T, NA, NU> {
        let settings = &self.settings;
        let (a, b) = settings.rk4.linearize(&self.model, x, u, settings.t_s);
        let mut stage = Stage::<T, NA, NU>::new();
        stage.a.view_mut((0, 0), (NX, NX)).copy_from(&a);
        stage.a[(NX, NX)] = T::one();
        stage.b.view_mut((0, 0), (NX, NU)).copy_from(&b);
        // ||x - z d||_Q^2 in terms of (x, z).
        let q_d = settings.weights.q * settings.direction;
        let q = &mut stage.q;
        q.view_mut((0, 0), (NX, NX)).copy_from(&settings.weights.q);
        q.view_mut((0, NX), (NX, 1)).copy_from(&-q_d);
        q.view_mut((NX, 0), (1, NX)).copy_from(&-q_d.transpose());
        q[(NX, NX)] = q_d.dot(&settings.direction);
        stage.r = settings.weights.r;
        stage.u = settings.u;
        stage
    }

    /// y = L'(x - z d), without input.
    fn terminal_stage(&self) -> Stage<T, NA, NU> {
        let mut stage = Stage::<T, NA, NU>::new();
        stage.a = SMatrix::zeros();
        stage.b = SMatrix::zeros();
        stage.r = SMatrix::identity();
        if let Some(factor) = Cholesky::<T, Const<NX>>::new(self.settings.terminal.p) {
            let root = factor.l().transpose();
            let shift = -(root * self.settings.direction);
            stage.a.view_mut((0, 0), (NX, NX)).copy_from(&root);
            stage.a.view_mut((0, NX), (NX, 1)).copy_from(&shift);
        }
        stage
    }

    /// The terminal cost |y|^2 and the cube in the terminal set.
    fn pose_end(&self, ocp: &mut Ocp<T, NA, NU, NP>) {
        let inside = T::one() - self.settings.margin;
        let half_edge = (self.settings.terminal.level / convert::<f64, T>(NX as f64)).sqrt();
        ocp.terminal.p = SMatrix::identity();
        ocp.terminal.p[(NX, NX)] = T::zero();
        ocp.terminal.x = Bounds::none();
        ocp.soft_x = [None; NA];
        ocp.terminal.soft_x = [None; NA];
        for i in 0..NX {
            ocp.terminal.x.lower[i] = -half_edge * inside;
            ocp.terminal.x.upper[i] = half_edge * inside;
        }
    }

    fn augmented_bounds(&self, x: &Bounds<T, NX>) -> Bounds<T, NA> {
        let infinity: T = convert(f64::INFINITY);
        Bounds {
            lower: augmented(&x.lower, -infinity),
            upper: augmented(&x.upper, infinity),
        }
    }

    /// State bounds and terminal set at a price instead.
    pub(super) fn soften(&self, ocp: &mut Ocp<T, NA, NU, NP>) {
        let width = width(&self.settings.x);
        let penalty = |width: T| {
            let width = if width > T::zero() { width } else { T::one() };
            Some(Penalty {
                linear: self.settings.soft_price / width,
                quadratic: self.settings.soft_price / (width * width),
            })
        };
        for (soft, width) in ocp.soft_x.iter_mut().zip(width.iter()) {
            *soft = penalty(*width);
        }
        let edge = self.settings.terminal.level.sqrt();
        for soft in ocp.terminal.soft_x.iter_mut().take(NX) {
            *soft = penalty(edge);
        }
    }
}

/// (x, z)
fn augmented<T: Scalar, const NX: usize, const NA: usize>(
    x: &SVector<T, NX>,
    z: T,
) -> SVector<T, NA> {
    SVector::from_fn(|i, _| x.get(i).copied().unwrap_or(z))
}

/// A bound of a program of `horizon` stages as one of the plant, whose stages begin one later. At
/// the first stage there is the set point's trust region, at the end the terminal set.
pub(super) fn of_the_plant(bound: BoundId, horizon: usize) -> Option<BoundId> {
    let stage = bound.stage.checked_sub(1)?;
    (bound.stage < horizon).then_some(BoundId { stage, ..bound })
}

/// The plant's inputs and the set point of a solved program.
pub(super) fn answer<
    T: Scalar,
    const NU: usize,
    const N: usize,
    const NA: usize,
    const NP: usize,
    const M: usize,
>(
    solution: &Solution<T, NA, NU, NP, M>,
) -> ([SVector<T, NU>; N], T) {
    let mut u = [SVector::zeros(); N];
    for (u, planned) in u.iter_mut().zip(solution.u.iter().skip(1)) {
        *u = *planned;
    }
    (u, solution.u[0][0])
}

/// x_N as the program of this `horizon` predicts it.
pub(super) fn predicted_end<
    T: Scalar,
    const NX: usize,
    const NU: usize,
    const NA: usize,
    const NP: usize,
    const M: usize,
>(
    solution: &Solution<T, NA, NU, NP, M>,
    horizon: usize,
) -> SVector<T, NX> {
    // x_1 of the program is (x_0, z), so x_{N+1} of the program is (x_N, z).
    let end = solution.x.get(horizon);
    SVector::from_fn(|i, _| end.and_then(|x| x.get(i)).copied().unwrap_or(T::zero()))
}
