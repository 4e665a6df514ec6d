//! One closed loop of a campaign.

use super::variant::Variant;
use ballbot::{Ballbot, GuaranteedSettings, GuaranteedWorkspace};
use ballbot_scenario::{Prepared, ScenarioError};
use lpvmpc::{Decision, GuaranteedController};
use lpvmpc_sim::{GuaranteedLoop, Random, Tolerances};
use nalgebra::{Vector1, Vector4};
use serde::Serialize;

/// How the plant is integrated: as exactly as it makes sense.
const TOLERANCES: Tolerances = Tolerances {
    relative: 1e-12,
    absolute: 1e-12,
};

/// What a closed loop amounts to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Record {
    /// Samples at which a torque was applied.
    pub samples: usize,
    /// Samples without a plan that keeps all bounds.
    pub infeasible: usize,
    /// States outside the bounds, at samples.
    pub violations: usize,
    /// Samples between which a state was outside the bounds.
    pub violations_between: usize,
    /// How often each decision was taken, from [`Decision::NewPlan`] on.
    pub decisions: [usize; 5],
    /// Samples at which the cost of the plan did not fall by the stage cost, less the sample's epsilon,
    /// though the set point stayed.
    pub cost_growths: usize,
    /// Largest |theta|, rad.
    pub largest_tilt_rad: f64,
    /// Largest part of the cost by which it grew at these.
    pub largest_growth: f64,
    /// The robot fell: |theta| beyond a right angle, or no motion any more.
    pub fell: bool,
    /// Largest difference of rollout and prediction at the end of the horizon, in state units.
    pub largest_gap: f64,
    /// Cost of the closed loop: the stage costs of states and torques, about the wanted set point.
    pub cost: f64,
}

/// Set points that a robot cannot follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImpossibleSetPoints {
    /// Another one at every sample.
    EverySample,
    /// From one side to the other at every sample.
    Alternating,
    /// Farther away at every sample, faster than the robot drives.
    RunningAway,
    /// 1e300, infinite, NaN and others in turn.
    Huge,
}

/// Set points and when they are given.
#[derive(Clone, Debug, PartialEq)]
pub struct SetPoints(Vec<f64>);

impl SetPoints {
    /// A set point up to `farthest` rad from 0, and others at random times, 40 samples apart on
    /// average.
    pub(super) fn draw(random: &mut Random, samples: usize, farthest: f64) -> Self {
        let mut wanted = farthest * random.symmetric();
        let points = (0..samples).map(|_| {
            let (jump, next) = (random.uniform(), random.symmetric());
            if jump < 1.0 / 40.0 {
                wanted = farthest * next;
            }
            wanted
        });
        Self(points.collect())
    }

    /// What a `course` of set points asks for.
    pub(super) fn of(
        course: ImpossibleSetPoints,
        random: &mut Random,
        samples: usize,
        farthest: f64,
    ) -> Self {
        let size = farthest * random.symmetric();
        let at = |k: usize, random: &mut Random| match course {
            ImpossibleSetPoints::EverySample => farthest * random.symmetric(),
            ImpossibleSetPoints::Alternating if k.is_multiple_of(2) => size,
            ImpossibleSetPoints::Alternating => -size,
            ImpossibleSetPoints::RunningAway => size * k as f64,
            ImpossibleSetPoints::Huge => {
                let beyond = [1e300, -1e300, f64::INFINITY, f64::NAN, size];
                beyond[(5.0 * random.uniform()) as usize % beyond.len()]
            }
        };
        Self((0..samples).map(|k| at(k, random)).collect())
    }

    /// The set points, one per sample.
    pub fn points(&self) -> &[f64] {
        &self.0
    }
}

/// The guaranteed loop, ready to run.
pub(super) struct Loop<'a> {
    prepared: &'a Prepared,
    guaranteed: GuaranteedLoop<Ballbot<f64>, Ballbot<f64>, 4, 1, 3>,
    workspace: GuaranteedWorkspace<f64>,
}

impl<'a> Loop<'a> {
    /// A state drawn evenly from the certified set, or from its `edge`, around rest at phi = 0, or at the angle next to it
    /// about which the set is within the bounds.
    pub fn start(
        prepared: &Prepared,
        edge: bool,
        random: &mut Random,
    ) -> Result<Vector4<f64>, ScenarioError> {
        let GuaranteedSettings {
            terminal,
            set_points: [lower, upper],
            direction: phi,
            ..
        } = settings(prepared)?;
        let rest = phi * 0.0_f64.max(*lower).min(*upper);
        let direction = Vector4::from_fn(|_, _| random.normal()).normalize();
        let part = random.uniform().powf(0.25);
        let radius = terminal.level.sqrt() * if edge { 1.0 } else { part };
        // With P = L L', x = L^-T y has x'Px = |y|^2.
        let factor = terminal.p.cholesky().map(|factor| factor.l().transpose());
        let state = factor.and_then(|root| root.solve_upper_triangular(&(direction * radius)));
        state.map(|state| rest + state).ok_or_else(no_certificate)
    }

    /// The loop of `prepared` with the changes of `variant`.
    pub fn new(
        prepared: &'a Prepared,
        variant: &Variant,
        random: &mut Random,
    ) -> Result<Self, ScenarioError> {
        let mut settings = *settings(prepared)?;
        match *variant {
            Variant::Candidates => settings.iterations.known = 0,
            Variant::Horizon(horizon) => settings.horizon = horizon,
            _ => {}
        }
        let controller = GuaranteedController::allocate(prepared.ballbot, settings);
        let controller = controller.map_err(ScenarioError::from)?;
        let start = Self::start(prepared, *variant == Variant::Edge, random)?;
        let plant = variant.plant(prepared, random)?;
        Ok(Self {
            prepared,
            workspace: controller.workspace(),
            guaranteed: GuaranteedLoop::new(controller, plant, start, TOLERANCES),
        })
    }

    /// Runs the loop.
    pub fn record(
        &mut self,
        variant: &Variant,
        wanted: &SetPoints,
        samples: usize,
        random: &mut Random,
    ) -> Record {
        let mut record = Record::default();
        // The set point, the cost and what it must fall by, while it must.
        let mut before: Option<(f64, f64, f64)> = None;
        for wanted in wanted.points().iter().take(samples) {
            if let Some(jump) = variant.push(self.prepared, random) {
                self.guaranteed.push(&jump);
                before = None;
            }
            record.look_at(self.guaranteed.state(), self.prepared);
            let step = self.guaranteed.decide(*wanted, &mut self.workspace);
            record.samples += 1;
            record.decisions[step.decision as usize] += 1;
            record.largest_gap = record.largest_gap.max(step.gap.amax());
            if !step.decision.is_guaranteed() {
                record.infeasible += 1;
            }
            if let Some((same, cost, fall)) = before
                && same == *wanted
            {
                record.compare(cost, fall, step.cost);
            }
            let stage = stage_cost(
                self.guaranteed.state(),
                step.set_point,
                &step.u,
                self.prepared,
            );
            let fall = stage - self.guaranteed.epsilon();
            before = step
                .decision
                .is_guaranteed()
                .then_some((*wanted, step.cost, fall));
            record.pay(self.guaranteed.state(), *wanted, &step.u, self.prepared);
            let actuation = variant.actuation(random);
            let before = *self.guaranteed.state();
            let moved = self.guaranteed.advance(&step.u, &actuation);
            if variant.is_nominal() {
                record.look_between(&before, &step.u, self.prepared);
            }
            if moved.is_err() || has_fallen(self.guaranteed.state()) {
                record.fell = true;
                break;
            }
        }
        record.look_at(self.guaranteed.state(), self.prepared);
        record
    }
}

impl Record {
    /// Takes a state into account.
    pub(super) fn look_at(&mut self, x: &Vector4<f64>, prepared: &Prepared) {
        self.largest_tilt_rad = self.largest_tilt_rad.max(x[1].abs());
        if !prepared.settings.x.contains(x, 0.0) {
            self.violations += 1;
        }
    }

    /// Takes the states between two samples into account, under the input `u` from `x` on.
    fn look_between(&mut self, x: &Vector4<f64>, u: &Vector1<f64>, prepared: &Prepared) {
        const PARTS: usize = 8;
        let part = prepared.settings.t_s / PARTS as f64;
        let mut x = *x;
        for _ in 1..PARTS {
            let moved = lpvmpc_sim::advance(&prepared.ballbot, &x, u, part, TOLERANCES);
            match moved {
                Ok(next) if prepared.settings.x.contains(&next, 0.0) => x = next,
                _ => {
                    self.violations_between += 1;
                    return;
                }
            }
        }
    }

    /// Adds the stage cost, where what is wanted is a number whose square is one.
    fn pay(&mut self, x: &Vector4<f64>, wanted: f64, u: &Vector1<f64>, prepared: &Prepared) {
        if !(wanted.abs() < 1e100) {
            return;
        }
        self.cost += stage_cost(x, wanted, u, prepared);
    }

    /// The cost must fall by `fall`, but for rounding: each of the some hundred terms it is the sum of
    /// is rounded to 1e-16 of it, and close to 0 the plant's integration is not exact.
    pub(super) fn compare(&mut self, before: f64, fall: f64, after: f64) {
        const RELATIVE: f64 = 1e-12;
        const ABSOLUTE: f64 = 1e-9;
        if !(after <= before * (1.0 + RELATIVE) - fall + ABSOLUTE) {
            self.cost_growths += 1;
            self.largest_growth = self.largest_growth.max(after / before - 1.0);
        }
    }

    /// The count of a decision.
    pub fn count(&self, decision: Decision) -> usize {
        self.decisions[decision as usize]
    }
}

/// ||x - z d||_Q^2 + ||u||_R^2
fn stage_cost(x: &Vector4<f64>, set_point: f64, u: &Vector1<f64>, prepared: &Prepared) -> f64 {
    let weights = &prepared.settings.weights;
    let error = x - Vector4::x() * set_point;
    (weights.q * error).dot(&error) + (weights.r * u).dot(u)
}

/// Beyond a right angle nothing brings the robot back.
pub(super) fn has_fallen(x: &Vector4<f64>) -> bool {
    !(x[1].abs() < std::f64::consts::FRAC_PI_2)
}

pub(super) fn settings(prepared: &Prepared) -> Result<&GuaranteedSettings<f64>, ScenarioError> {
    prepared.guaranteed().ok_or_else(no_certificate)
}

fn no_certificate() -> ScenarioError {
    ScenarioError::Value {
        key: "controller.terminal".to_owned(),
        value: "(not certified)".to_owned(),
        expected: "a campaign needs a certified terminal set".to_owned(),
    }
}
