//! Plans on the nonlinear model: their rollout as policies, cost and feasibility.

use super::GuardedController;
use super::aim::SetPoints;
use crate::model::{LpvModel, Scalar};
use crate::ocp::Bounds;
use crate::policy::input_at;
use crate::predictor::Rk4;
use nalgebra::{SMatrix, SVector, convert};

/// Inputs with the states that the nonlinear model reaches under them, and the feedback with which
/// they are followed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plan<T, const NX: usize, const NU: usize, const N: usize> {
    /// x_0.
    pub start: SVector<T, NX>,
    /// u_0 to u_{N-1}; what lies beyond the horizon is zero.
    pub u: [SVector<T, NU>; N],
    /// x_1 to x_N; what lies beyond the horizon is zero.
    pub x: [SVector<T, NX>; N],
    /// K_0 to K_{N-1}: at the state x, stage i has the input u_i + K_i (x - x_i).
    pub gain: [SMatrix<T, NU, NX>; N],
    /// The largest values of the states from sample to sample, at the Runge-Kutta steps.
    pub highest: [SVector<T, NX>; N],
    /// The smallest ones.
    pub lowest: [SVector<T, NX>; N],
    /// How far the plant may be from x_1 to x_N when it follows the plan to there.
    pub drift: [SVector<T, NX>; N],
    /// The same at the end, in the norm of P.
    pub end_drift: T,
    /// x_N at the end of the horizon.
    pub end: SVector<T, NX>,
    /// z: the plan ends near z d.
    pub set_point: T,
    /// Cost, the offset from the wanted set point included.
    pub cost: T,
}

/// What is rolled out: inputs about planned states, with feedback towards them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Policy<T, const NX: usize, const NU: usize, const N: usize> {
    /// x_0 to x_{N-1}.
    pub x: [SVector<T, NX>; N],
    /// u_0 to u_{N-1}.
    pub u: [SVector<T, NU>; N],
    /// K_0 to K_{N-1}.
    pub gain: [SMatrix<T, NU, NX>; N],
}

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
    /// (x - z d)'P (x - z d)
    pub(super) fn terminal_value(&self, x: &SVector<T, NX>, set_point: T) -> T {
        let error = x - self.settings.direction * set_point;
        (self.settings.terminal.p * error).dot(&error)
    }

    /// The rest of `last` from the measured state, ended by the terminal law.
    pub(super) fn rest(
        &self,
        x0: &SVector<T, NX>,
        last: &Plan<T, NX, NU, N>,
        aims: &SetPoints<T, N>,
    ) -> Plan<T, NX, NU, N> {
        let end = self.settings.horizon - 1;
        let planned = last.x.iter().zip(last.u.iter().zip(&last.gain).skip(1));
        let mut planned = planned.take(end);
        let mut plan = self.simulate(x0, |x| match planned.next() {
            Some((x_planned, (u, gain))) => {
                (input_at(x, (x_planned, u), gain, &self.settings.u), *gain)
            }
            None => self.terminal_law(x, last.set_point),
        });
        (plan.drift, plan.end_drift) = (last.drift, last.end_drift);
        self.aimed_as_surely(x0, plan, last.set_point, aims)
    }

    /// The rollout `plan`, which ended in the terminal set around `near`, with its best set point.
    /// Its end may lie as near to the edge of the set as it did.
    fn aimed_as_surely(
        &self,
        x0: &SVector<T, NX>,
        plan: Plan<T, NX, NU, N>,
        near: T,
        aims: &SetPoints<T, N>,
    ) -> Plan<T, NX, NU, N> {
        let level = self.settings.terminal.level;
        let edge = self.terminal_value(&plan.end, near).min(level);
        let almost = self.almost(self.end_drift);
        self.aimed(x0, plan, near, edge.max(almost), aims)
    }

    /// The whole of `last` once more, from where the plant has gone since: the best plan of a plant
    /// that is on its way changes little from sample to sample, but for the place.
    pub(super) fn repeated(
        &self,
        x0: &SVector<T, NX>,
        last: &Plan<T, NX, NU, N>,
        aims: &SetPoints<T, N>,
    ) -> Plan<T, NX, NU, N> {
        let d = &self.settings.direction;
        let gone = (x0 - last.start).dot(d) / d.norm_squared();
        let states = core::iter::once(&last.start).chain(&last.x);
        let mut stages = states.zip(last.u.iter().zip(&last.gain));
        let plan = self.simulate(x0, |x| match stages.next() {
            Some((x_planned, (u, gain))) => {
                let u = input_at(x, (&(x_planned + d * gone), u), gain, &self.settings.u);
                (u, *gain)
            }
            None => (SVector::zeros(), SMatrix::zeros()),
        });
        let level = self.almost(self.end_drift);
        let mut plan = self.aimed(x0, plan, last.set_point + gone, level, aims);
        (plan.drift, plan.end_drift) = (last.drift, last.end_drift);
        plan
    }

    /// The terminal value that a new plan may reach when the plant ends as far from it as from a plan
    /// with this `end_drift`.
    fn almost(&self, end_drift: T) -> T {
        let radius = self.settings.terminal.level.sqrt();
        let inside = radius * (T::one() - self.settings.margin * convert::<f64, T>(0.5));
        let inside = inside - self.reserve(end_drift);
        inside * inside
    }

    /// What is left free at the edge of the terminal set for a drift such as this one.
    pub(super) fn reserve(&self, end_drift: T) -> T {
        let most = self.settings.terminal.level.sqrt() * convert::<f64, T>(0.2);
        (end_drift * convert::<f64, T>(1.2)).min(most)
    }

    /// The plan that follows the terminal law around the admissible set point nearest to `x`.
    pub(super) fn under_terminal_law(
        &self,
        x: &SVector<T, NX>,
        aims: &SetPoints<T, N>,
    ) -> Plan<T, NX, NU, N> {
        let d = &self.settings.direction;
        let weighted = self.settings.terminal.p * d;
        let nearest = weighted.dot(x) / weighted.dot(d);
        let [lower, upper] = self.settings.set_points;
        let set_point = nearest.max(lower).min(upper);
        let plan = self.simulate(x, |x| self.terminal_law(x, set_point));
        self.aimed_as_surely(x, plan, set_point, aims)
    }

    /// The terminal law around the set point, cut off at the input bounds, and its gain.
    fn terminal_law(
        &self,
        x: &SVector<T, NX>,
        set_point: T,
    ) -> (SVector<T, NU>, SMatrix<T, NU, NX>) {
        let gain = -self.settings.terminal.gain;
        let origin = self.settings.direction * set_point;
        let u = input_at(x, (&origin, &SVector::zeros()), &gain, &self.settings.u);
        (u, gain)
    }

    /// The plan of a policy that lies a `fraction` of the way from `along` to `towards`.
    pub(super) fn between(
        &self,
        x0: &SVector<T, NX>,
        aims: &SetPoints<T, N>,
        along: &Plan<T, NX, NU, N>,
        towards: &Policy<T, NX, NU, N>,
        fraction: T,
    ) -> Plan<T, NX, NU, N> {
        let from = core::iter::once(x0).chain(&along.x).zip(&along.u);
        let to = towards.x.iter().zip(&towards.u).zip(&towards.gain);
        let mut stages = from.zip(to);
        let plan = self.simulate(x0, |x| match stages.next() {
            Some(((x_from, u_from), ((x_to, u_to), gain))) => {
                let x_planned = x_from + (x_to - x_from) * fraction;
                let u_planned = u_from + (u_to - u_from) * fraction;
                let u = input_at(x, (&x_planned, &u_planned), gain, &self.settings.u);
                (u, *gain)
            }
            None => (SVector::zeros(), SMatrix::zeros()),
        });
        let level = self.almost(self.end_drift);
        self.aimed(x0, plan, along.set_point, level, aims)
    }

    /// The rollout under `input`, which gives the input and the gain at each stage's state.
    fn simulate(
        &self,
        x0: &SVector<T, NX>,
        mut input: impl FnMut(&SVector<T, NX>) -> (SVector<T, NU>, SMatrix<T, NU, NX>),
    ) -> Plan<T, NX, NU, N> {
        let settings = &self.settings;
        let mut plan = Plan {
            start: *x0,
            u: [SVector::zeros(); N],
            x: [SVector::zeros(); N],
            gain: [SMatrix::zeros(); N],
            highest: [SVector::zeros(); N],
            lowest: [SVector::zeros(); N],
            drift: [SVector::zeros(); N],
            end_drift: T::zero(),
            end: *x0,
            set_point: T::zero(),
            cost: T::zero(),
        };
        let places = plan.u.iter_mut().zip(&mut plan.gain).zip(&mut plan.x);
        let extremes = plan.highest.iter_mut().zip(&mut plan.lowest);
        let substeps = settings.rollout.rk4.substeps;
        let step = settings.t_s / convert::<f64, T>(substeps as f64);
        for (((u, gain), x_next), (highest, lowest)) in places.zip(extremes).take(settings.horizon)
        {
            (*u, *gain) = input(&plan.end);
            (*highest, *lowest) = (plan.end, plan.end);
            for _ in 0..substeps {
                plan.end = Rk4 { substeps: 1 }.advance(&self.model, &plan.end, u, step);
                *highest = highest.sup(&plan.end);
                *lowest = lowest.inf(&plan.end);
            }
            *x_next = plan.end;
        }
        plan
    }

    /// The rollout `plan` with the admissible set point that is best for it, and its cost. The cost
    /// is quadratic in z; the set points from which the end lies within `level` are an interval. Where there is
    /// none, that of the smallest terminal value.
    fn aimed(
        &self,
        x0: &SVector<T, NX>,
        mut plan: Plan<T, NX, NU, N>,
        near: T,
        level: T,
        aims: &SetPoints<T, N>,
    ) -> Plan<T, NX, NU, N> {
        let settings = &self.settings;
        let d = &settings.direction;
        let changes = aims.before_last_change(settings.horizon);
        // Relative to a set point nearby: far from zero, squares would leave no digits.
        let origin = d * near;
        let q_d = settings.weights.q * d;
        let p_d = settings.terminal.p * d;
        let stiffness = p_d.dot(d);
        let states = core::iter::once(x0).chain(&plan.x).take(settings.horizon);
        let pull = states
            .skip(changes)
            .fold(T::zero(), |sum, x| sum + q_d.dot(&(x - origin)));
        let end = plan.end - origin;
        let centre = p_d.dot(&end);
        let weight = settings.offset_weight;
        let stages = convert::<f64, T>((settings.horizon - changes) as f64);
        let best = (pull + centre - weight * (near - aims.end))
            / (stages * q_d.dot(d) + stiffness + weight);
        let middle = centre / stiffness;
        let value = (settings.terminal.p * end).dot(&end);
        // Not quite to the edge: rounding would put every second end beyond it.
        let within = level * (T::one() - T::default_epsilon().sqrt());
        let room = (within - value) / stiffness + middle * middle;
        let room = if room > T::zero() {
            room.sqrt()
        } else {
            T::zero()
        };
        let [lower, upper] = settings.set_points;
        let move_by = best.max(middle - room).min(middle + room);
        plan.set_point = (near + move_by).max(lower).min(upper);
        // An end that lies nearer to the edge than that keeps its set point.
        let [there, here] = [plan.set_point, near].map(|z| self.terminal_value(&plan.end, z));
        if there > level && here <= there {
            plan.set_point = near;
        }
        plan.cost = self.cost(x0, &plan, aims, changes);
        plan
    }

    /// The plan's cost for the given aims, whose first `changes` stages come before the last change.
    fn cost(
        &self,
        x0: &SVector<T, NX>,
        plan: &Plan<T, NX, NU, N>,
        aims: &SetPoints<T, N>,
        changes: usize,
    ) -> T {
        let settings = &self.settings;
        let offset = plan.set_point - aims.end;
        let mut cost = settings.offset_weight * offset * offset;
        let states = core::iter::once(x0).chain(&plan.x);
        let stages = states.zip(plan.u.iter().zip(&aims.stages)).enumerate();
        for (i, (x, (u, wanted))) in stages.take(settings.horizon) {
            let aim = if i < changes { *wanted } else { plan.set_point };
            let error = x - settings.direction * aim;
            cost += (settings.weights.q * error).dot(&error);
            cost += (settings.weights.r * *u).dot(u);
        }
        cost + self.terminal_value(&plan.end, plan.set_point)
    }

    /// Whether the plan keeps all bounds, between the samples, too, and ends in the terminal set;
    /// false for numbers that are none.
    pub(super) fn is_feasible(&self, plan: &Plan<T, NX, NU, N>) -> bool {
        let none = core::iter::repeat(SVector::zeros());
        self.holds(plan, none, T::zero(), T::zero())
    }

    /// Whether it does so wherever the plant can be that follows it.
    pub(super) fn is_robust(&self, plan: &Plan<T, NX, NU, N>) -> bool {
        // A sample begins as far from the plan as the one before ends.
        let before = core::iter::once(SVector::zeros()).chain(plan.drift);
        let drift = before
            .zip(&plan.drift)
            .map(|(before, after)| before.sup(after));
        let rounding = self.settings.margin * convert::<f64, T>(0.01);
        self.holds(plan, drift, plan.end_drift, rounding)
    }

    /// Whether the plan keeps away from all bounds by `drift` and `margin` times their width.
    fn holds(
        &self,
        plan: &Plan<T, NX, NU, N>,
        drift: impl Iterator<Item = SVector<T, NX>>,
        end_drift: T,
        margin: T,
    ) -> bool {
        let settings = &self.settings;
        let x = shrunk(&settings.x, margin);
        let [lower, upper] = settings.set_points;
        let reached = self.terminal_value(&plan.end, plan.set_point).sqrt() + end_drift;
        let level = settings.terminal.level * (T::one() - margin);
        let between = settings.rollout.between;
        let extremes = plan.highest.iter().zip(&plan.lowest).zip(drift);
        let mut extremes = extremes.take(settings.horizon);
        let mut inputs = plan.u.iter().take(settings.horizon);
        // Where nothing drifts, the end is compared as it is: a root rounds.
        let inside = if end_drift > T::zero() {
            reached * reached <= level
        } else {
            self.terminal_value(&plan.end, plan.set_point) <= level
        };
        plan.cost.is_finite()
            && extremes.all(|((highest, lowest), drift)| {
                let room = between + drift;
                x.hold_at(&(highest + room)) && x.hold_at(&(lowest - room))
            })
            && inputs.all(|u| settings.u.contains(u, T::zero()))
            && plan.set_point >= lower
            && plan.set_point <= upper
            && inside
    }

    /// Cost and price of what a plan exceeds, by which plans are compared while none is feasible.
    pub(super) fn merit(&self, plan: &Plan<T, NX, NU, N>) -> T {
        let settings = &self.settings;
        let bounds = shrunk(&settings.x, settings.margin);
        let width = width(&settings.x);
        let mut excess = T::zero();
        let extremes = plan.highest.iter().zip(&plan.lowest);
        for (highest, lowest) in extremes.take(settings.horizon) {
            let over = (highest - bounds.upper).sup(&(bounds.lower - lowest));
            for (over, width) in over.iter().zip(width.iter()) {
                if *over > T::zero() && *width > T::zero() {
                    excess += *over / *width;
                }
            }
        }
        let reached = self.terminal_value(&plan.end, plan.set_point) / settings.terminal.level;
        let outside = (reached.sqrt() - T::one()).max(T::zero());
        plan.cost + settings.soft_price * (excess + outside)
    }
}

/// The bounds, each moved inwards by `margin` times the width of the pair (times its own size
/// where the other one is infinite).
pub(super) fn shrunk<T: Scalar, const K: usize>(bounds: &Bounds<T, K>, margin: T) -> Bounds<T, K> {
    let width = width(bounds) * margin;
    Bounds {
        lower: bounds.lower + width,
        upper: bounds.upper - width,
    }
}

/// Width of each pair of bounds; the size of the finite one where the other is not; 0 without.
pub(super) fn width<T: Scalar, const K: usize>(bounds: &Bounds<T, K>) -> SVector<T, K> {
    bounds.lower.zip_map(&bounds.upper, |lower, upper| {
        let whole = upper - lower;
        if whole.is_finite() {
            return whole;
        }
        let finite = [lower, upper].into_iter().filter(|side| side.is_finite());
        finite.fold(convert(0.0), |size: T, side| size.max(side.abs()))
    })
}
