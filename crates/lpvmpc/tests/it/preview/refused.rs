//! What makes no sense is refused by name, and leaves inputs that can be applied.

use super::plants::PENDULUM;
use super::short_case::{Plan, settings};
use crate::pendulum::Pendulum;
use lpvmpc::{
    Bounds, Controller, ControllerError, ControllerMemory, GeneralRow, Iterations, List, Penalty,
    Preview, PreviewError, PreviewMistake as Mistake, PreviewPart as Part, Reference, Status,
    TerminalIngredient, Weights, Workspace,
};
use nalgebra::{Matrix1, Matrix2, RowVector2, Vector1, Vector2};

type Told<'a> = Preview<'a, Pendulum<f64>, f64, 2, 1, 1>;
type Row = GeneralRow<f64, 2, 1>;

fn rest() -> Told<'static> {
    Preview::new(Reference::constant(Vector2::zeros()))
}

/// The answer to a preview in room for stages of their own and one row each, and what a good sample
/// answers after it.
fn answer(preview: &Told<'_>) -> Plan {
    let mut plan = None;
    for iterations in [Iterations::Fixed(1), Iterations::default()] {
        let mut settings = settings();
        settings.iterations = iterations;
        let room = settings.capacity().with_own_stages().with_general_rows(1);
        let memory = ControllerMemory::allocate(room);
        let mut controller = Controller::new(PENDULUM, settings, memory).unwrap();
        let mut workspace = Workspace::allocate(room);
        let x = Vector2::new(0.1, 0.0);
        let first = controller.step_with(&x, &rest(), &mut workspace).clone();
        for two_parts in [false, true] {
            if two_parts {
                controller.prepare_with(preview, &mut workspace);
            }
            let refused = controller
                .feedback_with(&x, preview, &mut workspace)
                .clone();
            assert!(!refused.status.is_solved());
            assert!(refused.active.is_empty());
            assert!(refused.u.iter().all(|u| settings.u.contains(u, 0.0)));
            plan = Some(refused);
            let again = controller.step_with(&x, &rest(), &mut workspace);
            assert_eq!(again.u, first.u);
        }
    }
    plan.unwrap()
}

fn assert_refused(preview: &Told<'_>, part: Part, stage: usize, mistake: Mistake) {
    let plan = answer(preview);
    let expected = PreviewError {
        part,
        stage,
        mistake,
    };
    assert_eq!(plan.status, Status::Refused(expected));
    let words = plan.status.to_string();
    assert!(words.contains("refused") && words.contains(&format!("stage {stage}")));
}

#[test]
fn numbers_that_are_not_finite() {
    for bad in [f64::NAN, f64::INFINITY] {
        let (good, wrong) = (Vector2::new(0.1, 0.0), Vector2::new(0.1, bad));
        let one = [Vector1::new(0.0), Vector1::new(0.1), Vector1::new(bad)];
        let preview = Told {
            u_ref: &one,
            ..rest()
        };
        assert_refused(&preview, Part::InputReference, 2, Mistake::NotFinite);
        let preview = Told {
            scheduling: &one,
            ..rest()
        };
        assert_refused(&preview, Part::Scheduling, 2, Mistake::NotFinite);
        let preview = Told {
            disturbance: &[good, wrong],
            ..rest()
        };
        assert_refused(&preview, Part::Disturbance, 1, Mistake::NotFinite);
        let row = Row {
            x: wrong,
            ..Row::default()
        };
        let preview = Told {
            rows: &[&[], &[row]],
            ..rest()
        };
        assert_refused(&preview, Part::Rows, 1, Mistake::NotFinite);
    }
}

#[test]
fn weights() {
    let good = settings().weights;
    let q = |q| [good, Weights { q, ..good }];
    let r = |r| [good, Weights { r, ..good }];
    let refuse = |weights: &[Weights<f64, 2, 1>], part, mistake| {
        let preview = Told { weights, ..rest() };
        assert_refused(&preview, part, 1, mistake);
    };
    let skew = Matrix2::new(1.0, 0.5, 0.0, 1.0);
    refuse(&q(skew), Part::StateWeight, Mistake::NotSymmetric);
    refuse(
        &q(-Matrix2::identity()),
        Part::StateWeight,
        Mistake::NotDefinite,
    );
    refuse(
        &r(Matrix1::new(0.0)),
        Part::InputWeight,
        Mistake::NotDefinite,
    );
    refuse(
        &r(Matrix1::new(f64::NAN)),
        Part::InputWeight,
        Mistake::NotSymmetric,
    );
    let preview = Told {
        terminal: Some(TerminalIngredient::Cost(skew)),
        ..rest()
    };
    assert_refused(&preview, Part::Terminal, 0, Mistake::NotSymmetric);
}

/// Q - S' R^-1 S decides: with Q = 1 and R = 0.1 a cross weight of 0.3 is good, one of 0.33 is not.
#[test]
fn cross_weights_and_linear_costs() {
    let weights = [Weights {
        q: Matrix2::identity(),
        r: Matrix1::new(0.1),
    }];
    let s = |entry| RowVector2::new(0.0, entry);
    for (bad, mistake) in [
        (0.33, Mistake::NotDefinite),
        (-0.33, Mistake::NotDefinite),
        (f64::NAN, Mistake::NotFinite),
        (f64::INFINITY, Mistake::NotFinite),
    ] {
        let cross = [s(0.3), s(-0.3), s(bad)];
        let preview = Told {
            weights: &weights,
            cross: &cross,
            ..rest()
        };
        assert_refused(&preview, Part::CrossWeight, 2, mistake);
    }
    // Beside the settings' own weights, too.
    let cross = [s(1e3)];
    let preview = Told {
        cross: &cross,
        ..rest()
    };
    assert_refused(&preview, Part::CrossWeight, 0, Mistake::NotDefinite);
    let preview = Told {
        linear_x: &[Vector2::zeros(), Vector2::new(f64::NAN, 0.0)],
        ..rest()
    };
    assert_refused(&preview, Part::LinearStateCost, 1, Mistake::NotFinite);
    let preview = Told {
        linear_u: &[Vector1::new(f64::INFINITY)],
        ..rest()
    };
    assert_refused(&preview, Part::LinearInputCost, 0, Mistake::NotFinite);
}

#[test]
fn bounds_and_prices() {
    let good = Bounds {
        lower: Vector1::new(-1.0),
        upper: Vector1::new(1.0),
    };
    for (lower, upper) in [(1.0, -1.0), (f64::NAN, 1.0), (f64::INFINITY, f64::INFINITY)] {
        let wrong = Bounds {
            lower: Vector1::new(lower),
            upper: Vector1::new(upper),
        };
        let preview = Told {
            u: &[good, good, wrong],
            ..rest()
        };
        assert_refused(&preview, Part::InputBounds, 2, Mistake::Crossed);
        let wide = Bounds {
            lower: Vector2::new(lower, 0.0),
            upper: Vector2::new(upper, 0.0),
        };
        let preview = Told {
            x: &[wide],
            ..rest()
        };
        assert_refused(&preview, Part::StateBounds, 0, Mistake::Crossed);
        let row = Row {
            lower,
            upper,
            ..Row::default()
        };
        let preview = Told {
            rows: &[&[row]],
            ..rest()
        };
        assert_refused(&preview, Part::Rows, 0, Mistake::Crossed);
    }
    for linear in [-1.0, f64::NAN, f64::INFINITY] {
        let price = Some(Penalty {
            linear,
            quadratic: 0.0,
        });
        let preview = Told {
            soft_x: &[[None, price]],
            ..rest()
        };
        assert_refused(&preview, Part::Prices, 0, Mistake::Price);
        let row = Row {
            soft: price,
            ..Row::default()
        };
        let preview = Told {
            rows: &[&[row]],
            ..rest()
        };
        assert_refused(&preview, Part::Rows, 0, Mistake::Price);
    }
}

/// Two rows in room for one, at a late stage only; more than can be told apart; none for stages.
#[test]
fn what_there_is_no_room_for() {
    let row = Row::default();
    let preview = Told {
        rows: &[&[row], &[], &[row, row]],
        ..rest()
    };
    assert_refused(&preview, Part::Rows, 2, Mistake::NoRoom);
    let settings = settings();
    let mut controller = Controller::allocate(PENDULUM, settings).unwrap();
    let mut workspace = controller.workspace();
    let x = Vector2::new(0.1, 0.0);
    let weights = [settings.weights];
    let bounds = [settings.x];
    let inputs = [settings.u];
    let many = vec![row; 300];
    for (preview, part) in [
        (
            Told {
                weights: &weights,
                ..rest()
            },
            Part::StateWeight,
        ),
        (
            Told {
                x: &bounds,
                ..rest()
            },
            Part::StateBounds,
        ),
        (
            Told {
                soft_x: &[[None; 2]],
                ..rest()
            },
            Part::StateBounds,
        ),
        (
            Told {
                u: &inputs,
                ..rest()
            },
            Part::InputBounds,
        ),
        (
            Told {
                rows: &[&[row]],
                ..rest()
            },
            Part::Rows,
        ),
    ] {
        let plan = controller.step_with(&x, &preview, &mut workspace);
        let expected = PreviewError {
            part,
            stage: 0,
            mistake: Mistake::NoRoom,
        };
        assert_eq!(plan.status, Status::Refused(expected));
        assert!(settings.u.contains(&plan.u[0], 0.0));
    }
    let mut large = Workspace::allocate(settings.capacity().with_general_rows(300));
    let preview = Told {
        rows: &[&many],
        ..rest()
    };
    let plan = controller.step_with(&x, &preview, &mut large);
    assert!(matches!(plan.status, Status::Refused(error) if error.mistake == Mistake::NoRoom));
    // The controller's own rows.
    controller.set_rows(List::repeat(row, 1)).unwrap();
    let reference = Reference::constant(Vector2::zeros());
    let plan = controller.step(&x, &reference, &mut workspace);
    assert!(matches!(plan.status, Status::Refused(error) if error.part == Part::Rows));
    // What needs no room is taken in the smallest workspace.
    controller.set_rows(List::empty()).unwrap();
    let preview = Told {
        disturbance: &[Vector2::new(0.0, 0.5)],
        u_ref: &[Vector1::new(-0.5)],
        rows: &[&[]],
        ..rest()
    };
    let plan = controller.step_with(&x, &preview, &mut workspace);
    assert!(plan.status.is_solved(), "{}", plan.status);
}

/// Entries beyond the horizon are not read, whatever they are.
#[test]
fn entries_beyond_the_horizon() {
    let n = settings().horizon;
    let mut pushes = vec![Vector2::new(0.0, 0.1); n];
    let mut bounds = vec![settings().x; n + 1];
    let step = |disturbance: &[Vector2<f64>], x: &[Bounds<f64, 2>]| {
        let room = settings().capacity().with_own_stages();
        let memory = ControllerMemory::allocate(room);
        let mut controller = Controller::new(PENDULUM, settings(), memory).unwrap();
        let preview = Told {
            disturbance,
            x,
            ..rest()
        };
        let mut workspace = Workspace::allocate(room);
        let x = Vector2::new(0.1, 0.0);
        controller.step_with(&x, &preview, &mut workspace).clone()
    };
    let expected = step(&pushes, &bounds);
    assert!(expected.status.is_solved());
    pushes.push(Vector2::repeat(f64::NAN));
    bounds.push(Bounds {
        lower: Vector2::repeat(1.0),
        upper: Vector2::repeat(-1.0),
    });
    let found = step(&pushes, &bounds);
    assert_eq!(found.u, expected.u);
}

#[test]
fn rows_of_the_controller() {
    let mut controller = Controller::allocate(PENDULUM, settings()).unwrap();
    for (lower, upper, mistake) in [
        (1.0, 0.0, Mistake::Crossed),
        (f64::NAN, 0.0, Mistake::Crossed),
    ] {
        let row = Row {
            lower,
            upper,
            ..Row::default()
        };
        let refused = controller.set_rows(List::repeat(row, 2));
        assert_eq!(refused, Err(ControllerError::Rows(mistake)));
    }
    let reference = Reference::constant(Vector2::zeros());
    let mut workspace = controller.workspace();
    let plan = controller.step(&Vector2::new(0.1, 0.0), &reference, &mut workspace);
    assert!(plan.status.is_solved(), "the rows are as they were: none");
}

/// A state that is not finite: inputs within the bounds of the preview, which do not hold zero.
#[test]
fn a_broken_state_keeps_the_bounds_of_the_preview() {
    for iterations in [Iterations::Fixed(1), Iterations::default()] {
        let mut settings = settings();
        settings.iterations = iterations;
        let room = settings.capacity().with_own_stages();
        let memory = ControllerMemory::allocate(room);
        let mut controller = Controller::new(PENDULUM, settings, memory).unwrap();
        let mut workspace = Workspace::allocate(room);
        let bounds = |i: usize| Bounds {
            lower: Vector1::new(1.0 + i as f64),
            upper: Vector1::new(1.5 + i as f64),
        };
        let list: Vec<_> = (0..3).map(bounds).collect();
        let preview = Told { u: &list, ..rest() };
        for x in [Vector2::new(f64::NAN, 0.0), Vector2::new(0.1, 0.0)] {
            let plan = controller.step_with(&x, &preview, &mut workspace);
            assert_eq!(plan.status.is_solved(), x[0].is_finite());
            for (i, u) in plan.u.iter().enumerate() {
                assert!(bounds(i.min(2)).contains(u, 0.0), "stage {i}: {u}");
            }
        }
    }
}
