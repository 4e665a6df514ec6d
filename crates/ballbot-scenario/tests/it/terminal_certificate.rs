//! The certificate of the default ballbot's terminal set, against its true motion.

use ballbot_scenario::{RobotTable, Scenario, TerminalCertificate, builtin};
use lpvmpc::{Embedding, Number};
use lpvmpc_certificate::{
    CertificateProblem, Interval, MOST_BOXES, TaylorModel, TerminalProblem, certify_terminal,
    synthesize_terminal,
};
use lpvmpc_design::{SchedulingGrid, zero_order_hold};
use lpvmpc_sim::{Tolerances, advance};
use nalgebra::{DMatrix, Vector1, Vector2, Vector4};
use std::f64::consts::{FRAC_PI_3, PI};
use std::path::Path;

fn certificate() -> TerminalCertificate {
    TerminalCertificate::check_digest(builtin::TERMINAL_CERTIFICATE).unwrap();
    TerminalCertificate::from_json(builtin::TERMINAL_CERTIFICATE).unwrap()
}

/// Uniform numbers in [-1, 1], from a linear congruential generator (Knuth's MMIX).
fn uniform(seed: &mut u64) -> f64 {
    *seed = seed
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

/// A point with x'Px = share^2 level.
fn state(found: &TerminalCertificate, share: f64, seed: &mut u64) -> Vector4<f64> {
    let direction = loop {
        let y = Vector4::from_fn(|_, _| uniform(seed));
        if y.norm() <= 1.0 && y.norm() > 1e-3 {
            break y.normalize();
        }
    };
    let factor = found.terminal.p.cholesky().unwrap().l().transpose();
    let y = direction * share * found.terminal.level.sqrt();
    factor.solve_upper_triangular(&y).unwrap()
}

#[test]
fn the_true_motion_decreases_the_cost_and_stays_in_the_set() {
    let found = certificate();
    let robot = found.plant.ballbot();
    let tolerances = Tolerances {
        relative: 1e-10,
        absolute: 1e-12,
    };
    let cost = |x: &Vector4<f64>| (found.terminal.p * x).dot(x);
    let mut seed = 1;
    for i in 0..20_000 {
        // Half of them on the boundary.
        let share = if i % 2 == 0 {
            1.0
        } else {
            uniform(&mut seed).abs()
        };
        let x = state(&found, share, &mut seed);
        let u = Vector1::from(-found.terminal.k * x);
        let half = advance(&robot, &x, &u, 0.5 * found.t_s, tolerances).unwrap();
        let next = advance(&robot, &half, &u, 0.5 * found.t_s, tolerances).unwrap();
        let stage = (found.q * x).dot(&x) + (found.r * u).dot(&u);
        let allowed = (1.0 - found.terminal.contraction) * cost(&x) - stage;
        assert!(cost(&next) <= allowed + 1e-6, "{x}");
        assert!(cost(&next) <= found.terminal.level);
        assert!(u[0].abs() <= found.input_limits[0]);
        for state in [x, half, next] {
            for (value, limit) in state.iter().zip(found.state_limits.iter()) {
                assert!(value.abs() <= *limit);
            }
        }
    }
}

/// The program takes its own certificate to be proved: this is where it is.
#[test]
fn the_built_in_certificate_is_proved() {
    let found = certificate();
    let proof = found.prove(&found.plant, MOST_BOXES, &|_| ()).unwrap();
    assert_eq!(proof.boxes, found.record.boxes);
}

/// Assumption 4 of docs/guarantees.md, for every state, whatever the parameters: phi and its Taylor
/// coefficient enter the scheduling with exactly zero, and A's column of phi is exactly zero for all
/// schedulings of the box.
#[test]
fn the_robot_does_not_notice_where_it_stands() {
    let mut table = certificate().plant;
    for friction in [0.0, 1e-3] {
        table.drive_friction_m2_s = friction;
        let x: Vector4<TaylorModel<4>> = Vector4::from_fn(|i, _| TaylorModel::symbol(0.0, 1e3, i));
        let torque = Vector1::new(TaylorModel::constant(0.0));
        for entry in Embedding::scheduling(&table, &x, &torque).iter() {
            assert_eq!(
                (entry.slopes()[0], entry.squares()[0], entry.error),
                (0.0, [0.0; 4], 0.0)
            );
        }
        let schedulings = [FRAC_PI_3, 2.0 * PI].map(|limit| Interval::new(-limit, limit));
        let (a, _) = Embedding::matrices(&table, &Vector2::from(schedulings));
        assert!(
            a.column(0)
                .iter()
                .all(|entry| *entry == Interval::point(0.0))
        );
    }
}

#[test]
fn the_certificate_is_of_the_built_in_robot() {
    let found = certificate();
    let prepared = Scenario::load("two-setpoints")
        .unwrap()
        .prepare(Path::new("."))
        .unwrap();
    assert_eq!(
        found.plant,
        RobotTable::try_from(&prepared.ballbot).unwrap()
    );
    assert_eq!(found.t_s, prepared.settings.t_s);
    assert_eq!(found.q, prepared.settings.weights.q);
    assert_eq!(found.r, prepared.settings.weights.r);
}

#[test]
fn the_intervals_hold_the_robots_matrices() {
    let table = certificate().plant;
    for (theta, rate) in [(0.0, 0.0), (0.1, -2.0), (-0.9, 6.0), (1.0, 1.0)] {
        let (a, b) = table.ballbot().matrices(&Vector2::new(theta, rate));
        let (rows, input) = table.matrices(&Vector2::new(theta, rate).map(Interval::point));
        for i in 0..4 {
            // The plain numbers have roundings of their own.
            let near = |range: Interval, value: f64| {
                (range.middle() - value).abs() <= 1e-12 * (1.0 + value.abs())
            };
            assert!((0..4).all(|j| near(rows[(i, j)], a[(i, j)])));
            assert!(near(input[i], b[i]));
        }
    }
}

fn problem(size: f64, contraction: f64) -> CertificateProblem<4, 1, 2> {
    let found = certificate();
    let limits = Vector2::new(size * FRAC_PI_3, size * 2.0 * PI);
    CertificateProblem {
        terminal: TerminalProblem {
            t_s: found.t_s,
            q: found.q,
            r: found.r,
            state_limits: Vector4::new(f64::INFINITY, limits[0], 10.0 * PI, limits[1]),
            input_limits: found.input_limits,
            contraction,
            level: 2000.0,
        },
        state_limits: Vector4::repeat(f64::INFINITY),
        scheduling_limits: limits,
        written_by: "test".to_owned(),
    }
}

/// At 60 degrees and 2 pi rad/s the design holds at each of its 7 x 7 points, and fails between.
#[test]
fn true_on_the_grid_and_false_between_is_rejected() {
    let problem = problem(1.0, 0.0);
    let table = certificate().plant;
    let robot = table.ballbot();
    let limits = problem.scheduling_limits;
    let grid = |points: usize| SchedulingGrid::new(-limits, limits, [points; 2]).unwrap();
    let found = synthesize_terminal(&robot, &grid(7), &problem.terminal).unwrap();
    let dense = |m: &[f64], r, c| DMatrix::from_column_slice(r, c, m);
    let p = dense(found.p.as_slice(), 4, 4);
    let k = dense(found.k.as_slice(), 1, 4);
    let q = dense(problem.terminal.q.as_slice(), 4, 4);
    let allowed = &p - q - k.transpose() * problem.terminal.r[0] * &k;
    let scale = p.clone().cholesky().unwrap().l().try_inverse().unwrap();
    let worst = |grid: SchedulingGrid<2>| {
        let decrease = grid.points().map(|point| {
            let (a, b) = robot.matrices(&point);
            let (a, b) =
                zero_order_hold(&dense(a.as_slice(), 4, 4), &dense(b.as_slice(), 4, 1), 0.05)
                    .unwrap();
            let closed = a - b * &k;
            let rest = &allowed - closed.transpose() * &p * closed;
            (&scale * rest * scale.transpose())
                .symmetric_eigenvalues()
                .min()
        });
        decrease.fold(f64::INFINITY, f64::min)
    };
    assert!(
        worst(grid(7)) > -1e-9,
        "true on the grid: {}",
        worst(grid(7))
    );
    assert!(
        worst(grid(43)) < -1e-4,
        "false between: {}",
        worst(grid(43))
    );
    // There is no proof of what is false, with any number of boxes.
    let refused = certify_terminal(table, &problem, 3000, &|_| ());
    assert!(refused.is_err());
}
