//! Linear models by the fundamental theorem of calculus.

use lpvmpc::{AlongMotion, AlongRay, Dynamics, GaussLegendre, LpvModel, Number, Predictor, Rk4};
use lpvmpc_testkit::rng::Rng;
use nalgebra::{Vector1, Vector2};

/// x_ddot = 9.81 sin(x) + (cos(x) + 0.3 u) u.
#[derive(Clone, Copy, Debug)]
struct Pendulum;

impl Dynamics<2, 1> for Pendulum {
    fn f<N: Number>(&self, x: &Vector2<N>, u: &Vector1<N>) -> Vector2<N> {
        let number = N::constant;
        let motor = (x[0].cos() + number(0.3) * u[0]) * u[0];
        Vector2::new(x[1], number(9.81) * x[0].sin() + motor)
    }
}

fn about(x: [f64; 2], u: f64, count: usize) -> AlongRay<Pendulum, f64, 2, 1, 3> {
    AlongRay {
        plant: Pendulum,
        x: Vector2::from(x),
        u: Vector1::new(u),
        nodes: GaussLegendre::with_nodes(count),
    }
}

/// n nodes integrate powers of up to 2 n - 1.
#[test]
fn formulas_of_gauss_and_legendre_are_exact_for_polynomials() {
    for count in 1..=GaussLegendre::MOST {
        let formula = GaussLegendre::with_nodes(count);
        assert_eq!(formula.count(), count);
        assert_eq!(formula.iter().count(), count);
        for power in 0..2 * count as i32 {
            let sum: f64 = formula
                .iter()
                .map(|(x, weight)| weight * x.powi(power))
                .sum();
            let exact = 1.0 / f64::from(power + 1);
            assert!(
                (sum - exact).abs() < 1e-15,
                "{count} nodes, x^{power}: {sum}"
            );
        }
        let beyond: f64 = formula
            .iter()
            .map(|(x, w)| w * x.powi(2 * count as i32))
            .sum();
        let exact = 1.0 / (2.0 * count as f64 + 1.0);
        assert!(count > 10 || (beyond - exact).abs() > 1e-15, "{count}");
        assert!(formula.iter().all(|(x, w)| x > 0.0 && x < 1.0 && w > 0.0));
    }
    assert_eq!(GaussLegendre::with_nodes(0).count(), 1);
    assert_eq!(GaussLegendre::with_nodes(99).count(), GaussLegendre::MOST);
}

/// About upright the mean of cos(lambda x) is sin(x)/x, that of lambda sin(lambda x)
/// is (sin(x)/x - cos(x))/x, and that of lambda is 1/2.
#[test]
fn the_means_of_a_pendulum_are_its_closed_forms() {
    let ray = about([0.0, 0.0], 0.0, 12);
    let mut rng = Rng::new(5);
    for _ in 0..50 {
        let x = Vector2::new(rng.uniform(-1.5, 1.5), rng.uniform(-5.0, 5.0));
        let u = Vector1::new(rng.uniform(-4.0, 4.0));
        let (a, b) = ray.matrices(&ray.scheduling(&x, &u));
        let (sin, cos) = x[0].sin_cos();
        let sinc = sin / x[0];
        let slope = 9.81 * sinc - (sinc - cos) / x[0] * u[0];
        let gain = sinc + 0.3 * u[0];
        assert!(
            (a[(1, 0)] - slope).abs() < 1e-13,
            "{} for {slope}",
            a[(1, 0)]
        );
        assert!((b[1] - gain).abs() < 1e-13);
        assert_eq!((a[(0, 0)], a[(1, 1)], b[0]), (0.0, 0.0, 0.0));
        assert!((a[(0, 1)] - 1.0).abs() < 1e-15);
        // The theorem itself: nothing is left for c.
        assert!((a * x + b * u - ray.derivative(&x, &u)).amax() < 1e-12);
        let c = ray.offset(&ray.scheduling(&x, &u)).unwrap();
        assert!(c.amax() < 1e-12);
    }
}

#[test]
fn the_model_is_exact_at_its_own_point_with_any_number_of_nodes() {
    let mut rng = Rng::new(6);
    for count in [1, 2, 5] {
        let ray = about([0.4, 0.1], -1.0, count);
        for _ in 0..20 {
            let x = Vector2::new(rng.uniform(-3.0, 3.0), rng.uniform(-5.0, 5.0));
            let u = Vector1::new(rng.uniform(-4.0, 4.0));
            let s = ray.scheduling(&x, &u);
            let (a, b) = ray.matrices(&s);
            let c = ray.offset(&s).unwrap();
            let f: Vector2<f64> = Pendulum.f(&x, &u);
            assert!((a * x + b * u + c - f).amax() < 1e-13);
            let (rate, by_x, by_u) = ray.embedded(&x, &u);
            assert!((rate - f).amax() == 0.0 && by_x == a && by_u == b);
            let pair = Predictor::StageConsistent(Rk4 { substeps: 2 });
            let matrices = pair.linearize(&ray, &x, &u, 0.05);
            let c = pair.offset(&ray, (&x, &u), 0.05, &matrices).unwrap();
            let next = pair.rk4().advance(&ray, &x, &u, 0.05);
            assert!((matrices.0 * x + matrices.1 * u + c - next).amax() < 1e-13);
        }
    }
}

/// A ray without length has the derivatives themselves; those of f are the plant's everywhere.
#[test]
fn at_the_steady_state_it_is_the_tangent() {
    let (x, u) = (Vector2::new(0.4, 0.1), Vector1::new(-1.0));
    let ray = about([0.4, 0.1], -1.0, 3);
    let motion = AlongMotion::<_, 3>(Pendulum);
    let (a, b) = ray.matrices(&ray.scheduling(&x, &u));
    let (_, by_x, by_u) = motion.tangent(&x, &u);
    assert!((a - by_x).amax() < 1e-14 && (b - by_u).amax() < 1e-14);
    let far = (Vector2::new(-2.0, 3.0), Vector1::new(2.0));
    assert_eq!(ray.tangent(&far.0, &far.1), motion.tangent(&far.0, &far.1));
    assert_eq!(
        motion.embedded(&far.0, &far.1),
        motion.tangent(&far.0, &far.1)
    );
}
