//! The controller in its feedback pipeline: memory, hand-over, offsets, bounds.

use super::pendulum::{PENDULUM, settings};
use crate::pendulum::Pendulum;
use lpvmpc::{
    Belief, Bounds, Controller, ControllerArrays, ControllerSettings, Estimator, EstimatorArrays,
    EstimatorError, EstimatorMemory, EstimatorSettings, FeedbackArrays, FeedbackMemory,
    FeedbackSettings, Held, InputReference, Iterations, Measurement, OutputFeedback, Planner,
    Predictor, Ramped, RampedInput, Reading, Regulator, Rk4, Scheduling, SolverSettings,
    Standalone, Status, TerminalIngredient, Verdict, Weights, Workspace, WorkspaceArrays,
};
use lpvmpc_testkit::rng::Rng;
use nalgebra::{Matrix1, Matrix1x2, Matrix2, Matrix3, SVector, Vector1, Vector2, Vector3};

pub const T_S: f64 = 0.02;
pub const DELAY: f64 = 0.03;
pub const N: usize = 25;
pub const INSTANTS: usize = 16;
pub const COMMANDS: usize = 8;
/// Bound of the torque, N m; it holds the pendulum at 0.4 rad at most.
pub const LIMIT: f64 = 4.0;

pub type Feedback<K> = OutputFeedback<Pendulum<f64>, K, f64, 2, 1, 1, 1, 1>;
pub type PlannerOfTorque = Held<Pendulum<f64>, f64, 2, 1, 1>;
type PlannerOfRate = Ramped<Pendulum<f64>, f64, 2, 1, 1, 3>;
pub type Regulated<K> = Standalone<Feedback<K>, <K as Planner<f64, 2, 1>>::Workspace>;

pub fn controller_settings(horizon: usize) -> ControllerSettings<f64, 2, 1, 1> {
    ControllerSettings {
        t_s: T_S,
        horizon,
        predictor: Predictor::StageConsistent(Rk4 { substeps: 1 }),
        weights: Weights {
            q: Matrix2::from_diagonal(&Vector2::new(100.0, 1.0)),
            r: Matrix1::new(0.1),
        },
        terminal: TerminalIngredient::Cost(Matrix2::new(200.0, 40.0, 40.0, 12.0)),
        x: Bounds::none(),
        u: limits(),
        soft_x: [None; 2],
        raise_prices: false,
        input_reference: InputReference::SteadyState,
        scheduling: Scheduling::Predicted,
        iterations: Iterations::default(),
        solver: SolverSettings::default(),
    }
}

fn limits() -> Bounds<f64, 1> {
    Bounds {
        lower: Vector1::new(-LIMIT),
        upper: Vector1::new(LIMIT),
    }
}

fn feedback_settings() -> FeedbackSettings<f64, 1> {
    FeedbackSettings {
        delay: DELAY,
        period: T_S,
        preview: true,
        u: limits(),
    }
}

fn belief() -> Belief<Pendulum<f64>, f64, 2, 1, 1, 1, 1> {
    let estimator = Estimator::allocate(PENDULUM, settings(), Vector2::zeros(), INSTANTS);
    Belief::Estimated(estimator.unwrap())
}

fn around<K: Planner<f64, 2, 1>>(planner: K) -> Feedback<K> {
    let memory = FeedbackMemory::allocate(COMMANDS, planner.horizon());
    OutputFeedback::new(belief(), planner, feedback_settings(), memory)
}

/// The torque is held.
pub fn held(horizon: usize) -> Regulated<PlannerOfTorque> {
    let controller = Controller::allocate(PENDULUM, controller_settings(horizon)).unwrap();
    Standalone {
        workspace: controller.workspace(),
        feedback: around(Held::new(controller)),
    }
}

/// The torque moves in ramps.
fn ramped(horizon: usize) -> Regulated<PlannerOfRate> {
    let plain = controller_settings(horizon);
    let settings = ControllerSettings {
        t_s: T_S,
        horizon,
        predictor: plain.predictor,
        weights: Weights {
            q: Matrix3::from_diagonal(&Vector3::new(100.0, 1.0, 0.1)),
            r: Matrix1::new(1e-3),
        },
        terminal: TerminalIngredient::Cost(Matrix3::new(
            200.0, 40.0, 0.0, 40.0, 12.0, 0.0, 0.0, 0.0, 0.0,
        )),
        x: Bounds {
            lower: Vector3::new(f64::NEG_INFINITY, f64::NEG_INFINITY, -LIMIT),
            upper: Vector3::new(f64::INFINITY, f64::INFINITY, LIMIT),
        },
        u: Bounds {
            lower: Vector1::new(-60.0),
            upper: Vector1::new(60.0),
        },
        soft_x: [None; 3],
        raise_prices: false,
        input_reference: InputReference::SteadyState,
        scheduling: Scheduling::Predicted,
        iterations: plain.iterations,
        solver: plain.solver,
    };
    let controller = Controller::allocate(RampedInput(PENDULUM), settings).unwrap();
    Standalone {
        workspace: controller.workspace(),
        feedback: around(Ramped::allocate(controller)),
    }
}

/// A pendulum with another torque on it, behind a delay, with noise and readings that are missing
/// or late.
pub struct World {
    pub x: Vector2<f64>,
    pub disturbance: f64,
    noise: f64,
    k: usize,
    past: Vec<f64>,
    /// Torques, and when they act.
    travelling: Vec<(f64, f64)>,
    acting: f64,
    rng: Rng,
}

impl World {
    pub fn new(disturbance: f64, noise: f64) -> Self {
        Self {
            x: Vector2::new(0.1, 0.0),
            disturbance,
            noise,
            k: 0,
            past: Vec::new(),
            travelling: Vec::new(),
            acting: 0.0,
            rng: Rng::new(7),
        }
    }

    pub fn measurement(&mut self) -> Measurement<f64, 1> {
        self.past.push(self.x[0] + self.noise * self.rng.normal());
        let late = [0, 0, 1, 2][self.k % 4];
        let reading = self.past.len().checked_sub(1 + late).map(|place| Reading {
            value: self.past[place],
            age: late as f64 * T_S,
        });
        Measurement {
            t: 1e9 + self.k as f64 * T_S,
            readings: [reading.filter(|_| self.k % 7 != 3)],
        }
    }

    pub fn advance(&mut self, torque: f64) {
        let now = self.k as f64 * T_S;
        self.travelling.push((now + DELAY, torque));
        for part in 0..4 {
            let until = now + f64::from(part) * T_S / 4.0 + 1e-9;
            while self
                .travelling
                .first()
                .is_some_and(|(due, _)| *due <= until)
            {
                self.acting = self.travelling.remove(0).1;
            }
            let u = Vector1::new(self.acting + self.disturbance);
            self.x = Rk4 { substeps: 1 }.advance(&PENDULUM, &self.x, &u, T_S / 4.0);
        }
        self.k += 1;
    }
}

fn target(t: f64) -> Vector2<f64> {
    Vector2::new(if t < 1e9 + 2.0 { 0.2 } else { -0.1 }, 0.0)
}

/// `samples` of a run with this regulator: torques and angles.
pub fn run(
    regulator: &mut impl Regulator<f64, 2, 1, 1>,
    world: &mut World,
    samples: usize,
) -> Vec<(f64, f64)> {
    let one = |_| {
        regulator.observe(&world.measurement());
        let command = regulator.decide(&target);
        assert!(command.status.is_solved(), "{}", command.status);
        assert!(command.u[0].abs() <= LIMIT, "{}", command.u);
        world.advance(command.u[0]);
        (command.u[0], world.x[0])
    };
    (0..samples).map(one).collect()
}

/// A torque of 0.6 N m that nobody told of leaves no error, whether the torque is held or moves in
/// ramps; its bounds are those of the commanded one.
#[test]
fn a_constant_torque_leaves_no_offset() {
    for disturbance in [-0.6, 0.0, 0.6] {
        let mut world = World::new(disturbance, 0.0);
        let torque = run(&mut held(N), &mut world, 400).last().unwrap().0;
        assert!((world.x[0] + 0.1).abs() < 1e-4, "{}", world.x);
        // It holds the weight, m g l sin: 9.81 sin 0.1.
        let expected = 9.81 * 0.1_f64.sin() - disturbance;
        assert!((torque - expected).abs() < 1e-3, "{torque} {expected}");
        let mut world = World::new(disturbance, 0.0);
        run(&mut ramped(N), &mut world, 400);
        assert!((world.x[0] + 0.1).abs() < 1e-3, "{}", world.x);
    }
}

/// What is commanded keeps its bounds, not what acts on the model: with 0.5 N m on top, all of the
/// 4 N m are used, and no more.
#[test]
fn the_bounds_are_those_of_the_commanded_input() {
    let mut regulator = held(N);
    let mut world = World::new(0.5, 0.0);
    run(&mut regulator, &mut world, 150);
    world.x[1] -= 1.2;
    let torques = run(&mut regulator, &mut world, 40);
    let lowest = torques.iter().map(|(u, _)| *u).fold(0.0, f64::min);
    let largest = torques.iter().map(|(u, _)| *u).fold(0.0, f64::max);
    assert!(lowest == -LIMIT || largest == LIMIT, "{lowest} {largest}");
}

#[test]
fn lent_memory_regulates_as_the_heap_does() {
    let controller: &mut ControllerArrays<f64, 2, 1, N, N> =
        Box::leak(Box::new(ControllerArrays::default()));
    let workspace: &mut WorkspaceArrays<f64, 2, 1, N, N> =
        Box::leak(Box::new(WorkspaceArrays::default()));
    let estimator: &mut EstimatorArrays<f64, 2, 1, 1, 1, INSTANTS> =
        Box::leak(Box::new(EstimatorArrays::default()));
    let feedback: &mut FeedbackArrays<f64, 2, 1, N, COMMANDS> =
        Box::leak(Box::new(FeedbackArrays::default()));
    let controller = Controller::new(PENDULUM, controller_settings(N), controller.lend()).unwrap();
    let estimator =
        Estimator::new(PENDULUM, settings(), Vector2::zeros(), estimator.lend()).unwrap();
    let mut lent = Standalone {
        feedback: OutputFeedback::new(
            Belief::Estimated(estimator),
            Held::new(controller),
            feedback_settings(),
            feedback.lend(),
        ),
        workspace: Workspace::new(workspace.lend()),
    };
    let of_lent = run(&mut lent, &mut World::new(0.3, 1e-3), 300);
    let of_heap = run(&mut held(N), &mut World::new(0.3, 1e-3), 300);
    assert_eq!(of_lent, of_heap);
}

/// One that takes the place of another with the same settings goes on to the last bit; one with a
/// longer or shorter horizon without a jolt.
#[test]
fn a_regulator_takes_over_where_another_stands() {
    fn handed_over<R: Regulator<f64, 2, 1, 1>>(at: usize, first: R, second: R) -> Vec<(f64, f64)> {
        let (mut first, mut second) = (first, second);
        let mut world = World::new(0.3, 1e-3);
        let mut path = run(&mut first, &mut world, at);
        second.take_over(&first);
        path.extend(run(&mut second, &mut world, 200 - at));
        path
    }
    let alone = run(&mut held(N), &mut World::new(0.3, 1e-3), 200);
    let in_ramps = run(&mut ramped(N), &mut World::new(0.3, 1e-3), 200);
    for at in [1, 2, 3, 5, 8, 20, 60, 76, 78, 80, 85, 101] {
        assert_eq!(handed_over(at, held(N), held(N)), alone, "{at}");
        assert_eq!(handed_over(at, ramped(N), ramped(N)), in_ramps, "{at}");
    }
    for horizon in [N + 10, N - 5] {
        let path = handed_over(60, held(N), held(horizon));
        let jolt = (path[60].0 - alone[60].0).abs();
        assert!(jolt < 0.01, "{horizon}: {jolt}");
    }
}

/// A sensor of infinite variance is not needed: what it reads changes nothing, and the filter is
/// that of the other sensors alone.
#[test]
fn a_sensor_that_is_not_needed_is_not_heard() {
    let one = settings();
    let two = EstimatorSettings {
        longest_step: one.longest_step,
        c: Matrix2::identity(),
        state_offset: one.state_offset,
        input_offset: one.input_offset,
        state_noise: one.state_noise,
        disturbance_noise: one.disturbance_noise,
        measurement_noise: Vector2::new(one.measurement_noise[0], f64::INFINITY),
        initial_state: one.initial_state,
        initial_disturbance: one.initial_disturbance,
        gate: one.gate,
    };
    let mut alone = Estimator::allocate(PENDULUM, one, Vector2::zeros(), 4).unwrap();
    let mut both = Estimator::allocate(PENDULUM, two, Vector2::zeros(), 4).unwrap();
    for k in 0..50 {
        let u = Vector1::new((0.3 * k as f64).sin());
        let angle = Some(Reading::fresh(0.01 * (0.2 * k as f64).cos()));
        let rate = [
            None,
            Some(Reading::fresh(f64::NAN)),
            Some(Reading::fresh(3.0)),
        ][k % 3];
        alone.update(&[angle]);
        let verdicts = both.update(&[angle, rate]);
        assert_eq!(verdicts[1], Verdict::NotNeeded);
        assert_eq!(both.state(), alone.state());
        assert_eq!(both.covariance(), alone.covariance());
        alone.advance(&u, T_S);
        both.advance(&u, T_S);
    }
}

#[test]
fn an_estimator_needs_memory_for_the_present() {
    let memory = EstimatorMemory::allocate(0);
    let refused = Estimator::new(PENDULUM, settings(), SVector::zeros(), memory);
    assert_eq!(refused.err(), Some(EstimatorError::Memory));
    let zero = EstimatorSettings {
        c: Matrix1x2::new(1.0, 0.0),
        measurement_noise: Vector1::zeros(),
        ..settings()
    };
    assert!(
        Estimator::<_, _, 2, 1, 1, 1, 1>::allocate(PENDULUM, zero, SVector::zeros(), 4).is_err()
    );
}

/// Without a reading there is no torque, and the status says so; with one it goes on.
#[test]
fn a_lost_state_commands_nothing() {
    let mut regulator = held(N);
    let mut world = World::new(0.0, 0.0);
    run(&mut regulator, &mut world, 50);
    let empty = Measurement {
        t: 1e9 + 50.0 * T_S + 1.0,
        readings: [None],
    };
    regulator.observe(&empty);
    let command = regulator.decide(&target);
    assert_eq!((command.u[0], command.status), (0.0, Status::NotFinite));
    let back = Measurement {
        t: empty.t + T_S,
        readings: [Some(Reading::fresh(0.1))],
    };
    assert!(regulator.observe(&back).restart.is_some());
    let command = regulator.decide(&target);
    assert!(command.status.is_solved() && command.u[0] != 0.0);
}

/// Before the first reading there is no state either.
#[test]
fn an_unknown_state_commands_nothing() {
    let mut regulator = held(N);
    let command = regulator.decide(&target);
    assert_eq!((command.u[0], command.status), (0.0, Status::NotFinite));
    let (t, readings) = (7.0, [None]);
    regulator.observe(&Measurement { t, readings });
    let command = regulator.decide(&target);
    assert_eq!((command.u[0], command.status), (0.0, Status::NotFinite));
    let (t, readings) = (7.02, [Some(Reading::fresh(0.1))]);
    regulator.observe(&Measurement { t, readings });
    let command = regulator.decide(&target);
    assert!(command.status.is_solved() && command.u[0] != 0.0);
}

/// Without a state a ramp does not go on between two decisions, and with one again it begins where the input was.
#[test]
fn a_ramp_rests_while_the_state_is_lost() {
    let mut regulator = ramped(N);
    let mut world = World::new(0.0, 0.0);
    let moving = run(&mut regulator, &mut world, 3);
    assert!((moving[2].0 - moving[1].0).abs() > 1e-3, "{moving:?}");
    let start = 1e9 + 3.0 * T_S + 1.0;
    for k in 0..100 {
        let (t, readings) = (start + f64::from(k) * T_S, [None]);
        regulator.observe(&Measurement { t, readings });
        let u = match k % 4 {
            0 => regulator.decide(&target).u,
            _ => regulator.between().unwrap(),
        };
        assert_eq!(u[0], 0.0, "{k}");
    }
    let (t, readings) = (start + 100.0 * T_S, [Some(Reading::fresh(0.1))]);
    regulator.observe(&Measurement { t, readings });
    let command = regulator.decide(&target);
    assert!(command.status.is_solved(), "{}", command.status);
    // The middle of a ramp of at most 60 N m/s.
    assert!(command.u[0].abs() <= 60.0 * T_S / 2.0, "{}", command.u);
}

/// What is said of the last plan, and what goes on between two decisions, is as it was.
#[test]
fn what_is_told_of_a_plan_is_taken_over() {
    fn check<K: Planner<f64, 2, 1>>(mut first: Regulated<K>, mut second: Regulated<K>)
    where
        Regulated<K>: Regulator<f64, 2, 1, 1>,
    {
        assert!(first.cost().is_nan());
        run(&mut first, &mut World::new(0.3, 0.0), 30);
        second.take_over(&first);
        assert_eq!(second.cost(), first.cost());
        assert!(first.cost() > 0.0);
        let largest = |of: &Regulated<K>| of.feedback.largest_inputs();
        assert_eq!(largest(&second), largest(&first));
        for _ in 0..3 {
            assert_eq!(second.between(), first.between());
        }
    }
    check(held(N), held(N));
    check(ramped(N), ramped(N));
}

#[test]
fn a_delay_that_is_none_counts_as_zero() {
    let with = |delay: f64| {
        let controller = Controller::allocate(PENDULUM, controller_settings(N)).unwrap();
        let settings = FeedbackSettings {
            delay,
            ..feedback_settings()
        };
        let memory = FeedbackMemory::allocate(COMMANDS, N);
        let mut regulator = Standalone {
            workspace: controller.workspace(),
            feedback: OutputFeedback::new(belief(), Held::new(controller), settings, memory),
        };
        run(&mut regulator, &mut World::new(0.3, 0.0), 60)
    };
    let without = with(0.0);
    assert_eq!(with(f64::NAN), without);
    assert_eq!(with(-0.01), without);
}
