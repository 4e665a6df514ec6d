//! Closed loops that run into their bounds: at every sample the controller's quadratic program
//! is solved a second time, densely, and the two plans are compared input by input.
//!
//! The second route's answers are not believed either: their optimality conditions are checked
//! first.

mod dense;

use ballbot::{Ballbot, limits};
use dense::{Dense, Optimum};
use lpvmpc::{
    BoundId, Bounds, Controller, ControllerSettings, InputReference, Iterations, Ocp, Predictor,
    Reference, Rk4, Scheduling, Solution, SolverSettings, Status, TerminalIngredient, Weights,
};
use lpvmpc_sim::{Tolerances, advance};
use nalgebra::{Matrix1, Matrix4, Vector1, Vector4};
use std::f64::consts::{PI, TAU};
use std::path::Path;

const NX: usize = 4;
const N: usize = 20;
/// Samples of a run: 4 s.
const SAMPLES: usize = 80;
const T_S: f64 = 0.05;
/// The two routes may differ by this much, in N m at any stage.
const AGREEMENT: f64 = 1e-8;
/// The dense route's optimality conditions hold to this, relative to their largest terms.
const OPTIMALITY: f64 = 1e-10;

type Loop = Controller<Ballbot<f64>, f64, NX, 1, 3>;
type Problem = Ocp<f64, NX, 1>;
type Plan = Solution<f64, NX, 1>;

/// What a run has shown.
struct Comparison {
    /// Samples with a plan.
    solved: usize,
    /// Largest difference of an input between the two routes, N m.
    difference: f64,
    /// Samples whose plan has an active bound.
    constrained: usize,
    /// Most bounds that are active in one plan, the terminal equality not counted.
    most_active: usize,
}

impl Comparison {
    fn print(&self) {
        println!(
            "difference {:.1e} N m, {} of {} plans constrained, up to {} bounds active",
            self.difference, self.constrained, self.solved, self.most_active
        );
    }
}

/// Runs the closed loop from rest at zero and compares every plan with the dense route. It ends
/// where both find that there is no plan.
fn compare(mut controller: Loop, phi_ref: fn(usize) -> f64) -> Comparison {
    let plant = Ballbot::<f64>::paper();
    let tolerances = Tolerances {
        relative: 1e-10,
        absolute: 1e-10,
    };
    let mut workspace = controller.workspace();
    let mut x = Vector4::zeros();
    let mut comparison = Comparison {
        solved: 0,
        difference: 0.0,
        constrained: 0,
        most_active: 0,
    };
    for k in 0..SAMPLES {
        let at = |i: usize| Vector4::new(phi_ref(k + i), 0.0, 0.0, 0.0);
        let stages: Vec<_> = (0..N).map(at).collect();
        let reference = Reference {
            stages: &stages,
            terminal: at(N),
        };
        let plan = controller.step(&x, &reference, &mut workspace).clone();
        let dense = Dense::condense(workspace.ocp());
        let Some(optimum) = dense.solve() else {
            let told = matches!(plan.status, Status::Infeasible(_));
            assert!(told, "sample {k}: {}", plan.status);
            break;
        };
        assert!(plan.status.is_solved(), "sample {k}: {}", plan.status);
        comparison.solved += 1;
        let residual = dense.residual(&optimum);
        assert!(residual <= OPTIMALITY, "sample {k}: {residual:e}");
        for (u, exact) in plan.u.iter().zip(&optimum.u) {
            comparison.difference = comparison.difference.max((u[0] - exact).abs());
        }
        assert_same_bounds(&dense, &optimum, &plan, k);
        let active = optimum.active.len() - dense.equalities;
        comparison.constrained += usize::from(active > 0);
        comparison.most_active = comparison.most_active.max(active);
        x = advance(&plant, &x, &plan.u[0], T_S, tolerances).unwrap();
    }
    comparison
}

/// Both routes name the same bounds, with the same multipliers. A bound that is met without
/// force may be listed or not.
fn assert_same_bounds(dense: &Dense, optimum: &Optimum, plan: &Plan, sample: usize) {
    let exact = |bound: BoundId| {
        let same = |(row, _): &&(usize, f64)| dense.rows[*row].bound == bound;
        optimum.active.iter().find(same).map_or(0.0, |(_, m)| *m)
    };
    let found = |bound: BoundId| {
        let rows = plan.active.iter().filter(|row| row.bound == bound);
        rows.map(|row| row.multiplier).sum::<f64>()
    };
    let largest = optimum
        .active
        .iter()
        .fold(1.0, |m: f64, (_, v)| m.max(v.abs()));
    let named = optimum.active.iter().map(|(row, _)| dense.rows[*row].bound);
    for bound in named.chain(plan.active.iter().map(|row| row.bound)) {
        let (one, other) = (found(bound), exact(bound));
        assert!(
            (one - other).abs() <= 1e-6 * largest,
            "sample {sample}: {bound}: {one} and {other}"
        );
    }
}

/// The terminal weight of scenario 1 of the reference file.
fn terminal_weight() -> Matrix4<f64> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/scenarios.json");
    let text = std::fs::read_to_string(path).unwrap();
    let file: serde_json::Value = serde_json::from_str(&text).unwrap();
    let p = &file["scenarios"]["1_two_setpoints_lpv"]["P"];
    Matrix4::from_fn(|i, j| p[i][j].as_f64().unwrap())
}

/// The paper's controller of scenario 1, within the given bounds on (theta, phi_dot, theta_dot)
/// and the torque.
fn controller(x: [f64; 3], u: f64, terminal: TerminalIngredient<f64, NX>) -> Loop {
    let x = Vector4::new(f64::INFINITY, x[0], x[1], x[2]);
    let u = Vector1::new(u);
    let settings = ControllerSettings {
        t_s: T_S,
        horizon: N,
        predictor: Predictor::FrozenRk4(Rk4 { substeps: 1 }),
        weights: Weights {
            q: Matrix4::from_diagonal(&Vector4::new(200.0, 1.0, 0.1, 0.1)),
            r: Matrix1::new(1000.0),
        },
        terminal,
        x: Bounds {
            lower: -x,
            upper: x,
        },
        u: Bounds {
            lower: -u,
            upper: u,
        },
        soft_x: [None; 4],
        raise_prices: false,
        input_reference: InputReference::SteadyState,
        scheduling: Scheduling::Predicted,
        iterations: Iterations::Fixed(1),
        solver: SolverSettings::default(),
    };
    Controller::allocate(Ballbot::<f64>::paper(), settings).unwrap()
}

/// phi_ref at a sample, rad: once around at 1 s and back at 3 s.
fn once_around(sample: usize) -> f64 {
    if (20..60).contains(&sample) { TAU } else { 0.0 }
}

/// The built-in scenario `tight-bounds`: two set points, within bounds that are active in about half of the plans.
#[test]
fn tight_bounds_agree_with_a_dense_solver() {
    let terminal = TerminalIngredient::Cost(terminal_weight());
    let comparison = compare(controller([0.3, 15.0, 2.0], 0.5, terminal), once_around);
    comparison.print();
    assert_eq!(comparison.solved, SAMPLES);
    assert!(comparison.difference <= AGREEMENT);
    let fraction = comparison.constrained as f64 / SAMPLES as f64;
    assert!((fraction - 0.52).abs() < 0.01, "{fraction}");
    assert_eq!(comparison.most_active, 8);
}

/// Half a turn, to be reached exactly at the end of every horizon: four rows that are always
/// active, and none of the paper's bounds.
#[test]
fn terminal_equality_agrees_with_a_dense_solver() {
    let bounds = [limits::THETA, limits::PHI_DOT, limits::THETA_DOT];
    let controller = controller(bounds, limits::TORQUE, TerminalIngredient::Equality);
    let comparison = compare(controller, |_| PI);
    comparison.print();
    assert_eq!(comparison.solved, SAMPLES);
    assert!(comparison.difference <= AGREEMENT);
    assert_eq!(comparison.constrained, 0);
}

/// The same within bounds that leave little room to get there; the second time so little that
/// the first plan is a vertex, with as many active rows as inputs.
#[test]
fn terminal_equality_within_tight_bounds_agrees_with_a_dense_solver() {
    for (x, u, most_active) in [([0.24, 15.0, 3.0], 0.9, 8), ([0.3, 12.0, 2.4], 0.5, N - NX)] {
        let comparison = compare(controller(x, u, TerminalIngredient::Equality), |_| PI);
        comparison.print();
        assert_eq!(comparison.solved, SAMPLES);
        assert!(comparison.difference <= AGREEMENT);
        assert_eq!(comparison.most_active, most_active);
    }
}

/// Where there is no plan, both routes find none: with a terminal state out of reach from the
/// start, and where the plant was not where the plan before expected it.
#[test]
fn both_routes_find_the_same_samples_infeasible() {
    let (mut at_once, mut later) = (0, 0);
    for theta in [0.04, 0.08, 0.16, 0.2] {
        for u in [0.1, 0.2, 0.3, 0.4] {
            for (terminal, phi_ref) in [
                (TerminalIngredient::Equality, (|_| PI) as fn(usize) -> f64),
                (TerminalIngredient::Cost(terminal_weight()), once_around),
            ] {
                let comparison = compare(controller([theta, 8.0, 1.0], u, terminal), phi_ref);
                comparison.print();
                assert!(comparison.difference <= AGREEMENT);
                at_once += usize::from(comparison.solved == 0);
                later += usize::from((1..SAMPLES).contains(&comparison.solved));
            }
        }
    }
    assert!(at_once > 0 && later > 0, "{at_once} at once, {later} later");
}
