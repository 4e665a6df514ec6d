//! The nearest steady state within bounds by a primal-dual interior-point method, with a line search on an exact penalty
//! (Nocedal and Wright, Numerical Optimization, ch. 18 and 19).
//!
//! The distance from the reference has its own curvature and no other: that of f is left to the line search.

use super::{
    Free, Point, SteadyStateProblem, bent, constrained_step, is_settled, rate, rates_of, sizes,
    stands,
};
use crate::model::{LpvModel, Scalar};
use crate::ocp::Bounds;
use nalgebra::{SMatrix, SVector, convert};

/// Steps at most.
const MOST_STEPS: usize = 100;
/// Halvings of a step at most.
const MOST_HALVINGS: usize = 40;
/// Part of the way to the nearest bound that a step goes at most.
const TO_BOUND: f64 = 0.995;
/// Part of the largest weight that the barrier begins with, at least.
const LEAST_BARRIER: f64 = 0.01;
/// The barrier falls by this factor with each step that is not shortened much.
const FALL: f64 = 0.2;
/// Part of the expected fall of the merit that a step has to bring (Armijo's condition).
const SUFFICIENT: f64 = 1e-4;

/// State or input, with its own cost and bounds.
struct Part<T, const K: usize> {
    value: SVector<T, K>,
    goal: SVector<T, K>,
    weights: SVector<T, K>,
    bounds: Bounds<T, K>,
    /// Multipliers of the lower and of the upper bounds.
    multipliers: [SVector<T, K>; 2],
}

/// The method, on its way.
pub(super) struct InteriorPoint<T, const NX: usize, const NU: usize> {
    x: Part<T, NX>,
    u: Part<T, NU>,
    barrier: T,
}

impl<T: Scalar, const NX: usize, const NU: usize> InteriorPoint<T, NX, NU> {
    /// At the point nearest to the reference that is inside the bounds by a part of the room between them.
    pub fn new(problem: &SteadyStateProblem<T, NX, NU>, inside: f64) -> Self {
        let (weights_x, weights_u) = problem.weights();
        let x = Part::new(problem.x_ref, weights_x, problem.x, inside);
        let u = Part::new(SVector::zeros(), weights_u, problem.u, inside);
        // In the unit of the cost: what there is to gain, at the most.
        let cost = (x.value - x.goal).map(|e| e * e).dot(&weights_x);
        let barrier = cost.max(weights_x.amax() * convert(LEAST_BARRIER));
        Self {
            x: x.with_multipliers(barrier),
            u: u.with_multipliers(barrier),
            barrier,
        }
    }

    pub fn point(&self) -> Point<T, NX, NU> {
        (self.x.value, self.u.value)
    }

    /// Goes to the nearest steady state within the bounds; `None` where the end is none.
    pub fn minimise<P, const NS: usize>(mut self, model: &P) -> Option<Self>
    where
        P: LpvModel<T, NX, NU, NS> + ?Sized,
    {
        let last_barrier = self.barrier.min(self.x.weights.amax()) * T::default_epsilon();
        let (x, u) = self.point();
        let (mut f, mut derivatives) = (rate(model, &x, &u), rates_of(model, &x, &u));
        let sizes = sizes(&derivatives.0);
        let size_of = |f: &SVector<T, NX>| f.component_div(&sizes).lp_norm(1);
        let mut price = T::zero();
        for _ in 0..MOST_STEPS {
            let (x, u) = self.point();
            let slopes = (self.x.slope(self.barrier), self.u.slope(self.barrier));
            let bends = (self.x.curvature(), self.u.curvature());
            let units = (self.x.units(&bends.0), self.u.units(&bends.1));
            let towards = (
                -slopes.0.component_mul(&units.0).component_mul(&units.0),
                -slopes.1.component_mul(&units.1).component_mul(&units.1),
            );
            let (dx, du) = constrained_step(f, &derivatives, &units, &towards)?;
            let off = size_of(&f);
            let along = slopes.0.dot(&dx) + slopes.1.dot(&du);
            let bend = bends.0.dot(&dx.component_mul(&dx)) + bends.1.dot(&du.component_mul(&du));
            let half: T = convert(0.5);
            // Above the multipliers, but not above those of long ago.
            price *= half;
            if off > T::zero() {
                price = price.max((along + bend * half) / (off * half * half));
            }
            let fall = (along - price * off).min(T::zero());
            let to_bound = self.x.to_bound(&dx).min(self.u.to_bound(&du));
            let merit = |x: &SVector<T, NX>, u: &SVector<T, NU>, f: &SVector<T, NX>| {
                let cost = self.x.cost(x, self.barrier) + self.u.cost(u, self.barrier);
                cost + price * size_of(f)
            };
            let before = merit(&x, &u, &f);
            let rounding = before.abs() * T::default_epsilon() * convert(10.0);
            // f and its derivatives at the end of a step that is good.
            let end_of = |step: T| {
                let (dx, du) = (dx * step, du * step);
                let (x, u) = (x + dx, u + du);
                let f = rate(model, &x, &u);
                let enough = before + fall * step * convert(SUFFICIENT) + rounding;
                if !(merit(&x, &u, &f) <= enough) {
                    return None;
                }
                let there = rates_of(model, &x, &u);
                // Beyond where f bends away, other steady states are nearer than the one that it leads to.
                let bent = bent(&derivatives, &there, &(dx, du), &sizes) * price;
                (bent <= (price * off + bend * step) * half).then_some((f, there))
            };
            let mut step = to_bound;
            let mut halvings = 0;
            let there = loop {
                if let Some(there) = end_of(step) {
                    break there;
                }
                halvings += 1;
                if halvings > MOST_HALVINGS {
                    return self.end(&f, &derivatives.0);
                }
                step *= half;
            };
            self.x.advance(&dx, step, self.barrier);
            self.u.advance(&du, step, self.barrier);
            (f, derivatives) = there;
            let settled = is_settled(&dx, &self.x.value) && is_settled(&du, &self.u.value);
            if settled && self.barrier <= last_barrier {
                return self.end(&f, &derivatives.0);
            }
            if settled || step >= half {
                self.barrier = (self.barrier * convert(FALL)).max(last_barrier);
            }
        }
        self.end(&f, &derivatives.0)
    }

    /// What it has come to, if the plant stands there, with this f and these derivatives of it.
    fn end(self, f: &SVector<T, NX>, a: &SMatrix<T, NX, NX>) -> Option<Self> {
        stands(f, a).then_some(self)
    }

    /// Which components are not at a bound, and the point with the others on theirs.
    pub fn active(&self) -> (Free<NX, NU>, Point<T, NX, NU>) {
        let (free_x, x) = self.x.active();
        let (free_u, u) = self.u.active();
        (
            Free {
                x: free_x,
                u: free_u,
            },
            (x, u),
        )
    }
}

impl<T: Scalar, const K: usize> Part<T, K> {
    /// At the point nearest to the `goal` that is `inside` the bounds by a part of the room between them, or of a single
    /// bound's size.
    fn new(goal: SVector<T, K>, weights: SVector<T, K>, bounds: Bounds<T, K>, inside: f64) -> Self {
        let inside: T = convert(inside);
        // A goal far beyond a bound asks for the bound, however far; its cost could be too much for the number type.
        let far: T = T::default_epsilon().powf(convert(-1.0 / 3.0));
        let goal = goal.zip_zip_map(&bounds.lower, &bounds.upper, |goal, lower, upper| {
            let beyond = |bound: T| (T::one() + bound.abs()) * far;
            goal.max(lower - beyond(lower)).min(upper + beyond(upper))
        });
        let value = goal.zip_zip_map(&bounds.lower, &bounds.upper, |goal, lower, upper| {
            let room = (upper - lower) * inside;
            let margin = |bound: T| room.min(T::one().max(bound.abs()) * inside);
            let mut value = goal;
            if lower.is_finite() {
                value = value.max(lower + margin(lower));
            }
            if upper.is_finite() {
                value = value.min(upper - margin(upper));
            }
            value
        });
        Self {
            value,
            goal,
            weights,
            bounds,
            multipliers: [SVector::zeros(); 2],
        }
    }

    fn with_multipliers(mut self, barrier: T) -> Self {
        self.multipliers = self
            .slacks(&self.value)
            .map(|slacks| slacks.map(|s| over(barrier, s)));
        self
    }

    /// How far the value is from the lower and from the upper bounds.
    fn slacks(&self, value: &SVector<T, K>) -> [SVector<T, K>; 2] {
        [value - self.bounds.lower, self.bounds.upper - value]
    }

    /// Half the weighted squares of the distance, and the barrier of the bounds.
    fn cost(&self, value: &SVector<T, K>, barrier: T) -> T {
        let half: T = convert(0.5);
        let error = value - self.goal;
        let distance = error.component_mul(&error).dot(&self.weights) * half;
        let slacks = self.slacks(value);
        let logarithms = slacks.iter().flat_map(|slacks| slacks.iter());
        let finite = logarithms.filter(|s| s.is_finite() && **s != T::zero());
        distance - { finite }.fold(T::zero(), |sum, s| sum + s.ln()) * barrier
    }

    /// The slope of that.
    fn slope(&self, barrier: T) -> SVector<T, K> {
        let [lower, upper] = self.slacks(&self.value);
        (self.value - self.goal).component_mul(&self.weights) - lower.map(|s| over(barrier, s))
            + upper.map(|s| over(barrier, s))
    }

    /// Its curvature, with the multipliers in place of what they are going to be.
    fn curvature(&self) -> SVector<T, K> {
        let mut curvature = self.weights;
        for (slacks, multipliers) in self.slacks(&self.value).iter().zip(&self.multipliers) {
            curvature += multipliers.zip_map(slacks, over);
        }
        curvature
    }

    /// The units in which a unit of each component bends the cost by 1; none where it has no room.
    fn units(&self, curvature: &SVector<T, K>) -> SVector<T, K> {
        let room = self.bounds.upper - self.bounds.lower;
        curvature.zip_map(&room, |curvature, room| {
            if room > T::zero() {
                T::one() / curvature.sqrt()
            } else {
                T::zero()
            }
        })
    }

    /// The part of the `step`, up to all of it, with which no bound is come too close to.
    fn to_bound(&self, step: &SVector<T, K>) -> T {
        let [lower, upper] = self.slacks(&self.value);
        longest(&lower, step).min(longest(&upper, &-step))
    }

    /// Goes so much of the `step`, and as much as there can be of that of the multipliers.
    fn advance(&mut self, step: &SVector<T, K>, part: T, barrier: T) {
        let before = self.slacks(&self.value);
        let moves = [*step, -step];
        self.value += step * part;
        let after = self.slacks(&self.value);
        for (k, multipliers) in self.multipliers.iter_mut().enumerate() {
            let change = SVector::from_fn(|i, _| {
                let (slack, z) = (before[k][i], multipliers[i]);
                over(barrier - z * moves[k][i], slack) - z
            });
            let part = longest(multipliers, &change);
            *multipliers += change * part;
            // Never far from the barrier's own.
            for (z, slack) in multipliers.iter_mut().zip(after[k].iter()) {
                let own = over(barrier, *slack);
                *z = z.max(own * convert(1e-8)).min(own * convert(1e8));
            }
        }
    }

    /// Which components are not at a bound, and the value with the others on theirs.
    fn active(&self) -> ([bool; K], SVector<T, K>) {
        let [lower, upper] = self.slacks(&self.value);
        let mut free = [true; K];
        let mut value = self.value;
        for (i, (free, value)) in free.iter_mut().zip(value.iter_mut()).enumerate() {
            let holds = |slack: T, multiplier: T| slack * self.weights[i] <= multiplier;
            if holds(lower[i], self.multipliers[0][i]) {
                (*free, *value) = (false, self.bounds.lower[i]);
            } else if holds(upper[i], self.multipliers[1][i]) {
                (*free, *value) = (false, self.bounds.upper[i]);
            }
        }
        (free, value)
    }
}

/// The part of the `step`, up to all of it, that takes nothing of what is positive beyond most of the way to zero.
fn longest<T: Scalar, const K: usize>(positive: &SVector<T, K>, step: &SVector<T, K>) -> T {
    let mut longest = T::one();
    for (value, step) in positive.iter().zip(step.iter()) {
        if *step < T::zero() && *value > T::zero() && -*step * longest > *value * convert(TO_BOUND)
        {
            longest = *value * convert(TO_BOUND) / -*step;
        }
    }
    longest
}

/// a over b; zero where there is no bound, or no room before it.
fn over<T: Scalar>(a: T, b: T) -> T {
    if b.is_finite() && b > T::zero() {
        a / b
    } else {
        T::zero()
    }
}
