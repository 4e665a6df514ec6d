//! Algorithm 2: scheduling from the rollout of the previous plan, and what a controller keeps
//! from sample to sample.

use super::{Memory, Sized, controller, moving_reference, settings, tilted};
use crate::cart_pole::textbook;
use crate::plant::CartPole;
use crate::runge_kutta::integrate;
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
fn assert_window<const N: usize, const M: usize>(
    controller: &Sized<N, M>,
    workspace: &Memory<N, M>,
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
    let mut controller: Sized<N, N> = controller(settings);
    let mut workspace = Memory::new();
    let mut x = tilted();
    let mut window = vec![Vector2::new(x[1], x[3]); N];
    for k in 0..40 {
        let reference = moving_reference(k);
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
    let mut controller: Sized<N, N> = controller(ControllerSettings {
        scheduling: Scheduling::Held(held),
        ..settings(N)
    });
    let mut workspace = Memory::new();
    let mut x = tilted();
    for k in 0..10 {
        let u = controller.step(&x, &moving_reference(k), &mut workspace).u[0];
        assert_window(&controller, &workspace, &[held; N]);
        x = plant_moves(&x, &u);
    }
}

/// The program of a sample is the paper's: weights, bounds at the stages 1 to N, and its solution
/// satisfies the optimality conditions.
#[test]
fn the_plan_is_the_optimum_of_the_program() {
    const N: usize = 20;
    let mut controller: Sized<N, N> = controller(settings(N));
    let mut workspace = Memory::new();
    let mut x = tilted();
    let mut most_active = 0;
    for k in 0..40 {
        let plan = controller
            .step(&x, &moving_reference(k), &mut workspace)
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
        let mut controller: Sized<N, { N + 4 }> = controller(ControllerSettings {
            terminal,
            ..settings(N)
        });
        let mut workspace = Memory::new();
        let mut x = Vector4::new(0.05, 0.02, 0.3, 0.0);
        for k in 0..10 {
            let reference = moving_reference(k);
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
    let mut controller: Sized<N, { N + 4 }> = controller(ControllerSettings {
        terminal: TerminalIngredient::Equality,
        ..settings(N)
    });
    let reference = moving_reference(3);
    let x = Vector4::new(0.05, 0.1, 0.0, 0.0);
    let plan = controller.step(&x, &reference, &mut Memory::new());
    assert_eq!(plan.status, Status::Solved);
    assert!((plan.x[N - 1] - reference.terminal).norm() <= 1e-9);
}

#[test]
fn reset_forgets_the_past() {
    const N: usize = 20;
    let mut controller: Sized<N, N> = controller(settings(N));
    let mut workspace = Memory::new();
    let reference = moving_reference(0);
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

#[test]
fn a_workspace_carries_nothing_between_controllers() {
    const N: usize = 20;
    let new = || -> Sized<N, N> { controller(settings(N)) };
    let (mut first, mut second) = (new(), new());
    let (mut first_alone, mut second_alone) = (new(), new());
    let mut shared = Memory::new();
    let (mut memory, mut other_memory) = (Memory::new(), Memory::new());
    let (mut x, mut y) = (tilted(), Vector4::new(-0.3, -0.2, 0.5, 0.0));
    for k in 0..30 {
        let (one, other) = (moving_reference(k), moving_reference(2 * k + 7));
        let u = first.step(&x, &one, &mut shared).u[0];
        let v = second.step(&y, &other, &mut shared).u[0];
        assert_eq!(first.solution(), first_alone.step(&x, &one, &mut memory));
        let alone = second_alone.step(&y, &other, &mut other_memory);
        assert_eq!(second.solution(), alone);
        (x, y) = (plant_moves(&x, &u), plant_moves(&y, &v));
    }
}

/// The horizon of the settings against one compiled in, bit by bit.
#[test]
fn a_short_horizon_is_that_of_a_smaller_controller() {
    const SHORT: usize = 11;
    const LONG: usize = 25;
    let mut short: Sized<SHORT, SHORT> = controller(settings(SHORT));
    let mut long: Sized<LONG, SHORT> = controller(settings(SHORT));
    let (mut workspace, mut long_workspace) = (Memory::new(), Memory::new());
    let mut x = tilted();
    for k in 0..30 {
        let reference = moving_reference::<SHORT>(k);
        let mut padded = Reference::constant(Vector4::repeat(f64::NAN));
        padded.stages[..SHORT].copy_from_slice(&reference.stages);
        padded.terminal = reference.terminal;
        let expected = short.step(&x, &reference, &mut workspace).clone();
        let found = long.step(&x, &padded, &mut long_workspace).clone();
        assert_eq!(found.u[..SHORT], expected.u);
        assert_eq!(found.x[..SHORT], expected.x);
        assert_eq!(found.cost, expected.cost);
        assert_eq!(found.status, expected.status);
        assert_eq!(found.active, expected.active);
        assert_eq!(found.changes, expected.changes);
        assert_eq!(long.rollout(), short.rollout());
        assert_eq!(
            long.tracking_cost(&x, &padded),
            short.tracking_cost(&x, &reference)
        );
        x = plant_moves(&x, &expected.u[0]);
    }
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
    let mut double: Sized<N, N> = controller(settings);
    let plant = CartPole::<f32>::laboratory();
    let mut narrow: Controller<CartPole<f32>, f32, 4, 1, 2, N, N> =
        Controller::new(plant, single(&settings)).unwrap();
    let (mut workspace, mut narrow_workspace) = (Memory::new(), Workspace::new());
    let mut x = tilted();
    for k in 0..60 {
        let reference = moving_reference::<N>(k);
        let narrow_reference = Reference {
            stages: reference.stages.map(|r| r.cast()),
            terminal: reference.terminal.cast(),
        };
        let u = double.step(&x, &reference, &mut workspace).u[0];
        let plan = narrow.step(&x.cast(), &narrow_reference, &mut narrow_workspace);
        assert_eq!(plan.status, Status::Solved);
        let error = (f64::from(plan.u[0][0]) - u[0]).abs();
        assert!(error <= 1e-3 * settings.u.upper[0], "sample {k}: {error}");
        x = plant_moves(&x, &u);
    }
}

/// One workspace for two controllers with other weights, bounds, ends and horizons leaves no
/// trace of the one in the plan of the other.
#[test]
fn controllers_that_share_a_workspace_do_not_see_each_other() {
    const N: usize = 12;
    let other = ControllerSettings {
        horizon: N - 4,
        weights: Weights {
            q: settings(N).weights.q * 3.0,
            r: settings(N).weights.r * 0.5,
        },
        terminal: TerminalIngredient::Equality,
        u: Bounds {
            lower: Vector1::new(-50.0),
            upper: Vector1::new(60.0),
        },
        ..settings(N)
    };
    let mut alone: [Sized<N, { N + 4 }>; 2] = [controller(settings(N)), controller(other)];
    let mut together = alone.clone();
    let mut own = [Memory::new(), Memory::new()];
    let mut shared = Memory::new();
    let x = Vector4::new(0.05, 0.02, 0.3, 0.0);
    for k in 0..4 {
        let reference = moving_reference(k);
        for (i, memory) in own.iter_mut().enumerate() {
            let expected = alone[i].step(&x, &reference, memory);
            let found = together[i].step(&x, &reference, &mut shared);
            assert_eq!(found, expected, "controller {i}, sample {k}");
            assert!(found.status.is_solved());
        }
    }
}
