//! A scenario run step by step, by a person who takes part: targets move, pushes come, settings
//! change while it runs. Sample for sample it is [`Prepared::run`].

use crate::error::ScenarioError;
use crate::file::schema::PointTable;
use crate::number::finite;
use crate::prepare::prepared::{Plane, Prepared};
use crate::prepare::reference::PhiReference;
use crate::run::planes::PlaneLoop;
use crate::words;
use lpvmpc::{Observation, Regulator, Status};
use lpvmpc_sim::{Disturbance, LogRow, Sample, Termination, WorldError};
use nalgebra::{Vector1, Vector3, Vector4};
use std::f64::consts::FRAC_PI_2;
use std::time::Duration;

/// Part of a bound that its torque may be short of it and still count as at it.
const NEARLY: f64 = 0.01;

/// A robot in its world, with all its planes.
pub struct Session {
    prepared: Prepared,
    loops: Vec<PlaneLoop>,
    samples: Vec<Sample<4, 1>>,
    /// What became of each plane's last measurement.
    observations: Vec<Observation<4>>,
    phase: Phase,
    cause: FailureCause,
    /// The planes follow what a person ordered, not the scenario.
    ordered: bool,
    /// Pushes that take effect with the next sample: plane, and change of its state.
    pushes: Vec<(usize, Vector4<f64>)>,
}

/// Whether the robot still stands.
#[derive(Clone, Debug, PartialEq)]
pub enum Phase {
    /// The controller is at work.
    Running,
    /// It gave up, for this reason; the robot falls without torque.
    Falling(Termination),
    /// It lies on the floor, or its motion cannot be followed any further.
    Down(Termination),
}

/// What led to a fall.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FailureCause {
    /// The first of the samples without interruption until now that had no plan: time and why.
    pub without_plan: Option<(f64, Status<f64>)>,
    /// For how long the torque of some plane has been at its bound without interruption, s.
    pub saturated: f64,
}

impl Session {
    /// The scenario at time zero.
    ///
    /// # Errors
    /// [`ScenarioError::Controller`] or [`ScenarioError::World`] if either refuses its settings.
    pub fn new(prepared: Prepared) -> Result<Self, ScenarioError> {
        let planes = prepared.planes.iter();
        let loops = planes.map(|plane| prepared.closed_loop(plane));
        Ok(Self {
            loops: loops.collect::<Result<_, ScenarioError>>()?,
            prepared,
            samples: Vec::new(),
            observations: Vec::new(),
            phase: Phase::Running,
            cause: FailureCause::default(),
            ordered: false,
            pushes: Vec::new(),
        })
    }

    /// The same robot where it stands, at the same time, under another scenario. Regulators and
    /// worlds go on with all that they know; with the same scenario nothing changes. It goes on
    /// with what it was ordered to do. A plane that it did not have starts as that scenario says.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn reconfigured(&self, mut prepared: Prepared) -> Result<Self, ScenarioError> {
        for (plane, followed) in prepared.planes.iter_mut().zip(&self.prepared.planes) {
            if self.ordered {
                plane.reference = followed.reference.clone();
            }
        }
        let planes = prepared.planes.iter().enumerate();
        let loops = planes.map(|(index, plane)| {
            Ok(match self.loops.get(index) {
                Some(before) => prepared.continued_loop(plane, before)?,
                None => {
                    let mut begun = prepared.closed_loop(plane)?;
                    begun.world = begun.world.at_time(self.time());
                    begun
                }
            })
        });
        let loops: Vec<_> = loops.collect::<Result<_, ScenarioError>>()?;
        let mut samples = self.samples.clone();
        let mut observations = self.observations.clone();
        if loops.len() != self.loops.len() {
            (samples, observations) = (Vec::new(), Vec::new());
        }
        let mut session = Self {
            prepared,
            loops,
            samples,
            observations,
            phase: self.phase.clone(),
            cause: self.cause.clone(),
            ordered: self.ordered,
            pushes: Vec::new(),
        };
        for (plane, change) in &self.pushes {
            session.change(*plane, *change)?;
        }
        Ok(session)
    }

    /// The scenario.
    pub fn prepared(&self) -> &Prepared {
        &self.prepared
    }

    /// Time since the beginning, s.
    pub fn time(&self) -> f64 {
        self.loops.first().map_or(0.0, |plane| plane.world.time())
    }

    /// The true state of each plane.
    pub fn states(&self) -> impl Iterator<Item = &Vector4<f64>> {
        self.loops.iter().map(|plane| plane.world.state())
    }

    /// phi_ref of each plane now, rad.
    pub fn targets(&self) -> impl Iterator<Item = f64> {
        let now = self.time();
        self.prepared
            .planes
            .iter()
            .map(move |plane| plane.reference.at(now))
    }

    /// The last sample of each plane; empty before the first.
    pub fn samples(&self) -> &[Sample<4, 1>] {
        &self.samples
    }

    /// What each plane's regulator made of its last measurement; empty before the first sample.
    pub fn observations(&self) -> &[Observation<4>] {
        &self.observations
    }

    /// The motors' torques (tau_1, tau_2, tau_3) of the last sample, N m; zero before the first.
    pub fn motor_torques(&self) -> Vector3<f64> {
        let torque = |plane: usize| self.samples.get(plane).map_or(0.0, |sample| sample.u[0]);
        let torques = Vector3::new(torque(0), torque(1), 0.0);
        self.prepared.wheels.motors(&torques)
    }

    /// The states that the model of a plane reaches under its last plan, one per sample of the
    /// horizon; empty when there is no such plane.
    pub fn prediction(&self, plane: usize) -> Vec<Vector4<f64>> {
        let regulator = self.loops.get(plane).map(|plane| &plane.regulator);
        regulator.map_or_else(Vec::new, |regulator| regulator.prediction().collect())
    }

    /// Whether the robot still stands.
    pub fn phase(&self) -> &Phase {
        &self.phase
    }

    /// What the controllers said at the last sample, for people.
    pub fn status_in_words(&self) -> String {
        match self.phase {
            Phase::Running => {
                let statuses = self.samples.iter().map(|sample| sample.status);
                let worst = statuses.reduce(|a, b| if a.is_solved() { b } else { a });
                let status = worst.map_or_else(String::new, |status| words::status(&status));
                let observations = self.observations.iter();
                let readings = words::readings(observations.map(|seen| (self.time(), *seen)));
                let both = [status, readings].into_iter();
                both.filter(|text| !text.is_empty())
                    .collect::<Vec<_>>()
                    .join("; ")
            }
            Phase::Falling(_) => "no plan, no torque".to_owned(),
            Phase::Down(_) => "on the floor".to_owned(),
        }
    }

    /// The bounds that are active in the last plan of a plane, for people; empty when there are
    /// none, or no such plane.
    pub fn active_bounds_in_words(&self, plane: usize) -> String {
        if self.phase != Phase::Running {
            return String::new();
        }
        let regulator = self.loops.get(plane).map(|plane| &plane.regulator);
        let bounds =
            regulator.map_or_else(Vec::new, |regulator| regulator.active_bounds().collect());
        words::active_bounds(&bounds, self.prepared.settings.t_s)
    }

    /// Why the robot does not stand any more, for people; `None` while it stands.
    pub fn fall_in_words(&self) -> Option<String> {
        let (Phase::Falling(termination) | Phase::Down(termination)) = &self.phase else {
            return None;
        };
        let mut text = words::termination(termination);
        if let Some((t, status)) = &self.cause.without_plan
            && !matches!(termination, Termination::NoPlan { .. })
        {
            text += &format!("; no plan from t = {t:.3} s on: {}", words::status(status));
        }
        if self.cause.saturated > 0.0 {
            let saturated = self.cause.saturated;
            text += &format!("; the torque had been at its bound for {saturated:.2} s");
        }
        Some(text)
    }

    /// One sample in all planes; `false` if the robot lies on the floor, and there was none.
    /// `clock` is monotonic.
    pub fn step(&mut self, clock: &dyn Fn() -> Duration) -> bool {
        self.pushes.clear();
        match self.phase {
            Phase::Running => self.sample(clock),
            Phase::Falling(_) => {
                self.go_on_without_torque(Vec::new());
                true
            }
            Phase::Down(_) => false,
        }
    }

    fn sample(&mut self, clock: &dyn Fn() -> Duration) -> bool {
        let mut samples = Vec::with_capacity(self.loops.len());
        let mut observations = Vec::with_capacity(self.loops.len());
        for (closed_loop, plane) in self.loops.iter_mut().zip(&self.prepared.planes) {
            let reference = |t| plane.state_reference(t);
            let mut last = None;
            let mut log = |row: LogRow<4, 1>| last = Some(row.observation);
            match closed_loop.sample(&reference, clock, &mut log) {
                Ok(sample) => samples.push(sample),
                Err(termination) => return self.give_up(termination, samples),
            }
            observations.extend(last);
        }
        self.samples = samples;
        self.observations = observations;
        self.note_cause();
        true
    }

    fn note_cause(&mut self) {
        let unsolved = self.samples.iter().find(|s| !s.status.is_solved());
        self.cause.without_plan = match (unsolved, &self.cause.without_plan) {
            (None, _) => None,
            (Some(_), Some(first)) => Some(*first),
            (Some(sample), None) => Some((sample.t, sample.status)),
        };
        let bounds = &self.prepared.settings.u;
        let (lower, upper) = (bounds.lower[0], bounds.upper[0]);
        let at_bound = |sample: &Sample<4, 1>| {
            let u = sample.u[0];
            // A descent may stop just short of it.
            u <= lower + NEARLY * lower.abs() || u >= upper - NEARLY * upper.abs()
        };
        if self.samples.iter().any(at_bound) {
            self.cause.saturated += self.prepared.settings.t_s;
        } else {
            self.cause.saturated = 0.0;
        }
    }

    /// The planes up to the one that ended have a sample already; those after it were not asked.
    fn give_up(&mut self, termination: Termination, samples: Vec<Sample<4, 1>>) -> bool {
        let falls = matches!(termination, Termination::NoPlan { .. });
        self.phase = if falls {
            Phase::Falling(termination)
        } else {
            Phase::Down(termination)
        };
        let any = falls || !samples.is_empty();
        if any {
            self.go_on_without_torque(samples);
        }
        any
    }

    /// A sample without torque in the planes that have none among `samples`.
    fn go_on_without_torque(&mut self, mut samples: Vec<Sample<4, 1>>) {
        let falling = self.loops.get(samples.len());
        let t = falling.map_or(0.0, |closed_loop| closed_loop.world.time());
        let status = match &self.phase {
            Phase::Falling(Termination::NoPlan { status, .. })
            | Phase::Down(Termination::NoPlan { status, .. }) => *status,
            _ => Status::NotFinite,
        };
        let planes = self.loops.iter().zip(&self.prepared.planes);
        for (closed_loop, plane) in planes.skip(samples.len()) {
            let x = *closed_loop.world.state();
            samples.push(Sample {
                t,
                x,
                estimate: x,
                u: Vector1::zeros(),
                x_ref: plane.state_reference(t),
                cost: f64::NAN,
                status,
                active_bounds: 0,
                step_time: Duration::ZERO,
                gap: Vector4::zeros(),
                guarantee: None,
            });
        }
        self.samples = samples;
        self.coast(t + self.prepared.settings.t_s);
    }

    /// Moves every plane on to the time `until` of its world without torque.
    fn coast(&mut self, until: f64) {
        for closed_loop in &mut self.loops {
            let world = &mut closed_loop.world;
            world.command(Vector1::zeros());
            while world.time() < until - 0.5 * world.period() {
                let moved = world.advance();
                if moved.is_err() || world.state()[1].abs() > FRAC_PI_2 {
                    if let Phase::Falling(termination) = &self.phase {
                        self.phase = Phase::Down(termination.clone());
                    }
                    return;
                }
            }
        }
    }

    /// From now on phi of each plane has to go to these values, rad: at once, or by a smooth move
    /// where the scenario asks for that. What is beyond the robot's planes is not heard. Says
    /// of each plane how many smooth moves that had not begun are dropped for this one: of the
    /// order before or, at the first order, of the scenario's own set points.
    ///
    /// # Errors
    /// A target that is not a finite number.
    pub fn set_targets(&mut self, targets: &[f64]) -> Result<Vec<usize>, ScenarioError> {
        for target in targets {
            finite("target", *target)?;
        }
        let time_s = self.time();
        let moves = self.prepared.moves;
        self.ordered = true;
        let planes = self.prepared.planes.iter_mut().zip(targets);
        let dropped = planes.map(|(plane, &phi_rad)| {
            let point = PointTable { time_s, phi_rad };
            plane.reference.redirect(point, moves)
        });
        Ok(dropped.collect())
    }

    /// From now on the planes follow these references; their times count from the beginning of
    /// the session.
    pub fn set_references(&mut self, references: impl IntoIterator<Item = PhiReference>) {
        for (plane, reference) in self.prepared.planes.iter_mut().zip(references) {
            plane.reference = reference;
        }
        self.ordered = true;
    }

    /// Pushes a plane now: its rates change by (phi_dot, theta_dot), rad/s.
    ///
    /// # Errors
    /// [`WorldError::Disturbance`] if the numbers are not finite.
    pub fn push(&mut self, plane: usize, phi_dot: f64, theta_dot: f64) -> Result<(), WorldError> {
        self.change(plane, Vector4::new(0.0, 0.0, phi_dot, theta_dot))
    }

    fn change(&mut self, plane: usize, change: Vector4<f64>) -> Result<(), WorldError> {
        let Some(closed_loop) = self.loops.get_mut(plane) else {
            return Ok(());
        };
        let time = closed_loop.world.time();
        closed_loop
            .world
            .disturb(Disturbance::Jump { time, change })?;
        self.pushes.push((plane, change));
        Ok(())
    }

    /// The planes, with what they have to follow.
    pub fn planes(&self) -> &[Plane] {
        &self.prepared.planes
    }
}
