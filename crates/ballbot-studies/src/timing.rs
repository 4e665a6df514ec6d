//! How long the controller takes on this machine.
//!
//! Every sample of a closed loop is repeated from the same memory of the past, and the shortest
//! time counts, so that what else the machine does is left out; the statistics are over the
//! samples of the sequence. The clock is handed in ([`Stopwatch`]).

mod problems;

pub use problems::{PROBLEMS, time_problems};

use crate::StudyError;
use ballbot::{Controller, ControllerSettings};
use ballbot_scenario::{Prepared, Problem, Scenario, ScenarioError};
use lpvmpc::{
    GuaranteedController, GuaranteedIterations, Iterations, Reference, Solver, TerminalIngredient,
};
use lpvmpc_sim::advance;
use nalgebra::Vector4;
use serde::Serialize;
use std::hint::black_box;
use std::path::Path;
use std::time::Duration;

/// The closed loops that are timed.
pub const SEQUENCES: [&str; 4] = [
    "two-setpoints",
    "lissajous",
    "single-setpoint-terminal",
    "tight-bounds",
];

/// Samples of a sequence, spread evenly, that are timed with a cold cache, and the most of their repetitions: each
/// needs a sweep, which takes a thousand times as long as a step.
const COLD_SAMPLES: usize = 40;
const COLD_PASSES: usize = 3;
/// What is swept before each of these, bytes: more than the caches of a core hold.
const SWEPT: usize = 48 << 20;

/// Samples of the guaranteed loop, and how long it keeps a set point.
const GUARDED_SAMPLES: usize = 400;
const HOLD: usize = 80;

/// The time since some instant, of a monotonic clock.
pub type Clock<'a> = &'a dyn Fn() -> Duration;

/// How times are taken.
#[derive(Clone, Copy)]
pub struct Stopwatch<'a> {
    /// By which clock.
    pub clock: Clock<'a>,
    /// Repetitions of each sample; with a cold cache at most three of them.
    pub passes: usize,
}

impl<'a> Stopwatch<'a> {
    /// Repetitions that leave out what else the machine does.
    pub const PASSES: usize = 30;

    /// Times by this clock, of [`Self::PASSES`] repetitions.
    pub fn new(clock: Clock<'a>) -> Self {
        Self {
            clock,
            passes: Self::PASSES,
        }
    }

    fn time(&self) -> Duration {
        (self.clock)()
    }

    /// The shortest of all repetitions, in microseconds.
    fn shortest(&self, repetition: impl FnMut() -> Duration) -> f64 {
        shortest_of(self.passes, repetition)
    }

    /// The shortest of those for which the caches are swept.
    fn shortest_cold(&self, repetition: impl FnMut() -> Duration) -> f64 {
        shortest_of(self.passes.min(COLD_PASSES), repetition)
    }
}

fn shortest_of(passes: usize, mut repetition: impl FnMut() -> Duration) -> f64 {
    let times = (0..passes).map(|_| repetition());
    times.min().unwrap_or_default().as_secs_f64() * 1e6
}

type Control = Controller<f64>;

/// Statistics of a time over a sequence, in microseconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Times {
    /// Half of the samples take no longer.
    pub median: f64,
    /// 99 % of the samples take no longer.
    pub p99: f64,
    /// No sample takes longer.
    pub max: f64,
}

/// The times of one sequence.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SequenceTimes {
    /// The scenario, or one of [`PROBLEMS`].
    pub name: String,
    /// The quadratic program alone.
    pub qp_us: Times,
    /// The same after other work, of 48 MB, has taken the caches.
    pub qp_cold_us: Times,
    /// The whole step: scheduling, predictor, quadratic program, rollout; of [`PROBLEMS`], the program alone.
    pub step_us: Times,
    /// The same after other work.
    pub step_cold_us: Times,
    /// Most bounds active in one sample (components of a terminal equality included).
    pub max_active: usize,
}

impl Times {
    fn new(mut times: Vec<f64>) -> Self {
        times.sort_by(f64::total_cmp);
        let at = |fraction: f64| {
            let index = (fraction * times.len() as f64).ceil() as usize;
            times.get(index.saturating_sub(1)).copied().unwrap_or(0.0)
        };
        Self {
            median: at(0.5),
            p99: at(0.99),
            max: at(1.0),
        }
    }
}

/// The times of the guaranteed step and of the plain one from the same states.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GuaranteedTimes {
    /// Without guarantee: terminal cost, the same predictor.
    pub plain_us: Times,
    /// The same as a descent, the default of scenarios.
    pub descent_us: Times,
    /// Of a descent, from the measured state to its answer, with everything else prepared.
    pub feedback_us: Times,
    /// The same after other work, of 48 MB, between `prepare` and `feedback`.
    pub feedback_cold_us: Times,
    /// A descent towards a set point 2.5 m away, given at once: several programs per sample.
    pub far_descent_us: Times,
    /// With artificial set point, certified terminal set and acceptance test; one quadratic
    /// program.
    pub guaranteed_us: Times,
}

/// Times the guaranteed loop of the scenario `far-setpoints`, with set points within a turn, along
/// with the plain controller.
///
/// # Errors
/// A controller refuses its settings or the plant cannot be integrated.
pub fn time_guaranteed(watch: Stopwatch<'_>) -> Result<GuaranteedTimes, StudyError> {
    let prepared = Scenario::load("far-setpoints")?.prepare(Path::new("."))?;
    let Some(mut settings) = prepared.guaranteed().copied() else {
        return Err(StudyError::Unsuitable("no terminal set"));
    };
    settings.iterations = GuaranteedIterations {
        known: 1,
        ..settings.iterations
    };
    let mut plain_settings = prepared.settings;
    plain_settings.terminal = TerminalIngredient::Cost(settings.terminal.p);
    plain_settings.iterations = Iterations::Fixed(1);
    let refused = ScenarioError::from;
    let mut plain = Control::allocate(prepared.ballbot, plain_settings).map_err(refused)?;
    let mut guaranteed =
        GuaranteedController::allocate(prepared.ballbot, settings).map_err(ScenarioError::from)?;
    let mut workspace = plain.workspace();
    let mut memory = guaranteed.workspace::<5>();
    let (mut plain_us, mut guaranteed_us) = (Vec::new(), Vec::new());
    let mut x = Vector4::zeros();
    for k in 0..GUARDED_SAMPLES {
        let wanted = [1.0, -0.5, 2.0, -2.0, 0.0][k / HOLD % 5];
        let reference = Reference::constant(Vector4::new(wanted, 0.0, 0.0, 0.0));
        let before = plain.clone();
        plain_us.push(watch.shortest(|| {
            plain.clone_from(&before);
            let start = watch.time();
            black_box(plain.step(black_box(&x), &reference, &mut workspace));
            watch.time() - start
        }));
        let (before, remembered) = (guaranteed.clone(), memory.clone());
        let mut u = prepared.settings.u.lower;
        guaranteed_us.push(watch.shortest(|| {
            guaranteed.clone_from(&before);
            memory.clone_from(&remembered);
            let start = watch.time();
            u = black_box(guaranteed.step(black_box(&x), wanted, &mut memory)).u;
            watch.time() - start
        }));
        x = advance(&prepared.ballbot, &x, &u, settings.t_s, prepared.tolerances)?;
    }
    let descent_settings = ControllerSettings {
        iterations: Iterations::default(),
        ..plain_settings
    };
    let near = |k: usize| [1.0, -0.5, 2.0, -2.0, 0.0][k / HOLD % 5];
    let far = |_: usize| prepared.ballbot.geometry.ball_angle(2.5);
    let descent = DescentTimes::of(&prepared, descent_settings, GUARDED_SAMPLES, near, watch)?;
    let far = DescentTimes::of(&prepared, descent_settings, HOLD, far, watch)?;
    Ok(GuaranteedTimes {
        plain_us: Times::new(plain_us),
        descent_us: descent.step,
        feedback_us: descent.feedback,
        feedback_cold_us: descent.feedback_cold,
        far_descent_us: far.step,
        guaranteed_us: Times::new(guaranteed_us),
    })
}

/// The times of a descent in a closed loop.
struct DescentTimes {
    step: Times,
    feedback: Times,
    feedback_cold: Times,
}

impl DescentTimes {
    /// From rest, towards the ball angle (rad) that is `wanted` at each sample.
    fn of(
        prepared: &Prepared,
        settings: ControllerSettings<f64>,
        samples: usize,
        wanted: impl Fn(usize) -> f64,
        watch: Stopwatch<'_>,
    ) -> Result<Self, StudyError> {
        let controller = Control::allocate(prepared.ballbot, settings);
        let mut controller = controller.map_err(ScenarioError::from)?;
        let mut workspace = controller.workspace();
        let (mut step, mut feedback, mut feedback_cold) = (Vec::new(), Vec::new(), Vec::new());
        let mut other_work = OtherWork::new();
        // Between the set point's jumps, of which there are few.
        let stride = samples.div_ceil(COLD_SAMPLES);
        let mut x = Vector4::zeros();
        for k in 0..samples {
            let reference = Reference::constant(Vector4::new(wanted(k), 0.0, 0.0, 0.0));
            let before = controller.clone();
            let mut answer = |other_work: Option<&mut OtherWork>| {
                controller.clone_from(&before);
                controller.prepare(&reference, &mut workspace);
                other_work.map(OtherWork::sweep);
                let start = watch.time();
                black_box(controller.feedback(black_box(&x), &reference, &mut workspace));
                watch.time() - start
            };
            feedback.push(watch.shortest(|| answer(None)));
            if k % stride == stride / 2 {
                let cold = watch.shortest_cold(|| answer(Some(&mut other_work)));
                feedback_cold.push(cold);
            }
            step.push(watch.shortest(|| {
                controller.clone_from(&before);
                let start = watch.time();
                black_box(controller.step(black_box(&x), &reference, &mut workspace));
                watch.time() - start
            }));
            x = next(prepared, &x, &controller)?;
        }
        Ok(Self {
            step: Times::new(step),
            feedback: Times::new(feedback),
            feedback_cold: Times::new(feedback_cold),
        })
    }
}

/// Times the controller of a scenario, without filter, delay line and world, on the scenario's robot
/// in an ideal world.
///
/// # Errors
/// The loop is a guaranteed one or plans the torque's rate, the controller refuses its settings, or the plant cannot be
/// integrated.
pub fn time(
    name: &str,
    prepared: &Prepared,
    watch: Stopwatch<'_>,
) -> Result<SequenceTimes, StudyError> {
    let unsuitable = match prepared.problem {
        Problem::Plain => None,
        Problem::Ramped(_) => Some(
            "the times are of a controller that plans the torque: leave [controller.torque_rate] out",
        ),
        Problem::Guaranteed(_) => Some(
            "the times are of a controller without a guarantee, which has other settings than this one; without a \
             scenario the guaranteed step is timed along far-setpoints",
        ),
    };
    if let Some(reason) = unsuitable {
        return Err(StudyError::Unsuitable(reason));
    }
    let mut record = Record::default();
    for plane in 0..prepared.planes.len() {
        time_plane(prepared, plane, watch, &mut record)?;
    }
    Ok(SequenceTimes {
        name: name.to_owned(),
        qp_us: Times::new(record.qp),
        qp_cold_us: Times::new(record.qp_cold),
        step_us: Times::new(record.step),
        step_cold_us: Times::new(record.step_cold),
        max_active: record.max_active,
    })
}

#[derive(Default)]
struct Record {
    qp: Vec<f64>,
    qp_cold: Vec<f64>,
    step: Vec<f64>,
    step_cold: Vec<f64>,
    max_active: usize,
}

fn time_plane(
    prepared: &Prepared,
    plane: usize,
    watch: Stopwatch<'_>,
    record: &mut Record,
) -> Result<(), StudyError> {
    let plane = &prepared.planes[plane];
    let t_s = prepared.settings.t_s;
    let mut controller =
        Control::allocate(prepared.ballbot, prepared.settings).map_err(ScenarioError::from)?;
    let mut workspace = controller.workspace();
    let mut solver = Solver::allocate(prepared.settings.capacity());
    let horizon = prepared.settings.horizon;
    let mut x = plane.initial_state;
    let mut other_work = OtherWork::new();
    let stride = prepared.samples.div_ceil(COLD_SAMPLES);
    for k in 0..prepared.samples {
        // Without preview the present reference is that of all stages.
        let seen = if prepared.feedback.preview { 1 } else { 0 };
        let at = |i: usize| plane.state_reference((k + seen * i) as f64 * t_s);
        let stages: Vec<_> = (0..horizon).map(at).collect();
        let reference = Reference {
            stages: &stages,
            terminal: at(horizon),
        };
        let before = controller.clone();
        let mut step = |other_work: Option<&mut OtherWork>| {
            controller.clone_from(&before);
            other_work.map(OtherWork::sweep);
            let start = watch.time();
            black_box(controller.step(black_box(&x), &reference, &mut workspace));
            watch.time() - start
        };
        record.step.push(watch.shortest(|| step(None)));
        if k % stride == 0 {
            let cold = watch.shortest_cold(|| step(Some(&mut other_work)));
            record.step_cold.push(cold);
        }
        let mut solution = before.solution().clone();
        let mut qp = |other_work: Option<&mut OtherWork>| {
            solution.clone_from(before.solution());
            other_work.map(OtherWork::sweep);
            let settings = &controller.settings().solver;
            let start = watch.time();
            solver.solve(black_box(workspace.ocp()), settings, &mut solution);
            let elapsed = watch.time() - start;
            black_box(&solution);
            elapsed
        };
        record.qp.push(watch.shortest(|| qp(None)));
        if k % stride == 0 {
            let cold = watch.shortest_cold(|| qp(Some(&mut other_work)));
            record.qp_cold.push(cold);
        }
        record.max_active = record.max_active.max(controller.solution().active.len());
        x = next(prepared, &x, &controller)?;
    }
    Ok(())
}

fn next(
    prepared: &Prepared,
    x: &Vector4<f64>,
    controller: &Control,
) -> Result<Vector4<f64>, StudyError> {
    let u = controller.solution().u[0];
    let t_s = prepared.settings.t_s;
    Ok(advance(&prepared.ballbot, x, &u, t_s, prepared.tolerances)?)
}

/// Memory that work of another kind goes through between two steps.
struct OtherWork {
    memory: Vec<u64>,
}

impl OtherWork {
    fn new() -> Self {
        Self {
            memory: vec![0; SWEPT / size_of::<u64>()],
        }
    }

    /// Reads and writes all of it.
    fn sweep(&mut self) {
        for word in &mut self.memory {
            *word = word.wrapping_add(1);
        }
        black_box(&self.memory);
    }
}
