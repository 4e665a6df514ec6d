//! A nonlinear plant with everything at once, against plans that IPOPT finds (`testdata/preview`).

use super::plants::PENDULUM;
use crate::pendulum::Pendulum;
use lpvmpc::{
    Bounds, Controller, ControllerMemory, ControllerSettings, GeneralRow, Iterations, Penalty,
    Predictor, Preview, Reference, Rk4, Status, TerminalIngredient, Weights, Workspace,
};
use nalgebra::{Matrix1, Matrix2, RowVector2, Vector1, Vector2};
use std::f64::consts::FRAC_PI_2;

const N: usize = 20;
const RK4: Rk4 = Rk4 { substeps: 2 };
const INFINITY: f64 = f64::INFINITY;

/// A line of the table, in its order.
struct Case {
    x0: Vector2<f64>,
    phase: f64,
    weight: f64,
    gust: f64,
    gust_stage: usize,
    gap: f64,
    price: f64,
    stiffer: f64,
    cross: f64,
    slope: f64,
    cost: f64,
    u0: f64,
}

fn cases() -> Vec<Case> {
    let table = include_str!("../../../../../testdata/preview/optima.csv");
    let lines = table.lines().skip(1);
    lines
        .map(|line| {
            let numbers: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
            let [
                angle,
                rate,
                phase,
                weight,
                gust,
                stage,
                gap,
                price,
                stiffer,
                cross,
                slope,
                cost,
                u0,
            ] = numbers[..]
            else {
                panic!("thirteen columns");
            };
            Case {
                x0: Vector2::new(angle, rate),
                phase,
                weight,
                gust,
                gust_stage: stage as usize,
                gap,
                price,
                stiffer,
                cross,
                slope,
                cost,
                u0,
            }
        })
        .collect()
}

/// What changes along the horizon, by the formulas of the program that made the table.
struct Lists {
    x_ref: Vec<Vector2<f64>>,
    u_ref: Vec<Vector1<f64>>,
    weights: Vec<Weights<f64, 2, 1>>,
    cross: [RowVector2<f64>; 1],
    linear_x: [Vector2<f64>; 1],
    linear_u: Vec<Vector1<f64>>,
    x: Vec<Bounds<f64, 2>>,
    u: Vec<Bounds<f64, 1>>,
    rows: Vec<[GeneralRow<f64, 2, 1>; 2]>,
    disturbance: Vec<Vector2<f64>>,
    models: Vec<Pendulum<f64>>,
}

fn lists(case: &Case) -> Lists {
    let (part, stages) = (|i: usize| i as f64 / N as f64, 0..=N);
    let limit = |i: usize| 4.0 + 2.0 * (i as f64 + case.phase).sin();
    let rate = |i: usize| 0.8 + 0.5 * part(i);
    Lists {
        x_ref: { stages.clone() }
            .map(|i| Vector2::new(0.1 * (0.3 * i as f64 + case.phase).sin(), 0.0))
            .collect(),
        u_ref: (0..N)
            .map(|i| Vector1::new(-0.5 * (0.2 * i as f64).sin()))
            .collect(),
        weights: (0..N)
            .map(|i| Weights {
                q: Matrix2::from_diagonal(&Vector2::new(1.0 + case.weight * part(i), 0.1)),
                r: Matrix1::new(0.1 + 0.05 * (i as f64 + FRAC_PI_2).sin()),
            })
            .collect(),
        cross: [RowVector2::new(0.1, 0.03) * case.cross],
        linear_x: [Vector2::new(0.1, -0.05) * case.slope],
        linear_u: (0..N)
            .map(|i| Vector1::new(0.2 * case.slope * (0.5 * i as f64).sin()))
            .collect(),
        x: { stages.clone() }
            .map(|i| Bounds {
                lower: Vector2::new(-INFINITY, -rate(i)),
                upper: Vector2::new(INFINITY, rate(i)),
            })
            .collect(),
        u: (0..N)
            .map(|i| Bounds {
                lower: Vector1::new(-limit(i)),
                upper: Vector1::new(limit(i)),
            })
            .collect(),
        rows: stages
            .map(|i| {
                let gap = GeneralRow {
                    x: Vector2::new(1.0, 0.2),
                    upper: case.gap + 0.5 * (-0.3 * i as f64).exp(),
                    ..GeneralRow::default()
                };
                let mixed = GeneralRow {
                    x: Vector2::new(2.0, 0.3),
                    u: Vector1::new(1.0),
                    lower: -3.0,
                    upper: 3.0,
                    soft: Some(Penalty {
                        linear: 1.0,
                        quadratic: 10.0,
                    }),
                };
                [gap, mixed]
            })
            .collect(),
        disturbance: (0..N)
            .map(|i| {
                let gust = if i >= case.gust_stage { case.gust } else { 0.0 };
                Vector2::new(0.05, gust)
            })
            .collect(),
        models: (0..N)
            .map(|i| Pendulum {
                stiffness: if i < 8 { 9.81 } else { 9.81 + case.stiffer },
                ..PENDULUM
            })
            .collect(),
    }
}

fn settings() -> ControllerSettings<f64, 2, 1, 1> {
    // What a preview says instead is not to be seen.
    let weights = Weights {
        q: Matrix2::identity() * 7.0,
        r: Matrix1::new(0.7),
    };
    let terminal = TerminalIngredient::Cost(Matrix2::new(147.0, 40.0, 40.0, 15.0));
    let narrow = Bounds {
        lower: Vector1::new(-0.1),
        upper: Vector1::new(0.1),
    };
    ControllerSettings {
        predictor: Predictor::StageConsistent(RK4),
        iterations: Iterations::descent(1e-9, 200),
        ..ControllerSettings::new(0.05, N, weights, terminal, narrow)
    }
}

/// Cost and first input of the optimum, the rows kept, and the plan a rollout of the plants under the
/// disturbance.
#[test]
fn a_descent_finds_the_plans_of_another_solver() {
    let pendulum = Pendulum {
        stiffness: 1.0,
        ..PENDULUM
    };
    let (mut active, mut converged) = (0, 0);
    for (line, case) in cases().iter().enumerate() {
        let lists = lists(case);
        let (end, stages) = lists.x_ref.split_last().unwrap();
        let rows: Vec<&[_]> = lists.rows.iter().map(|rows| &rows[..]).collect();
        let soft = [[
            None,
            Some(Penalty {
                linear: case.price,
                quadratic: 2.0,
            }),
        ]];
        let preview = Preview {
            u_ref: &lists.u_ref,
            weights: &lists.weights,
            cross: &lists.cross,
            linear_x: &lists.linear_x,
            linear_u: &lists.linear_u,
            x: &lists.x,
            soft_x: &soft,
            u: &lists.u,
            rows: &rows,
            disturbance: &lists.disturbance,
            models: &lists.models,
            ..Preview::new(Reference {
                stages,
                terminal: *end,
            })
        };
        let room = settings().capacity().with_own_stages();
        let room = room.with_general_rows(5);
        let memory = ControllerMemory::allocate(room);
        let mut controller = Controller::new(pendulum, settings(), memory).unwrap();
        let mut workspace = Workspace::allocate(room);
        let plan = controller.step_with(&case.x0, &preview, &mut workspace);
        let plan = plan.clone();
        assert!(plan.status.is_solved(), "{line}: {}", plan.status);
        converged += usize::from(plan.status == Status::Converged);
        let mut prices = 0.0;
        let mut x = case.x0;
        for i in 0..=N {
            let [gap, mixed] = lists.rows[i];
            if i > 0 {
                let over = (x[1].abs() - lists.x[i].upper[1]).max(0.0);
                prices += case.price * over + over * over;
                let left = gap.upper - gap.x.dot(&x);
                assert!(left > -1e-6, "{line}: {left} at {i}");
                active += usize::from(left < 1e-6);
            }
            if i < N {
                let u = plan.u[i];
                let over = ((mixed.x.dot(&x) + u[0]).abs() - 3.0).max(0.0);
                prices += over + 5.0 * over * over;
                let (k, d) = (lists.models[i].stiffness, lists.disturbance[i]);
                x = runge_kutta(x, |x| {
                    Vector2::new(x[1], k * x[0].sin() - 0.1 * x[1] + u[0]) + d
                });
                assert!((x - plan.x[i]).amax() < 1e-9, "{line}: {x} at {i}");
            }
        }
        let cost = controller.tracking_cost_with(&case.x0, &preview) + prices;
        // Linear costs may bring it below zero.
        let error = (cost - case.cost).abs();
        assert!(
            error < 1e-6 * case.cost.abs().max(0.1),
            "line {line}: {cost} for {}",
            case.cost
        );
        let error = (plan.u[0][0] - case.u0).abs();
        assert!(
            error < 1e-6,
            "line {line}: {} for {}",
            plan.u[0][0],
            case.u0
        );
    }
    assert!(active > 20 && converged > 35, "{active} {converged}");
}

/// Two steps of the classical method over a sample.
fn runge_kutta(x: Vector2<f64>, f: impl Fn(Vector2<f64>) -> Vector2<f64>) -> Vector2<f64> {
    let h = 0.05 / 2.0;
    (0..2).fold(x, |x, _| {
        let k1 = f(x);
        let k2 = f(x + k1 * (h / 2.0));
        let k3 = f(x + k2 * (h / 2.0));
        let k4 = f(x + k3 * h);
        x + (k1 + (k2 + k3) * 2.0 + k4) * (h / 6.0)
    })
}
