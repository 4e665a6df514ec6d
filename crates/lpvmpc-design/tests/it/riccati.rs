//! Riccati equations: closed forms, a second route, and problems that have no solution.

use lpvmpc_design::{LqProblem, RiccatiError, poles, solve_care, solve_dare};
use nalgebra::{DMatrix, dmatrix};

use crate::paper::{B_OPTIMAL, at_rest, cost};

fn problem<'a>(
    a: &'a DMatrix<f64>,
    b: &'a DMatrix<f64>,
    q: &'a DMatrix<f64>,
    r: &'a DMatrix<f64>,
) -> LqProblem<'a> {
    LqProblem {
        a,
        b,
        q,
        r,
        cross: None,
    }
}

#[test]
fn scalar_equations_have_the_positive_root_of_their_quadratic() {
    for (a, b, q, r) in [
        (1.0_f64, 1.0, 1.0, 1.0),
        (-3.0, 0.1, 5.0, 2.0),
        (0.0, 2.0, 3.0, 10.0),
        (40.0, 1.0, 1e-3, 1e3),
        (0.9, 1.0, 0.0, 1.0e-3),
    ] {
        let of = |x| DMatrix::from_element(1, 1, x);
        let (am, bm, qm, rm) = (of(a), of(b), of(q), of(r));
        if a != 0.9 {
            // 2 a p - b^2 p^2 / r + q = 0
            let root = r * (a + (a * a + q * b * b / r).sqrt()) / (b * b);
            let found = solve_care(&problem(&am, &bm, &qm, &rm)).unwrap();
            assert!(
                (found.p[0] / root - 1.0).abs() < 1e-13,
                "{} for {root}",
                found.p[0]
            );
        }
        // b^2 p^2 + (r - a^2 r - b^2 q) p - q r = 0
        let middle = r - a * a * r - b * b * q;
        let root = (-middle + (middle * middle + 4.0 * b * b * q * r).sqrt()) / (2.0 * b * b);
        let found = solve_dare(&problem(&am, &bm, &qm, &rm)).unwrap();
        assert!(
            (found.p[0] - root).abs() <= 1e-12 * root.abs(),
            "{} for {root}",
            found.p[0]
        );
    }
}

/// Two states apart from each other, the slow one of which costs next to nothing beside the other: each has the root of
/// its own quadratic.
#[test]
fn a_small_cost_beside_a_large_one_is_as_exact() {
    for (large, small) in [(1e20, 1e-6), (1e8, 1e-10), (1.0, 1e-18)] {
        let of = |x, y| DMatrix::from_diagonal(&nalgebra::dvector![x, y]);
        let poles = [0.5_f64, 0.999];
        let (a, b) = (of(poles[0], poles[1]), of(1.0, 1.0));
        let q = of(large, small);
        // Each input is worth as much as its state.
        let r = q.clone();
        let found = solve_dare(&problem(&a, &b, &q, &r)).unwrap();
        let fast = [-3.0, -1e-3];
        let continuous = solve_care(&problem(&of(fast[0], fast[1]), &b, &q, &r)).unwrap();
        for i in 0..2 {
            let weight = q[(i, i)];
            // p^2 - a^2 p - 1 = 0 in units of the weight
            let half = 0.5 * poles[i] * poles[i];
            let root = half + (half * half + 1.0).sqrt();
            let discrete = found.p[(i, i)] / weight;
            assert!((discrete - root).abs() < 1e-9, "{discrete} for {root}");
            // p^2 - 2 a p - 1 = 0
            let root = fast[i] + (fast[i] * fast[i] + 1.0).sqrt();
            let own = continuous.p[(i, i)] / weight;
            assert!((own - root).abs() < 1e-9, "{own} for {root}");
        }
    }
}

#[test]
fn a_double_integrator_has_its_closed_form() {
    // Q = diag(1, 0), R = 1: P = [sqrt 2, 1; 1, sqrt 2], K = [1, sqrt 2].
    let a = dmatrix![0.0, 1.0; 0.0, 0.0];
    let b = dmatrix![0.0; 1.0];
    let q = dmatrix![1.0, 0.0; 0.0, 0.0];
    let r = dmatrix![1.0];
    let found = solve_care(&problem(&a, &b, &q, &r)).unwrap();
    let root = 2.0_f64.sqrt();
    assert!((found.p - dmatrix![root, 1.0; 1.0, root]).norm() < 1e-13);
    assert!((found.k - dmatrix![1.0, root]).norm() < 1e-13);
}

/// P as the limit of the value iteration, started at zero: slow, and independent of doubling.
fn value_iteration(problem: &LqProblem<'_>, steps: usize) -> Option<DMatrix<f64>> {
    let (a, b) = (problem.a, problem.b);
    let mut p = DMatrix::zeros(a.nrows(), a.nrows());
    for _ in 0..steps {
        let cross = match problem.cross {
            Some(s) => a.transpose() * &p * b + s,
            None => a.transpose() * &p * b,
        };
        let weight = (problem.r + b.transpose() * &p * b).try_inverse()?;
        p = a.transpose() * &p * a + problem.q - &cross * weight * cross.transpose();
        // The skew part would grow with the open loop.
        p = (&p + p.transpose()) * 0.5;
    }
    Some(p)
}

#[test]
fn the_discrete_equation_agrees_with_value_iteration_with_and_without_cross_cost() {
    // Two inputs, an unstable pole pair, a singular A (one state is a pure delay).
    let a = dmatrix![
        1.1, 0.3, 0.0, 0.2;
        -0.3, 1.1, 0.1, 0.0;
        0.0, 0.2, 0.5, 0.1;
        1.0, 0.0, 0.0, 0.0
    ];
    let b = dmatrix![1.0, 0.0; 0.2, 0.5; 0.0, 1.0; 0.0, 0.0];
    let q = DMatrix::from_diagonal(&nalgebra::dvector![2.0, 1.0, 0.5, 0.3]);
    let r = dmatrix![1.0, 0.2; 0.2, 3.0];
    let s = dmatrix![0.3, 0.0; 0.0, -0.2; 0.1, 0.1; 0.0, 0.05];
    for cross in [None, Some(&s)] {
        let problem = LqProblem {
            cross,
            ..problem(&a, &b, &q, &r)
        };
        let found = solve_dare(&problem).unwrap();
        let expected = value_iteration(&problem, 400).unwrap();
        assert!((&found.p - &expected).norm() < 1e-11 * expected.norm());
        assert!((&found.p - found.p.transpose()).norm() == 0.0);
        assert!(
            found.relative_residual < 1e-14,
            "{:e}",
            found.relative_residual
        );
        assert!(found.poles.iter().all(|pole| pole.norm() < 1.0));
    }
}

#[test]
fn a_cross_cost_is_a_change_of_input() {
    // u = v - R^-1 S'x turns the cost with S into one without: the same optimal loop.
    let (a, b) = at_rest(B_OPTIMAL);
    let (q, r) = cost();
    let s = dmatrix![3.0; -4.0; 0.2; 0.1];
    let with = solve_care(&LqProblem {
        cross: Some(&s),
        ..problem(&a, &b, &q, &r)
    })
    .unwrap();
    let shift = s.transpose() / r[0];
    let (a_s, q_s) = (&a - &b * &shift, &q - &s * &shift);
    let without = solve_care(&problem(&a_s, &b, &q_s, &r)).unwrap();
    assert!((&with.p - &without.p).norm() < 1e-10 * with.p.norm());
    assert!((&with.k - (without.k + shift)).norm() < 1e-10 * with.k.norm());
}

#[test]
fn the_optimal_poles_are_the_stable_half_of_the_hamiltonian_spectrum() {
    let (a, b) = at_rest(B_OPTIMAL);
    let (q, r) = cost();
    let found = solve_care(&problem(&a, &b, &q, &r)).unwrap();
    let mut hamiltonian = DMatrix::zeros(8, 8);
    let g = &b * b.transpose() / r[0];
    hamiltonian.view_mut((0, 0), (4, 4)).copy_from(&a);
    hamiltonian.view_mut((0, 4), (4, 4)).copy_from(&-g);
    hamiltonian.view_mut((4, 0), (4, 4)).copy_from(&-&q);
    hamiltonian
        .view_mut((4, 4), (4, 4))
        .copy_from(&-a.transpose());
    let spectrum = poles(&hamiltonian).unwrap();
    for (found, expected) in found.poles.iter().zip(&spectrum) {
        assert!(
            (found - expected).norm() < 1e-8 * expected.norm(),
            "{found} for {expected}"
        );
    }
}

#[test]
fn poles_ten_decades_apart_are_solved_too() {
    let a = DMatrix::from_diagonal(&nalgebra::dvector![-1e6, 2.0, -1e-4]);
    let b = dmatrix![1e3; 1.0; 1.0];
    let q = DMatrix::identity(3, 3);
    let r = dmatrix![1.0];
    let found = solve_care(&problem(&a, &b, &q, &r)).unwrap();
    assert!(
        found.relative_residual < 1e-12,
        "{:e}",
        found.relative_residual
    );
    assert!(found.p.symmetric_eigenvalues().min() > 0.0);
}

/// Numbers in (-1, 1) that are the same in every run (xorshift, Marsaglia 2003).
struct Scattered(u64);

impl Scattered {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 as f64 / u64::MAX as f64 * 2.0 - 1.0
    }

    fn matrix(&mut self, rows: usize, columns: usize) -> DMatrix<f64> {
        DMatrix::from_fn(rows, columns, |_, _| self.next())
    }
}

#[test]
fn scattered_problems_are_solved_to_rounding() {
    let mut scattered = Scattered(1);
    for number in 0..600 {
        let (n, m) = (1 + number % 6, 1 + number % 3);
        let a = scattered.matrix(n, n);
        let b = scattered.matrix(n, m);
        let root = scattered.matrix(n, n);
        let q = root.transpose() * root;
        let r = DMatrix::identity(m, m) * 10.0_f64.powf(3.0 * scattered.next());
        // Time scales over two decades; sampled, modes that at most double in a sample.
        let continuous = &a * 10.0_f64.powf(scattered.next() + 0.5);
        let discrete = &a * (2.0 / a.norm());
        for (name, found) in [
            ("CARE", solve_care(&problem(&continuous, &b, &q, &r))),
            ("DARE", solve_dare(&problem(&discrete, &b, &q, &r))),
        ] {
            let found = found.unwrap();
            let residual = found.relative_residual;
            assert!(residual < 1e-12, "{name} {number}: {residual:e}");
            let smallest = found.p.symmetric_eigenvalues().min();
            assert!(
                smallest > -1e-12 * found.p.norm(),
                "{name} {number}: {smallest:e}"
            );
        }
    }
}

#[test]
fn an_unstable_mode_without_input_is_named() {
    let a = dmatrix![-1.0, 0.0; 0.0, 2.0];
    let b = dmatrix![1.0; 0.0];
    let (q, r) = (DMatrix::identity(2, 2), dmatrix![1.0]);
    for solve in [solve_care, solve_dare] {
        let error = solve(&problem(&a, &b, &q, &r)).unwrap_err();
        assert!(
            matches!(error, RiccatiError::NotStabilisable { pole } if (pole - 2.0).norm() < 1e-12),
            "{error}"
        );
    }
}

#[test]
fn an_integrator_without_input_is_named() {
    let a = dmatrix![-1.0, 0.0; 0.0, 0.0];
    let b = dmatrix![1.0; 0.0];
    let (q, r) = (DMatrix::identity(2, 2), dmatrix![1.0]);
    let error = solve_care(&problem(&a, &b, &q, &r)).unwrap_err();
    assert!(
        matches!(error, RiccatiError::NotStabilisable { .. }),
        "{error}"
    );
    let a = dmatrix![0.5, 0.0; 0.0, 1.0];
    let error = solve_dare(&problem(&a, &b, &q, &r)).unwrap_err();
    assert!(
        matches!(error, RiccatiError::NotStabilisable { .. }),
        "{error}"
    );
}

#[test]
fn an_integrator_or_unstable_mode_without_cost_is_named() {
    let b = dmatrix![1.0; 1.0];
    let (q, r) = (dmatrix![1.0, 0.0; 0.0, 0.0], dmatrix![1.0]);
    for pole in [0.0, 3.0] {
        let a = dmatrix![-1.0, 0.0; 0.0, pole];
        let error = solve_care(&problem(&a, &b, &q, &r)).unwrap_err();
        assert!(
            matches!(error, RiccatiError::NotDetectable { .. }),
            "{pole}: {error}"
        );
    }
    for pole in [1.0, -1.0, 3.0] {
        let a = dmatrix![0.5, 0.0; 0.0, pole];
        let error = solve_dare(&problem(&a, &b, &q, &r)).unwrap_err();
        assert!(
            matches!(error, RiccatiError::NotDetectable { .. }),
            "{pole}: {error}"
        );
    }
}

#[test]
fn mistakes_in_the_matrices_are_named() {
    let (a, b) = at_rest(B_OPTIMAL);
    let (q, r) = cost();
    let message = |problem: &LqProblem<'_>| {
        let care = solve_care(problem).unwrap_err().to_string();
        assert_eq!(care, solve_dare(problem).unwrap_err().to_string());
        care
    };
    let wide = DMatrix::zeros(4, 3);
    assert!(message(&problem(&wide, &b, &q, &r)).contains("A is 4 x 3: it must be square"));
    let short = DMatrix::zeros(3, 1);
    assert!(message(&problem(&a, &short, &q, &r)).contains("B is 3 x 1: it must be 4 x 1"));
    let mut skew = q.clone();
    skew[(0, 2)] = 5.0;
    assert!(message(&problem(&a, &b, &skew, &r)).contains("Q is not symmetric: Q[(0, 2)] is 5"));
    let mut indefinite = q.clone();
    indefinite[(3, 3)] = -0.1;
    let text = message(&problem(&a, &b, &indefinite, &r));
    assert!(
        text.contains("Q is not positive semidefinite") && text.contains("-0.1"),
        "{text}"
    );
    for value in [0.0, -1.0] {
        let r = DMatrix::from_element(1, 1, value);
        let text = message(&problem(&a, &b, &q, &r));
        assert!(text.contains("R is not positive definite"), "{text}");
    }
    let mut hole = a.clone();
    hole[(3, 1)] = f64::NAN;
    assert!(message(&problem(&hole, &b, &q, &r)).contains("A[(3, 1)] is NaN"));
    let mut endless = b.clone();
    endless[(2, 0)] = f64::INFINITY;
    assert!(message(&problem(&a, &endless, &q, &r)).contains("B[(2, 0)] is inf"));
    let s = DMatrix::from_element(4, 1, 500.0);
    let crossed = LqProblem {
        cross: Some(&s),
        ..problem(&a, &b, &q, &r)
    };
    assert!(message(&crossed).contains("Q - S R^-1 S' is not positive semidefinite"));
}

#[test]
fn weights_far_apart_are_not_blamed_on_a_mode() {
    // A definite Q sees every mode, whatever its units; squares of these weights overflow.
    let (a, b) = at_rest(B_OPTIMAL);
    let (q, r) = cost();
    for largest in [1e20, 1e80, 1e150, 1e200, 1e300] {
        let mut far = q.clone();
        far[(0, 0)] = largest;
        for solve in [solve_care, solve_dare] {
            match solve(&problem(&a, &b, &far, &r)) {
                Ok(found) => assert!(found.relative_residual < 1e-10),
                Err(error @ RiccatiError::NotDetectable { .. }) => panic!("{largest:e}: {error}"),
                Err(error) => {
                    let text = error.to_string();
                    assert!(!text.contains("detectable"), "{largest:e}: {text}");
                }
            }
        }
    }
    for weight in [1e-300, 1e-200, 1e155, 1e200, 1e300] {
        let weight = DMatrix::from_element(1, 1, weight);
        for solve in [solve_care, solve_dare] {
            if let Err(error) = solve(&problem(&a, &b, &q, &weight)) {
                let text = error.to_string();
                // It once said that R = 1e300 was not positive definite.
                assert!(!text.contains("definite"), "{text}");
            }
        }
    }
}

#[test]
fn units_of_inputs_and_costs_do_not_hide_a_mode() {
    // The integrator is beyond the input and beyond the cost at any size of either.
    for size in [1e-12, 1.0, 1e12] {
        let (r, one) = (dmatrix![1.0], DMatrix::identity(2, 2));
        let a = dmatrix![-1.0, 0.0; 0.0, 2.0];
        let error = solve_care(&problem(&a, &dmatrix![size; 0.0], &one, &r)).unwrap_err();
        assert!(
            matches!(error, RiccatiError::NotStabilisable { .. }),
            "{size:e}: {error}"
        );
        let q = dmatrix![size, 0.0; 0.0, 0.0];
        let error = solve_care(&problem(&a, &dmatrix![1.0; 1.0], &q, &r)).unwrap_err();
        assert!(
            matches!(error, RiccatiError::NotDetectable { .. }),
            "{size:e}: {error}"
        );
    }
}

#[test]
fn a_mode_that_rounding_hides_is_not_blamed() {
    // Sampled every 5 s the fast mode grows by e^20, beside which the integrator cannot be seen.
    let a = dmatrix![1.0, 1e8; 0.0, 5e8];
    let b = dmatrix![1e8; 5e8];
    let (q, r) = (DMatrix::identity(2, 2), dmatrix![1.0]);
    if let Err(error) = solve_dare(&problem(&a, &b, &q, &r)) {
        assert!(
            matches!(error, RiccatiError::NoConvergence { .. }),
            "{error}"
        );
    }
}
