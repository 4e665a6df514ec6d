//! Newton's method for a steady state on given bounds.

use super::{
    Free, Point, SteadyStateProblem, bent, constrained_step, is_settled, rate, rates_of, sizes,
    stands,
};
use crate::model::{LpvModel, Scalar};
use nalgebra::{SVector, convert};

/// Steps at most.
const MOST_STEPS: usize = 50;
/// Steps after which they are halved, and halved again: f may be far from linear.
const PATIENCE: usize = 15;

/// How far steps go.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Steps {
    /// They are taken as long as f hardly bends over them, for beyond there other steady states may be nearer.
    Straight,
    /// They are halved after some, and halved again.
    Halved,
}

/// The steady state nearest to the reference, from `point` on, where the components that are not `free` stay. `None` if it
/// does not converge.
pub(super) fn newton<P, T, const NX: usize, const NU: usize, const NS: usize>(
    model: &P,
    problem: &SteadyStateProblem<T, NX, NU>,
    free: &Free<NX, NU>,
    (mut x, mut u): Point<T, NX, NU>,
    steps: Steps,
) -> Option<Point<T, NX, NU>>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS> + ?Sized,
{
    let one_if = |free: bool| if free { T::one() } else { T::zero() };
    let free: Point<T, NX, NU> = (
        SVector::from_fn(|i, _| one_if(free.x[i])),
        SVector::from_fn(|i, _| one_if(free.u[i])),
    );
    let weights = problem.weights();
    let units = (
        free.0
            .zip_map(&weights.0, |free, weight| free / weight.sqrt()),
        free.1
            .zip_map(&weights.1, |free, weight| free / weight.sqrt()),
    );
    let mut derivatives = rates_of(model, &x, &u);
    let mut f = rate(model, &x, &u);
    for step in 0..MOST_STEPS {
        let towards = (
            (problem.x_ref - x).component_mul(&free.0),
            (-u).component_mul(&free.1),
        );
        let (mut dx, mut du) = constrained_step(f, &derivatives, &units, &towards)?;
        if steps == Steps::Halved {
            let halvings = i32::try_from(step / PATIENCE).unwrap_or(i32::MAX);
            let part = convert::<f64, T>(0.5).powi(halvings);
            (dx, du) = (dx * part, du * part);
        }
        (x, u) = (x + dx, u + du);
        let there = rates_of(model, &x, &u);
        let (before, now) = (f, rate(model, &x, &u));
        let stands = stands(&now, &there.0);
        if stands && is_settled(&dx, &x) && is_settled(&du, &u) {
            return Some((x, u));
        }
        if steps == Steps::Straight && !stands {
            let sizes = sizes(&derivatives.0);
            let off = before.component_div(&sizes).lp_norm(1);
            let straight = bent(&derivatives, &there, &(dx, du), &sizes) <= off * convert(0.5);
            if !straight {
                return None;
            }
        }
        f = now;
        derivatives = there;
    }
    None
}
