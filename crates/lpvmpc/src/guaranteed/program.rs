//! The quadratic program of a guaranteed sample.
//!
//! Its state is (x, z) with the set point z, which stays as it is, both seen from the set point of
//! the plan that it is made along: so it does not matter where the plant stands. Two stages are
//! added to the horizon: at the first, whose input is z, the state is given its set point; at the
//! last, the state becomes y = H L'(x_N - z d) with P = L L', so that the terminal cost is |y|^2 and
//! the terminal set the ball |y|^2 <= level. The reflection H puts the plan's own y on the first
//! axis, where the program asks for the ball's tangent plane; the ball's curvature is in the cost,
//! with the multiplier of the program before. The acceptance test asks for the ball itself.

use super::plan::{Plan, shrunk, width};
use super::slopes::Slopes;
use super::{GuaranteedWorkspace, Planner};
use crate::model::{LpvModel, Scalar};
use crate::ocp::{Bounds, Common, Ocp, Penalty, Stage};
use crate::solution::{ActiveRow, Quantity, Solution};
use nalgebra::{Cholesky, Const, SMatrix, SVector, convert};

impl<P, T, const NX: usize, const NU: usize, const NS: usize> Planner<P, T, NX, NU, NS>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// The program along the plan `along`, whose states it lets be where they keep half of the margin.
    pub(super) fn pose<const NA: usize>(
        &mut self,
        along: &Plan<T, NX, NU>,
        ocp: &mut Ocp<T, NA, NU>,
    ) {
        if self.slope == Slope::Jacobian {
            for (i, (x, planned)) in along.states().zip(&along.stages).enumerate() {
                self.slopes_at(i, x, &planned.u);
            }
        }
        self.pose_with_slopes(along, ocp);
        if self.without_room {
            self.without_room = self.admit(along, ocp);
        }
    }

    /// Widens the bounds of the program's states so far that they hold for the plan `along` itself, which then is one
    /// of the program's points; whether they did not.
    fn admit<const NA: usize>(&self, along: &Plan<T, NX, NU>, ocp: &mut Ocp<T, NA, NU>) -> bool {
        let origin = self.settings.direction * along.set_point;
        let mut widened = false;
        // The plan's stage i is the program's i + 1, and x_0 is as it is.
        for (x, common) in along.states().zip(ocp.own.iter_mut().skip(1)).skip(1) {
            let planned = augmented(&(x - origin), T::zero());
            let bounds = &mut common.x;
            widened |= !bounds.hold_at(&planned);
            bounds.lower = bounds.lower.inf(&planned);
            bounds.upper = bounds.upper.sup(&planned);
        }
        widened
    }

    /// The same where the derivatives along the plan, if they are asked for, are known.
    fn pose_with_slopes<const NA: usize>(&self, along: &Plan<T, NX, NU>, ocp: &mut Ocp<T, NA, NU>) {
        let settings = &self.settings;
        // The last stage of the horizon follows its samples.
        ocp.horizon = settings.horizon + 2;
        let x0 = &along.start;
        let origin = settings.direction * along.set_point;
        ocp.x0 = augmented(&(x0 - origin), T::zero());
        let tight = shrunk(&settings.x, settings.margin);
        // The other half is for a plan that is repeated: it must keep the bounds, too.
        let half = shrunk(&settings.x, settings.margin * convert::<f64, T>(0.5));
        // The measured state is as it is; x_1 and later are bounded, as far from the bounds as the
        // plan goes beyond its samples.
        let bounds = |i: usize, x: &SVector<T, NX>| {
            let (above, below) = self.beyond_samples(along, i);
            let (lower, upper) = (tight.lower + below, tight.upper - above);
            let kept = settings.x.hold_at(&(x + above)) && settings.x.hold_at(&(x - below));
            let (least, most) = if kept {
                (half.lower + below, half.upper - above)
            } else {
                (lower, upper)
            };
            let (lower, upper) = (lower.inf(&x.sup(&least)), upper.sup(&x.inf(&most)));
            let infinity: T = convert(f64::INFINITY);
            Bounds {
                lower: augmented(&(lower - origin), -infinity),
                upper: augmented(&(upper - origin), infinity),
            }
        };
        let samples = along.states().zip(&along.stages).zip(&self.aims.stages);
        let mut stages = ocp.stages.iter_mut().zip(ocp.own.iter_mut());
        if let Some(first) = stages.next() {
            (*first.0, *first.1) = self.set_point_stage(along.set_point);
        }
        for ((i, ((x, planned), wanted)), stage) in samples.enumerate().zip(&mut stages) {
            let aim = (i < self.aims.changes).then_some(*wanted - along.set_point);
            let relative = (x - origin, planned.x - origin);
            let slopes = match (self.slope, self.slopes.get(i)) {
                (Slope::Jacobian, Some(known)) => known.slopes,
                _ => {
                    let (model, t_s) = (&self.model, settings.t_s);
                    settings.rk4.linearize(model, x, &planned.u, t_s)
                }
            };
            (*stage.0, *stage.1) = self.sample_stage(&slopes, &planned.u, relative, aim);
            if i > 0 {
                stage.1.x = bounds(i, x);
            }
        }
        let end = self.root() * (along.end - origin);
        let radius = self.settings.terminal.level.sqrt();
        // The tangent plane touches the ball where the last program ended, or this plan does.
        let touch = self.touch.unwrap_or(end);
        if let Some(last) = stages.next() {
            *last.0 = self.terminal_stage(&touch);
            *last.1 = Common {
                x: bounds(settings.horizon, &along.end),
                ..Common::default()
            };
        }
        let edge = radius * (T::one() - settings.margin) - self.reserve(self.end_drift);
        let widest = if end.norm() <= radius { radius } else { edge };
        self.pose_end(edge, widest, touch[0] < T::zero(), ocp);
    }

    /// Where the solved program ended as y, and the multiplier of the terminal set: what the next
    /// one is posed with.
    pub(super) fn learn<const NA: usize>(
        &mut self,
        workspace: &GuaranteedWorkspace<T, NU, NA>,
        along: &Plan<T, NX, NU>,
    ) {
        let GuaranteedWorkspace { ocp, solution, .. } = workspace;
        let at_end = |row: &ActiveRow<T>| {
            row.bound.stage == ocp.horizon && row.bound.quantity == Quantity::State(0)
        };
        let radius = self.settings.terminal.level.sqrt();
        let row = solution.active.iter().find(at_end);
        self.pressure = row.map_or(T::zero(), |row| row.multiplier.max(T::zero()) / radius);
        let origin = self.settings.direction * (along.set_point + set_point_move(solution));
        let from = self.settings.direction * along.set_point;
        let end = predicted_end(solution, self.settings.horizon, &from);
        let y = self.root() * (end - origin);
        self.touch = (self.pressure > T::zero() && y.norm() > T::zero()).then_some(y);
    }

    /// How far the plan goes above and below x_i in the samples on both sides of it, but no farther
    /// than both ends of them.
    fn beyond_samples(
        &self,
        along: &Plan<T, NX, NU>,
        i: usize,
    ) -> (SVector<T, NX>, SVector<T, NX>) {
        let between = self.settings.rollout.between;
        let (mut above, mut below) = (between, between);
        let widest = width(&self.settings.x) * convert::<f64, T>(0.1);
        let samples = along.states().zip(&along.stages);
        for (from, stage) in samples.skip(i.saturating_sub(1)).take(i.min(1) + 1) {
            above = above.sup(&(stage.highest - from.sup(&stage.x) + between));
            below = below.sup(&(from.inf(&stage.x) - stage.lowest + between));
        }
        if let Some(drift) = i.checked_sub(1).and_then(|before| self.drift.get(before)) {
            (above, below) = (above + drift, below + drift);
        }
        // A plan that is far from good must not close the bounds.
        (above.inf(&widest), below.inf(&widest))
    }

    /// (x, 0) becomes (x, z): the first input is z, with the offset cost. Both what is wanted and z are
    /// seen from the plan's set point, `along`.
    fn set_point_stage<const NA: usize>(&self, along: T) -> (Stage<T, NA, NU>, Common<T, NA, NU>) {
        let weight = self.settings.offset_weight;
        let mut stage = Stage::new();
        stage.a = SMatrix::identity();
        stage.b[(NX, 0)] = T::one();
        stage.linear_u[0] = weight * (along - self.aims.end);
        let mut common = Common::default();
        common.r[(0, 0)] = weight;
        let [lower, upper] = self.settings.set_points;
        (common.u.lower[0], common.u.upper[0]) = (lower - along, upper - along);
        (stage, common)
    }

    /// One sample of the plant, linear by the `slopes`, exact at the plan itself: under `u` it leads from the
    /// first of the `relative` states to the second. With an `aim` the stage cost is about it, else about z.
    fn sample_stage<const NA: usize>(
        &self,
        (a, b): &Slopes<T, NX, NU>,
        u: &SVector<T, NU>,
        relative: (SVector<T, NX>, SVector<T, NX>),
        aim: Option<T>,
    ) -> (Stage<T, NA, NU>, Common<T, NA, NU>) {
        let settings = &self.settings;
        let (x_here, x_next) = relative;
        let mut stage = Stage::<T, NA, NU>::new();
        stage.a.view_mut((0, 0), (NX, NX)).copy_from(a);
        stage.a[(NX, NX)] = T::one();
        stage.b.view_mut((0, 0), (NX, NU)).copy_from(b);
        stage.c = augmented(&(x_next - a * x_here - b * u), T::zero());
        // Damped towards the plan's input.
        stage.linear_u = settings.weights.r * u * -self.damping;
        let mut common = Common::<T, NA, NU>::default();
        let q_d = settings.weights.q * settings.direction;
        let q = &mut common.q;
        q.view_mut((0, 0), (NX, NX)).copy_from(&settings.weights.q);
        match aim {
            // ||x - aim d||_Q^2
            Some(aim) => stage.linear_x = augmented(&(q_d * -aim), T::zero()),
            // ||x - z d||_Q^2 in terms of (x, z).
            None => {
                q.view_mut((0, NX), (NX, 1)).copy_from(&-q_d);
                q.view_mut((NX, 0), (1, NX)).copy_from(&-q_d.transpose());
                q[(NX, NX)] = q_d.dot(&settings.direction);
            }
        }
        common.r = settings.weights.r * (T::one() + self.damping);
        common.u = settings.u;
        (stage, common)
    }

    /// L', where P = L L'.
    fn root(&self) -> SMatrix<T, NX, NX> {
        let factor = Cholesky::<T, Const<NX>>::new(self.settings.terminal.p);
        factor.map_or_else(SMatrix::zeros, |factor| factor.l().transpose())
    }

    /// y = H L'(x - z d), without input; `end` is the plan's own L'(x - z d).
    fn terminal_stage<const NA: usize>(&self, end: &SVector<T, NX>) -> Stage<T, NA, NU> {
        let mut stage = Stage::<T, NA, NU>::new();
        let root = reflected(end, &self.root());
        let shift = -(root * self.settings.direction);
        stage.a.view_mut((0, 0), (NX, NX)).copy_from(&root);
        stage.a.view_mut((0, NX), (NX, 1)).copy_from(&shift);
        stage
    }

    /// The terminal cost |y|^2, the tangent plane of the terminal set at the `edge`, and the curvature
    /// of the ball behind it, with the multiplier that it had; no y beyond the `widest`. The
    /// reflection takes the place where the plane touches to the `upper` or the lower end.
    fn pose_end<const NA: usize>(&self, edge: T, widest: T, upper: bool, ocp: &mut Ocp<T, NA, NU>) {
        let touches = self.touch.is_some();
        let pressure = if touches { self.pressure } else { T::zero() };
        ocp.terminal.p = SMatrix::identity() * (T::one() + pressure);
        ocp.terminal.p[(NX, NX)] = T::zero();
        ocp.terminal.linear_x = SVector::zeros();
        let place = if upper { edge } else { -edge };
        ocp.terminal.linear_x[0] = -pressure * place;
        ocp.terminal.x = Bounds::none();
        ocp.terminal.soft_x = [None; NA];
        for i in 0..NX {
            ocp.terminal.x.lower[i] = -widest;
            ocp.terminal.x.upper[i] = widest;
        }
    }

    /// State bounds and terminal set at a price instead.
    pub(super) fn soften<const NA: usize>(&self, ocp: &mut Ocp<T, NA, NU>) {
        let width = width(&self.settings.x);
        let penalty = |width: T| {
            let width = if width > T::zero() { width } else { T::one() };
            Some(Penalty {
                linear: self.settings.soft_price / width,
                quadratic: self.settings.soft_price / (width * width),
            })
        };
        for common in &mut ocp.own {
            for (soft, width) in common.soft_x.iter_mut().zip(width.iter()) {
                *soft = penalty(*width);
            }
        }
        let edge = self.settings.terminal.level.sqrt();
        for soft in ocp.terminal.soft_x.iter_mut().take(NX) {
            *soft = penalty(edge);
        }
    }
}

/// What the quadratic program is linear along a plan by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Slope {
    /// The derivatives of the rollout: right close to the plan.
    Jacobian,
    /// The embedding's own matrices, the scheduling of the plan: better far from it.
    Embedding,
}

impl Slope {
    /// The other one.
    pub(super) fn other(self) -> Self {
        match self {
            Self::Jacobian => Self::Embedding,
            Self::Embedding => Self::Jacobian,
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

/// The answer of a solved program as a policy, from the plant's own origin: planned states, inputs and
/// feedback matrices from stage 0 on; `from` is the set point of the plan that the program was made along, times the
/// direction.
pub(super) fn answer<'a, T: Scalar, const NX: usize, const NU: usize, const NA: usize>(
    workspace: &'a GuaranteedWorkspace<T, NU, NA>,
    from: &'a SVector<T, NX>,
) -> impl Iterator<Item = (SVector<T, NX>, SVector<T, NU>, SMatrix<T, NU, NX>)> + 'a {
    let GuaranteedWorkspace {
        solution, solver, ..
    } = workspace;
    let inputs = solution.u.iter().skip(1);
    let factors = solver.factors().iter().skip(1);
    let stages = solution.x.iter().zip(inputs.zip(factors));
    stages.map(move |(planned, (u, factor))| {
        let feedback = factor.feedback.fixed_columns::<NX>(0).into_owned();
        (plant_state::<T, NX, NA>(planned) + from, *u, feedback)
    })
}

/// How far a solved program moves the set point.
pub(super) fn set_point_move<T: Scalar, const NU: usize, const NA: usize>(
    solution: &Solution<T, NA, NU>,
) -> T {
    let first = solution.u.first().and_then(|u| u.get(0));
    first.copied().unwrap_or(T::zero())
}

fn plant_state<T: Scalar, const NX: usize, const NA: usize>(x: &SVector<T, NA>) -> SVector<T, NX> {
    SVector::from_fn(|i, _| x.get(i).copied().unwrap_or(T::zero()))
}

/// x_N as the program of this `horizon` predicts it; `from` as in [`answer`].
pub(super) fn predicted_end<T: Scalar, const NX: usize, const NU: usize, const NA: usize>(
    solution: &Solution<T, NA, NU>,
    horizon: usize,
    from: &SVector<T, NX>,
) -> SVector<T, NX> {
    // x_1 of the program is (x_0, z), so x_{N+1} of the program is (x_N, z).
    let end = solution.x.get(horizon);
    end.map_or(*from, |x| plant_state::<T, NX, NA>(x) + from)
}

/// H `m` with the reflection H that takes `v` to the first axis.
fn reflected<T: Scalar, const K: usize>(
    v: &SVector<T, K>,
    m: &SMatrix<T, K, K>,
) -> SMatrix<T, K, K> {
    let size = v.norm();
    let mut normal = *v;
    if K > 0 {
        // The sign that does not cancel.
        normal[0] += if v[0] < T::zero() { -size } else { size };
    }
    let square = normal.norm_squared();
    if !(square > T::zero() && square.is_finite()) {
        return *m;
    }
    let two: T = convert(2.0);
    m - normal * (normal.transpose() * m) * (two / square)
}
