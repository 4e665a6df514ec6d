//! The Riccati kernel alone: one backward step against the cost it claims to minimise.

use lpvmpc::riccati::{BadPivot, CostToGo, StageFactor};
use lpvmpc::{Capacity, Common, List, Ocp, Solution, Solver, SolverSettings, Stage, Status};
use lpvmpc_testkit::rng::Rng;
use nalgebra::{Matrix1, Matrix2, SMatrix, SVector, Vector1};

/// A stage, its weights, and the cost-to-go behind it.
struct Problem<const NX: usize, const NU: usize> {
    stage: Stage<f64, NX, NU>,
    weights: Common<f64, NX, NU>,
    behind: CostToGo<f64, NX>,
}

impl<const NX: usize, const NU: usize> Problem<NX, NU> {
    /// Everything that a stage can have: cross weight, linear costs, affine term. [Q S'; S R] is
    /// the Gram matrix of 12 random rows, positive semidefinite; P has rank NX - 1 at most.
    fn random(rng: &mut Rng) -> Self {
        let g_x = rng.matrix::<12, NX>();
        let g_u = rng.matrix::<12, NU>();
        let mut root_p = rng.matrix::<NX, NX>();
        root_p.row_mut(0).fill(0.0);
        Self {
            stage: Stage {
                a: rng.matrix(),
                b: rng.matrix(),
                c: rng.matrix(),
                linear_x: rng.matrix(),
                linear_u: rng.matrix(),
            },
            weights: Common {
                q: g_x.transpose() * g_x,
                r: g_u.transpose() * g_u,
                s: g_u.transpose() * g_x,
                ..Common::default()
            },
            behind: CostToGo {
                quadratic: root_p.transpose() * root_p,
                linear: rng.matrix(),
            },
        }
    }

    fn next(&self, x: &SVector<f64, NX>, u: &SVector<f64, NU>) -> SVector<f64, NX> {
        let Stage { a, b, c, .. } = &self.stage;
        a * x + b * u + c
    }

    /// The stage's cost and the cost-to-go behind it.
    fn cost(&self, x: &SVector<f64, NX>, u: &SVector<f64, NU>) -> f64 {
        let Common { q, r, s, .. } = &self.weights;
        let Stage {
            linear_x, linear_u, ..
        } = &self.stage;
        0.5 * x.dot(&(q * x))
            + u.dot(&(s * x))
            + 0.5 * u.dot(&(r * u))
            + linear_x.dot(x)
            + linear_u.dot(u)
            + value(&self.behind, &self.next(x, u))
    }

    /// The minimum over u and its size, from values of the cost alone: a quadratic function is
    /// known by its values at 0, e_i, -e_i and e_i + e_j. The size is the largest of them.
    fn minimum(&self, x: &SVector<f64, NX>) -> (SVector<f64, NU>, f64, f64) {
        let unit = |i| SVector::from_fn(|row, _| if row == i { 1.0 } else { 0.0 });
        let at = |u: SVector<f64, NU>| self.cost(x, &u);
        let origin = at(SVector::zeros());
        let gradient = SVector::from_fn(|i, _| (at(unit(i)) - at(-unit(i))) / 2.0);
        let hessian = SMatrix::<f64, NU, NU>::from_fn(|i, j| {
            at(unit(i) + unit(j)) - at(unit(i)) - at(unit(j)) + origin
        });
        let u = -hessian.cholesky().unwrap().solve(&gradient);
        let corners = (0..NU).flat_map(|i| (0..NU).map(move |j| (i, j)));
        let values = corners.map(|(i, j)| at(unit(i) + unit(j)).abs());
        (u, at(u), values.fold(origin.abs(), f64::max))
    }

    fn eliminate(&self) -> (StageFactor<f64, NX, NU>, CostToGo<f64, NX>) {
        let mut factor = StageFactor::zeros();
        let mut cost_to_go = self.behind;
        let outcome = factor.eliminate(&self.stage, &self.weights, &mut cost_to_go);
        outcome.unwrap();
        (factor, cost_to_go)
    }
}

fn value<const NX: usize>(cost_to_go: &CostToGo<f64, NX>, x: &SVector<f64, NX>) -> f64 {
    0.5 * x.dot(&(cost_to_go.quadratic * x)) + cost_to_go.linear.dot(x)
}

/// Rounding in costs of the given size: a few hundred operations, and a factor of 100 for the
/// condition of R + B'PB.
fn rounding(size: f64) -> f64 {
    1e5 * f64::EPSILON * (1.0 + size)
}

fn cost_to_go_is_the_minimum<const NX: usize, const NU: usize>(rng: &mut Rng) {
    for _ in 0..100 {
        let problem = Problem::<NX, NU>::random(rng);
        let (_, front) = problem.eliminate();
        assert_eq!(front.quadratic, front.quadratic.transpose());
        // The cost-to-go leaves the constant out: it is 0 at the origin.
        let (_, constant, _) = problem.minimum(&SVector::zeros());
        for _ in 0..10 {
            let x = rng.matrix() * rng.power_of_ten(-1.0, 1.0);
            let (_, minimum, size) = problem.minimum(&x);
            let error = value(&front, &x) + constant - minimum;
            assert!(
                error.abs() <= rounding(size),
                "{NX} x {NU}: {error:e} of {size:e}"
            );
        }
    }
}

#[test]
fn the_cost_to_go_in_front_is_the_minimum_over_the_input() {
    let mut rng = Rng::new(11);
    cost_to_go_is_the_minimum::<1, 1>(&mut rng);
    cost_to_go_is_the_minimum::<4, 1>(&mut rng);
    cost_to_go_is_the_minimum::<2, 3>(&mut rng);
    cost_to_go_is_the_minimum::<6, 3>(&mut rng);
    cost_to_go_is_the_minimum::<12, 4>(&mut rng);
}

/// Moving away from u = K x + k by d costs d'(R + B'PB)d/2 and nothing of first order.
#[test]
fn gain_and_feedforward_minimise() {
    let mut rng = Rng::new(12);
    for _ in 0..200 {
        let problem = Problem::<4, 2>::random(&mut rng);
        let (factor, _) = problem.eliminate();
        let (b, r) = (&problem.stage.b, &problem.weights.r);
        let hessian = r + b.transpose() * problem.behind.quadratic * b;
        let x = rng.matrix::<4, 1>();
        let u = factor.feedback * x + factor.feedforward;
        let optimum = problem.cost(&x, &u);
        let (expected, _, size) = problem.minimum(&x);
        assert!((u - expected).norm() <= rounding(size), "{u}{expected}");
        for _ in 0..10 {
            let d = rng.matrix::<2, 1>();
            let excess = problem.cost(&x, &(u + d)) - optimum;
            let quadratic = 0.5 * d.dot(&(hessian * d));
            assert!((excess - quadratic).abs() <= rounding(size), "{excess:e}");
            assert!(excess > 0.0);
        }
    }
}

/// The identity that the dual method rests on: in the normalised deviation v the cost is the
/// cost-to-go plus |v|^2/2, whatever the stage's matrices are.
#[test]
fn the_deviation_costs_half_its_square() {
    let mut rng = Rng::new(13);
    for _ in 0..200 {
        let problem = Problem::<4, 3>::random(&mut rng);
        let (factor, front) = problem.eliminate();
        let at = |x: &SVector<f64, 4>, v: &SVector<f64, 3>| problem.cost(x, &factor.policy(x, v));
        let constant = at(&SVector::zeros(), &SVector::zeros());
        for _ in 0..10 {
            let x = rng.matrix::<4, 1>();
            let v = rng.matrix::<3, 1>() * rng.power_of_ten(-1.0, 1.0);
            let expected = value(&front, &x) + constant + 0.5 * v.norm_squared();
            let (_, _, size) = problem.minimum(&x);
            let error = at(&x, &v) - expected;
            assert!(
                error.abs() <= rounding(size + v.norm_squared()),
                "{error:e}"
            );
        }
    }
}

/// Without a deviation the policy is the feedback law; `next` is the dynamics.
#[test]
fn policy_and_next_agree_with_the_stage() {
    let mut rng = Rng::new(14);
    for _ in 0..200 {
        let problem = Problem::<5, 2>::random(&mut rng);
        let (factor, _) = problem.eliminate();
        let (x, v) = (rng.matrix(), rng.matrix());
        let law = factor.feedback * x + factor.feedforward;
        let policy = factor.policy(&x, &SVector::zeros());
        assert!((policy - law).norm() <= 1e-14 * (1.0 + law.norm()));

        let u = factor.policy(&x, &v);
        let expected = problem.next(&x, &u);
        let found = problem.stage.next(&x, &u);
        let size = 1.0 + x.norm() + u.norm();
        let error = (found - expected).norm();
        assert!(error <= 1e-13 * size * (1.0 + problem.stage.b.norm()));
    }
}

/// L^-1 is lower triangular and whitens R + B'PB.
#[test]
fn the_inverse_factor_is_that_of_the_input_hessian() {
    let mut rng = Rng::new(15);
    for _ in 0..200 {
        let problem = Problem::<3, 4>::random(&mut rng);
        let (factor, _) = problem.eliminate();
        let (b, r) = (&problem.stage.b, &problem.weights.r);
        let hessian = r + b.transpose() * problem.behind.quadratic * b;
        let l = factor.inverse_factor;
        assert_eq!(l, l.lower_triangle());
        let whitened = l * hessian * l.transpose();
        assert!((whitened - SMatrix::identity()).norm() <= rounding(0.0));
    }
}

/// R alone need not be definite: the cost-to-go behind the stage may make up for it.
#[test]
fn an_indefinite_input_weight_is_fine_if_the_sum_is_definite() {
    let mut rng = Rng::new(16);
    let mut problem = Problem::<1, 1>::random(&mut rng);
    problem.weights.r = Matrix1::new(-3.0);
    problem.stage.b = Matrix1::new(2.0);
    problem.behind.quadratic = Matrix1::new(1.0);
    let (_, front) = problem.eliminate();
    let (_, constant, _) = problem.minimum(&Vector1::zeros());
    let x = Vector1::new(0.7);
    let (_, minimum, size) = problem.minimum(&x);
    let error = value(&front, &x) + constant - minimum;
    assert!(error.abs() <= rounding(size), "{error:e}");
}

/// The pivot that `eliminate` complains about for R = `r`, B = I, P = `p`.
fn pivot(r: Matrix2<f64>, p: Matrix2<f64>) -> f64 {
    let stage = Stage {
        a: Matrix2::identity(),
        b: Matrix2::identity(),
        ..Stage::new()
    };
    let weights = Common {
        r,
        ..Common::default()
    };
    let mut cost_to_go = CostToGo {
        quadratic: p,
        linear: SVector::zeros(),
    };
    let outcome = StageFactor::zeros().eliminate(&stage, &weights, &mut cost_to_go);
    let BadPivot(pivot) = outcome.expect_err("not positive definite");
    pivot
}

#[test]
fn what_is_not_positive_definite_is_refused_with_its_pivot() {
    let zero = Matrix2::zeros();
    // By hand: the pivots of [4 2; 2 d] are 4 and d - 1.
    assert_eq!(pivot(Matrix2::new(4.0, 2.0, 2.0, 1.0), zero), 0.0);
    assert_eq!(pivot(Matrix2::new(4.0, 2.0, 2.0, -1.0), zero), -2.0);
    assert_eq!(pivot(Matrix2::new(-5.0, 0.0, 0.0, 1.0), zero), -5.0);
    // R + B'PB counts, not R.
    let p = Matrix2::from_diagonal_element(3.0);
    assert_eq!(pivot(Matrix2::new(1.0, 2.0, 2.0, -4.0), p), -2.0);
    assert_eq!(pivot(Matrix2::from_diagonal_element(-3.0), p), 0.0);
    // Numbers that are none.
    assert!(pivot(Matrix2::new(f64::NAN, 0.0, 0.0, 1.0), zero).is_nan());
    assert!(pivot(Matrix2::new(1.0, 0.0, f64::NAN, 1.0), zero).is_nan());
    assert!(pivot(Matrix2::new(f64::INFINITY, 0.0, 0.0, 1.0), zero).is_infinite());
}

/// In the horizon, the failure names the stage, counted from the front.
#[test]
fn the_solver_names_stage_and_pivot() {
    let mut ocp = Ocp::<f64, 1, 1>::allocate(5);
    ocp.own = List::repeat(Common::default(), 5);
    for stage in &mut ocp.stages {
        stage.a = Matrix1::new(1.0);
        stage.b = Matrix1::new(1.0);
    }
    // P is 0 behind stage 2, so its R is the pivot.
    ocp.own[2].r = Matrix1::new(-0.25);
    let capacity = Capacity {
        stages: 5,
        rows: 1,
        active: 1,
        ..Capacity::default()
    };
    let mut solution = Solution::allocate(capacity);
    Solver::allocate(capacity).solve(&ocp, &SolverSettings::default(), &mut solution);
    let expected = Status::NumericalFailure {
        stage: 2,
        pivot: -0.25,
    };
    assert_eq!(solution.status, expected);
    assert!(solution.u.iter().all(|u| u[0].is_finite()));
    let message = expected.to_string();
    assert!(
        message.contains("stage 2") && message.contains("-0.25"),
        "{message}"
    );
}
