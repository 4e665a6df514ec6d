//! Plans on the nonlinear model: their rollout as policies, cost and feasibility.

use super::least_cost::LeastCost;
use super::{GuaranteedSettings, Planner};
use crate::list::List;
use crate::model::{LpvModel, Scalar};
use crate::ocp::Bounds;
use crate::policy::input_at;
use crate::working_set::copy;
use nalgebra::{SMatrix, SVector, convert};

/// Inputs with the states that the nonlinear model reaches under them, and the feedback with which
/// they are followed.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub(super) struct Plan<T: 'static, const NX: usize, const NU: usize> {
    /// x_0.
    pub start: SVector<T, NX>,
    /// The samples of the horizon.
    pub stages: List<PlannedStage<T, NX, NU>>,
    /// How far the plant may be from x_N when it follows the plan to there, in the norm of P.
    pub end_drift: T,
    /// x_N.
    pub end: SVector<T, NX>,
    /// z: the plan ends near z d.
    pub set_point: T,
    /// Cost, the offset from the wanted set point included.
    pub cost: T,
    /// Whether the states are another plan's, moved, instead of a rollout.
    pub estimated: bool,
}

/// Sample i of a plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlannedStage<T, const NX: usize, const NU: usize> {
    /// u_i.
    pub u: SVector<T, NU>,
    /// K_i: at the state x, the input is u_i + K_i (x - x_i).
    pub feedback: SMatrix<T, NU, NX>,
    /// x_{i+1}.
    pub x: SVector<T, NX>,
    /// The largest values of the states in the sample, at the Runge-Kutta steps.
    pub highest: SVector<T, NX>,
    /// The smallest ones.
    pub lowest: SVector<T, NX>,
    /// How far the plant may be from x_{i+1} when it follows the plan to there.
    pub drift: SVector<T, NX>,
}

impl<T: Scalar, const NX: usize, const NU: usize> PlannedStage<T, NX, NU> {
    pub fn zeros() -> Self {
        Self {
            u: SVector::zeros(),
            feedback: SMatrix::zeros(),
            x: SVector::zeros(),
            highest: SVector::zeros(),
            lowest: SVector::zeros(),
            drift: SVector::zeros(),
        }
    }
}

impl<T: Scalar, const NX: usize, const NU: usize> Plan<T, NX, NU> {
    /// A plan of nothing yet.
    pub fn new(stages: List<PlannedStage<T, NX, NU>>) -> Self {
        Self {
            start: SVector::zeros(),
            stages,
            end_drift: T::zero(),
            end: SVector::zeros(),
            set_point: T::zero(),
            cost: T::zero(),
            estimated: false,
        }
    }

    /// x_0 to x_N.
    pub fn states(&self) -> impl Iterator<Item = &SVector<T, NX>> + Clone {
        core::iter::once(&self.start).chain(self.stages.iter().map(|stage| &stage.x))
    }

    pub fn copy_from(&mut self, other: &Self) {
        copy(&mut self.stages, &other.stages);
        self.start = other.start;
        self.end_drift = other.end_drift;
        self.end = other.end;
        self.set_point = other.set_point;
        self.cost = other.cost;
        self.estimated = other.estimated;
    }

    /// Takes over how far the plant may be from the plan `last`.
    pub(super) fn drift_as(&mut self, last: &Self) {
        for (stage, last) in self.stages.iter_mut().zip(&last.stages) {
            stage.drift = last.drift;
        }
        self.end_drift = last.end_drift;
    }
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Planner<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// (x - z d)'P (x - z d)
    pub(super) fn terminal_value(&self, x: &SVector<T, NX>, set_point: T) -> T {
        let error = x - self.settings.direction * set_point;
        (self.settings.terminal.p * error).dot(&error)
    }

    /// Gives a rollout that ended in the terminal set around `near` its best set point. Its end may lie
    /// as near to the edge of the set as it did.
    pub(super) fn aim_as_surely(&self, plan: &mut Plan<T, NX, NU>, near: T) {
        let level = self.settings.terminal.level;
        let edge = self.terminal_value(&plan.end, near).min(level);
        let almost = self.almost(self.end_drift);
        self.aim(plan, near, edge.max(almost));
    }

    /// `plan` becomes the whole of `last` once more, from where the plant has gone since, unless that
    /// leaves the bounds or costs more than `most`: the best plan of a plant that is on its way changes little from sample to
    /// sample, but for the place.
    pub(super) fn repeat(
        &self,
        x0: &SVector<T, NX>,
        last: &Plan<T, NX, NU>,
        most: T,
        plan: &mut Plan<T, NX, NU>,
    ) {
        let d = &self.settings.direction;
        let gone = self.gone(x0, last);
        let mut stages = last.states().zip(&last.stages);
        let near = last.set_point + gone;
        let whole = self.simulate(x0, plan, Some((near, most)), |x| match stages.next() {
            Some((x_planned, PlannedStage { u, feedback, .. })) => {
                let planned = (&(x_planned + d * gone), u);
                (input_at(x, planned, feedback, &self.settings.u), *feedback)
            }
            None => (SVector::zeros(), SMatrix::zeros()),
        });
        if whole {
            self.aim(plan, near, self.almost(self.end_drift));
            plan.drift_as(last);
        }
    }

    /// How far along the direction the plant has gone since `last` was made.
    fn gone(&self, x0: &SVector<T, NX>, last: &Plan<T, NX, NU>) -> T {
        let d = &self.settings.direction;
        (x0 - last.start).dot(d) / d.norm_squared()
    }

    /// Whether the plan `last` ends farther from what is wanted than its terminal set reaches. Where it does not, the
    /// plant arrives, and the same plan once more would shoot past.
    pub(super) fn is_under_way(&self, last: &Plan<T, NX, NU>) -> bool {
        let GuaranteedSettings {
            terminal,
            direction,
            ..
        } = &self.settings;
        (last.set_point - self.aims.end).abs() > terminal.extent(direction)
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

    /// `plan` becomes the one that follows the terminal law around the admissible set point nearest to
    /// `x`.
    pub(super) fn follow_terminal_law(&self, x: &SVector<T, NX>, plan: &mut Plan<T, NX, NU>) {
        let d = &self.settings.direction;
        let weighted = self.settings.terminal.p * d;
        let nearest = weighted.dot(x) / weighted.dot(d);
        let [lower, upper] = self.settings.set_points;
        let set_point = nearest.max(lower).min(upper);
        self.simulate(x, plan, None, |x| self.terminal_law(x, set_point));
        self.aim_as_surely(plan, set_point);
    }

    /// The terminal law around the set point, cut off at the input bounds, and its feedback matrix.
    pub(super) fn terminal_law(
        &self,
        x: &SVector<T, NX>,
        set_point: T,
    ) -> (SVector<T, NU>, SMatrix<T, NU, NX>) {
        let feedback = -self.settings.terminal.gain;
        let origin = self.settings.direction * set_point;
        let u = input_at(x, (&origin, &SVector::zeros()), &feedback, &self.settings.u);
        (u, feedback)
    }

    /// `plan` becomes that of a policy that lies a `fraction` of the way from `along` to `towards`, planned
    /// states, inputs and feedback matrices from stage 0 on; with the `most` that it may cost, unless it costs
    /// more or leaves the bounds.
    pub(super) fn go_between(
        &self,
        along: &Plan<T, NX, NU>,
        towards: impl Iterator<Item = (SVector<T, NX>, SVector<T, NU>, SMatrix<T, NU, NX>)>,
        fraction: T,
        most: Option<T>,
        plan: &mut Plan<T, NX, NU>,
    ) {
        let from = along
            .states()
            .zip(along.stages.iter().map(|stage| &stage.u));
        let mut stages = from.zip(towards);
        let most = most.map(|most| (along.set_point, most));
        let whole = self.simulate(&along.start, plan, most, |x| match stages.next() {
            Some(((x_from, u_from), (x_to, u_to, feedback))) => {
                let x_planned = x_from + (x_to - x_from) * fraction;
                let u_planned = u_from + (u_to - u_from) * fraction;
                let u = input_at(x, (&x_planned, &u_planned), &feedback, &self.settings.u);
                (u, feedback)
            }
            None => (SVector::zeros(), SMatrix::zeros()),
        });
        if whole {
            self.aim(plan, along.set_point, self.almost(self.end_drift));
        }
    }

    /// `plan` becomes the rollout under `input`, which gives the input and the feedback matrix at each
    /// stage's state. With a set point nearby and the `most` that it may cost, it ends, and the answer is
    /// `false`, where every plan that begins like this costs more or leaves the bounds.
    pub(super) fn simulate(
        &self,
        x0: &SVector<T, NX>,
        plan: &mut Plan<T, NX, NU>,
        most: Option<(T, T)>,
        mut input: impl FnMut(&SVector<T, NX>) -> (SVector<T, NU>, SMatrix<T, NU, NX>),
    ) -> bool {
        let settings = &self.settings;
        let mut x = *x0;
        let mut least = most.map(|(near, most)| {
            let least = LeastCost::new(settings, &self.aims, near);
            (least, most)
        });
        for (i, stage) in plan.stages.iter_mut().enumerate() {
            let (u, feedback) = input(&x);
            if let Some((least, most)) = &mut least {
                least.add(i, &x, &u);
                if least.value() > *most {
                    plan.cost = convert(f64::INFINITY);
                    return false;
                }
            }
            *stage = self.sample(&x, u, feedback);
            x = stage.x;
            if most.is_some() && !self.keeps(&settings.x, stage, &SVector::zeros()) {
                plan.cost = convert(f64::INFINITY);
                return false;
            }
        }
        (plan.start, plan.end, plan.end_drift) = (*x0, x, T::zero());
        plan.estimated = false;
        true
    }

    /// The rollout of a sample from `x` under `u`.
    // Not inlined, so that the loop has the registers for itself.
    #[inline(never)]
    pub(super) fn sample(
        &self,
        x: &SVector<T, NX>,
        u: SVector<T, NU>,
        feedback: SMatrix<T, NU, NX>,
    ) -> PlannedStage<T, NX, NU> {
        let GuaranteedSettings { rollout, t_s, .. } = &self.settings;
        let (mut highest, mut lowest) = (*x, *x);
        let follow = |x: &SVector<T, NX>| (highest, lowest) = (highest.sup(x), lowest.inf(x));
        let x = rollout
            .rk4
            .advance_through(&self.model, x, &u, *t_s, follow);
        PlannedStage {
            u,
            feedback,
            x,
            highest,
            lowest,
            drift: SVector::zeros(),
        }
    }

    /// Gives the rollout `plan` the admissible set point that is best for it, and its cost. The cost
    /// is quadratic in z; the set points from which the end lies within `level` are an interval. Where
    /// there is none, that of the smallest terminal value.
    fn aim(&self, plan: &mut Plan<T, NX, NU>, near: T, level: T) {
        let (settings, aims) = (&self.settings, &self.aims);
        let d = &settings.direction;
        // Relative to a set point nearby: far from zero, squares would leave no digits.
        let origin = d * near;
        let q_d = settings.weights.q * d;
        let p_d = settings.terminal.p * d;
        let stiffness = p_d.dot(d);
        let states = plan.states().take(plan.stages.len());
        let pull = states
            .skip(aims.changes)
            .fold(T::zero(), |sum, x| sum + q_d.dot(&(x - origin)));
        let end = plan.end - origin;
        let centre = p_d.dot(&end);
        let weight = settings.offset_weight;
        let stages = convert::<f64, T>((plan.stages.len() - aims.changes) as f64);
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
        plan.cost = self.cost(plan);
    }

    /// Aims at what was `wanted` before, if anything else was since, and gives the `plan` its cost for it.
    pub(super) fn aim_again(&mut self, wanted: Option<(T, usize)>, plan: &mut Plan<T, NX, NU>) {
        if let Some(wanted) = wanted {
            self.aims.go_on(wanted);
            plan.cost = self.cost(plan);
        }
    }

    /// The plan's cost for what it is aimed at.
    pub(super) fn cost(&self, plan: &Plan<T, NX, NU>) -> T {
        let (settings, aims) = (&self.settings, &self.aims);
        let offset = plan.set_point - aims.end;
        let mut cost = settings.offset_weight * offset * offset;
        let stages = plan.stages.iter().zip(&aims.stages);
        for (i, (x, (PlannedStage { u, .. }, wanted))) in plan.states().zip(stages).enumerate() {
            let aim = if i < aims.changes {
                *wanted
            } else {
                plan.set_point
            };
            let error = x - settings.direction * aim;
            cost += (settings.weights.q * error).dot(&error);
            cost += (settings.weights.r * *u).dot(u);
        }
        cost + self.terminal_value(&plan.end, plan.set_point)
    }

    /// Whether the plan keeps all bounds, between the samples, too, and ends in the terminal set;
    /// false for numbers that are none.
    pub(super) fn is_feasible(&self, plan: &Plan<T, NX, NU>) -> bool {
        let none = core::iter::repeat(SVector::zeros());
        self.holds(plan, none, T::zero(), T::zero())
    }

    /// Whether it does so wherever the plant can be that follows it.
    pub(super) fn is_robust(&self, plan: &Plan<T, NX, NU>) -> bool {
        // A sample begins as far from the plan as the one before ends.
        let after = plan.stages.iter().map(|stage| stage.drift);
        let before = core::iter::once(SVector::zeros()).chain(after.clone());
        let drift = before.zip(after).map(|(before, after)| before.sup(&after));
        self.holds(plan, drift, plan.end_drift, self.rounding())
    }

    /// The same, and how far from `plan` that is, as far as it has to be known.
    pub(super) fn becomes_robust(&mut self, plan: &mut Plan<T, NX, NU>) -> bool {
        let x = shrunk(&self.settings.x, self.rounding());
        self.find_drift_while(plan, |planner, stage, before| {
            planner.keeps(&x, stage, &before.sup(&stage.drift))
        }) && self.is_robust(plan)
    }

    /// The part of the bounds' width that new plans keep away from them for rounding.
    fn rounding(&self) -> T {
        self.settings.margin * convert::<f64, T>(0.01)
    }

    /// Whether a sample keeps away from the bounds `x` by `drift`, between the Runge-Kutta steps, too.
    fn keeps(
        &self,
        x: &Bounds<T, NX>,
        stage: &PlannedStage<T, NX, NU>,
        drift: &SVector<T, NX>,
    ) -> bool {
        let room = self.settings.rollout.between + drift;
        x.hold_at(&(stage.highest + room)) && x.hold_at(&(stage.lowest - room))
    }

    /// Whether the plan keeps away from all bounds by `drift` and `margin` times their width.
    fn holds(
        &self,
        plan: &Plan<T, NX, NU>,
        drift: impl Iterator<Item = SVector<T, NX>>,
        end_drift: T,
        margin: T,
    ) -> bool {
        let settings = &self.settings;
        let x = shrunk(&settings.x, margin);
        let [lower, upper] = settings.set_points;
        let reached = self.terminal_value(&plan.end, plan.set_point).sqrt() + end_drift;
        let level = settings.terminal.level * (T::one() - margin);
        // Where nothing drifts, the end is compared as it is: a root rounds.
        let inside = if end_drift > T::zero() {
            reached * reached <= level
        } else {
            self.terminal_value(&plan.end, plan.set_point) <= level
        };
        plan.cost.is_finite()
            && plan
                .stages
                .iter()
                .zip(drift)
                .all(|(stage, drift)| self.keeps(&x, stage, &drift))
            && plan
                .stages
                .iter()
                .all(|stage| settings.u.contains(&stage.u, T::zero()))
            && plan.set_point >= lower
            && plan.set_point <= upper
            && inside
    }

    /// Cost and price of what a plan exceeds, by which plans are compared while none is feasible.
    pub(super) fn merit(&self, plan: &Plan<T, NX, NU>) -> T {
        let settings = &self.settings;
        let bounds = shrunk(&settings.x, settings.margin);
        let width = width(&settings.x);
        let mut excess = T::zero();
        for stage in &plan.stages {
            let over = (stage.highest - bounds.upper).sup(&(bounds.lower - stage.lowest));
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
