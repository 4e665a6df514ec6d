//! A whole horizon without bounds against the dense system of its optimality conditions.

use lpvmpc::{Capacity, Common, List, Ocp, Solution, Solver, SolverSettings, Stage, Status};
use lpvmpc_testkit::rng::Rng;
use nalgebra::{DMatrix, DVector};

/// A horizon of `horizon` stages, of the `memory` that there is, that differ in everything.
fn random_ocp<const NX: usize, const NU: usize>(
    rng: &mut Rng,
    horizon: usize,
    memory: usize,
) -> Ocp<f64, NX, NU> {
    let mut ocp = Ocp {
        x0: rng.matrix(),
        horizon,
        own: List::repeat(Common::default(), memory),
        ..Ocp::allocate(memory)
    };
    for (stage, common) in ocp.stages.iter_mut().zip(&mut ocp.own) {
        let g_x = rng.matrix::<12, NX>();
        let g_u = rng.matrix::<12, NU>();
        *stage = Stage {
            // Neither dying out nor exploding over the horizon.
            a: rng.matrix() / (NX as f64).sqrt(),
            b: rng.matrix(),
            c: rng.matrix(),
            linear_x: rng.matrix(),
            linear_u: rng.matrix(),
        };
        *common = Common {
            q: g_x.transpose() * g_x,
            r: g_u.transpose() * g_u,
            s: g_u.transpose() * g_x,
            ..Common::default()
        };
    }
    let root = rng.matrix::<NX, NX>();
    ocp.terminal.p = root.transpose() * root;
    ocp.terminal.linear_x = rng.matrix();
    ocp
}

/// The dense optimality conditions [H C'; C 0] (z, multipliers) = (-g, d) of
/// min z'Hz/2 + g'z subject to C z = d with z = (x_0, u_0, x_1, .., u_{N-1}, x_N).
struct Dense {
    h: DMatrix<f64>,
    g: DVector<f64>,
    c: DMatrix<f64>,
    d: DVector<f64>,
}

impl Dense {
    fn new<const NX: usize, const NU: usize>(ocp: &Ocp<f64, NX, NU>) -> Self {
        let n = ocp.horizon;
        let width = NX + NU;
        let (variables, rows) = (n * width + NX, (n + 1) * NX);
        let mut h = DMatrix::zeros(variables, variables);
        let mut g = DVector::zeros(variables);
        let mut c = DMatrix::zeros(rows, variables);
        let mut d = DVector::zeros(rows);
        c.view_mut((0, 0), (NX, NX)).fill_with_identity();
        d.rows_mut(0, NX).copy_from(&ocp.x0);
        for (i, stage) in ocp.stages.iter().enumerate().take(n) {
            let (x, u, next) = (i * width, i * width + NX, (i + 1) * width);
            let Common { q, r, s, .. } = ocp.common_at(i);
            h.view_mut((x, x), (NX, NX)).copy_from(q);
            h.view_mut((u, u), (NU, NU)).copy_from(r);
            h.view_mut((u, x), (NU, NX)).copy_from(s);
            h.view_mut((x, u), (NX, NU)).copy_from(&s.transpose());
            g.rows_mut(x, NX).copy_from(&stage.linear_x);
            g.rows_mut(u, NU).copy_from(&stage.linear_u);
            // x_{i+1} - A x_i - B u_i = c
            let row = (i + 1) * NX;
            c.view_mut((row, next), (NX, NX)).fill_with_identity();
            c.view_mut((row, x), (NX, NX)).copy_from(&-stage.a);
            c.view_mut((row, u), (NX, NU)).copy_from(&-stage.b);
            d.rows_mut(row, NX).copy_from(&stage.c);
        }
        let end = n * width;
        h.view_mut((end, end), (NX, NX)).copy_from(&ocp.terminal.p);
        g.rows_mut(end, NX).copy_from(&ocp.terminal.linear_x);
        Self { h, g, c, d }
    }

    /// The minimiser, its cost, and the condition of the system.
    fn solve(&self) -> (DVector<f64>, f64, f64) {
        let (variables, rows) = (self.g.len(), self.d.len());
        let mut system = DMatrix::zeros(variables + rows, variables + rows);
        let mut right = DVector::zeros(variables + rows);
        let corner = (variables, variables);
        system.view_mut((0, 0), corner).copy_from(&self.h);
        system
            .view_mut((variables, 0), (rows, variables))
            .copy_from(&self.c);
        system
            .view_mut((0, variables), (variables, rows))
            .copy_from(&self.c.transpose());
        right.rows_mut(0, variables).copy_from(&-&self.g);
        right.rows_mut(variables, rows).copy_from(&self.d);
        let singular = system.singular_values();
        let condition = singular.max() / singular.min();
        let z = system.lu().solve(&right).unwrap();
        let z = z.rows(0, variables).into_owned();
        let cost = 0.5 * z.dot(&(&self.h * &z)) + self.g.dot(&z);
        (z, cost, condition)
    }
}

fn matches_the_dense_solution<const NX: usize, const NU: usize>(
    rng: &mut Rng,
    horizon: usize,
    memory: usize,
) {
    let capacity = Capacity {
        stages: memory,
        rows: 1,
        active: 1,
        ..Capacity::default()
    };
    let mut solver = Solver::allocate(capacity);
    let mut solution = Solution::allocate(capacity);
    for _ in 0..10 {
        let ocp = random_ocp::<NX, NU>(rng, horizon, memory);
        solver.solve(&ocp, &SolverSettings::default(), &mut solution);
        assert_eq!(solution.status, Status::Solved);
        assert_eq!(solution.changes, 0);
        let (z, cost, condition) = Dense::new(&ocp).solve();
        // The error of a direct method: rounding times condition, times a modest factor.
        let allowed = 100.0 * f64::EPSILON * condition * z.norm();
        assert!(
            allowed < 1e-6 * z.norm(),
            "the comparison must say something"
        );
        let width = NX + NU;
        for i in 0..horizon {
            let u = solution.u[i] - z.rows(i * width + NX, NU);
            let x = solution.x[i] - z.rows((i + 1) * width, NX);
            assert!(u.norm() <= allowed, "u_{i} of {horizon}: {:e}", u.norm());
            assert!(
                x.norm() <= allowed,
                "x_{} of {horizon}: {:e}",
                i + 1,
                x.norm()
            );
        }
        // At the minimum the error of the cost is of second order: what is left is rounding.
        let error = (solution.cost - cost).abs();
        let terms = 0.5 * z.dot(&(Dense::new(&ocp).h * &z)) + 1.0;
        assert!(error <= 1e-11 * terms + allowed, "cost: {error:e}");
    }
}

#[test]
fn the_horizon_without_bounds_is_the_dense_solution() {
    let mut rng = Rng::new(21);
    matches_the_dense_solution::<1, 1>(&mut rng, 1, 1);
    matches_the_dense_solution::<4, 1>(&mut rng, 20, 20);
    matches_the_dense_solution::<2, 3>(&mut rng, 10, 10);
    matches_the_dense_solution::<6, 3>(&mut rng, 12, 12);
}

#[test]
fn so_is_a_horizon_shorter_than_the_memory() {
    let mut rng = Rng::new(22);
    matches_the_dense_solution::<4, 1>(&mut rng, 1, 20);
    matches_the_dense_solution::<4, 2>(&mut rng, 7, 20);
}
