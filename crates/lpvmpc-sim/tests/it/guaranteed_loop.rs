//! The guaranteed loop around a mass on a rail: batch and stepping, late inputs, pushes.

use lpvmpc::{
    BoundId, Bounds, GuaranteedController, GuaranteedFeedback, GuaranteedIterations,
    GuaranteedSettings, LpvModel, Measurement, Quantity, Reading, Regulator, Rk4, Rollout, Side,
    SolverSettings, TerminalSet, Weights,
};
use lpvmpc_design::lqr_discrete;
use lpvmpc_sim::{
    Actuation, ClosedLoop, GuaranteedLoop, RunConfig, Termination, Tolerances, Unloaded, World,
    record,
};
use nalgebra::{DMatrix, Matrix1, Matrix2, Matrix2x1, RowVector2, Vector1, Vector2};
use std::time::Duration;

const TOLERANCES: Tolerances = Tolerances {
    relative: 1e-12,
    absolute: 1e-12,
};
const T_S: f64 = 0.1;

/// x = (position [m], speed [m/s]), u = acceleration [m/s^2].
#[derive(Clone, Copy, PartialEq)]
struct Mass;

impl LpvModel<f64, 2, 1, 1> for Mass {
    fn scheduling(&self, _: &Vector2<f64>, _: &Vector1<f64>) -> Vector1<f64> {
        Vector1::zeros()
    }

    fn matrices(&self, _: &Vector1<f64>) -> (Matrix2<f64>, Vector2<f64>) {
        (Matrix2::new(0.0, 1.0, 0.0, 0.0), Vector2::new(0.0, 1.0))
    }
}

type Guaranteed = GuaranteedController<Mass, f64, 2, 1, 1>;
type Feedback = GuaranteedFeedback<Mass, f64, 2, 1, 1, 3>;

/// At most 0.5 m/s and 1 m/s^2. The mass is linear, so the LQR's cost decreases by the stage cost
/// in every level set, and in this one the law keeps the bounds.
fn controller() -> Guaranteed {
    let (q, r) = (Matrix2::identity(), Matrix1::new(0.1));
    let (a, b) = (
        Matrix2::new(1.0, T_S, 0.0, 1.0),
        Matrix2x1::new(T_S * T_S / 2.0, T_S),
    );
    let [a, b, q_d, r_d] = [
        DMatrix::from_column_slice(2, 2, a.as_slice()),
        DMatrix::from_column_slice(2, 1, b.as_slice()),
        DMatrix::from_column_slice(2, 2, q.as_slice()),
        DMatrix::from_column_slice(1, 1, r.as_slice()),
    ];
    let lqr = lqr_discrete(&a, &b, &q_d, &r_d).unwrap();
    let settings = GuaranteedSettings {
        t_s: T_S,
        horizon: 10,
        rk4: Rk4 { substeps: 1 },
        // The plant of these tests is the rollout itself.
        rollout: Rollout {
            rk4: Rk4 { substeps: 1 },
            error: Matrix2::zeros(),
            between: Vector2::zeros(),
        },
        weights: Weights { q, r },
        terminal: TerminalSet {
            gain: RowVector2::from_row_slice(lqr.k.as_slice()),
            p: Matrix2::from_column_slice(lqr.p.as_slice()),
            level: 0.5,
        },
        x: Bounds {
            lower: Vector2::new(f64::NEG_INFINITY, -0.5),
            upper: Vector2::new(f64::INFINITY, 0.5),
        },
        u: Bounds {
            lower: Vector1::new(-1.0),
            upper: Vector1::new(1.0),
        },
        direction: Vector2::new(1.0, 0.0),
        set_points: [f64::NEG_INFINITY, f64::INFINITY],
        offset_weight: 100.0,
        margin: 1e-3,
        iterations: GuaranteedIterations {
            known: 1,
            unknown: 30,
        },
        soft_price: 1e3,
        solver: SolverSettings::default(),
    };
    Guaranteed::allocate(Mass, settings).unwrap()
}

#[test]
fn a_run_is_the_sequence_of_its_samples() {
    let wanted = |t: f64| if t < 2.0 { 20.0 } else { -1.0 };
    let world = World::ideal(Unloaded::<_, 1>(&Mass), Vector2::zeros(), T_S, TOLERANCES);
    let regulator = Feedback::guaranteed_feedback(controller(), false);
    let course = RunConfig {
        samples: 120,
        reference: &|t| Vector2::new(wanted(t), 0.0),
        clock: &|| Duration::ZERO,
        progress: &|_| (),
    };
    let mut closed_loop = ClosedLoop::new(regulator, world).unwrap();
    let run = record(&mut closed_loop, &course).trajectory;
    assert_eq!(run.termination, Termination::Complete);
    let mut stepped = GuaranteedLoop::new(controller(), Mass, Vector2::zeros(), TOLERANCES);
    let mut workspace = controller().workspace::<3>();
    for sample in &run.samples {
        assert_eq!(*stepped.state(), sample.x);
        let step = stepped.decide(wanted(sample.t), &mut workspace);
        assert_eq!((step.u, step.cost), (sample.u, sample.cost));
        assert_eq!(sample.guarantee.unwrap().decision, step.decision);
        assert!(step.decision.is_guaranteed());
        assert!(sample.x[1].abs() <= 0.5, "{}", sample.x);
        stepped.advance(&step.u, &Actuation::ideal()).unwrap();
    }
    assert!(
        (run.final_state[0] + 1.0).abs() < 1e-2,
        "{}",
        run.final_state
    );
}

/// The plan meets the bounds that are reported as active, speeds at their stages and the force that is
/// applied, and no others.
#[test]
fn active_bounds_are_where_the_plan_meets_them() {
    let mut regulator = Feedback::guaranteed_feedback(controller(), false);
    let (mut speeds, mut forces) = (0, 0);
    let mut x = Vector2::zeros();
    for k in 0..60 {
        regulator.observe(&Measurement {
            t: k as f64 * T_S,
            readings: [0, 1].map(|i| Some(Reading::fresh(x[i]))),
        });
        let command = regulator.decide(&|_| Vector2::new(20.0, 0.0));
        let plan: Vec<_> = regulator.prediction().collect();
        let active: Vec<_> = regulator.active_bounds().collect();
        let upper_speed = |stage| {
            active.contains(&BoundId {
                stage,
                quantity: Quantity::State(1),
                side: Side::Upper,
            })
        };
        for (i, x) in plan.iter().enumerate() {
            // The margin is a thousandth of the bounds' width.
            assert_eq!(upper_speed(i + 1), x[1] > 0.5 - 0.0011, "{k} {i} {x}");
            speeds += usize::from(upper_speed(i + 1));
        }
        let upper_force = active.contains(&BoundId {
            stage: 0,
            quantity: Quantity::Input(0),
            side: Side::Upper,
        });
        assert_eq!(upper_force, command.u[0] > 1.0 - 1e-9, "{k}: {}", command.u);
        forces += usize::from(upper_force);
        x = plan[0];
    }
    assert!(speeds > 100 && forces > 0, "{speeds} {forces}");
}

/// Position and speed under a constant acceleration are known: the old input acts during the
/// delay, the new one with its error after it, and a push comes on top.
#[test]
fn a_late_and_wrong_input_acts_as_said() {
    let mut run = GuaranteedLoop::new(controller(), Mass, Vector2::zeros(), TOLERANCES);
    run.advance(&Vector1::new(1.0), &Actuation::ideal())
        .unwrap();
    let first = Vector2::new(T_S * T_S / 2.0, T_S);
    assert!((run.state() - first).amax() < 1e-12);
    let late = Actuation {
        delay: 0.25 * T_S,
        error: Vector1::new(0.5),
    };
    run.advance(&Vector1::new(-1.0), &late).unwrap();
    let (early, rest) = (0.25 * T_S, 0.75 * T_S);
    let turned = first[1] + early;
    let end = Vector2::new(
        first[0] + first[1] * early + early * early / 2.0 + turned * rest - 0.25 * rest * rest,
        turned - 0.5 * rest,
    );
    assert!((run.state() - end).amax() < 1e-12, "{} {end}", run.state());
    run.push(&Vector2::new(0.0, 1.0));
    assert!((run.state()[1] - end[1] - 1.0).abs() < 1e-12);
}
