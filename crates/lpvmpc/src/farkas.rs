//! Proof that a problem is infeasible: multipliers under which its hard bounds contradict each
//! other (Farkas' lemma).

use crate::adjoint::Adjoint;
use crate::model::Scalar;
use crate::ocp::Ocp;
use crate::rows;
use crate::solution::{ActiveRow, ActiveSet, BoundId, Part, Quantity, Side};
use crate::solver_settings::default_tolerance;
use nalgebra::{SVector, convert};

/// The sum is known to so many roundings of its terms.
const ROUNDINGS: f64 = 100.0;

/// By how much the hard bounds of `ocp` contradict each other under the multipliers of `proof`, less
/// an estimate of rounding: above zero, no inputs satisfy them all.
///
/// The multiplied violations sum up to a function that is linear in the inputs,
///
/// ```text
/// V(u) = sum of multiplier * violation = constant + sum g_k'u_k
/// ```
///
/// which would be at most zero at a feasible point. The result is its least value over the inputs
/// within their bounds; where an input has no bound, or one of 1e20 or more, its g must vanish, up to
/// eps^(2/3) of its terms. After
/// [`Status::Infeasible`](crate::Status::Infeasible) the solution's active rows are such a proof.
/// A `proof` with a soft bound or a multiplier of the wrong sign proves nothing: minus infinity.
#[inline(never)]
pub fn infeasibility_margin<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    proof: &ActiveSet<T>,
) -> T {
    let nothing: T = convert(f64::NEG_INFINITY);
    // What the multipliers themselves are off by, from the search.
    let rounding: T = default_tolerance();
    // V, the sum of the sizes of its terms, and the largest sum of terms of an entry of g.
    let (mut least, mut size, mut largest) = (T::zero(), T::zero(), T::zero());
    for row in proof.iter().filter(|row| row.multiplier != T::zero()) {
        let equality = row.bound.side == Side::Equality;
        let hard = row.part == Part::Hard && rows::soft_price(ocp, &row.bound).is_none();
        if !(hard && (equality || row.multiplier >= T::zero())) {
            return nothing;
        }
        let (lower, upper) = rows::limits(ocp, &row.bound);
        let term = match row.bound.side {
            Side::Lower | Side::Equality => row.multiplier * lower,
            Side::Upper => -(row.multiplier * upper),
        };
        least += term;
        size += term.abs();
    }
    let mut adjoint = Adjoint::new(ocp, None, proof);
    while let Some(at) = adjoint.step(proof) {
        let Some(stage) = ocp.stages.get(at.stage) else {
            continue;
        };
        let bounds = &ocp.common_at(at.stage).u;
        let (sum, sizes) = sum_and_size(&stage.c, &at.costate);
        least += sum;
        size += sizes;
        let terms = at.dynamics + at.rows.abs();
        for (j, (slope, terms)) in at.gradient.iter().zip(terms.iter()).enumerate() {
            let limit = if *slope > T::zero() {
                bounds.lower[j]
            } else {
                bounds.upper[j]
            };
            largest = largest.max(*terms);
            if rows::is_limit(limit) {
                least += *slope * limit;
                size += *terms * limit.abs();
            } else if !(slope.abs() <= rounding * largest) {
                return nothing;
            }
        }
    }
    let (sum, sizes) = sum_and_size(&ocp.x0, &adjoint.costate);
    least += sum;
    size += sizes;
    least - T::default_epsilon() * convert(ROUNDINGS) * size
}

/// Lists in a `proof` the bounds of inputs that it rests on, each with the multiplier that makes the sum of the violations no
/// longer depend on that input, as far as there are places. By how much the bounds contradict each other stays the same.
pub(crate) fn list_input_bounds<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    proof: &mut ActiveSet<T>,
) {
    let rounding: T = default_tolerance();
    let mut largest = T::zero();
    let mut adjoint = Adjoint::new(ocp, None, proof);
    while let Some(at) = adjoint.step(proof) {
        let terms = at.dynamics + at.rows.abs();
        for (j, (slope, terms)) in at.gradient.iter().zip(terms.iter()).enumerate() {
            largest = largest.max(*terms);
            let side = if *slope > T::zero() {
                Side::Lower
            } else {
                Side::Upper
            };
            let bound = BoundId {
                stage: at.stage,
                quantity: Quantity::Input(j),
                side,
            };
            if slope.abs() > rounding * largest {
                proof.push(ActiveRow {
                    bound,
                    part: Part::Hard,
                    multiplier: slope.abs(),
                    exceeded: false,
                });
            }
        }
    }
}

/// a'b, and the sum of the sizes of its terms.
#[inline(never)]
fn sum_and_size<T: Scalar, const K: usize>(a: &SVector<T, K>, b: &SVector<T, K>) -> (T, T) {
    let terms = a.iter().zip(b.iter()).map(|(a, b)| *a * *b);
    terms.fold((T::zero(), T::zero()), |(sum, size), term| {
        (sum + term, size + term.abs())
    })
}
