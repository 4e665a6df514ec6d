//! A plant that is no ballbot: the cart-pole of the example.

use super::closed_loop::{self, Sample};
use super::plant::CartPole;
use super::regulator::{self, FORCE, Regulator};
use lpvmpc::{
    Controller, ControllerSettings, Iterations, LpvModel, Quantity, Reference, Scheduling, Side,
    Status, TerminalIngredient,
};
use lpvmpc_testkit::rng::Rng;
use nalgebra::{Vector1, Vector2, Vector4};
use std::f64::consts::PI;

/// x_dot by the formulas of Barto, Sutton and Anderson, "Neuronlike adaptive elements that can
/// solve difficult learning control problems" (1983), with viscous friction of the cart.
pub fn textbook(plant: &CartPole, x: &Vector4<f64>, u: &Vector1<f64>) -> Vector4<f64> {
    let (theta, s_dot, theta_dot) = (x[1], x[2], x[3]);
    let (sin, cos) = theta.sin_cos();
    let total = plant.cart_mass + plant.pole_mass;
    let moment = plant.pole_mass * plant.half_length;
    let force = u[0] - plant.friction * s_dot;
    let shared = (force + moment * theta_dot * theta_dot * sin) / total;
    let arm = plant.half_length * (4.0 / 3.0 - plant.pole_mass * cos * cos / total);
    let theta_ddot = (plant.gravity * sin - cos * shared) / arm;
    let s_ddot = shared - moment * theta_ddot * cos / total;
    Vector4::new(s_dot, theta_dot, s_ddot, theta_ddot)
}

#[test]
fn the_embedding_is_the_textbook_plant() {
    let mut rng = Rng::new(31);
    let exactly_upright = Vector4::new(0.3, 0.0, 1.0, 2.0);
    let anywhere = (0..2000).map(|_| {
        Vector4::new(
            rng.uniform(-3.0, 3.0),
            rng.uniform(-PI, PI) * rng.power_of_ten(-9.0, 0.0),
            rng.uniform(-5.0, 5.0),
            rng.uniform(-10.0, 10.0),
        )
    });
    for (i, x) in std::iter::once(exactly_upright).chain(anywhere).enumerate() {
        let plant = CartPole {
            friction: 0.01 * (i % 100) as f64,
            pole_mass: 0.05 + 0.01 * (i % 37) as f64,
            ..CartPole::laboratory()
        };
        let u = Vector1::new((i as f64).sin() * FORCE);
        let expected = textbook(&plant, &x, &u);
        let error = (plant.derivative(&x, &u) - expected).norm();
        assert!(error <= 1e-12 * (1.0 + expected.norm()), "{x}: {error:e}");
    }
}

/// The limit of the Riccati recursion solves the Riccati equation, and its feedback is stable.
#[test]
fn the_terminal_weight_solves_the_riccati_equation() {
    let plant = CartPole::laboratory();
    let settings = regulator::settings(&plant, 1.0, Scheduling::Predicted).unwrap();
    let TerminalIngredient::Cost(p) = settings.terminal else {
        panic!("a terminal cost");
    };
    let (a, b) = plant.matrices(&Vector2::zeros());
    let (a, b) = settings.predictor.discretize(&a, &b, settings.t_s);
    let hessian = settings.weights.r + b.transpose() * p * b;
    let k = -hessian.try_inverse().unwrap() * b.transpose() * p * a;
    let residual = settings.weights.q + a.transpose() * p * (a + b * k) - p;
    // The recursion stops at a relative change of 1e-13; the residual is that change, and
    // rounding of A'P(A + BK), whose factors have norms of a few.
    assert!(
        residual.norm() <= 1e-12 * p.norm(),
        "{:e}",
        residual.norm() / p.norm()
    );
    let radius = (a + b * k).complex_eigenvalues().map(|pole| pole.norm());
    assert!(radius.max() < 1.0, "{radius}");
}

fn closed_loop(degrees: f64, track: f64, scheduling: Scheduling<f64, 2>) -> (Vec<Sample>, f64) {
    let plant = CartPole::laboratory();
    let settings = regulator::settings(&plant, track, scheduling).unwrap();
    let mut controller: Regulator = Controller::allocate(plant, settings).unwrap();
    let start = Vector4::new(0.0, degrees.to_radians(), 0.0, 0.0);
    let samples = closed_loop::run(&plant, &mut controller, start, 100);
    let cost = closed_loop::cost(&samples, &settings.weights);
    (samples, cost)
}

fn linear() -> Scheduling<f64, 2> {
    Scheduling::Held(Vector2::zeros())
}

#[test]
fn it_stands_up_from_a_large_tilt_with_the_force_at_its_bound() {
    for degrees in [-35.0, -20.0, 5.0, 30.0, 35.0] {
        let track = 2.4;
        let (samples, _) = closed_loop(degrees, track, Scheduling::Predicted);
        assert!(closed_loop::stands(&samples, track), "{degrees} degrees");
        assert!(samples.iter().all(|sample| sample.status.is_solved()));
        assert!(samples.iter().all(|sample| sample.u[0].abs() <= FORCE));
        let saturated = samples.iter().any(|sample| sample.u[0].abs() == FORCE);
        assert_eq!(saturated, degrees.abs() >= 20.0, "{degrees} degrees");
    }
}

/// From 25 degrees the cart would go to 0.87 m; the track ends at 0.8 m. Plans respect its end to
/// the solver's tolerance, so the plant passes it by no more than the plan's error over a sample.
#[test]
fn it_stands_up_within_a_short_track() {
    let (free, _) = closed_loop(25.0, 2.4, Scheduling::Predicted);
    let (samples, _) = closed_loop(25.0, 0.8, Scheduling::Predicted);
    let error = closed_loop::prediction_error(&samples)[0];
    assert!(error < 1e-3, "{error} m");
    assert!(closed_loop::farthest(&free) > 0.85);
    assert!(closed_loop::stands(&samples, 0.8 + error + 1e-9));
    assert!(closed_loop::farthest(&samples) > 0.8 - 1e-3, "not in use");
    assert!(samples.iter().all(|sample| sample.status.is_solved()));
    assert!(samples.iter().all(|sample| sample.u[0].abs() <= FORCE));
}

/// Where the plant is nonlinear the matrices of the upright pole mislead: linear MPC loses the
/// pole from tilts that LPV MPC masters.
#[test]
fn linear_mpc_is_worse_from_a_large_tilt() {
    for degrees in [30.0, 35.0] {
        let (_, lpv_cost) = closed_loop(degrees, 2.4, Scheduling::Predicted);
        let (samples, linear_cost) = closed_loop(degrees, 2.4, linear());
        assert!(lpv_cost <= linear_cost, "{lpv_cost} {linear_cost}");
        assert!(!closed_loop::stands(&samples, 2.4));
    }
}

/// From a moderate tilt both succeed, and the LPV prediction is the better one: its scheduling is
/// wrong by its change over a sample, that of linear MPC by the whole tilt.
#[test]
fn the_lpv_prediction_is_closer_to_the_plant() {
    for degrees in [10.0, 20.0] {
        let (lpv, _) = closed_loop(degrees, 2.4, Scheduling::Predicted);
        let (held, _) = closed_loop(degrees, 2.4, linear());
        assert!(closed_loop::stands(&held, 2.4));
        let [lpv, held] = [lpv, held].map(|run| closed_loop::prediction_error(&run)[1]);
        assert!(lpv < held / 4.0, "{lpv} {held}");
    }
}

/// Near the upright position the plant is linear, and so is the LPV controller. The embedding's
/// terms are even in the scheduling: the difference falls with the cube of the tilt.
#[test]
fn near_upright_both_controllers_are_the_same() {
    let difference = |degrees: f64| {
        let (lpv, _) = closed_loop(degrees, 2.4, Scheduling::Predicted);
        let (held, _) = closed_loop(degrees, 2.4, linear());
        let pairs = lpv.iter().zip(&held);
        pairs.map(|(a, b)| (a.x - b.x).norm()).fold(0.0, f64::max)
    };
    let (coarse, fine) = (difference(1.0), difference(0.5));
    // No bound is active at these tilts. The next term is smaller by theta^2 and theta_dot^2.
    let order = (coarse / fine).log2();
    assert!((order - 3.0).abs() < 0.1, "order {order}");
}

/// A start 1 cm beyond the end of the track was infeasible for ever, the force went from bound to
/// bound, and the message named the force at stage 37.
#[test]
fn a_start_outside_of_a_state_bound_has_a_plan_and_comes_back() {
    let plant = CartPole::laboratory();
    let settings = regulator::settings(&plant, 0.4, Scheduling::Predicted).unwrap();
    for (s, theta) in [(0.41, 0.0), (-0.45, 0.02), (0.41, 0.1)] {
        let start = Vector4::new(s, theta, 0.0, 0.0);
        let mut controller: Regulator = Controller::allocate(plant, settings).unwrap();
        let samples = closed_loop::run(&plant, &mut controller, start, 100);
        for (k, sample) in samples.iter().enumerate() {
            assert!(sample.status.is_solved(), "{start}, sample {k}");
            let outside = sample.x[0].abs() > 0.4 + 1e-3;
            assert!(!outside || k < 20, "{start}, sample {k}: {}", sample.x);
        }
        assert!(samples.last().unwrap().x.norm() < 0.02);
    }
}

/// Hard on request; and then the cause is told: the bound that the start lies beyond.
#[test]
fn a_hard_bound_that_cannot_be_kept_is_named_with_its_first_stage() {
    let plant = CartPole::laboratory();
    let soft = regulator::settings(&plant, 0.4, Scheduling::Predicted).unwrap();
    let hard = ControllerSettings {
        soft_x: [None; 4],
        raise_prices: false,
        ..soft
    };
    for (s, side) in [
        (0.43, Side::Upper),
        (-0.43, Side::Lower),
        (0.6, Side::Upper),
    ] {
        let mut controller: Regulator = Controller::allocate(plant, hard).unwrap();
        let mut workspace = controller.workspace();
        let start = Vector4::new(s, 0.0, 0.0, 0.0);
        let upright = Reference::constant(Vector4::zeros());
        let plan = controller.step(&start, &upright, &mut workspace);
        let Status::Infeasible(cause) = plan.status else {
            panic!("{}", plan.status);
        };
        assert_eq!((cause.quantity, cause.side), (Quantity::State(0), side));
        // 15 N move a cart of 1 kg by 2 cm in a sample, and the pole with it.
        assert!(cause.stage <= 3, "{cause}");
    }
}

/// A plan of a descent that counts as one keeps its hard bounds. Where none was found that does, either the last program is
/// proved to be infeasible, or the programs were too few.
#[test]
fn a_descent_says_when_its_plan_exceeds_a_hard_bound() {
    let plant = CartPole::laboratory();
    let soft = regulator::settings(&plant, 1.5, Scheduling::Predicted).unwrap();
    let mut exceeded = Vec::new();
    for most in [1, 2, 8, 30] {
        let hard = ControllerSettings {
            soft_x: [None; 4],
            raise_prices: false,
            iterations: Iterations::Descent {
                tolerance: 1e-5,
                most,
                first: most,
            },
            ..soft
        };
        let mut rng = Rng::new(7);
        let (mut few, mut solved) = (0, 0);
        for _ in 0..100 {
            let mut one = |size: f64| rng.uniform(-size, size);
            let start = Vector4::new(one(1.4), one(0.7), one(2.0), one(3.0));
            let goal = Reference::constant(Vector4::new(one(1.4), 0.0, 0.0, 0.0));
            let mut controller: Regulator = Controller::allocate(plant, hard).unwrap();
            let mut workspace = controller.workspace();
            let plan = controller.step(&start, &goal, &mut workspace);
            let beyond = plan.x.iter().map(|x| x[0].abs() - 1.5);
            let beyond = beyond.fold(f64::NEG_INFINITY, f64::max);
            match plan.status {
                Status::Infeasible(_) => {
                    assert!(lpvmpc::infeasibility_margin(workspace.ocp(), &plan.active) > 0.0);
                    assert!(beyond > 1e-9);
                }
                Status::Exceeded(bound) => {
                    assert_eq!(bound.quantity, Quantity::State(0));
                    let at_it = plan.x[bound.stage - 1][0].abs();
                    assert!(at_it > 1.5 + 0.029, "{start} {bound}: {at_it}");
                    few += 1;
                }
                status => {
                    assert!(status.is_solved(), "{status}");
                    assert!(beyond < 0.031, "{start}: {beyond}");
                    solved += 1;
                }
            }
        }
        exceeded.push(few);
        assert!(solved > 40, "{most}: {solved}");
    }
    assert!(exceeded[0] > 10 && exceeded[3] == 0, "{exceeded:?}");
}
