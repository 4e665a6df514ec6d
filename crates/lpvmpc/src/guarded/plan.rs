//! Plans on the nonlinear model: their rollout, cost and feasibility.

use super::GuardedController;
use crate::model::{LpvModel, Scalar};
use crate::ocp::Bounds;
use nalgebra::{SVector, convert};

/// Inputs with the states that the nonlinear model reaches under them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plan<T, const NX: usize, const NU: usize, const N: usize> {
    /// u_0 to u_{N-1}; what lies beyond the horizon is zero.
    pub u: [SVector<T, NU>; N],
    /// x_1 to x_N; what lies beyond the horizon is zero.
    pub x: [SVector<T, NX>; N],
    /// x_N at the end of the horizon.
    pub end: SVector<T, NX>,
    /// z: the plan ends near z d.
    pub set_point: T,
    /// Cost, the offset from the wanted set point included.
    pub cost: T,
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
    /// The terminal law around the set point, cut off at the input bounds.
    pub(super) fn terminal_law(&self, x: &SVector<T, NX>, set_point: T) -> SVector<T, NU> {
        let error = x - self.settings.direction * set_point;
        self.settings
            .u
            .project(&-(self.settings.terminal.gain * error))
    }

    /// (x - z d)'P (x - z d)
    pub(super) fn terminal_value(&self, x: &SVector<T, NX>, set_point: T) -> T {
        let error = x - self.settings.direction * set_point;
        (self.settings.terminal.p * error).dot(&error)
    }

    /// The plan of the given inputs.
    pub(super) fn roll_out(
        &self,
        x0: &SVector<T, NX>,
        u: [SVector<T, NU>; N],
        set_point: T,
        wanted: T,
    ) -> Plan<T, NX, NU, N> {
        let mut inputs = u.iter();
        self.simulate(x0, set_point, wanted, |_| {
            inputs.next().copied().unwrap_or_else(SVector::zeros)
        })
    }

    /// The plan that follows the terminal law around the admissible set point nearest to `x`.
    pub(super) fn under_terminal_law(&self, x: &SVector<T, NX>, wanted: T) -> Plan<T, NX, NU, N> {
        let d = &self.settings.direction;
        let weighted = self.settings.terminal.p * d;
        let nearest = weighted.dot(x) / weighted.dot(d);
        let [lower, upper] = self.settings.set_points;
        let set_point = nearest.max(lower).min(upper);
        self.simulate(x, set_point, wanted, |x| self.terminal_law(x, set_point))
    }

    /// The inputs of `along`, moved by the `fraction` of the way to (`u`, `set_point`).
    pub(super) fn between(
        &self,
        x0: &SVector<T, NX>,
        wanted: T,
        along: &Plan<T, NX, NU, N>,
        u: &[SVector<T, NU>; N],
        set_point: T,
        fraction: T,
    ) -> Plan<T, NX, NU, N> {
        let mut inputs = along.u;
        for (from, to) in inputs.iter_mut().zip(u) {
            let moved = *from + (to - *from) * fraction;
            *from = self.settings.u.project(&moved);
        }
        let set_point = along.set_point + (set_point - along.set_point) * fraction;
        self.roll_out(x0, inputs, set_point, wanted)
    }

    fn simulate(
        &self,
        x0: &SVector<T, NX>,
        set_point: T,
        wanted: T,
        mut input: impl FnMut(&SVector<T, NX>) -> SVector<T, NU>,
    ) -> Plan<T, NX, NU, N> {
        let settings = &self.settings;
        let offset = set_point - wanted;
        let mut plan = Plan {
            u: [SVector::zeros(); N],
            x: [SVector::zeros(); N],
            end: *x0,
            set_point,
            cost: settings.offset_weight * offset * offset,
        };
        let mut x = *x0;
        let steps = plan.u.iter_mut().zip(&mut plan.x);
        for (u, x_next) in steps.take(settings.horizon) {
            *u = input(&x);
            let error = x - settings.direction * set_point;
            plan.cost += (settings.weights.q * error).dot(&error);
            plan.cost += (settings.weights.r * *u).dot(u);
            x = settings.rk4.advance(&self.model, &x, u, settings.t_s);
            *x_next = x;
        }
        plan.cost += self.terminal_value(&x, set_point);
        plan.end = x;
        plan
    }

    /// Whether the plan keeps all bounds by `margin` times their width, and ends in the terminal
    /// set as clearly; false for numbers that are none.
    pub(super) fn is_feasible(&self, plan: &Plan<T, NX, NU, N>, margin: T) -> bool {
        let settings = &self.settings;
        let x = shrunk(&settings.x, margin);
        let [lower, upper] = settings.set_points;
        let level = settings.terminal.level * (T::one() - margin);
        let mut states = plan.x.iter().take(settings.horizon);
        let mut inputs = plan.u.iter().take(settings.horizon);
        plan.cost.is_finite()
            && states.all(|state| x.contains(state, T::zero()))
            && inputs.all(|u| settings.u.contains(u, T::zero()))
            && plan.set_point >= lower
            && plan.set_point <= upper
            && self.terminal_value(&plan.end, plan.set_point) <= level
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
