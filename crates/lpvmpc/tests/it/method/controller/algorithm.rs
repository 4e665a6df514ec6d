//! Algorithm 2: scheduling from the rollout of the previous plan, and what a controller keeps
//! from sample to sample.

use super::{along, controller, moving, settings, tilted};
use crate::method::cart_pole::textbook;
use crate::method::plant::CartPole;
use crate::method::regulator::Regulator;
use crate::method::runge_kutta::integrate;
use lpvmpc::{
    Bounds, Controller, ControllerSettings, InputReference, Iterations, LpvModel, Reference, Rk4,
    Scheduling, SolverSettings, Status, TerminalIngredient, Weights, Workspace, kkt_residual,
};
use nalgebra::{Vector1, Vector2, Vector4};

/// The plant between two samples.
fn plant_moves(x: &Vector4<f64>, u: &Vector1<f64>) -> Vector4<f64> {
    Rk4 { substeps: 20 }.advance(&CartPole::laboratory(), x, u, 0.05)
}

/// Asserts that the program's matrices are those of the scheduling `window`.
fn assert_window(
    controller: &Regulator,
    workspace: &Workspace<f64, 4, 1>,
    window: &[Vector2<f64>],
) {
    let plant = CartPole::laboratory();
    let t_s = controller.settings().t_s;
    for (stage, scheduling) in workspace.ocp().stages.iter().zip(window) {
        let (a, b) = plant.matrices(scheduling);
        let (a, b) = controller.settings().predictor.discretize(&a, &b, t_s);
        // The rollouts agree to rounding, and so do the matrices.
        assert!((stage.a - a).norm() <= 1e-12 * a.norm());
        assert!((stage.b - b).norm() <= 1e-12 * b.norm());
    }
}

/// rho_{i|0} = sigma(x_0), then rho_{i|k} = sigma(x_{i+1|k-1}) with the rollout of the plan k - 1
/// through the nonlinear plant, here by the textbook's formulas.
#[test]
fn the_scheduling_is_that_of_the_last_rollout_one_stage_on() {
    const N: usize = 15;
    let plant = CartPole::laboratory();
    let settings = settings(N);
    let substeps = settings.predictor.rk4().substeps;
    let mut controller = controller(settings);
    let mut workspace = controller.workspace();
    let mut x = tilted();
    let mut window = vec![Vector2::new(x[1], x[3]); N];
    for k in 0..40 {
        let states = moving(N, k);
        let reference = along(&states);
        let plan = controller.step(&x, &reference, &mut workspace).clone();
        assert_eq!(plan.status, Status::Solved);
        assert_eq!(workspace.ocp().x0, x);
        assert_window(&controller, &workspace, &window);

        let mut state = x;
        for (i, u) in plan.u.iter().enumerate() {
            let h = settings.t_s / substeps as f64;
            state = integrate(|x| textbook(&plant, x, u), state, h, substeps);
            let rolled_out = controller.rollout()[i];
            assert!((rolled_out - state).norm() <= 1e-11 * (1.0 + state.norm()));
            window[i] = Vector2::new(state[1], state[3]);
        }
        x = plant_moves(&x, &plan.u[0]);
    }
}

#[test]
fn held_scheduling_stays() {
    const N: usize = 8;
    let held = Vector2::new(0.2, -0.5);
    let mut controller = controller(ControllerSettings {
        scheduling: Scheduling::Held(held),
        ..settings(N)
    });
    let mut workspace = controller.workspace();
    let mut x = tilted();
    for k in 0..10 {
        let u = controller.step(&x, &along(&moving(N, k)), &mut workspace).u[0];
        assert_window(&controller, &workspace, &[held; N]);
        x = plant_moves(&x, &u);
    }
}

/// The program of a sample is the paper's: weights, bounds at the stages 1 to N, and its solution
/// satisfies the optimality conditions.
#[test]
fn the_plan_is_the_optimum_of_the_program() {
    const N: usize = 20;
    let mut controller = controller(settings(N));
    let mut workspace = controller.workspace();
    let mut x = tilted();
    let mut most_active = 0;
    for k in 0..40 {
        let plan = controller
            .step(&x, &along(&moving(N, k)), &mut workspace)
            .clone();
        let residual = kkt_residual(workspace.ocp(), &plan);
        // Relative to the largest term; the solver's own tolerance is 4e-11.
        assert!(residual.largest() <= 1e-9, "sample {k}: {residual:?}");
        most_active = most_active.max(plan.active.len());
        x = plant_moves(&x, &plan.u[0]);
    }
    assert!(most_active >= 2, "the bounds have to be in use");
}

/// J counts ||x - x_ref||^2 in full, the solver half of it and without the constant.
#[test]
fn the_tracking_cost_is_twice_the_programs_plus_the_constant() {
    const N: usize = 12;
    for terminal in [settings(N).terminal, TerminalIngredient::Equality] {
        let mut controller = controller(ControllerSettings {
            terminal,
            ..settings(N)
        });
        let mut workspace = controller.workspace();
        let mut x = Vector4::new(0.05, 0.02, 0.3, 0.0);
        for k in 0..10 {
            let states = moving(N, k);
            let reference = along(&states);
            let plan = controller.step(&x, &reference, &mut workspace).clone();
            assert_eq!(plan.status, Status::Solved);
            let q = controller.settings().weights.q;
            let stages = reference.stages.iter().map(|r| r.dot(&(q * r)));
            let end = match terminal {
                TerminalIngredient::Cost(p) => reference.terminal.dot(&(p * reference.terminal)),
                TerminalIngredient::Equality => 0.0,
            };
            let constant = stages.sum::<f64>() + end;
            let found = controller.tracking_cost(&x, &reference);
            let expected = 2.0 * plan.cost + constant;
            // The terms cancel where the tracking is good: rounding is relative to the constant.
            assert!(
                (found - expected).abs() <= 1e-13 * (constant + found),
                "{found} {expected}"
            );
            x = plant_moves(&x, &plan.u[0]);
        }
    }
}

/// With the terminal equality the plan ends on the reference.
#[test]
fn the_terminal_equality_is_met() {
    const N: usize = 20;
    let mut controller = controller(ControllerSettings {
        terminal: TerminalIngredient::Equality,
        ..settings(N)
    });
    let states = moving(N, 3);
    let reference = along(&states);
    let x = Vector4::new(0.05, 0.1, 0.0, 0.0);
    let mut workspace = controller.workspace();
    let plan = controller.step(&x, &reference, &mut workspace);
    assert_eq!(plan.status, Status::Solved);
    assert!((plan.x[N - 1] - reference.terminal).norm() <= 1e-9);
}

#[test]
fn reset_forgets_the_past() {
    const N: usize = 20;
    let mut controller = controller(settings(N));
    let mut workspace = controller.workspace();
    let states = moving(N, 0);
    let reference = along(&states);
    let first = controller
        .step(&tilted(), &reference, &mut workspace)
        .clone();
    assert!(first.changes > 0, "the warm start has to matter");
    let second = controller
        .step(&tilted(), &reference, &mut workspace)
        .clone();
    assert_ne!(first, second, "there has to be a past");
    controller.reset();
    let again = controller.step(&tilted(), &reference, &mut workspace);
    assert_eq!(again, &first);
}

/// The example's settings in single precision.
fn single(settings: &ControllerSettings<f64, 4, 1, 2>) -> ControllerSettings<f32, 4, 1, 2> {
    let TerminalIngredient::Cost(p) = settings.terminal else {
        panic!("the example has a terminal cost");
    };
    ControllerSettings {
        t_s: settings.t_s as f32,
        horizon: settings.horizon,
        predictor: settings.predictor,
        weights: Weights {
            q: settings.weights.q.cast(),
            r: settings.weights.r.cast(),
        },
        terminal: TerminalIngredient::Cost(p.cast()),
        x: Bounds {
            lower: settings.x.lower.cast(),
            upper: settings.x.upper.cast(),
        },
        u: Bounds {
            lower: settings.u.lower.cast(),
            upper: settings.u.upper.cast(),
        },
        soft_x: [None; 4],
        raise_prices: false,
        input_reference: InputReference::SteadyState,
        scheduling: Scheduling::Predicted,
        iterations: Iterations::Fixed(1),
        solver: SolverSettings::default(),
    }
}

/// Both precisions see the same measured states. An input's error is rounding (6e-8) grown by
/// the plant's instability over the horizon (a pole of 4.4/s over 1 s: 80) and by the condition
/// of the program: a thousandth of the largest force is asked for.
#[test]
fn single_precision_is_close_to_double() {
    const N: usize = 20;
    let settings = settings(N);
    let mut double = controller(settings);
    let plant = CartPole::laboratory();
    let mut narrow = Controller::allocate(plant, single(&settings)).unwrap();
    let (mut workspace, mut narrow_workspace) = (double.workspace(), narrow.workspace());
    let mut x = tilted();
    for k in 0..60 {
        let states = moving(N, k);
        let reference = along(&states);
        let narrow_states: Vec<Vector4<f32>> = states.iter().map(|x| x.cast()).collect();
        let narrow_reference = Reference {
            stages: &narrow_states[..N],
            terminal: narrow_states[N],
        };
        let u = double.step(&x, &reference, &mut workspace).u[0];
        let plan = narrow.step(&x.cast(), &narrow_reference, &mut narrow_workspace);
        assert_eq!(plan.status, Status::Solved);
        let error = (f64::from(plan.u[0][0]) - u[0]).abs();
        assert!(error <= 1e-3 * settings.u.upper[0], "sample {k}: {error}");
        x = plant_moves(&x, &u);
    }
}
