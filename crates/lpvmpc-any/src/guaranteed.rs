//! The loop that keeps its promise, to a fixed equilibrium: no plan is applied that the nonlinear model does not
//! confirm.
//!
//! Every sample has a plan that is known to work: the rest of the last one, with the terminal law as feedback towards
//! its states, ended by the terminal law; or that law alone. The controller's answer takes its place only if its
//! rollout keeps all bounds, ends in the terminal set and costs no more (suboptimal MPC: Scokaert, Mayne and Rawlings
//! 1999). Where a plan ended outside the set, the next programs have the tangent plane there as a row at the end of the
//! horizon.

use crate::check::Names;
use crate::controller_settings::limits;
use crate::error::MpcError;
use crate::plan::Plan;
use crate::preview::Preview;
use crate::settings::{Limits, MpcSettings, Row, Terminal, TerminalSet};
use crate::sized::AnySize;
use lpvmpc::{Decision, Penalty, Status};
use lpvmpc_plant::Plant;
use nalgebra::{DMatrix, DVector};

/// Rollouts have so many Runge-Kutta steps for each one of the controller's.
const FINER: usize = 4;
/// What a new plan keeps away from bounds and the edge of the set, of their distance from the equilibrium: room for the
/// integration error of the samples to come.
const MARGIN: f64 = 1e-3;
/// Programs are made with so much more room.
const PROGRAM_MARGIN: f64 = 2.0 * MARGIN;
/// What an end outside of the set costs, in units of what the terminal cost itself rises by there: soft, since a program
/// that cannot end there from the first plan may lead to one that can.
const PRICE: f64 = 20.0;
/// Answers of the controller that are looked at while no plan is known.
const MOST_LOOKS: usize = 8;

/// What a rollout gives.
#[derive(Clone)]
struct Motion {
    u: Vec<DVector<f64>>,
    /// x_0 to x_N.
    x: Vec<DVector<f64>>,
    cost: f64,
    /// e'Pe at the end.
    end: f64,
}

pub(crate) struct Guarantee {
    set: TerminalSet,
    x_bounds: Limits,
    u_bounds: Limits,
    horizon: usize,
    substeps: usize,
    last: Option<Motion>,
    /// Where a plan last ended outside the set: P (x_N - x_eq).
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
        if data.period.is_some() {
            let fault =
                "the plant is in discrete time; a certificate is about one in continuous time";
            return Err(MpcError::new("terminal", fault));
        }
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
        Ok(Some(Self {
            set: (**set).clone(),
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
        self.cut = None;
    }

    /// One sample; see [`crate::Mpc::step`].
    pub fn step(
        &mut self,
        controller: &mut dyn AnySize,
        x: &[f64],
        preview: &Preview,
    ) -> Result<Plan, MpcError> {
        if *preview != Preview::default() {
            let fault = "a controller with a certified terminal set goes to its equilibrium, and takes nothing else";
            return Err(MpcError::new("preview", fault));
        }
        let names = Names::new(controller.plant());
        let at = DVector::from_row_slice(x);
        let is_state = x.len() == names.states.len() && x.iter().all(|value| value.is_finite());
        let known = match is_state {
            true => self.known(controller.plant(), &at)?,
            false => None,
        };
        let looks = if known.is_none() && is_state {
            MOST_LOOKS
        } else {
            1
        };
        let mut plan = controller.step(x, &self.told())?;
        for look in 1..=looks {
            if !is_state {
                break;
            }
            let inputs = plan.u.row_iter().map(|u| u.transpose()).collect::<Vec<_>>();
            let motion = self.roll_out(controller.plant(), &at, &|i, _| inputs[i].clone())?;
            self.cut_at(&motion);
            let cheaper = known
                .as_ref()
                .is_none_or(|(_, known)| motion.cost <= known.cost);
            if cheaper && self.keeps(&motion, MARGIN) {
                if !plan.is_solved() {
                    plan.kind = Status::Improved;
                    plan.status = format!("confirmed by the model ({})", plan.status);
                }
                return Ok(self.answer(plan, motion, Decision::NewPlan));
            }
            if look < looks {
                controller.reset();
                plan = controller.step(x, &self.told())?;
            }
        }
        if let Some((decision, motion)) = known {
            plan.kind = Status::NoImprovement;
            plan.status = format!("{decision}: no better plan was found");
            plan.active.clear();
            return Ok(self.answer(plan, motion, decision));
        }
        self.last = None;
        if self.cut.take().is_some() && is_state {
            // What the controller does without a set is better than what it does towards one that it cannot reach.
            controller.reset();
            plan = controller.step(x, &self.told())?;
        }
        plan.decision = Some(Decision::SoftBounds);
        if !plan.is_solved() && is_state {
            let motion = self.roll_out(controller.plant(), &at, &|_, x| self.law(x))?;
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

    fn answer(&mut self, mut plan: Plan, motion: Motion, decision: Decision) -> Plan {
        plan.decision = Some(decision);
        write(&mut plan, &motion);
        self.last = Some(motion);
        plan
    }

    /// What the controller is told: bounds with room, and the tangent plane at the end.
    fn told(&self) -> Preview {
        let Self { set, x_bounds, .. } = self;
        let moved = |bounds: &[f64]| -> Vec<f64> {
            let pairs = bounds.iter().zip(set.x.iter());
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
            let upper = normal.dot(&set.x) + reach * (1.0 - PROGRAM_MARGIN);
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
            x_ref: vec![set.x.clone()],
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
            let normal = &self.set.p * (end - &self.set.x);
            self.cut = Some(&normal / normal.norm());
        }
    }

    /// The rest of the last plan, or the terminal law alone: whichever works, the cheaper one.
    fn known(
        &self,
        plant: &Plant,
        x: &DVector<f64>,
    ) -> Result<Option<(Decision, Motion)>, MpcError> {
        let law = self.roll_out(plant, x, &|_, x| self.law(x))?;
        let law = self
            .keeps(&law, 0.0)
            .then_some((Decision::TerminalLaw, law));
        let Some(last) = &self.last else {
            return Ok(law);
        };
        let rest = self.roll_out(plant, x, &|i, x| match last.u.get(i + 1) {
            Some(u) => u - &self.set.k * (x - &last.x[i + 1]),
            None => self.law(x),
        })?;
        let rest = self
            .keeps(&rest, 0.0)
            .then_some((Decision::Candidate, rest));
        Ok(match (rest, law) {
            (Some(rest), Some(law)) if law.1.cost < rest.1.cost => Some(law),
            (Some(rest), _) => Some(rest),
            (None, law) => law,
        })
    }

    fn law(&self, x: &DVector<f64>) -> DVector<f64> {
        &self.set.u - &self.set.k * (x - &self.set.x)
    }

    /// Whether bounds are kept and the end is in the set, with this share of room.
    fn keeps(&self, motion: &Motion, margin: f64) -> bool {
        let Self { set, x_bounds, .. } = self;
        let inside = |x: &DVector<f64>| {
            (0..x.len()).all(|i| {
                let room = |bound: f64| margin * finite_or((bound - set.x[i]).abs(), 0.0);
                let (lower, upper) = (x_bounds.lower[i], x_bounds.upper[i]);
                x[i] >= lower + room(lower) && x[i] <= upper - room(upper)
            })
        };
        motion.cost.is_finite()
            && motion.end <= set.level * (1.0 - margin)
            && motion.x[1..].iter().all(inside)
    }

    /// The motion of the nonlinear plant under inputs that are moved into their bounds.
    fn roll_out(
        &self,
        plant: &Plant,
        x: &DVector<f64>,
        input: &dyn Fn(usize, &DVector<f64>) -> DVector<f64>,
    ) -> Result<Motion, MpcError> {
        let set = &self.set;
        let mut motion = Motion {
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
            let (e, v) = (&x - &set.x, &u - &set.u);
            motion.cost += e.dot(&(&set.q * &e)) + v.dot(&(&set.r * &v));
            x = advance(plant, &x, &u, set.t_s, self.substeps)?;
            motion.u.push(u);
            motion.x.push(x.clone());
        }
        let e = &x - &set.x;
        motion.end = e.dot(&(&set.p * &e));
        motion.cost += motion.end;
        Ok(motion)
    }
}

/// A sample by the classical Runge-Kutta method.
fn advance(
    plant: &Plant,
    x: &DVector<f64>,
    u: &DVector<f64>,
    t_s: f64,
    steps: usize,
) -> Result<DVector<f64>, MpcError> {
    let rate = |x: &DVector<f64>| {
        let rates = plant.derivative(x.as_slice(), u.as_slice());
        let rates = rates.map_err(|error| MpcError::new(error.place, error.fault))?;
        Ok::<_, MpcError>(DVector::from_vec(rates))
    };
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
