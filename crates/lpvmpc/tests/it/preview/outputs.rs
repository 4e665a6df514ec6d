//! Outputs: where they are linear, as the weights, linear costs and rows that they amount to; where they make no sense,
//! refused.

use super::plants::PENDULUM;
use super::short_case::{Plan, Settings, settings};
use lpvmpc::{
    Controller, ControllerMemory, GeneralRow, Iterations, OutputGoal, Outputs, Penalty, Predictor,
    Preview, PreviewError, PreviewMistake as Mistake, PreviewPart as Part, Reference, Rk4, Status,
    VisitTangent, Weights, Workspace,
};
use nalgebra::{Matrix1, Matrix2, RowVector2, Vector1, Vector2};

type Told<'a> = Preview<'a, crate::pendulum::Pendulum<f64>, f64, 2, 1, 1>;

/// A bounded output with an input, and a weighted one of everything.
#[derive(Debug)]
struct Two {
    bounded: OutputGoal<f64>,
    weighted: OutputGoal<f64>,
}

const C: [[f64; 2]; 2] = [[2.0, 0.3], [1.0, -0.4]];
const D: [f64; 2] = [1.0, 0.2];
const CONSTANT: [f64; 2] = [0.1, -0.05];

impl Outputs<f64, 2, 1> for Two {
    fn count(&self) -> usize {
        2
    }

    fn bounded(&self) -> usize {
        1
    }

    fn depends_on_input(&self, _: usize) -> bool {
        true
    }

    fn goal(&self, i: usize, j: usize) -> OutputGoal<f64> {
        match j {
            0 => self.bounded,
            _ => OutputGoal {
                reference: self.weighted.reference * (1.0 + 0.1 * i as f64),
                ..self.weighted
            },
        }
    }

    fn values(
        &self,
        _: usize,
        x: &Vector2<f64>,
        u: &Vector1<f64>,
        visit: &mut dyn FnMut(usize, f64),
    ) {
        for j in 0..2 {
            visit(j, Vector2::from(C[j]).dot(x) + D[j] * u[0] + CONSTANT[j]);
        }
    }

    fn tangents(
        &self,
        i: usize,
        x: &Vector2<f64>,
        u: &Vector1<f64>,
        visit: &mut VisitTangent<'_, f64, 2, 1>,
    ) {
        self.values(i, x, u, &mut |j, y| {
            visit(j, y, &C[j].into(), &Vector1::new(D[j]))
        });
    }
}

fn two() -> Two {
    Two {
        bounded: OutputGoal {
            lower: -2.0,
            upper: 2.5,
            soft: Some(Penalty {
                linear: 0.5,
                quadratic: 1.0,
            }),
            ..OutputGoal::none()
        },
        weighted: OutputGoal {
            weight: 3.0,
            reference: 0.2,
            ..OutputGoal::none()
        },
    }
}

/// The plans of a few samples, each one program or a descent, whole or in two parts.
fn plans(settings: Settings, preview: &Told<'_>, two_parts: bool) -> Vec<Plan> {
    let room = settings.capacity().with_own_stages().with_general_rows(2);
    let mut controller =
        Controller::new(PENDULUM, settings, ControllerMemory::allocate(room)).unwrap();
    let mut workspace = Workspace::allocate(room);
    let mut x = Vector2::new(0.6, -0.3);
    (0..6)
        .map(|_| {
            if two_parts {
                controller.prepare_with(preview, &mut workspace);
            }
            let plan = controller
                .feedback_with(&x, preview, &mut workspace)
                .clone();
            assert!(plan.status.is_solved(), "{:?}", plan.status);
            x = plan.x[0];
            plan
        })
        .collect()
}

#[test]
fn linear_outputs_are_weights_linear_costs_and_rows() {
    let rk4 = Rk4 { substeps: 2 };
    let fixed = |most, predictor| Settings {
        iterations: Iterations::Fixed(most),
        predictor,
        ..settings()
    };
    // A row of the preview beside them.
    let own = GeneralRow {
        x: Vector2::new(0.0, 1.0),
        lower: -1.5,
        soft: Some(Penalty {
            linear: 2.0,
            quadratic: 0.0,
        }),
        ..GeneralRow::default()
    };
    let two = two();
    let (w, c, d) = (two.weighted.weight, Vector2::from(C[1]), D[1]);
    let weights = Weights {
        q: Matrix2::identity() + c * c.transpose() * w,
        r: Matrix1::new(0.1 + w * d * d),
    };
    // Twice the error times its slope, at the origin.
    let errors: Vec<f64> = (0..25)
        .map(|i| 2.0 * w * (CONSTANT[1] - two.goal(i, 1).reference))
        .collect();
    let mut linear_x: Vec<Vector2<f64>> = errors.iter().map(|error| c * *error).collect();
    // Outputs cost nothing at the end.
    linear_x.push(Vector2::zeros());
    let linear_u: Vec<Vector1<f64>> = errors.iter().map(|error| Vector1::new(d * error)).collect();
    let row = GeneralRow {
        x: C[0].into(),
        u: Vector1::new(D[0]),
        lower: two.bounded.lower - CONSTANT[0],
        upper: two.bounded.upper - CONSTANT[0],
        soft: two.bounded.soft,
    };
    let still = Reference::constant(Vector2::zeros());
    for settings in [
        settings(),
        fixed(1, Predictor::FrozenRk4(rk4)),
        fixed(3, Predictor::StageConsistent(rk4)),
    ] {
        for two_parts in [false, true] {
            let outputs = Told {
                outputs: Some(&two),
                rows: &[&[own]],
                u_ref: &[Vector1::zeros()],
                ..Preview::new(still)
            };
            let written_out = Told {
                weights: &[weights],
                cross: &[RowVector2::new(c[0], c[1]) * (w * d)],
                linear_x: &linear_x,
                linear_u: &linear_u,
                rows: &[&[row, own]],
                u_ref: &[Vector1::zeros()],
                ..Preview::new(still)
            };
            let found = plans(settings, &outputs, two_parts);
            let expected = plans(settings, &written_out, two_parts);
            // A descent begins with other closed loops of its regulator, and ends within its tolerance.
            let descent = matches!(settings.iterations, Iterations::Descent { .. });
            let bound = if descent { 1e-3 } else { 1e-9 };
            let mut active = 0;
            for (found, expected) in found.iter().zip(&expected) {
                active += expected.active.len();
                for (found, expected) in found.u.iter().zip(&expected.u) {
                    let error = (found - expected).amax();
                    assert!(
                        error < bound,
                        "{:?}, {two_parts}: {error:e}",
                        settings.iterations
                    );
                }
            }
            assert!(active > 0);
        }
    }
}

#[test]
fn goals_without_sense_are_refused() {
    let refused = |change: &dyn Fn(&mut Two), rows: usize| {
        let mut two = two();
        change(&mut two);
        let settings = settings();
        let room = settings
            .capacity()
            .with_own_stages()
            .with_general_rows(rows);
        let mut controller =
            Controller::new(PENDULUM, settings, ControllerMemory::allocate(room)).unwrap();
        let preview = Told {
            outputs: Some(&two),
            ..Preview::new(Reference::constant(Vector2::zeros()))
        };
        let x = Vector2::new(0.1, 0.0);
        controller
            .step_with(&x, &preview, &mut Workspace::allocate(room))
            .status
    };
    let outputs = |stage, mistake| {
        Status::Refused(PreviewError {
            part: Part::Outputs,
            stage,
            mistake,
        })
    };
    assert!(refused(&|_| {}, 1).is_solved());
    for (status, expected) in [
        (
            refused(&|two| two.weighted.weight = -1.0, 1),
            outputs(0, Mistake::NotDefinite),
        ),
        (
            refused(&|two| two.weighted.weight = f64::NAN, 1),
            outputs(0, Mistake::NotFinite),
        ),
        (
            refused(&|two| two.bounded.lower = 3.0, 1),
            outputs(0, Mistake::Crossed),
        ),
        (
            refused(&|two| two.bounded.soft.as_mut().unwrap().linear = -1.0, 1),
            outputs(0, Mistake::Price),
        ),
        // Without room for their rows.
        (
            refused(&|_| {}, 0),
            Status::Refused(PreviewError {
                part: Part::Rows,
                stage: 0,
                mistake: Mistake::NoRoom,
            }),
        ),
    ] {
        assert_eq!(status, expected);
    }
}
