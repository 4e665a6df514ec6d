//! Settings and models that change while a controller runs.

use super::plants::PENDULUM;
use super::short_case::settings;
use crate::pendulum::Pendulum;
use lpvmpc::{
    Bounds, Controller, ControllerError, InputReference, Iterations, Predictor, Preview, Reference,
    Rk4, Status, TerminalIngredient, Weights,
};
use nalgebra::{Matrix1, Matrix2, Vector1, Vector2};

fn upright() -> Reference<'static, f64, 2> {
    Reference::constant(Vector2::zeros())
}

/// From the first step on they are those of a controller that is built with them.
#[test]
fn other_settings_are_those_of_a_controller_built_with_them() {
    let other = |iterations| {
        let mut other = settings();
        other.weights = Weights {
            q: Matrix2::from_diagonal(&Vector2::new(3.0, 0.1)),
            r: Matrix1::new(0.5),
        };
        other.terminal = TerminalIngredient::Equality;
        other.u = Bounds {
            lower: Vector1::new(-6.0),
            upper: Vector1::new(7.0),
        };
        other.x.upper[0] = 0.9;
        other.soft_x = [None; 2];
        other.input_reference = InputReference::Given(Vector1::new(0.2));
        other.predictor = Predictor::FrozenRk4(Rk4 { substeps: 3 });
        other.iterations = iterations;
        other
    };
    for iterations in [Iterations::Fixed(2), Iterations::default()] {
        let mut set = Controller::allocate(PENDULUM, settings()).unwrap();
        let mut made = Controller::allocate(PENDULUM, other(iterations)).unwrap();
        let [mut memory, mut own] = [set.workspace(), made.workspace()];
        let x = Vector2::new(0.4, 0.2);
        // With a past and a target that are not those of the new settings.
        set.step(&x, &upright(), &mut memory);
        set.prepare(&upright(), &mut memory);
        set.set_settings(other(iterations)).unwrap();
        set.reset();
        let expected = made.step(&x, &upright(), &mut own).clone();
        assert!(expected.status.is_solved());
        assert_eq!(set.step(&x, &upright(), &mut memory), &expected);
        assert_eq!(set.target(), made.target());
        assert_eq!(*set.settings(), other(iterations));
    }
}

/// With a past, too, the next plan is a good one: a descent ends where one without a past ends.
#[test]
fn a_plan_goes_on_under_other_weights_and_another_model() {
    let heavy = Pendulum {
        stiffness: 15.0,
        ..PENDULUM
    };
    let precise = |r: f64| {
        let mut settings = settings();
        settings.weights.r[0] = r;
        settings.iterations = Iterations::descent(1e-9, 50);
        settings
    };
    let mut changed = Controller::allocate(PENDULUM, precise(0.1)).unwrap();
    let mut fresh = Controller::allocate(heavy, precise(1.0)).unwrap();
    let [mut memory, mut own] = [changed.workspace(), fresh.workspace()];
    let x = Vector2::new(0.3, -0.5);
    changed.step(&x, &upright(), &mut memory);
    changed.prepare(&upright(), &mut memory);
    changed.set_model(heavy);
    changed.set_settings(precise(1.0)).unwrap();
    let found = changed.feedback(&x, &upright(), &mut memory).u[0];
    let expected = fresh.step(&x, &upright(), &mut own).u[0];
    assert!((found - expected).amax() < 1e-5, "{found} {expected}");
}

#[test]
fn settings_that_make_no_sense_are_refused_and_change_nothing() {
    let mut controller = Controller::allocate(PENDULUM, settings()).unwrap();
    let mut refused = |change: &dyn Fn(&mut super::short_case::Settings)| {
        let mut other = settings();
        change(&mut other);
        let error = controller.set_settings(other).unwrap_err();
        assert_eq!(*controller.settings(), settings());
        error
    };
    let r = refused(&|s| s.weights.r[0] = -1.0);
    assert_eq!(r, ControllerError::WeightSign("R"));
    let u = refused(&|s| s.u.lower[0] = f64::NAN);
    let expected = ControllerError::Bounds {
        quantity: "input",
        component: 0,
    };
    assert_eq!(u, expected);
    for error in [refused(&|s| s.horizon += 1), refused(&|s| s.t_s *= 2.0)] {
        assert_eq!(error, ControllerError::Another);
        assert!(error.to_string().contains("takes over"));
    }
}

/// A controller that takes over goes on as the one before would have, under what both are told; one
/// with a longer horizon has a plan, too.
#[test]
fn a_plan_with_a_preview_is_taken_over() {
    let told = Preview {
        disturbance: &[Vector2::new(0.0, 1.0), Vector2::new(0.0, -1.0)],
        u_ref: &[Vector1::new(0.3)],
        ..Preview::new(upright())
    };
    for iterations in [Iterations::Fixed(1), Iterations::default()] {
        let settings = super::short_case::Settings {
            iterations,
            ..settings()
        };
        let longer = super::short_case::Settings {
            horizon: settings.horizon + 5,
            ..settings
        };
        let mut before = Controller::allocate(PENDULUM, settings).unwrap();
        let mut after = Controller::allocate(PENDULUM, settings).unwrap();
        let mut long = Controller::allocate(PENDULUM, longer).unwrap();
        let mut workspace = long.workspace();
        let mut x = Vector2::new(0.3, 0.0);
        for _ in 0..5 {
            let u = before.step_with(&x, &told, &mut workspace).u[0];
            x = Rk4 { substeps: 2 }.advance(&PENDULUM, &x, &u, 0.05);
        }
        after.take_over(&before);
        long.take_over(&before);
        let expected = before.step_with(&x, &told, &mut workspace).u[0];
        assert_eq!(after.step_with(&x, &told, &mut workspace).u[0], expected);
        let plan = long.step_with(&x, &told, &mut workspace);
        assert!(plan.status.is_solved());
        assert!(
            (plan.u[0] - expected).amax() < 0.1,
            "{} {expected}",
            plan.u[0]
        );
    }
}

/// The same between a feedback and the next sample, whose rollout is still to come.
#[test]
fn a_plan_is_taken_over_from_a_feedback() {
    for iterations in [Iterations::Fixed(1), Iterations::default()] {
        let settings = super::short_case::Settings {
            iterations,
            ..settings()
        };
        let mut before = Controller::allocate(PENDULUM, settings).unwrap();
        let mut after = Controller::allocate(PENDULUM, settings).unwrap();
        let mut workspace = before.workspace();
        let mut x = Vector2::new(0.4, 0.0);
        for k in 0..12 {
            before.prepare(&upright(), &mut workspace);
            let u = before.feedback(&x, &upright(), &mut workspace).u[0];
            // A push, so that the plan of the sample before is another one.
            let push = Vector2::new(0.0, if k % 3 == 0 { 0.4 } else { 0.0 });
            x = Rk4 { substeps: 2 }.advance(&PENDULUM, &x, &u, 0.05) + push;
            let mut other = before.clone();
            after.take_over(&before);
            let expected = other.step(&x, &upright(), &mut workspace).u[0];
            let taken = after.step(&x, &upright(), &mut workspace).u[0];
            assert!((taken - expected).amax() < 1e-12, "{k}: {taken} {expected}");
        }
    }
}

/// A push beyond a hard bound leaves no plan for some samples. What was tried then is over with them: on a linear plant,
/// whose problem has one optimum, a plan that is called converged is that of a controller without a past.
#[test]
fn after_samples_without_a_plan_a_converged_one_is_the_optimum() {
    let linear = Pendulum {
        stiffness: 0.0,
        ..PENDULUM
    };
    for (push, horizon) in [(-0.3, 10), (-0.5, 20), (-1.0, 20), (-1.0, 40)] {
        let mut settings = super::short_case::Settings {
            horizon,
            t_s: 0.1,
            iterations: Iterations::descent(1e-5, 8),
            terminal: TerminalIngredient::Cost(Matrix2::identity() * 10.0),
            u: Bounds {
                lower: Vector1::new(-1.0),
                upper: Vector1::new(1.0),
            },
            x: Bounds {
                lower: Vector2::new(f64::NEG_INFINITY, -0.5),
                upper: Vector2::new(f64::INFINITY, 0.5),
            },
            soft_x: [None; 2],
            ..settings()
        };
        settings.weights = Weights {
            q: Matrix2::identity(),
            r: Matrix1::new(0.1),
        };
        let mut controller = Controller::allocate(linear, settings).unwrap();
        let mut workspace = controller.workspace();
        let mut x = Vector2::new(4.0, 0.0);
        let (mut without, mut converged) = (0, 0);
        for k in 0..40 {
            if k == 8 {
                x[1] += push;
            }
            let plan = controller.step(&x, &upright(), &mut workspace);
            let (status, u) = (plan.status, plan.first_input());
            without += usize::from(!status.is_solved());
            if status == Status::Converged {
                let cost = controller.tracking_cost(&x, &upright());
                let mut fresh = Controller::allocate(linear, settings).unwrap();
                fresh.step(&x, &upright(), &mut workspace);
                let least = fresh.tracking_cost(&x, &upright());
                assert!(
                    cost <= least * (1.0 + 1e-3),
                    "{push} {horizon} {k}: {cost} {least}"
                );
                converged += 1;
            }
            x = Rk4 { substeps: 2 }.advance(&linear, &x, &u, 0.1);
        }
        assert!(without > 0 && converged > 20, "{without} {converged}");
    }
}

/// What was prepared and is not used leaves no trace: the plan does not move on twice.
#[test]
fn what_is_prepared_in_vain_changes_nothing() {
    let elsewhere = Reference::constant(Vector2::new(0.5, 0.0));
    let settings = super::short_case::Settings {
        iterations: Iterations::descent(1e-5, 1),
        ..settings()
    };
    let mut controller = Controller::allocate(PENDULUM, settings).unwrap();
    let mut workspace = controller.workspace();
    let mut x = Vector2::new(0.8, -0.4);
    for k in 0..15 {
        let u = controller.step(&x, &upright(), &mut workspace).u[0];
        x = Rk4 { substeps: 2 }.advance(&PENDULUM, &x, &u, 0.05);
        x[1] += if k % 3 == 0 { 0.3 } else { 0.0 };
        let [mut stepped, mut changed, mut twice, mut once, mut taken] =
            [(); 5].map(|()| controller.clone());
        let expected = controller
            .clone()
            .step(&x, &upright(), &mut workspace)
            .u
            .clone();
        let check = |what: &str, found: &[Vector1<f64>]| {
            let apart = found.iter().zip(expected.iter());
            let error = apart.map(|(a, b)| (a - b).amax()).fold(0.0, f64::max);
            assert!(error < 1e-9, "{k}, {what}: {error}");
        };
        stepped.prepare(&upright(), &mut workspace);
        taken.take_over(&stepped);
        check("step", &stepped.step(&x, &upright(), &mut workspace).u);
        check("take over", &taken.step(&x, &upright(), &mut workspace).u);
        changed.prepare(&upright(), &mut workspace);
        changed.set_bounds(settings.x, settings.u).unwrap();
        check(
            "bounds",
            &changed.feedback(&x, &upright(), &mut workspace).u,
        );
        once.prepare(&upright(), &mut workspace);
        let answer = once.feedback(&x, &upright(), &mut workspace).u[0];
        twice.prepare(&elsewhere, &mut workspace);
        twice.prepare(&upright(), &mut workspace);
        let again = twice.feedback(&x, &upright(), &mut workspace).u[0];
        assert!(
            (again - answer).amax() < 1e-9,
            "{k}, twice: {again} {answer}"
        );
    }
}

/// From the paper's loop to a descent: it begins with the loop's last plan, not with that of an earlier descent.
#[test]
fn a_descent_goes_on_from_the_plan_of_the_papers_loop() {
    let with = |iterations| super::short_case::Settings {
        iterations,
        ..settings()
    };
    let descent = with(Iterations::descent(1e-5, 1));
    let mut controller = Controller::allocate(PENDULUM, descent).unwrap();
    let mut workspace = controller.workspace();
    controller.step(&Vector2::new(-1.0, -1.0), &upright(), &mut workspace);
    controller.set_settings(with(Iterations::Fixed(1))).unwrap();
    let mut x = Vector2::new(1.0, 1.0);
    for k in 0..10 {
        let u = controller.step(&x, &upright(), &mut workspace).u[0];
        x = Rk4 { substeps: 2 }.advance(&PENDULUM, &x, &u, 0.05);
        // Without gains and a known cost, as one that knows nothing but this plan.
        let mut other = Controller::allocate(PENDULUM, descent).unwrap();
        other.take_over(&controller);
        let expected = other.step(&x, &upright(), &mut workspace).clone();
        let mut changed = controller.clone();
        changed.set_settings(descent).unwrap();
        let found = changed.step(&x, &upright(), &mut workspace);
        assert_eq!(found.u, expected.u, "{k}");
        assert_eq!(found.x, expected.x, "{k}");
    }
}
