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
//! References that are known to change along the horizon are what its stages are aimed at up to the last change that is
//! seen, and the target from there on: functions of time that stay while what is beyond the horizon stays, so that the
//! rest of a plan costs what it did.
//!
//! A disturbance d that an estimator finds beside the inputs is taken off what is commanded: the plant gets u + d, and
//! that is what plans are made of, within the bounds moved by d and with as much of the set as these leave the law.

mod aims;
mod checks;
mod motion;
mod program;

use crate::check::{Axis, Names};
use crate::controller_settings::limits;
use crate::error::MpcError;
use crate::plan::{Plan, Target};
use crate::preview::Preview;
use crate::settings::{Limits, MpcSettings, Terminal, TerminalSet};
use crate::sized::{Acting, AnySize};
use aims::{Aims, Targets};
pub(crate) use checks::check_estimator;
use lpvmpc::{Decision, Status};
use lpvmpc_plant::Plant;
use motion::Motion;
use nalgebra::DVector;
use program::Way;

/// Rollouts have so many Runge-Kutta steps for each one of the controller's, in continuous time.
const FINER: usize = 4;
/// What a new plan keeps away from bounds and the edge of the set, of their distance from the equilibrium: room for the
/// integration error of the samples to come.
const MARGIN: f64 = 1e-3;
/// Answers of the controller that are looked at while no plan is known, by the share of the way to the set point at
/// which their targets are.
const FIRST_TARGETS: [f64; 8] = [1.0, 1.0, 1.0, 0.5, 0.25, 0.1, 0.0, 0.0];
/// A stride that is shorter than this share of the way is none.
const SHORTEST_STRIDE: f64 = 1e-3;

pub(crate) struct Guarantee {
    set: TerminalSet,
    x_bounds: Limits,
    u_bounds: Limits,
    horizon: usize,
    substeps: usize,
    targets: Targets,
    /// Where the plant is sent while no plan is known: one place, since one that moved with it would never have it stop.
    refuge: Option<DVector<f64>>,
    /// The share of the way from the last target to the set point that the next one is moved by.
    stride: f64,
    last: Option<Motion>,
    /// Where a plan last ended outside the set: P (x_N - x_target), of unit length.
    cut: Option<DVector<f64>>,
}

/// What holds in one sample.
struct Sample {
    /// The state from which is planned.
    x: DVector<f64>,
    aims: Aims,
    /// What acts beside the input.
    beside: DVector<f64>,
    /// Bounds of the input together with that.
    u: Limits,
    /// The level up to which the terminal law keeps them.
    level: f64,
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
        let data = plant.data();
        checks::check(&names, data, settings, set)?;
        let x_bounds = limits(&settings.x_bounds, &data.states);
        let u_bounds = limits(&settings.u_bounds, &data.inputs);
        names.check_limits(Axis::States, "x_bounds", &x_bounds)?;
        names.check_limits(Axis::Inputs, "u_bounds", &u_bounds)?;
        let of_states = (set.x.as_slice(), set.state_limits.as_slice());
        checks::check_reach("x_bounds", &names.states, of_states, &x_bounds)?;
        let of_inputs = (set.u.as_slice(), set.input_limits.as_slice());
        checks::check_reach("u_bounds", &names.inputs, of_inputs, &u_bounds)?;
        let Some(factor) = set.p.clone().cholesky() else {
            let fault = "the certificate's P is not positive definite";
            return Err(MpcError::new("terminal", fault));
        };
        let free = data.is_invariant_along();
        Ok(Some(Self {
            set: (**set).clone(),
            targets: Targets::new(set, &factor.inverse(), &free, &x_bounds),
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

    /// Goes on from the plan of one with other settings, if that is about the same set: what that plan is worth, and
    /// whether it keeps the bounds, is asked anew at every sample.
    pub fn take_over(&mut self, previous: &Self) {
        if (&self.set, self.horizon) == (&previous.set, previous.horizon) {
            self.last.clone_from(&previous.last);
            self.refuge.clone_from(&previous.refuge);
            self.stride = previous.stride;
            self.cut.clone_from(&previous.cut);
        }
    }

    pub fn reset(&mut self) {
        self.last = None;
        self.refuge = None;
        self.stride = 1.0;
        self.cut = None;
    }

    /// One sample, where `beside` is added to the input: see [`crate::Mpc::step`].
    pub fn step(
        &mut self,
        controller: &mut dyn AnySize,
        x: &[f64],
        beside: Option<&[f64]>,
        preview: &Preview,
    ) -> Result<Plan, MpcError> {
        let names = Names::new(controller.plant());
        let aims = self.targets.aims(&names, self.horizon, preview)?;
        let mut sample = self.sample(x, beside, aims);
        let acting = beside.map(|on_inputs| Acting {
            on_inputs,
            on_states: &[],
        });
        if x.len() != names.states.len() || x.iter().any(|value| !value.is_finite()) {
            let told = self.told(&sample, &sample.aims.end, Way::AsWanted);
            let mut plan = controller.step(x, acting, &told)?;
            self.last = None;
            plan.decision = Some(Decision::SoftBounds);
            plan.status = format!("not guaranteed: {}", plan.status);
            return Ok(plan);
        }
        sample.aims = self.targets.seen_from(&sample.x, &sample.aims);
        let (sample, wanted) = (&sample, &sample.aims.end);
        let known = self.known(controller.plant(), sample)?;
        let from = match (&known, &self.refuge) {
            (Some((_, motion)), _) => motion.target.clone(),
            (None, Some(refuge)) => refuge.clone(),
            (None, None) => self.targets.nearest(&sample.x),
        };
        let shares: &[f64] = match &known {
            Some(_) if from == *wanted => &[0.0],
            Some(_) => &[1.0, 0.25, 0.0625, 0.0].map(|part| part * self.stride),
            None if self.refuge.is_none() => &FIRST_TARGETS,
            // The controller's own plan, from sample to sample, until one is confirmed.
            None => &[0.0],
        };
        let limit = known
            .as_ref()
            .map_or(f64::INFINITY, |(_, known)| self.worth(sample, known));
        let mut refused = None;
        for (look, share) in shares.iter().enumerate() {
            if look > 0 && known.is_none() {
                controller.reset();
            }
            let target = &from + (wanted - &from) * *share;
            // Where no plan is known, a way that leads there at all comes before the wanted one.
            let way = match known.is_some() || *share >= 1.0 {
                true => Way::AsWanted,
                false => Way::Straight,
            };
            let mut plan = controller.step(x, acting, &self.told(sample, &target, way))?;
            let inputs = plan.u.row_iter().map(|u| u.transpose() + &sample.beside);
            let inputs: Vec<_> = inputs.collect();
            let motion = self.roll_out(controller.plant(), sample, &target, &|i, _| {
                inputs[i].clone()
            })?;
            self.cut_at(sample, &motion);
            if self.worth(sample, &motion) <= limit && self.keeps(sample, &motion, MARGIN) {
                if *share > 0.0 {
                    self.stride = (2.0 * share).min(1.0);
                }
                if !plan.is_solved() {
                    plan.kind = Status::Improved;
                    plan.status = format!("confirmed by the model ({})", plan.status);
                }
                return Ok(self.answer(plan, sample, motion, Decision::NewPlan));
            }
            if *share > 0.0 {
                self.stride = (0.25 * share).max(SHORTEST_STRIDE);
            }
            refused = Some(plan);
        }
        let Some(mut plan) = refused else {
            return controller.step(x, acting, &self.told(sample, wanted, Way::AsWanted));
        };
        if let Some((decision, motion)) = known {
            plan.kind = Status::NoImprovement;
            plan.status = format!("{decision}: no better plan was found");
            plan.active.clear();
            return Ok(self.answer(plan, sample, motion, decision));
        }
        self.last = None;
        let is_first = self.refuge.replace(from.clone()).is_none();
        if self.cut.take().is_some() && is_first {
            // What the controller does without a set is better than what it does towards one that it cannot reach; and
            // where it is now it finds a plan sooner than on a long way.
            controller.reset();
            plan = controller.step(x, acting, &self.told(sample, &from, Way::Straight))?;
        }
        plan.decision = Some(Decision::SoftBounds);
        if !plan.is_solved() {
            let law = |_: usize, x: &DVector<f64>| self.law(x, &from);
            let motion = self.roll_out(controller.plant(), sample, &from, &law)?;
            plan.decision = Some(Decision::SaturatedLqr);
            motion.write(&mut plan, &sample.beside, &self.u_bounds);
        }
        plan.status = format!(
            "not guaranteed, {}: {}",
            plan.decision.map_or(String::new(), |d| d.to_string()),
            plan.status
        );
        Ok(plan)
    }

    fn sample(&self, x: &[f64], beside: Option<&[f64]>, aims: Aims) -> Sample {
        let set = &self.set;
        let beside = match beside {
            Some(beside) => DVector::from_row_slice(beside),
            None => DVector::zeros(set.u.len()),
        };
        let moved = |bounds: &[f64]| -> Vec<f64> {
            let pairs = bounds.iter().zip(beside.iter());
            pairs.map(|(bound, beside)| bound + beside).collect()
        };
        let u = Limits {
            lower: moved(&self.u_bounds.lower),
            upper: moved(&self.u_bounds.upper),
        };
        // The law goes with the root of the level. Undisturbed, its limits are within the bounds.
        let share = |j: usize| match beside[j] == 0.0 {
            true => 1.0,
            false => {
                let room = (u.upper[j] - set.u[j]).min(set.u[j] - u.lower[j]);
                match room >= set.input_limits[j] {
                    true => 1.0,
                    false => (room / set.input_limits[j]).max(0.0),
                }
            }
        };
        let share = (0..beside.len()).map(share).fold(1.0, f64::min);
        Sample {
            x: DVector::from_row_slice(x),
            aims,
            u,
            level: set.level * share * share,
            beside,
        }
    }

    fn answer(
        &mut self,
        mut plan: Plan,
        sample: &Sample,
        motion: Motion,
        decision: Decision,
    ) -> Plan {
        plan.decision = Some(decision);
        motion.write(&mut plan, &sample.beside, &self.u_bounds);
        plan.target = Some(Target {
            x: motion.target.as_slice().to_vec(),
            u: (&self.set.u - &sample.beside).as_slice().to_vec(),
        });
        self.last = Some(motion);
        self.refuge = None;
        plan
    }

    /// The rest of the last plan, or the terminal law alone, to the last plan's target or where the plant is: whichever
    /// works, the cheapest one.
    fn known(
        &self,
        plant: &Plant,
        sample: &Sample,
    ) -> Result<Option<(Decision, Motion)>, MpcError> {
        let mut known: Option<(Decision, Motion)> = None;
        let mut offer = |decision: Decision, motion: Motion| {
            let best = known
                .as_ref()
                .map_or(f64::INFINITY, |(_, best)| self.worth(sample, best));
            if self.keeps(sample, &motion, 0.0) && self.worth(sample, &motion) < best {
                known = Some((decision, motion));
            }
        };
        if let Some(last) = &self.last {
            let rest = self.roll_out(
                plant,
                sample,
                &last.target,
                &|i, x| match last.u.get(i + 1) {
                    Some(u) => u - &self.set.k * (x - &last.x[i + 1]),
                    None => self.law(x, &last.target),
                },
            )?;
            offer(Decision::Candidate, rest);
        }
        let here = self.targets.nearest(&sample.x);
        let last = self.last.as_ref().map(|last| &last.target);
        for target in last.into_iter().chain([&sample.aims.end, &here]) {
            let law = self.roll_out(plant, sample, target, &|_, x| self.law(x, target))?;
            offer(Decision::TerminalLaw, law);
        }
        Ok(known)
    }

    fn law(&self, x: &DVector<f64>, target: &DVector<f64>) -> DVector<f64> {
        &self.set.u - &self.set.k * (x - target)
    }
}
