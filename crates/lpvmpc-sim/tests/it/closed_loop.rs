//! Controller and plant together: what a run records, and how it ends.

use ballbot::{Ballbot, limits};
use lpvmpc::{
    Bounds, Controller, ControllerSettings, InputReference, Iterations, LpvModel, Predictor,
    Quantity, Rk4, Scheduling, Side, SolverSettings, Status, TerminalIngredient, Weights,
};
use lpvmpc_sim::{Experiment, PlantError, Termination, Tolerances, Trajectory, run};
use nalgebra::{Matrix1, Matrix2, Matrix4, Vector1, Vector2, Vector4};
use std::cell::{Cell, RefCell};
use std::time::Duration;

const TOLERANCES: Tolerances = Tolerances {
    relative: 1e-9,
    absolute: 1e-9,
};

/// A mass on a rail: x = (position, speed), u = acceleration.
#[derive(Clone)]
struct Mass;

impl LpvModel<f64, 2, 1, 1> for Mass {
    fn scheduling(&self, _: &Vector2<f64>, _: &Vector1<f64>) -> Vector1<f64> {
        Vector1::zeros()
    }

    fn matrices(&self, _: &Vector1<f64>) -> (Matrix2<f64>, Vector2<f64>) {
        (Matrix2::new(0.0, 1.0, 0.0, 0.0), Vector2::new(0.0, 1.0))
    }
}

/// The same mass on a rail that ends at 0.5 m.
struct ShortRail;

impl LpvModel<f64, 2, 1, 1> for ShortRail {
    fn scheduling(&self, x: &Vector2<f64>, u: &Vector1<f64>) -> Vector1<f64> {
        Mass.scheduling(x, u)
    }

    fn matrices(&self, scheduling: &Vector1<f64>) -> (Matrix2<f64>, Vector2<f64>) {
        Mass.matrices(scheduling)
    }

    fn derivative(&self, x: &Vector2<f64>, u: &Vector1<f64>) -> Vector2<f64> {
        if x[0] < 0.5 {
            Mass.derivative(x, u)
        } else {
            Vector2::repeat(f64::NAN)
        }
    }
}

const T_S: f64 = 0.1;
const SAMPLES: usize = 30;

/// Runs from rest at zero towards a constant position reference.
fn run_mass<P: LpvModel<f64, 2, 1, 1>>(
    plant: &P,
    fastest: f64,
    target: &dyn Fn(f64) -> f64,
    clock: &dyn Fn() -> Duration,
    progress: &dyn Fn(usize),
) -> Trajectory<2, 1> {
    let settings = ControllerSettings {
        t_s: T_S,
        horizon: 10,
        predictor: Predictor::FrozenRk4(Rk4 { substeps: 1 }),
        weights: Weights {
            q: Matrix2::from_diagonal(&Vector2::new(1.0, 0.1)),
            r: Matrix1::new(0.01),
        },
        terminal: TerminalIngredient::Cost(Matrix2::identity() * 10.0),
        x: Bounds {
            lower: Vector2::new(f64::NEG_INFINITY, -fastest),
            upper: Vector2::new(f64::INFINITY, fastest),
        },
        u: Bounds {
            lower: Vector1::new(-2.0),
            upper: Vector1::new(2.0),
        },
        soft_x: [None; 2],
        raise_prices: false,
        input_reference: InputReference::SteadyState,
        scheduling: Scheduling::Predicted,
        iterations: Iterations::Fixed(1),
        solver: SolverSettings::default(),
    };
    let controller = Controller::allocate(Mass, settings).unwrap();
    let experiment = Experiment {
        initial_state: Vector2::zeros(),
        samples: SAMPLES,
        reference: &|t| Vector2::new(target(t), 0.0),
        tolerances: TOLERANCES,
        clock,
        progress,
    };
    run(controller, plant, &experiment)
}

fn stopped() -> Duration {
    Duration::ZERO
}

/// Samples stand at multiples of t_s, and each state follows from the one before.
fn assert_chained(trajectory: &Trajectory<2, 1>) {
    let states: Vec<_> = trajectory.states().copied().collect();
    assert_eq!(states.len(), trajectory.samples.len() + 1);
    assert_eq!(states[states.len() - 1], trajectory.final_state);
    for (k, sample) in trajectory.samples.iter().enumerate() {
        assert_eq!(sample.t, k as f64 * T_S);
        assert_eq!(sample.x, states[k]);
        assert_eq!(sample.status, Status::Solved);
        // A mass under a held acceleration moves along a parabola.
        let (x, u) = (sample.x, sample.u[0]);
        let speed = x[1] + u * T_S;
        let expected = Vector2::new(x[0] + (x[1] + speed) / 2.0 * T_S, speed);
        assert!((states[k + 1] - expected).norm() < 1e-9, "sample {k}");
    }
    let expected = trajectory.samples.len() as f64 * T_S;
    assert_eq!(trajectory.final_time, expected);
}

#[test]
fn a_complete_run_is_recorded_whole() {
    let reports = RefCell::new(Vec::new());
    let target = |t: f64| if t < 1.5 { 1.0 } else { -1.0 };
    let trajectory = run_mass(&Mass, 1.0, &target, &stopped, &|done| {
        reports.borrow_mut().push(done);
    });
    assert_eq!(trajectory.termination, Termination::Complete);
    assert_eq!(trajectory.samples.len(), SAMPLES);
    assert_eq!(trajectory.conflict(), None);
    assert_chained(&trajectory);
    assert_eq!(*reports.borrow(), (1..=SAMPLES).collect::<Vec<_>>());
    for sample in &trajectory.samples {
        assert_eq!(sample.x_ref, Vector2::new(target(sample.t), 0.0));
        assert!(sample.x[1].abs() <= 1.0 + 1e-6, "speed {}", sample.x[1]);
    }
    assert_eq!(trajectory.final_reference, Vector2::new(-1.0, 0.0));
    assert!(
        trajectory
            .samples
            .iter()
            .any(|sample| sample.active_bounds > 0)
    );
    // The controller sees the jump coming, and brakes before it.
    assert!(trajectory.samples[14].x[1] < 0.0);
}

#[test]
fn no_samples_no_motion() {
    let run_of = |samples| {
        let controller = ballbot_controller();
        let experiment = Experiment {
            initial_state: Vector4::new(0.0, 0.1, 0.0, 0.0),
            samples,
            reference: &|_| Vector4::zeros(),
            tolerances: TOLERANCES,
            clock: &stopped,
            progress: &|_| (),
        };
        run(controller, &Ballbot::<f64>::paper(), &experiment)
    };
    let nothing = run_of(0);
    assert_eq!(nothing.states().count(), 1);
    assert_eq!(nothing.final_time, 0.0);
    assert_eq!(nothing.termination, Termination::Complete);
    assert_eq!(run_of(1).states().count(), 2);
}

#[test]
fn a_failing_plant_ends_the_run_and_keeps_its_record() {
    let reports = Cell::new(0);
    let trajectory = run_mass(&ShortRail, 1.0, &|_| 1.0, &stopped, &|done| {
        reports.set(done);
    });
    let Termination::PlantFailed { t, error } = &trajectory.termination else {
        panic!("{:?}", trajectory.termination);
    };
    assert!(matches!(error, PlantError::Diverged { .. }), "{error}");
    let recorded = trajectory.samples.len();
    assert!(recorded > 1 && recorded < SAMPLES, "{recorded}");
    assert_eq!(reports.get(), recorded);
    assert_eq!(*t, trajectory.final_time);
    assert_eq!(trajectory.conflict(), None);
    // The last state is the one from which the rail's end was reached.
    assert!(trajectory.final_state[0] < 0.5);
    assert!(trajectory.final_state[0] + trajectory.final_state[1] * T_S > 0.4);
    assert_chained(&trajectory);
    // Until then it is the run on the whole rail.
    let whole = run_mass(&Mass, 1.0, &|_| 1.0, &stopped, &|_| ());
    assert_eq!(trajectory.samples[..], whole.samples[..recorded]);
}

#[test]
fn an_infeasible_problem_ends_the_run_and_keeps_its_record() {
    /// Pushes the mass from 0.3 m on, harder than its controller knows.
    struct Slope;

    impl LpvModel<f64, 2, 1, 1> for Slope {
        fn scheduling(&self, x: &Vector2<f64>, u: &Vector1<f64>) -> Vector1<f64> {
            Mass.scheduling(x, u)
        }

        fn matrices(&self, scheduling: &Vector1<f64>) -> (Matrix2<f64>, Vector2<f64>) {
            Mass.matrices(scheduling)
        }

        fn derivative(&self, x: &Vector2<f64>, u: &Vector1<f64>) -> Vector2<f64> {
            let push = if x[0] > 0.3 { 10.0 } else { 0.0 };
            Mass.derivative(x, u) + Vector2::new(0.0, push)
        }
    }

    let fastest = 1.0;
    let trajectory = run_mass(&Slope, fastest, &|_| 1.0, &stopped, &|_| ());
    let Termination::NoPlan { t, status } = &trajectory.termination else {
        panic!("{:?}", trajectory.termination);
    };
    assert_eq!(*t, trajectory.final_time);
    assert!(matches!(status, Status::Infeasible(_)), "{status}");
    // The speed is more above its bound than one sample of braking takes away.
    assert!(trajectory.final_state[1] > fastest + 2.0 * T_S);
    // It cannot brake hard enough, or it is too fast: the two that exclude each other.
    let conflict = trajectory.conflict().expect("a bound");
    let named = (conflict.quantity, conflict.side);
    let pair = [
        (Quantity::State(1), Side::Upper),
        (Quantity::Input(0), Side::Lower),
    ];
    assert!(pair.contains(&named), "{conflict}");
    let recorded = trajectory.samples.len();
    assert!(recorded > 1 && recorded < SAMPLES, "{recorded}");
    assert_eq!(trajectory.states().count(), recorded + 1);
    assert!(
        trajectory
            .samples
            .iter()
            .all(|sample| sample.status.is_solved())
    );
}

#[test]
fn a_start_that_is_no_number_ends_the_run_at_once() {
    let controller = ballbot_controller();
    let experiment = Experiment {
        initial_state: Vector4::new(0.0, f64::NAN, 0.0, 0.0),
        samples: 5,
        reference: &|_| Vector4::zeros(),
        tolerances: TOLERANCES,
        clock: &stopped,
        progress: &|_| (),
    };
    let plant = Ballbot::<f64>::paper();
    let trajectory = run(controller, &plant, &experiment);
    assert!(trajectory.samples.is_empty());
    assert_eq!(trajectory.states().count(), 1);
    assert!(
        matches!(trajectory.termination, Termination::NoPlan { t: 0.0, .. }),
        "{:?}",
        trajectory.termination
    );
}

#[test]
fn bad_tolerances_end_the_run_at_once() {
    let controller = ballbot_controller();
    let experiment = Experiment {
        initial_state: Vector4::zeros(),
        samples: 5,
        reference: &|_| Vector4::zeros(),
        tolerances: Tolerances {
            relative: 0.0,
            absolute: 0.0,
        },
        clock: &stopped,
        progress: &|_| (),
    };
    let plant = Ballbot::<f64>::paper();
    let trajectory = run(controller, &plant, &experiment);
    assert!(trajectory.samples.is_empty());
    assert!(matches!(
        trajectory.termination,
        Termination::PlantFailed {
            t: 0.0,
            error: PlantError::Tolerances { .. }
        }
    ));
}

/// The paper's controller of scenario 1, with torque bounds that it runs into.
fn ballbot_controller() -> ballbot::Controller<f64> {
    let state = Vector4::new(
        f64::INFINITY,
        limits::THETA,
        limits::PHI_DOT,
        limits::THETA_DOT,
    );
    let settings = ControllerSettings {
        t_s: 0.05,
        horizon: 20,
        predictor: Predictor::FrozenRk4(Rk4 { substeps: 2 }),
        weights: Weights {
            q: Matrix4::from_diagonal(&Vector4::new(200.0, 1.0, 0.1, 0.1)),
            r: Matrix1::new(1000.0),
        },
        terminal: TerminalIngredient::Cost(Matrix4::from_diagonal(&Vector4::new(
            2000.0, 40000.0, 50.0, 1700.0,
        ))),
        x: Bounds {
            lower: -state,
            upper: state,
        },
        u: Bounds {
            lower: Vector1::new(-0.5),
            upper: Vector1::new(0.5),
        },
        soft_x: [None; 4],
        raise_prices: false,
        input_reference: InputReference::SteadyState,
        scheduling: Scheduling::Predicted,
        iterations: Iterations::Fixed(1),
        solver: SolverSettings::default(),
    };
    Controller::allocate(Ballbot::<f64>::paper(), settings).unwrap()
}

fn run_ballbot(clock: &dyn Fn() -> Duration) -> Trajectory<4, 1> {
    let experiment = Experiment {
        initial_state: Vector4::zeros(),
        samples: 80,
        reference: &|t| Vector4::new(if t < 1.0 { 0.0 } else { 3.0 }, 0.0, 0.0, 0.0),
        tolerances: TOLERANCES,
        clock,
        progress: &|_| (),
    };
    let plant = Ballbot::<f64>::paper();
    run(ballbot_controller(), &plant, &experiment)
}

/// Every number of the record but the times per step.
fn bits(trajectory: &Trajectory<4, 1>) -> Vec<u64> {
    let samples = trajectory.samples.iter().flat_map(|sample| {
        let numbers = sample.x.iter().chain(&sample.u).chain(&sample.x_ref);
        numbers.copied().chain([sample.t, sample.cost])
    });
    let end = trajectory.final_state.iter().copied();
    samples.chain(end).map(f64::to_bits).collect()
}

#[test]
fn a_run_is_the_same_to_the_bit() {
    let (first, second) = (run_ballbot(&stopped), run_ballbot(&stopped));
    assert_eq!(first.termination, Termination::Complete);
    assert!(first.samples.iter().any(|sample| sample.active_bounds > 0));
    assert_eq!(first, second);
    assert_eq!(bits(&first), bits(&second));
}

#[test]
fn the_clock_is_for_the_time_per_step_only() {
    let reads = Cell::new(0);
    // Seven milliseconds pass between any two looks.
    let ticking = || {
        reads.set(reads.get() + 1);
        Duration::from_millis(7 * reads.get())
    };
    // Runs backwards, which a broken clock may do: no time, but no failure.
    let left = Cell::new(1_000_000);
    let backwards = || {
        left.set(left.get() - 1);
        Duration::from_secs(left.get())
    };
    let (still, ticked, reversed) = (
        run_ballbot(&stopped),
        run_ballbot(&ticking),
        run_ballbot(&backwards),
    );
    assert_eq!(bits(&still), bits(&ticked));
    assert_eq!(bits(&still), bits(&reversed));
    let step_times = |trajectory: &Trajectory<4, 1>| -> Vec<Duration> {
        trajectory
            .samples
            .iter()
            .map(|sample| sample.step_time)
            .collect()
    };
    assert_eq!(step_times(&still), [Duration::ZERO; 80]);
    assert_eq!(step_times(&ticked), [Duration::from_millis(7); 80]);
    assert_eq!(step_times(&reversed), [Duration::ZERO; 80]);
}
