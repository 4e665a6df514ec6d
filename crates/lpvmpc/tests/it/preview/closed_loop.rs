//! What a preview is for: closed loops.

use super::plants::{CART, PENDULUM};
use super::short_case::settings;
use crate::pendulum::Pendulum;
use lpvmpc::{
    Bounds, Controller, ControllerMemory, ControllerSettings, GeneralRow, Iterations, List,
    LpvModel, Predictor, Preview, Reference, Rk4, Status, TerminalIngredient, Weights, Workspace,
};
use nalgebra::{Matrix1, Matrix2, Matrix3, Vector1, Vector2, Vector3};

const T_S: f64 = 0.05;
type Settings = ControllerSettings<f64, 2, 1, 1>;

fn both_ways() -> [Iterations<f64>; 2] {
    [Iterations::Fixed(1), Iterations::default()]
}

fn rest() -> Reference<'static, f64, 2> {
    Reference::constant(Vector2::zeros())
}

/// x_dot = f(x) over `duration` seconds.
fn in_small_steps(
    x: &Vector2<f64>,
    duration: f64,
    f: &dyn Fn(Vector2<f64>) -> Vector2<f64>,
) -> Vector2<f64> {
    const STEPS: usize = 200;
    let h = duration / STEPS as f64;
    (0..STEPS).fold(*x, |x, _| {
        let middle = x + f(x) * (h / 2.0);
        x + f(middle) * h
    })
}

/// x_dot = f(x, u) + d over a sample, with the formula of the pendulum, not its embedding.
fn plant_moves(x: &Vector2<f64>, u: f64, push: f64) -> Vector2<f64> {
    let f = |x: Vector2<f64>| Vector2::new(x[1], 9.81 * x[0].sin() - 0.1 * x[1] + u + push);
    in_small_steps(x, T_S, &f)
}

/// A gust that comes at 1 s, and one from the other side: leaning into it before it comes costs less
/// than to meet it when it is measured, and that less than not to know it. In the paper's loop and in
/// the descent, in one step and in two parts.
#[test]
fn a_disturbance_that_is_known_ahead_costs_less() {
    let gust = |k: usize| match k {
        20..50 => 2.5,
        50..70 => -1.5,
        _ => 0.0,
    };
    let weights = settings().weights;
    for iterations in both_ways() {
        for two_parts in [false, true] {
            let run = |known: &dyn Fn(usize, usize) -> f64| {
                let settings = Settings {
                    iterations,
                    input_reference: lpvmpc::InputReference::Given(Vector1::zeros()),
                    ..settings()
                };
                let pendulum = PENDULUM;
                let mut controller = Controller::allocate(pendulum, settings).unwrap();
                let mut workspace = controller.workspace();
                let (mut x, mut cost) = (Vector2::zeros(), 0.0);
                for k in 0..160 {
                    let pushes: Vec<_> = (0..25).map(|i| Vector2::new(0.0, known(k, i))).collect();
                    let preview = Preview {
                        disturbance: &pushes,
                        ..Preview::new(rest())
                    };
                    if two_parts {
                        controller.prepare_with(&preview, &mut workspace);
                    }
                    let plan = controller.feedback_with(&x, &preview, &mut workspace);
                    assert!(plan.status.is_solved(), "{k}: {}", plan.status);
                    let u = plan.u[0];
                    cost += x.dot(&(weights.q * x)) + weights.r[0] * u[0] * u[0];
                    x = plant_moves(&x, u[0], gust(k));
                    // What the model expects is what comes: the rollout of a descent is the plan.
                    let expected = controller.rollout()[0];
                    let exact = !two_parts && known(k, 0) == gust(k);
                    assert!(
                        !exact || (x - expected).amax() < 1e-4,
                        "{k}: {x} {expected}"
                    );
                }
                assert!(x.amax() < 1e-2);
                cost
            };
            let ahead = run(&|k, i| gust(k + i));
            let measured = run(&|k, _| gust(k));
            let unknown = run(&|_, _| 0.0);
            assert!(ahead < 0.95 * measured, "{ahead} {measured}");
            assert!(measured < 0.95 * unknown, "{measured} {unknown}");
        }
    }
}

/// A disturbance that stays: with it told, the loop has no offset, since the target is where the
/// disturbed plant stands.
#[test]
fn a_constant_disturbance_leaves_no_offset() {
    for iterations in both_ways() {
        let settings = Settings {
            iterations,
            ..settings()
        };
        let pendulum = PENDULUM;
        let mut controller = Controller::allocate(pendulum, settings).unwrap();
        let mut workspace = controller.workspace();
        let mut x = Vector2::new(0.3, 0.0);
        for _ in 0..200 {
            let preview = Preview {
                disturbance: &[Vector2::new(0.0, 2.0)],
                ..Preview::new(rest())
            };
            let u = controller.step_with(&x, &preview, &mut workspace).u[0];
            x = plant_moves(&x, u[0], 2.0);
        }
        assert!(x.amax() < 1e-5, "{x}");
        let target = controller.target().unwrap();
        assert!(
            target.reached && (target.u[0] + 2.0).abs() < 1e-6,
            "{target:?}"
        );
    }
}

/// A hard row on angle and torque together, set once, holds at every sample of the loop, and is in the
/// way: without it the loop leaves it.
#[test]
fn rows_hold_in_the_closed_loop() {
    let row = GeneralRow {
        x: Vector2::new(6.0, 1.0),
        u: Vector1::new(1.0),
        lower: -2.0,
        upper: 2.0,
        soft: None,
    };
    for iterations in both_ways() {
        let run = |rows: bool| {
            let settings = Settings {
                iterations,
                ..settings()
            };
            let room = settings.capacity().with_general_rows(1);
            let memory = ControllerMemory::allocate(room);
            let pendulum = PENDULUM;
            let mut controller = Controller::new(pendulum, settings, memory).unwrap();
            if rows {
                controller.set_rows(List::repeat(row, 1)).unwrap();
            }
            let mut workspace = Workspace::allocate(room);
            let mut x = Vector2::new(0.5, 0.0);
            let (mut beyond, mut at_bound) = (0.0_f64, 0);
            for k in 0..80 {
                let plan = controller.step(&x, &rest(), &mut workspace);
                assert!(plan.status.is_solved(), "{k}: {}", plan.status);
                let u = plan.u[0];
                let value = row.x.dot(&x) + u[0];
                beyond = beyond.max(value.abs() - 2.0);
                at_bound += usize::from(value.abs() > 2.0 - 1e-6);
                x = plant_moves(&x, u[0], 0.0);
            }
            assert!(x.amax() < 1e-2, "{x}");
            (beyond, at_bound)
        };
        let (beyond, at_bound) = run(true);
        assert!(beyond < 1e-8 && at_bound > 1, "{beyond:e} {at_bound}");
        let (without, _) = run(false);
        assert!(without > 0.5, "{without}");
    }
}

/// Gates on a rail that open and close: a cart has to be between 0.9 m and 1.1 m from 1.0 s to 1.2 s,
/// beyond 1.5 m from 1.6 s on. Known ahead, every gate is passed; known only when it is there, not.
#[test]
fn moving_gaps_are_passed() {
    let gate = |k: usize| {
        let (lower, upper) = match k {
            20..=24 => (0.9, 1.1),
            32.. => (1.5, 2.5),
            _ => (f64::NEG_INFINITY, f64::INFINITY),
        };
        Bounds {
            lower: Vector2::new(lower, f64::NEG_INFINITY),
            upper: Vector2::new(upper, f64::INFINITY),
        }
    };
    for iterations in both_ways() {
        let run = |known: &dyn Fn(usize, usize) -> Bounds<f64, 2>| {
            let weights = Weights {
                q: Matrix2::from_diagonal(&Vector2::new(1.0, 0.1)),
                r: Matrix1::new(0.1),
            };
            let acceleration = Bounds {
                lower: Vector1::new(-4.0),
                upper: Vector1::new(4.0),
            };
            let terminal = TerminalIngredient::Cost(Matrix2::new(2.0, 1.0, 1.0, 1.0));
            let settings = Settings {
                iterations,
                ..Settings::new(T_S, 30, weights, terminal, acceleration)
            };
            let hard = both_prices(&settings);
            let room = settings.capacity().with_own_stages();
            let room = lpvmpc::Capacity {
                rows: room.rows + 62,
                active: room.active + 124,
                ..room
            };
            let memory = ControllerMemory::allocate(room);
            let mut controller = Controller::new(CART, settings, memory).unwrap();
            let mut workspace = Workspace::allocate(room);
            let mut x = Vector2::zeros();
            let mut missed = 0;
            for k in 0..60 {
                let bounds: Vec<_> = (0..=30).map(|i| known(k, i)).collect();
                let preview = Preview {
                    x: &bounds,
                    soft_x: &hard,
                    ..Preview::new(rest())
                };
                let u = controller.step_with(&x, &preview, &mut workspace).u[0];
                assert!(u[0].abs() <= 4.0);
                missed += usize::from(!gate(k).contains(&x, 1e-5));
                x = Rk4 { substeps: 1 }.advance(&CART, &x, &u, T_S);
            }
            missed
        };
        assert_eq!(run(&|k, i| gate(k + i)), 0, "{iterations:?}");
        assert!(run(&|k, _| gate(k)) > 3, "{iterations:?}");
    }
}

/// Exact prices, so that a gate that cannot be passed any more has a plan.
fn both_prices(settings: &Settings) -> [lpvmpc::SoftBounds<f64, 2>; 1] {
    let price = lpvmpc::Penalty {
        linear: 1e3 * settings.weights.q[(0, 0)],
        quadratic: 0.0,
    };
    [[Some(price), None]]
}

/// A plant with a third state that stands still.
enum WithState {
    /// A spring and its stiffness: (position, speed, stiffness).
    Stiffness,
    /// [`PENDULUM`] and a push: (angle, rate, push).
    Push,
}

impl LpvModel<f64, 3, 1, 1> for WithState {
    fn scheduling(&self, x: &Vector3<f64>, u: &Vector1<f64>) -> Vector1<f64> {
        match self {
            Self::Stiffness => Vector1::new(x[2]),
            Self::Push => PENDULUM.scheduling(&Vector2::new(x[0], x[1]), u),
        }
    }

    fn matrices(&self, s: &Vector1<f64>) -> (Matrix3<f64>, Vector3<f64>) {
        let (plant, push) = match self {
            Self::Stiffness => (SPRING, 0.0),
            Self::Push => (PENDULUM, 1.0),
        };
        let (a, b) = plant.matrices(s);
        let mut a = a.insert_row(2, 0.0).insert_column(2, 0.0);
        a[(1, 2)] = push;
        (a, b.push(0.0))
    }
}

/// A spring whose stiffness is its scheduling.
const SPRING: Pendulum<f64> = Pendulum {
    stiffness: -1.0,
    damping: 0.2,
};

/// Scheduling from outside is a plant with that parameter as a state, in a loop along which it changes
/// from sample to sample.
#[test]
fn scheduling_from_outside_is_a_parameter_as_a_state() {
    let force = Bounds {
        lower: Vector1::new(-3.0),
        upper: Vector1::new(3.0),
    };
    let given = lpvmpc::InputReference::Given(Vector1::zeros());
    let r = Matrix1::new(0.1);
    for iterations in both_ways() {
        let told = ControllerSettings {
            iterations,
            input_reference: given,
            ..ControllerSettings::new(
                0.1,
                15,
                Weights {
                    q: Matrix2::identity(),
                    r,
                },
                TerminalIngredient::Cost(Matrix2::identity() * 3.0),
                force,
            )
        };
        let without = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 0.0));
        let state = ControllerSettings {
            iterations,
            input_reference: given,
            ..ControllerSettings::new(
                0.1,
                15,
                Weights { q: without, r },
                TerminalIngredient::Cost(without * 3.0),
                force,
            )
        };
        let mut told = Controller::allocate(SPRING, told).unwrap();
        let mut state = Controller::allocate(WithState::Stiffness, state).unwrap();
        let (mut memory, mut other) = (told.workspace(), state.workspace());
        let mut x = Vector2::new(1.0, -2.0);
        for k in 0..40 {
            let stiffness = 2.0 + 1.5 * (0.3 * f64::from(k)).sin();
            let preview = Preview {
                scheduling: &[Vector1::new(stiffness)],
                ..Preview::new(rest())
            };
            let found = told.step_with(&x, &preview, &mut memory).u[0];
            let reference = Reference::constant(Vector3::zeros());
            let with = Vector3::new(x[0], x[1], stiffness);
            let plan = state.step(&with, &reference, &mut other);
            assert!(plan.status.is_solved());
            // Where the stiffness of the last sample stood in the plan, its matrices are the old ones.
            let tolerance = match iterations {
                Iterations::Fixed(_) if k > 0 => 0.2,
                Iterations::Fixed(_) => 1e-9,
                Iterations::Descent { .. } => 1e-4,
            };
            let error = (found - plan.u[0]).amax();
            assert!(error < tolerance, "{k} {iterations:?}: {error:e}");
            assert_ne!(plan.status, Status::NotFinite);
            let (a, b) = SPRING.matrices(&Vector1::new(stiffness));
            x = in_small_steps(&x, 0.1, &|x| a * x + b * found);
        }
        assert!(x.amax() < 0.05, "{x}");
    }
}

/// A disturbance is a state that stands still, whatever the predictor and in both ways to iterate. The
/// stage-consistent matrices follow the scheduling of the undisturbed motion within a sample, which
/// moves them by a ten-thousandth; a descent ends where the matrices do not matter.
#[test]
fn a_disturbance_is_a_state_that_stands_still() {
    let rk4 = Rk4 { substeps: 2 };
    let given = lpvmpc::InputReference::Given(Vector1::zeros());
    let precise = Iterations::descent(1e-8, 30);
    for (predictor, iterations, tolerance) in [
        (Predictor::FrozenRk4(rk4), Iterations::Fixed(2), 1e-9),
        (Predictor::FrozenExact(rk4), Iterations::Fixed(1), 1e-9),
        (Predictor::StageConsistent(rk4), Iterations::Fixed(1), 1e-3),
        (Predictor::StageConsistent(rk4), precise, 1e-6),
    ] {
        let plain = Settings {
            predictor,
            iterations,
            input_reference: given,
            ..settings()
        };
        let TerminalIngredient::Cost(p) = plain.terminal else {
            panic!("the example has a terminal cost");
        };
        let wide = |m: &Matrix2<f64>| m.insert_row(2, 0.0).insert_column(2, 0.0);
        let weights = Weights {
            q: wide(&plain.weights.q),
            r: plain.weights.r,
        };
        let infinity = f64::INFINITY;
        let state = ControllerSettings {
            predictor,
            iterations,
            input_reference: given,
            x: Bounds {
                lower: plain.x.lower.push(-infinity),
                upper: plain.x.upper.push(infinity),
            },
            soft_x: [plain.soft_x[0], plain.soft_x[1], None],
            ..ControllerSettings::new(
                plain.t_s,
                plain.horizon,
                weights,
                TerminalIngredient::Cost(wide(&p)),
                plain.u,
            )
        };
        let mut told = Controller::allocate(PENDULUM, plain).unwrap();
        let mut state = Controller::allocate(WithState::Push, state).unwrap();
        let (mut memory, mut other) = (told.workspace(), state.workspace());
        let push = -1.5;
        let mut x = Vector2::new(0.5, -1.0);
        for k in 0..40 {
            let preview = Preview {
                disturbance: &[Vector2::new(0.0, push)],
                ..Preview::new(rest())
            };
            let found = told.step_with(&x, &preview, &mut memory).u[0];
            let reference = Reference::constant(Vector3::zeros());
            let plan = state.step(&x.push(push), &reference, &mut other);
            assert!(plan.status.is_solved());
            let error = (found - plan.u[0]).amax();
            assert!(
                error < tolerance,
                "{predictor:?} {iterations:?} {k}: {error:e}"
            );
            x = plant_moves(&x, found[0], push);
        }
    }
}
