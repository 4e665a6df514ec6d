//! The predictor against Runge-Kutta steps, Taylor polynomials, the matrix exponential and known
//! solutions.

use super::plant::CartPole;
use super::runge_kutta::integrate;
use lpvmpc::{LpvModel, Rk4};
use lpvmpc_testkit::rng::Rng;
use nalgebra::{DMatrix, Matrix1, Matrix5, SMatrix, SVector, Vector1, Vector2, Vector4, Vector5};

/// A pair of random matrices; ||A|| t_s reaches past 1, where the powers of A matter.
fn random_pair<const NX: usize, const NU: usize>(
    rng: &mut Rng,
) -> (SMatrix<f64, NX, NX>, SMatrix<f64, NX, NU>, f64) {
    let a = rng.matrix::<NX, NX>();
    let t_s = rng.uniform(0.05, 2.0) / a.norm();
    (a, rng.matrix(), t_s)
}

/// What rounding may do to a vector of the size of x and u grown over one sample: a step has
/// fewer than 40 roundings per column of A on the way to an entry, four steps at most.
fn rounding<const NX: usize, const NU: usize>(
    (a, b, t_s): &(SMatrix<f64, NX, NX>, SMatrix<f64, NX, NU>, f64),
    x: &SVector<f64, NX>,
    u: &SVector<f64, NU>,
) -> f64 {
    let roundings = 160.0 * (NX + NU) as f64;
    let size = (a.norm() * t_s).exp() * (x.norm() + t_s * b.norm() * u.norm());
    roundings * f64::EPSILON * size
}

fn equals_runge_kutta<const NX: usize, const NU: usize>(rng: &mut Rng) {
    for trial in 0..200 {
        let substeps = 1 + trial % 4;
        let pair = random_pair::<NX, NU>(rng);
        let (a, b, t_s) = &pair;
        let (x, u) = (rng.matrix::<NX, 1>(), rng.matrix::<NU, 1>());
        let (a_d, b_d) = Rk4 { substeps }.discretize(a, b, *t_s);
        let found = a_d * x + b_d * u;
        let expected = integrate(|x| a * x + b * u, x, t_s / substeps as f64, substeps);
        let error = (found - expected).norm();
        assert!(
            error <= rounding(&pair, &x, &u),
            "{NX} x {NU}, {substeps} sub-steps: {error:e}"
        );
    }
}

#[test]
fn the_pair_does_what_runge_kutta_steps_do() {
    let mut rng = Rng::new(1);
    equals_runge_kutta::<1, 1>(&mut rng);
    equals_runge_kutta::<2, 1>(&mut rng);
    equals_runge_kutta::<3, 2>(&mut rng);
    equals_runge_kutta::<4, 1>(&mut rng);
    equals_runge_kutta::<6, 3>(&mut rng);
    equals_runge_kutta::<12, 4>(&mut rng);
}

/// s sub-steps are the pair of one step of t_s / s, applied s times.
#[test]
fn sub_steps_compose() {
    let mut rng = Rng::new(2);
    for trial in 0..200 {
        let substeps = 2 + trial % 5;
        let pair = random_pair::<4, 2>(&mut rng);
        let (a, b, t_s) = &pair;
        let (x, u) = (rng.matrix::<4, 1>(), rng.matrix::<2, 1>());
        let (a_d, b_d) = Rk4 { substeps }.discretize(a, b, *t_s);
        let (a_1, b_1) = Rk4 { substeps: 1 }.discretize(a, b, t_s / substeps as f64);
        let stepped = (0..substeps).fold(x, |x, _| a_1 * x + b_1 * u);
        let error = (a_d * x + b_d * u - stepped).norm();
        assert!(error <= rounding(&pair, &x, &u), "{substeps}: {error:e}");
    }
}

/// sum over k <= 4 of M^k / k! and h times the sum over k <= 3 of M^k / (k + 1)! B, by Horner.
#[test]
fn one_step_is_the_taylor_polynomial() {
    let mut rng = Rng::new(3);
    for _ in 0..200 {
        let pair = random_pair::<5, 2>(&mut rng);
        let (a, b, t_s) = &pair;
        let m = a * *t_s;
        let identity = Matrix5::identity();
        let b_factor = (3..=4).rfold(identity, |inner, k| identity + m * inner / f64::from(k)) * m
            / 2.0
            + identity;
        let a_expected = identity + m * b_factor;
        let b_expected = b_factor * b * *t_s;
        let (a_d, b_d) = Rk4 { substeps: 1 }.discretize(a, b, *t_s);
        let unit = Vector5::repeat(1.0);
        let allowed = rounding(&pair, &unit, &Vector2::repeat(1.0));
        assert!((a_d - a_expected).norm() <= allowed);
        assert!((b_d - b_expected).norm() <= allowed);
    }
}

/// A chain of four integrators is nilpotent, so the polynomial is the exact solution; with a
/// sampling time of 1/2 its entries h^k / k! are known.
#[test]
fn a_chain_of_integrators_is_exact() {
    let a = SMatrix::<f64, 4, 4>::from_fn(|i, j| if j == i + 1 { 1.0 } else { 0.0 });
    let b = Vector4::new(0.0, 0.0, 0.0, 1.0);
    for substeps in [1, 2, 4] {
        let (a_d, b_d) = Rk4 { substeps }.discretize(&a, &b, 0.5);
        let terms = [1.0, 0.5, 1.0 / 8.0, 1.0 / 48.0, 1.0 / 384.0];
        for i in 0..4 {
            for j in 0..4 {
                let expected = if j >= i { terms[j - i] } else { 0.0 };
                assert!((a_d[(i, j)] - expected).abs() <= 4.0 * f64::EPSILON);
            }
            assert!((b_d[i] - terms[4 - i]).abs() <= 4.0 * f64::EPSILON);
        }
    }
}

/// The exact zero-order-hold pair: the exponential of [A B; 0 0] t_s, by scaling and squaring of
/// a Taylor polynomial of order 18 (a remainder of 0.25^19 / 19! is far below rounding).
fn zero_order_hold<const NX: usize, const NU: usize>(
    a: &SMatrix<f64, NX, NX>,
    b: &SMatrix<f64, NX, NU>,
    t_s: f64,
) -> (SMatrix<f64, NX, NX>, SMatrix<f64, NX, NU>) {
    let mut m = DMatrix::zeros(NX + NU, NX + NU);
    m.view_mut((0, 0), (NX, NX)).copy_from(&(a * t_s));
    m.view_mut((0, NX), (NX, NU)).copy_from(&(b * t_s));
    let mut squarings = 0;
    while m.norm() > 0.25 {
        m *= 0.5;
        squarings += 1;
    }
    let identity = DMatrix::identity(NX + NU, NX + NU);
    let mut exponential = identity.clone();
    for k in (1..=18).rev() {
        exponential = &identity + &m * exponential / f64::from(k);
    }
    for _ in 0..squarings {
        exponential = &exponential * &exponential;
    }
    (
        SMatrix::from_fn(|i, j| exponential[(i, j)]),
        SMatrix::from_fn(|i, j| exponential[(i, NX + j)]),
    )
}

/// Errors of A_d and B_d.
fn discretisation_errors<const NX: usize, const NU: usize>(
    a: &SMatrix<f64, NX, NX>,
    b: &SMatrix<f64, NX, NU>,
    t_s: f64,
    substeps: usize,
) -> [f64; 2] {
    let (a_d, b_d) = Rk4 { substeps }.discretize(a, b, t_s);
    let (a_exact, b_exact) = zero_order_hold(a, b, t_s);
    [(a_d - a_exact).norm(), (b_d - b_exact).norm()]
}

/// Asserts that the error falls by 2^`order` from `coarse` to `fine`. The next term of the error
/// expansion is about h ||A|| / 6 of the first, 0.02 at the steps used here: 0.1 is a wide berth
/// around it and far from the next integer.
fn assert_order(coarse: f64, fine: f64, order: f64) {
    let found = (coarse / fine).log2();
    assert!(
        (found - order).abs() < 0.1,
        "order {found}, not {order}: {coarse:e} {fine:e}"
    );
}

#[test]
fn the_discretisation_has_order_four() {
    let mut rng = Rng::new(4);
    for _ in 0..50 {
        let (a, b, _) = random_pair::<4, 2>(&mut rng);
        let (a, t_s) = (a / a.norm(), 1.0);
        // Halved steps over the same sample: order 4.
        let coarse = discretisation_errors(&a, &b, t_s, 8);
        let fine = discretisation_errors(&a, &b, t_s, 16);
        assert_order(coarse[0], fine[0], 4.0);
        assert_order(coarse[1], fine[1], 4.0);
        // One step over a halved sample: order 5.
        let coarse = discretisation_errors(&a, &b, t_s / 8.0, 1);
        let fine = discretisation_errors(&a, &b, t_s / 16.0, 1);
        assert_order(coarse[0], fine[0], 5.0);
        assert_order(coarse[1], fine[1], 5.0);
    }
}

/// x_dot = u - x^2, which rises to sqrt(u) as a hyperbolic tangent.
struct Rising;

impl LpvModel<f64, 1, 1, 1> for Rising {
    fn scheduling(&self, x: &Vector1<f64>, _: &Vector1<f64>) -> Vector1<f64> {
        *x
    }

    fn matrices(&self, scheduling: &Vector1<f64>) -> (Matrix1<f64>, Matrix1<f64>) {
        (-scheduling, Matrix1::identity())
    }
}

#[test]
fn the_nonlinear_step_has_order_four_on_a_known_solution() {
    let (x0, u, t_s) = (0.3_f64, 2.25_f64, 0.8);
    let root = u.sqrt();
    let exact = |t: f64| root * (root * t + (x0 / root).atanh()).tanh();
    let error = |t_s: f64, substeps| {
        let x = Rk4 { substeps }.advance(&Rising, &Vector1::new(x0), &Vector1::new(u), t_s);
        (x[0] - exact(t_s)).abs()
    };
    assert_order(error(t_s, 64), error(t_s, 128), 4.0);
    assert_order(error(t_s / 32.0, 1), error(t_s / 64.0, 1), 5.0);
}

/// A nonlinear plant of four states: against 4096 steps of the other implementation, whose own
/// error is (16/4096)^4 = 2e-10 of what is measured.
#[test]
fn the_nonlinear_step_has_order_four_on_the_cart_pole() {
    let plant = CartPole::laboratory();
    let x = Vector4::new(0.1, 0.7, -0.5, 2.0);
    let u = Vector1::new(5.0);
    let error = |t_s: f64, substeps| {
        let exact = integrate(|x| plant.derivative(x, &u), x, t_s / 4096.0, 4096);
        (Rk4 { substeps }.advance(&plant, &x, &u, t_s) - exact).norm()
    };
    assert_order(error(0.2, 16), error(0.2, 32), 4.0);
    assert_order(error(0.02, 1), error(0.01, 1), 5.0);
}

#[test]
fn the_nonlinear_step_is_the_runge_kutta_step() {
    let plant = CartPole::laboratory();
    let mut rng = Rng::new(5);
    for trial in 0..200 {
        let substeps = 1 + trial % 4;
        let x = rng.matrix::<4, 1>();
        let u = Vector1::new(rng.uniform(-10.0, 10.0));
        let found = Rk4 { substeps }.advance(&plant, &x, &u, 0.05);
        let h = 0.05 / substeps as f64;
        let expected = integrate(|x| plant.derivative(x, &u), x, h, substeps);
        // Some 100 roundings per step, of rates that are ten times the state.
        let allowed = 1e3 * f64::EPSILON * (1.0 + expected.norm());
        assert!((found - expected).norm() <= allowed, "{found}{expected}");
    }
}

/// A model whose scheduling does not depend on the state.
struct Frozen<const NX: usize, const NU: usize> {
    a: SMatrix<f64, NX, NX>,
    b: SMatrix<f64, NX, NU>,
}

impl<const NX: usize, const NU: usize> LpvModel<f64, NX, NU, 0> for Frozen<NX, NU> {
    fn scheduling(&self, _: &SVector<f64, NX>, _: &SVector<f64, NU>) -> SVector<f64, 0> {
        SVector::zeros()
    }

    fn matrices(&self, _: &SVector<f64, 0>) -> (SMatrix<f64, NX, NX>, SMatrix<f64, NX, NU>) {
        (self.a, self.b)
    }
}

/// The two forms of the method are one: with the scheduling held, the nonlinear step is the pair.
#[test]
fn held_scheduling_makes_the_two_forms_one() {
    let mut rng = Rng::new(6);
    for trial in 0..200 {
        let predictor = Rk4 {
            substeps: 1 + trial % 4,
        };
        let pair = random_pair::<4, 2>(&mut rng);
        let (a, b, t_s) = pair;
        let (x, u) = (rng.matrix::<4, 1>(), rng.matrix::<2, 1>());
        let (a_d, b_d) = predictor.discretize(&a, &b, t_s);
        let advanced = predictor.advance(&Frozen { a, b }, &x, &u, t_s);
        let error = (a_d * x + b_d * u - advanced).norm();
        assert!(error <= rounding(&pair, &x, &u), "{error:e}");
    }
}
