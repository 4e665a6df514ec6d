//! The descent: every program is an improvement or is not taken, the plan is a rollout of the
//! nonlinear model, and a step can be taken in two parts.

use super::{assert_safe, controller, settings};
use crate::method::plant::CartPole;
use lpvmpc::{
    ControllerSettings, Iterations, LpvModel, Penalty, Predictor, Reference, Rk4, Status,
    TerminalIngredient,
};
use lpvmpc_testkit::rng::Rng;
use nalgebra::{Matrix4, SMatrix, Vector1, Vector4};

const N: usize = 20;
const RK4: Rk4 = Rk4 { substeps: 2 };

fn descent(most: usize) -> ControllerSettings<f64, 4, 1, 2> {
    let mut soft_x = [None; 4];
    soft_x[0] = Some(Penalty {
        linear: 1e4,
        quadratic: 0.0,
    });
    ControllerSettings {
        predictor: Predictor::StageConsistent(RK4),
        soft_x,
        iterations: Iterations::descent(1e-3, most),
        ..settings(N)
    }
}

/// States from which the pole can be caught, and some from which it cannot.
fn random_state(rng: &mut Rng) -> Vector4<f64> {
    let limits = Vector4::new(2.0, 0.8, 2.0, 2.0);
    limits.map(|limit| rng.uniform(-limit, limit))
}

fn set_point(position: f64) -> Reference<'static, f64, 4> {
    Reference::constant(Vector4::new(position, 0.0, 0.0, 0.0))
}

/// The merit written out anew: cost of the rollout of the planned inputs, and the track's ends.
fn merit(x0: &Vector4<f64>, plan: &[Vector1<f64>], reference: &Reference<'_, f64, 4>) -> f64 {
    let settings = descent(1);
    let TerminalIngredient::Cost(p) = settings.terminal else {
        panic!("the example has a terminal cost");
    };
    let (q, r) = (settings.weights.q, settings.weights.r[0]);
    let mut x = *x0;
    let mut total = 0.0;
    for (i, u) in plan.iter().enumerate() {
        let error = x - reference.at(i);
        let beyond = if i > 0 {
            (x[0].abs() - 2.4).max(0.0)
        } else {
            0.0
        };
        total += error.dot(&(q * error)) + r * u[0] * u[0] + 1e4 * beyond;
        x = RK4.advance(&CartPole::laboratory(), &x, u, settings.t_s);
    }
    let error = x - reference.terminal;
    total + error.dot(&(p * error)) + 1e4 * (x[0].abs() - 2.4).max(0.0)
}

/// A sample without a plan from the one before has a budget of its own: the first, and one after a reset.
#[test]
fn a_first_sample_has_its_own_budget() {
    let with_first = |first: usize| ControllerSettings {
        iterations: Iterations::Descent {
            tolerance: 1e-9,
            most: 2,
            first,
        },
        ..descent(1)
    };
    let x = Vector4::new(0.0, 0.7, 0.0, 0.0);
    let mut tried = controller(with_first(9));
    let mut memory = tried.workspace();
    for _ in 0..2 {
        tried.step(&x, &set_point(1.0), &mut memory);
        assert!((3..=9).contains(&tried.problems()), "{}", tried.problems());
        let next = tried.solution().x[0];
        tried.step(&next, &set_point(1.0), &mut memory);
        assert!(tried.problems() <= 2, "{}", tried.problems());
        tried.reset();
    }
    let none = lpvmpc::Controller::allocate(CartPole::laboratory(), with_first(0));
    assert!(none.is_err());
}

/// With more programs the plan costs less or the same, from any state to any set point.
#[test]
fn every_program_is_an_improvement_or_is_not_taken() {
    let mut rng = Rng::new(21);
    let mut memory = controller(descent(1)).workspace();
    for _ in 0..200 {
        let (x, reference) = (random_state(&mut rng), set_point(rng.uniform(0.0, 2.0)));
        let costs = [1, 2, 3, 5, 8, 13].map(|most| {
            let mut tried = controller(descent(most));
            let plan = tried.step(&x, &reference, &mut memory).clone();
            assert_safe(&plan, &settings(N).u);
            assert!(plan.status.is_solved(), "{}", plan.status);
            assert!(tried.problems() <= most);
            merit(&x, &plan.u, &reference)
        });
        for pair in costs.windows(2) {
            assert!(pair[1] <= pair[0] * (1.0 + 1e-12), "{x} {costs:?}");
        }
    }
}

/// The states of the plan are those of the nonlinear model under its inputs: there is no gap.
#[test]
fn the_plan_is_a_rollout() {
    let mut rng = Rng::new(22);
    let mut memory = controller(descent(1)).workspace();
    for _ in 0..50 {
        let x = random_state(&mut rng);
        let mut tried = controller(descent(8));
        let reference = set_point(1.0);
        let plan = tried.step(&x, &reference, &mut memory);
        let merit = merit(&x, &plan.u, &reference);
        assert!(
            (2.0 * plan.cost / merit - 1.0).abs() < 1e-9,
            "{} {merit}",
            plan.cost
        );
        let mut state = x;
        for (u, planned) in plan.u.iter().zip(&plan.x) {
            state = RK4.advance(&CartPole::laboratory(), &state, u, descent(8).t_s);
            assert!((state - planned).amax() < 1e-9 * (1.0 + state.amax()));
        }
    }
}

/// What is called converged is a stationary point: no input can be moved, alone and within its
/// bounds, such that the merit falls by more than the tolerance allows.
#[test]
fn converged_plans_are_stationary() {
    let mut rng = Rng::new(23);
    let mut memory = controller(descent(1)).workspace();
    let mut converged = 0;
    for _ in 0..60 {
        let (x, reference) = (
            random_state(&mut rng) * 0.5,
            set_point(rng.uniform(0.0, 1.0)),
        );
        let mut tried = controller(descent(40));
        let plan = tried.step(&x, &reference, &mut memory).clone();
        if plan.status != Status::Converged {
            continue;
        }
        converged += 1;
        let cost = merit(&x, &plan.u, &reference);
        for (i, step) in (0..N).flat_map(|i| [(i, 0.05), (i, -0.05)]) {
            let mut moved = plan.u.clone();
            moved[i][0] = (moved[i][0] + step).clamp(-15.0, 15.0);
            let other = merit(&x, &moved, &reference);
            assert!(other > cost * (1.0 - 1e-3), "stage {i}: {other} < {cost}");
        }
    }
    assert!(converged > 40, "{converged} of 60 converged");
}

/// A far jump of the set point in mid-run, a push, a pole beyond what can be caught: a plan every
/// time, and rest at the set point where the pole did not fall.
#[test]
fn jumps_and_pushes_leave_a_plan() {
    let mut memory = controller(descent(1)).workspace();
    let mut tried = controller(descent(8));
    let plant = CartPole::laboratory();
    let mut x = Vector4::zeros();
    for k in 0..300 {
        if k == 150 {
            x[3] += 2.0;
        }
        let goal = if k < 75 { 2.0 } else { -2.0 };
        let plan = tried.step(&x, &set_point(goal), &mut memory);
        assert!(plan.status.is_solved(), "sample {k}: {}", plan.status);
        x = Rk4 { substeps: 20 }.advance(&plant, &x, &plan.u[0], 0.05);
        assert!(x[0].abs() < 2.4 * 1.01, "sample {k}: {x}");
    }
    assert!((x - Vector4::new(-2.0, 0.0, 0.0, 0.0)).amax() < 1e-3, "{x}");
}

/// Close to rest, far from zero, rounding of the states is all that is left to gain: one program per
/// sample is enough then.
#[test]
fn rounding_is_not_improved_on() {
    let mut memory = controller(descent(1)).workspace();
    let plant = CartPole::laboratory();
    let mut tried = controller(descent(8));
    let mut x = Vector4::new(0.0, 0.1, 0.0, 0.0);
    for k in 0..600 {
        let plan = tried.step(&x, &set_point(2.0), &mut memory);
        x = Rk4 { substeps: 20 }.advance(&plant, &x, &plan.u[0], 0.05);
        if (x[0] - 2.0).abs() < 1e-8 {
            assert_eq!(tried.problems(), 1, "sample {k}: {x}");
        }
    }
    assert!((x[0] - 2.0).abs() < 1e-8, "{x}");
}

/// Numbers that are none in state or reference: no plan, inputs within their bounds, and the next
/// good sample is a first one.
#[test]
fn numbers_that_are_none_are_refused() {
    let mut memory = controller(descent(1)).workspace();
    let mut fresh = controller(descent(8));
    let x = Vector4::new(0.1, 0.2, 0.0, 0.0);
    let expected = fresh.step(&x, &set_point(1.0), &mut memory).u.clone();
    for bad in [f64::NAN, f64::INFINITY, 1e300] {
        let mut tried = controller(descent(8));
        tried.step(&x, &set_point(1.0), &mut memory);
        let broken = Vector4::new(0.1, bad, 0.0, 0.0);
        for (x, goal) in [(broken, 1.0), (x, bad)] {
            let plan = tried.step(&x, &set_point(goal), &mut memory);
            assert_safe(plan, &settings(N).u);
            if goal == 1e300 {
                // A number, but beyond the track: the cart heads for its end.
                assert!(plan.status.is_solved(), "{}", plan.status);
                let target = tried.target().unwrap();
                assert!(!target.reached && target.x[0] == 2.4, "{}", target.x);
                tried.reset();
            } else {
                assert_eq!(plan.status, Status::NotFinite, "{bad}");
            }
        }
        let plan = tried.step(&x, &set_point(1.0), &mut memory);
        assert_eq!(plan.u, expected, "{bad}");
    }
}

/// A terminal equality is met by the nonlinear model, from as far as torque and time allow.
#[test]
fn a_terminal_equality_holds_for_the_model() {
    let mut memory = controller(descent(1)).workspace();
    for distance in [0.05, 0.1, 0.3] {
        let mut tried = controller(ControllerSettings {
            terminal: TerminalIngredient::Equality,
            iterations: Iterations::descent(1e-6, 60),
            ..descent(60)
        });
        let plan = tried.step(&Vector4::zeros(), &set_point(distance), &mut memory);
        let goal = Vector4::new(distance, 0.0, 0.0, 0.0);
        assert!(
            (plan.x[N - 1] - goal).amax() < 1e-4,
            "{distance}: {}",
            plan.x[N - 1]
        );
    }
}

/// `prepare` and `feedback` are a step: the very same of the paper's algorithm, whose program does
/// not depend on the measured state.
#[test]
fn a_step_of_the_paper_can_be_taken_in_two_parts() {
    let [mut whole, mut parts] = [settings(N), settings(N)].map(controller);
    let (mut memory, mut own) = (whole.workspace(), parts.workspace());
    let plant = CartPole::laboratory();
    let mut x = Vector4::new(0.1, 0.3, 0.0, 0.0);
    for k in 0..60 {
        let reference = set_point(if k < 30 { 0.0 } else { 0.5 });
        parts.prepare(&reference, &mut own);
        let found = parts.feedback(&x, &reference, &mut own).u.clone();
        let expected = &whole.step(&x, &reference, &mut memory).u;
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).amax() < 1e-12, "sample {k}");
        }
        x = RK4.advance(&plant, &x, &expected[0], 0.05);
    }
}

/// Of a descent, the two parts do one program per sample: a little dearer than steps, on the same
/// way, and through jumps, pushes and states that are none.
#[test]
fn a_descent_can_be_taken_in_two_parts() {
    let plant = CartPole::laboratory();
    let run = |split: bool| {
        let mut tried = controller(descent(8));
        let mut memory = tried.workspace();
        let mut x = Vector4::new(0.0, 0.4, 0.0, 0.0);
        let mut total = 0.0;
        for k in 0..200 {
            let goal = if k < 100 { 1.0 } else { -1.0 };
            let reference = set_point(goal);
            let plan = if split {
                tried.prepare(&reference, &mut memory);
                tried.feedback(&x, &reference, &mut memory)
            } else {
                tried.step(&x, &reference, &mut memory)
            };
            assert_safe(plan, &settings(N).u);
            let u = plan.u[0];
            let error = x - reference.terminal;
            total += error.dot(&(settings(N).weights.q * error)) + 0.01 * u[0] * u[0];
            x = Rk4 { substeps: 20 }.advance(&plant, &x, &u, 0.05);
        }
        assert!((x[0] + 1.0).abs() < 1e-2, "{x}");
        total
    };
    let (whole, parts) = (run(false), run(true));
    assert!((parts / whole - 1.0).abs() < 0.02, "{parts} {whole}");
}

/// The derivatives of a sample against central differences of the sample itself.
#[test]
fn a_rollout_is_differentiated() {
    let mut rng = Rng::new(24);
    let plant = CartPole::laboratory();
    for _ in 0..100 {
        let x = random_state(&mut rng);
        let u = Vector1::new(rng.uniform(-10.0, 10.0));
        let (a, b) = RK4.differentiate(&plant, &x, &u, 0.05);
        let next = |x: Vector4<f64>, u: f64| RK4.advance(&plant, &x, &Vector1::new(u), 0.05);
        let step = 1e-6;
        let columns = [0, 1, 2, 3].map(|j| {
            let unit = Vector4::ith(j, step);
            (next(x + unit, u[0]) - next(x - unit, u[0])) / (2.0 * step)
        });
        let slope_u = (next(x, u[0] + step) - next(x, u[0] - step)) / (2.0 * step);
        // The default Jacobian is of differences itself: 1e-10 of its second and third derivatives.
        assert!((a - Matrix4::from_columns(&columns)).amax() < 1e-7);
        assert!((b - slope_u).amax() < 1e-7);
    }
}

/// The embedding's matrices at a state are no Jacobian, except where the scheduling stands still.
#[test]
fn the_embedding_is_not_the_jacobian() {
    let plant = CartPole::laboratory();
    let tilted = Vector4::new(0.0, 0.5, 0.0, 1.0);
    let apart = |x: &Vector4<f64>| -> f64 {
        let (jacobian, _): (SMatrix<f64, 4, 4>, _) = plant.jacobian(x, &Vector1::zeros());
        let (a, _) = plant.matrices(&plant.scheduling(x, &Vector1::zeros()));
        (jacobian - a).amax()
    };
    assert!(apart(&Vector4::zeros()) < 1e-8);
    assert!(apart(&tilted) > 1.0);
}
