//! The loop that keeps its promise, to an equilibrium or to one moved along states that the plant does not notice: no
//! plan is applied that the nonlinear model does not confirm.
//!
//! Every sample has a plan that is known to work: the rest of the last one, with the terminal law as feedback towards
//! its states, ended by the terminal law; or that law alone. The controller's answer takes its place only if its
//! rollout keeps all bounds, ends in the terminal set and costs no more (suboptimal MPC: Scokaert, Mayne and Rawlings
//! 1999). Where a plan ended outside the set, the next programs have the tangent plane there as a row at the end of the
//! horizon.
//!
//! Where no formula of the plant reads a state, such as a cart's position, the certificate holds about every
//! equilibrium that is moved along it. So a set point far away is approached by artificial ones (Limon, Alvarado, Alamo
//! and Camacho 2008): each plan ends at a target of its own, whose distance from the set point is part of its cost, and
//! which moves on by strides: each twice as long as the last one that succeeded, or a quarter or a sixteenth of that.

use crate::check::Names;
use crate::controller_settings::limits;
use crate::error::MpcError;
use crate::plan::Plan;
use crate::preview::Preview;
use crate::settings::{Limits, MpcSettings, Row, Terminal, TerminalSet};
use crate::sized::AnySize;
use lpvmpc::{Decision, Penalty, Status};
use lpvmpc_plant::{Plant, PlantError};
use nalgebra::{DMatrix, DVector};

/// Rollouts have so many Runge-Kutta steps for each one of the controller's, in continuous time.
const FINER: usize = 4;
/// What a new plan keeps away from bounds and the edge of the set, of their distance from the equilibrium: room for the
/// integration error of the samples to come.
const MARGIN: f64 = 1e-3;
/// Programs are made with so much more room.
const PROGRAM_MARGIN: f64 = 2.0 * MARGIN;
/// What an end outside of the set costs, in units of what the terminal cost itself rises by there: soft, since a program
/// that cannot end there from the first plan may lead to one that can.
const PRICE: f64 = 20.0;
/// Answers of the controller that are looked at while no plan is known, by the share of the way to the set point at
/// which their targets are.
const FIRST_TARGETS: [f64; 8] = [1.0, 1.0, 1.0, 0.5, 0.25, 0.1, 0.0, 0.0];
/// What a target's distance from the set point costs, in units of the terminal cost of a state there: more than 1, so
/// that it is worth while to move on.
const OFFSET_PRICE: f64 = 10.0;
/// A stride that is shorter than this share of the way is none.
const SHORTEST_STRIDE: f64 = 1e-3;
/// Of a set point further away than so many lengths of the set, the direction counts: strides remain of use.
const FAR: f64 = 1e3;

/// What a rollout gives.
#[derive(Clone)]
struct Motion {
    /// The equilibrium that it is to end at.
    target: DVector<f64>,
    u: Vec<DVector<f64>>,
    /// x_0 to x_N.
    x: Vec<DVector<f64>>,
    /// About the target.
    cost: f64,
    /// e'Pe at the end, about the target.
    end: f64,
}

pub(crate) struct Guarantee {
    set: TerminalSet,
    x_bounds: Limits,
    u_bounds: Limits,
    horizon: usize,
    substeps: usize,
    /// Where targets may be: at the equilibrium, and anywhere along states that the plant does not notice, as far as
    /// the set stays within the bounds.
    targets: Limits,
    /// Where the plant is sent while no plan is known: one place, since one that moved with it would never have it stop.
    refuge: Option<DVector<f64>>,
    /// How far the set reaches along each state.
    lengths: Vec<f64>,
    /// The share of the way from the last target to the set point that the next one is moved by.
    stride: f64,
    last: Option<Motion>,
    /// Where a plan last ended outside the set: P (x_N - x_target), of unit length.
    cut: Option<DVector<f64>>,
}

impl Guarantee {
    /// What `settings` ask for; `None` without a certified terminal set.
    ///
    /// # Errors
    /// The certificate is not for these settings.
    pub fn new(plant: &Plant, settings: &MpcSettings) -> Result<Option<Self>, MpcError> {
        let Terminal::Certified(set) = &settings.terminal else {
            return Ok(None);
        };
        let names = Names::new(plant);
        check_sizes(&names, set)?;
        check_settings(settings, set)?;
        let data = plant.data();
        let bounded = data
            .outputs
            .iter()
            .any(|y| y.lower.is_some() || y.upper.is_some());
        if bounded {
            let fault = "the plant's outputs have bounds, of which the certificate says nothing";
            return Err(MpcError::new("terminal", fault));
        }
        let x_bounds = limits(&settings.x_bounds, &data.states);
        let u_bounds = limits(&settings.u_bounds, &data.inputs);
        for (place, names, (at, reach), bounds) in [
            (
                "x_bounds",
                &names.states,
                (&set.x, &set.state_limits),
                &x_bounds,
            ),
            (
                "u_bounds",
                &names.inputs,
                (&set.u, &set.input_limits),
                &u_bounds,
            ),
        ] {
            if bounds.lower.len() != names.len() || bounds.upper.len() != names.len() {
                continue;
            }
            for i in 0..names.len() {
                let (lower, upper) = (at[i] - reach[i], at[i] + reach[i]);
                // Rounding apart, since the limits were made of such bounds.
                let slack = 1e-9 * (1.0 + at[i].abs());
                let within = lower >= bounds.lower[i] - slack && upper <= bounds.upper[i] + slack;
                if !within {
                    let fault = format!(
                        "{} is bounded by {} to {}, and in the certified set it reaches {lower} to {upper}; \
                         certify with these bounds",
                        names[i], bounds.lower[i], bounds.upper[i]
                    );
                    return Err(MpcError::new(place, fault));
                }
            }
        }
        let is_free = data.is_invariant_along();
        let target = |bound: &[f64], side: f64| {
            let along = |i: usize| match is_free[i] {
                true if bound[i].is_finite() => bound[i] - side * set.state_limits[i],
                true => bound[i],
                false => set.x[i],
            };
            (0..set.x.len()).map(along).collect::<Vec<f64>>()
        };
        // The equilibrium itself is always there, rounding apart.
        let least = |values: Vec<f64>| pairwise(&values, &set.x, f64::min);
        let most = |values: Vec<f64>| pairwise(&values, &set.x, f64::max);
        let targets = Limits {
            lower: least(target(&x_bounds.lower, -1.0)),
            upper: most(target(&x_bounds.upper, 1.0)),
        };
        let Some(factor) = set.p.clone().cholesky() else {
            let fault = "the certificate's P is not positive definite";
            return Err(MpcError::new("terminal", fault));
        };
        let inverse = factor.inverse();
        let lengths = (0..set.x.len()).map(|i| (set.level * inverse[(i, i)]).sqrt());
        let lengths: Vec<f64> = lengths.collect();
        Ok(Some(Self {
            set: (**set).clone(),
            targets,
            lengths,
            stride: 1.0,
            refuge: None,
            x_bounds,
            u_bounds,
            horizon: settings.horizon,
            substeps: settings.substeps * FINER,
            last: None,
            cut: None,
        }))
    }

    pub fn reset(&mut self) {
        self.last = None;
        self.refuge = None;
        self.stride = 1.0;
        self.cut = None;
    }

    /// One sample; see [`crate::Mpc::step`].
    pub fn step(
        &mut self,
        controller: &mut dyn AnySize,
        x: &[f64],
        preview: &Preview,
    ) -> Result<Plan, MpcError> {
        let names = Names::new(controller.plant());
        let mut wanted = self.set_point(&names, preview)?;
        let at = DVector::from_row_slice(x);
        if x.len() != names.states.len() || x.iter().any(|value| !value.is_finite()) {
            let mut plan = controller.step(x, &self.told(&wanted))?;
            self.last = None;
            plan.decision = Some(Decision::SoftBounds);
            plan.status = format!("not guaranteed: {}", plan.status);
            return Ok(plan);
        }
        for i in 0..at.len() {
            let here = self.nearest(&at)[i];
            let far = FAR * self.lengths[i];
            wanted[i] = wanted[i].max(here - far).min(here + far);
        }
        let known = self.known(controller.plant(), &at, &wanted)?;
        let from = match (&known, &self.refuge) {
            (Some((_, motion)), _) => motion.target.clone(),
            (None, Some(refuge)) => refuge.clone(),
            (None, None) => self.nearest(&at),
        };
        let shares: &[f64] = match &known {
            Some(_) if from == wanted => &[0.0],
            Some(_) => &[1.0, 0.25, 0.0625, 0.0].map(|part| part * self.stride),
            None if self.refuge.is_none() => &FIRST_TARGETS,
            // The controller's own plan, from sample to sample, until one is confirmed.
            None => &[0.0],
        };
        let limit = known
            .as_ref()
            .map_or(f64::INFINITY, |(_, known)| self.worth(known, &wanted));
        let mut refused = None;
        for (look, share) in shares.iter().enumerate() {
            if look > 0 && known.is_none() {
                controller.reset();
            }
            let target = &from + (&wanted - &from) * *share;
            let mut plan = controller.step(x, &self.told(&target))?;
            let inputs = plan.u.row_iter().map(|u| u.transpose()).collect::<Vec<_>>();
            let motion = self.roll_out(controller.plant(), (&at, &target), &|i, _| {
                inputs[i].clone()
            })?;
            self.cut_at(&motion);
            if self.worth(&motion, &wanted) <= limit && self.keeps(&motion, MARGIN) {
                if *share > 0.0 {
                    self.stride = (2.0 * share).min(1.0);
                }
                if !plan.is_solved() {
                    plan.kind = Status::Improved;
                    plan.status = format!("confirmed by the model ({})", plan.status);
                }
                return Ok(self.answer(plan, motion, Decision::NewPlan));
            }
            if *share > 0.0 {
                self.stride = (0.25 * share).max(SHORTEST_STRIDE);
            }
            refused = Some(plan);
        }
        let Some(mut plan) = refused else {
            return controller.step(x, &self.told(&wanted));
        };
        if let Some((decision, motion)) = known {
            plan.kind = Status::NoImprovement;
            plan.status = format!("{decision}: no better plan was found");
            plan.active.clear();
            return Ok(self.answer(plan, motion, decision));
        }
        self.last = None;
        let is_first = self.refuge.replace(from.clone()).is_none();
        if self.cut.take().is_some() && is_first {
            // What the controller does without a set is better than what it does towards one that it cannot reach; and
            // where it is now it finds a plan sooner than on a long way.
            controller.reset();
            plan = controller.step(x, &self.told(&from))?;
        }
        plan.decision = Some(Decision::SoftBounds);
        if !plan.is_solved() {
            let law = |_: usize, x: &DVector<f64>| self.law(x, &from);
            let motion = self.roll_out(controller.plant(), (&at, &from), &law)?;
            plan.decision = Some(Decision::SaturatedLqr);
            write(&mut plan, &motion);
        }
        plan.status = format!(
            "not guaranteed, {}: {}",
            plan.decision.map_or(String::new(), |d| d.to_string()),
            plan.status
        );
        Ok(plan)
    }

    /// Where the plant is to go: the equilibrium, moved along the states that the plant does not notice to where the
    /// reference is, as far as the bounds have room for the set about it.
    fn set_point(&self, names: &Names, preview: &Preview) -> Result<DVector<f64>, MpcError> {
        let refused = |fault: String| Err(MpcError::new("preview", fault));
        let rest = Preview {
            x_ref: Vec::new(),
            ..preview.clone()
        };
        if rest != Preview::default() {
            let fault = "a controller with a certified terminal set takes a set point x_ref, and nothing else that is \
                         ahead";
            return refused(fault.to_owned());
        }
        let Some(wanted) = preview.x_ref.first() else {
            return Ok(self.set.x.clone());
        };
        let n = self.set.x.len();
        if wanted.len() != n || wanted.iter().any(|value| !value.is_finite()) {
            let fault = format!("x_ref: it must be {n} finite numbers");
            return refused(fault);
        }
        let is_fixed = |i: &usize| self.targets.lower[*i] == self.targets.upper[*i];
        let off =
            |i: &usize| (wanted[*i] - self.set.x[*i]).abs() > 1e-9 * (1.0 + self.set.x[*i].abs());
        if let Some(i) = (0..n).filter(is_fixed).find(off) {
            let free: Vec<&str> = (0..n)
                .filter(|i| !is_fixed(i))
                .map(|i| names.states[i].as_str())
                .collect();
            let free = match free.as_slice() {
                [] => "no state".to_owned(),
                free => free.join(", "),
            };
            let fault = format!(
                "x_ref: {} is {}, and the certificate is about {}; elsewhere may be what no formula of the plant \
                 reads: {free}",
                names.states[i], wanted[i], self.set.x[i]
            );
            return refused(fault);
        }
        Ok(self.nearest(wanted))
    }

    /// The target that is nearest to a state, coordinate by coordinate.
    fn nearest(&self, x: &DVector<f64>) -> DVector<f64> {
        let Limits { lower, upper } = &self.targets;
        DVector::from_fn(x.len(), |i, _| x[i].max(lower[i]).min(upper[i]))
    }

    /// The cost of a motion with that of its target's distance from the set point.
    fn worth(&self, motion: &Motion, wanted: &DVector<f64>) -> f64 {
        let off = &motion.target - wanted;
        motion.cost + OFFSET_PRICE * off.dot(&(&self.set.p * &off))
    }

    fn answer(&mut self, mut plan: Plan, motion: Motion, decision: Decision) -> Plan {
        plan.decision = Some(decision);
        write(&mut plan, &motion);
        self.last = Some(motion);
        self.refuge = None;
        plan
    }

    /// What the controller is told: bounds with room, and the tangent plane at the end.
    fn told(&self, target: &DVector<f64>) -> Preview {
        let Self { set, x_bounds, .. } = self;
        let moved = |bounds: &[f64]| -> Vec<f64> {
            let pairs = bounds.iter().zip(target.iter());
            pairs
                .map(|(bound, at)| bound - PROGRAM_MARGIN * finite_or(bound - at, 0.0))
                .collect()
        };
        let mut rows = Vec::new();
        if let Some(normal) = &self.cut {
            // Of e'Pe <= level, where it is nearest to where the plan ended: at e* along P^-1 normal.
            let solved = set.p.clone().cholesky().map(|factor| factor.solve(normal));
            let size = solved.map_or(f64::INFINITY, |along| along.dot(normal).sqrt());
            let reach = set.level.sqrt() * size;
            let upper = normal.dot(target) + reach * (1.0 - PROGRAM_MARGIN);
            // The gradient of e'Pe at e* is 2 sqrt(level) / size long.
            let linear = PRICE * 2.0 * set.level.sqrt() / size;
            rows = vec![Vec::new(); self.horizon + 1];
            rows[self.horizon] = vec![Row {
                name: "terminal set".to_owned(),
                x: normal.clone(),
                u: DVector::zeros(set.u.len()),
                lower: f64::NEG_INFINITY,
                upper,
                soft: Some(Penalty {
                    linear,
                    quadratic: linear / reach,
                }),
            }];
        }
        Preview {
            x_ref: vec![target.clone()],
            u_ref: vec![set.u.clone()],
            x_bounds: vec![Limits {
                lower: moved(&x_bounds.lower),
                upper: moved(&x_bounds.upper),
            }],
            rows,
            ..Preview::default()
        }
    }

    fn cut_at(&mut self, motion: &Motion) {
        if let Some(end) = motion.x.last()
            && motion.end > self.set.level * (1.0 - PROGRAM_MARGIN)
            && motion.end.is_finite()
        {
            let normal = &self.set.p * (end - &motion.target);
            self.cut = Some(&normal / normal.norm());
        }
    }

    /// The rest of the last plan, or the terminal law alone, to the last plan's target or where the plant is: whichever
    /// works, the cheapest one.
    fn known(
        &self,
        plant: &Plant,
        x: &DVector<f64>,
        wanted: &DVector<f64>,
    ) -> Result<Option<(Decision, Motion)>, MpcError> {
        let mut known: Option<(Decision, Motion)> = None;
        let mut offer = |decision: Decision, motion: Motion| {
            let worth = |motion: &Motion| self.worth(motion, wanted);
            let best = known
                .as_ref()
                .map_or(f64::INFINITY, |(_, best)| worth(best));
            if self.keeps(&motion, 0.0) && worth(&motion) < best {
                known = Some((decision, motion));
            }
        };
        if let Some(last) = &self.last {
            let rest =
                self.roll_out(plant, (x, &last.target), &|i, x| match last.u.get(i + 1) {
                    Some(u) => u - &self.set.k * (x - &last.x[i + 1]),
                    None => self.law(x, &last.target),
                })?;
            offer(Decision::Candidate, rest);
        }
        let here = self.nearest(x);
        let last = self.last.as_ref().map(|last| &last.target);
        for target in last.into_iter().chain([wanted, &here]) {
            let law = self.roll_out(plant, (x, target), &|_, x| self.law(x, target))?;
            offer(Decision::TerminalLaw, law);
        }
        Ok(known)
    }

    fn law(&self, x: &DVector<f64>, target: &DVector<f64>) -> DVector<f64> {
        &self.set.u - &self.set.k * (x - target)
    }

    /// Whether bounds are kept and the end is in the set, with this share of room.
    fn keeps(&self, motion: &Motion, margin: f64) -> bool {
        let Self { set, x_bounds, .. } = self;
        let inside = |x: &DVector<f64>| {
            (0..x.len()).all(|i| {
                let room = |bound: f64| margin * finite_or((bound - motion.target[i]).abs(), 0.0);
                let (lower, upper) = (x_bounds.lower[i], x_bounds.upper[i]);
                x[i] >= lower + room(lower) && x[i] <= upper - room(upper)
            })
        };
        motion.cost.is_finite()
            && motion.end <= set.level * (1.0 - margin)
            && motion.x[1..].iter().all(inside)
    }

    /// The motion of the nonlinear plant from `x` to `target` under inputs that are moved into their bounds.
    fn roll_out(
        &self,
        plant: &Plant,
        (x, target): (&DVector<f64>, &DVector<f64>),
        input: &dyn Fn(usize, &DVector<f64>) -> DVector<f64>,
    ) -> Result<Motion, MpcError> {
        let set = &self.set;
        let mut motion = Motion {
            target: target.clone(),
            u: Vec::with_capacity(self.horizon),
            x: vec![x.clone()],
            cost: 0.0,
            end: f64::NAN,
        };
        let mut x = x.clone();
        for i in 0..self.horizon {
            let wanted = input(i, &x);
            let u = DVector::from_fn(wanted.len(), |j, _| {
                wanted[j]
                    .max(self.u_bounds.lower[j])
                    .min(self.u_bounds.upper[j])
            });
            let (e, v) = (&x - target, &u - &set.u);
            motion.cost += e.dot(&(&set.q * &e)) + v.dot(&(&set.r * &v));
            x = advance(plant, &x, &u, set.t_s, self.substeps)?;
            motion.u.push(u);
            motion.x.push(x.clone());
        }
        let e = &x - target;
        motion.end = e.dot(&(&set.p * &e));
        motion.cost += motion.end;
        Ok(motion)
    }
}

/// A sample, in continuous time by the classical Runge-Kutta method.
fn advance(
    plant: &Plant,
    x: &DVector<f64>,
    u: &DVector<f64>,
    t_s: f64,
    steps: usize,
) -> Result<DVector<f64>, MpcError> {
    let known =
        |motion: Result<Vec<f64>, PlantError>| Ok::<_, MpcError>(DVector::from_vec(motion?));
    if plant.period().is_some() {
        return known(plant.next(x.as_slice(), u.as_slice()));
    }
    let rate = |x: &DVector<f64>| known(plant.derivative(x.as_slice(), u.as_slice()));
    let h = t_s / steps as f64;
    let mut x = x.clone();
    for _ in 0..steps {
        let k1 = rate(&x)?;
        let k2 = rate(&(&x + &k1 * (0.5 * h)))?;
        let k3 = rate(&(&x + &k2 * (0.5 * h)))?;
        let k4 = rate(&(&x + &k3 * h))?;
        x += (k1 + (k2 + k3) * 2.0 + k4) * (h / 6.0);
    }
    Ok(x)
}

fn write(plan: &mut Plan, motion: &Motion) {
    let (horizon, m, n) = (motion.u.len(), plan.u.ncols(), plan.x.ncols());
    plan.u = DMatrix::from_fn(horizon, m, |i, j| motion.u[i][j]);
    plan.x = DMatrix::from_fn(horizon + 1, n, |i, j| motion.x[i][j]);
    plan.cost = motion.cost;
}

fn pairwise(a: &[f64], b: &DVector<f64>, choose: fn(f64, f64) -> f64) -> Vec<f64> {
    a.iter()
        .zip(b.iter())
        .map(|(a, b)| choose(*a, *b))
        .collect()
}

fn finite_or(value: f64, otherwise: f64) -> f64 {
    if value.is_finite() { value } else { otherwise }
}

fn check_sizes(names: &Names, set: &TerminalSet) -> Result<(), MpcError> {
    let (n, m) = (names.states.len(), names.inputs.len());
    let right = set.x.len() == n
        && set.u.len() == m
        && set.k.shape() == (m, n)
        && set.p.shape() == (n, n)
        && set.q.shape() == (n, n)
        && set.r.shape() == (m, m)
        && set.state_limits.len() == n
        && set.input_limits.len() == m;
    let numbers = set
        .k
        .iter()
        .chain(set.p.iter())
        .chain(set.x.iter())
        .chain(set.u.iter());
    let finite = numbers.chain([&set.level]).all(|value| value.is_finite());
    match right && finite && set.level > 0.0 {
        true => Ok(()),
        false => {
            let fault = format!(
                "the certificate must be one of {n} states and {m} inputs, with finite numbers"
            );
            Err(MpcError::new("terminal", fault))
        }
    }
}

/// The decrease is proved for the certificate's sampling time and weights, and so for smaller weights.
fn check_settings(settings: &MpcSettings, set: &TerminalSet) -> Result<(), MpcError> {
    if settings.t_s != set.t_s {
        let fault = format!(
            "it is {} s, that of the certificate {} s",
            settings.t_s, set.t_s
        );
        return Err(MpcError::new("t_s", fault));
    }
    for (place, own, proved) in [("q", &settings.q, &set.q), ("r", &settings.r, &set.r)] {
        if own.shape() != proved.shape() {
            // Named with the weights.
            continue;
        }
        let rest = proved - own;
        let smallest = rest.symmetric_eigenvalues().min();
        if !(smallest >= -1e-12 * proved.amax()) {
            let fault = "it is larger than the certificate's, for which alone the decrease of the cost is proved";
            return Err(MpcError::new(place, fault));
        }
    }
    for (place, there) in [
        ("rows", !settings.rows.is_empty()),
        ("q_y", settings.q_y.is_some()),
        ("y_bounds", settings.y_bounds.is_some()),
        ("r_du", settings.r_du.is_some()),
        ("du_bounds", settings.du_bounds.is_some()),
        ("u_ref", settings.u_ref.is_some()),
    ] {
        if there {
            let fault = "the certificate says nothing of it; leave it out, or take another terminal ingredient";
            return Err(MpcError::new(place, fault));
        }
    }
    Ok(())
}
