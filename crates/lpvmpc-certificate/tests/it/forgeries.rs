//! Certificates that claim what is not so, each forged in another way. All must be refused, with a
//! message that names what is wrong.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on must fail, in its support functions too"
)]

use lpvmpc::{Embedding, LpvModel, Number, Rk4};
use lpvmpc_certificate::{
    Certificate, ClaimError, DocumentError, MOST_BOXES, MOST_BYTES, is_at_most,
};
use nalgebra::{Matrix1, Matrix1x2, Matrix2, SMatrix, Vector1, Vector2};
use std::sync::LazyLock;

use crate::pendulum::Pendulum;
use crate::terminal::{PendulumCertificate, certificate};

static TRUE: LazyLock<PendulumCertificate> = LazyLock::new(certificate);

fn refused(forged: &PendulumCertificate) -> ClaimError {
    forged
        .prove(&Pendulum, MOST_BOXES, &|_| ())
        .expect_err("a forgery was proved")
}

/// The pendulum's matrices as those of a map.
struct Sampled;

impl Embedding<2, 1, 1> for Sampled {
    fn period(&self) -> Option<f64> {
        Some(TRUE.t_s)
    }

    fn scheduling<N: Number>(&self, x: &Vector2<N>, u: &Vector1<N>) -> Vector1<N> {
        Embedding::scheduling(&Pendulum, x, u)
    }

    fn matrices<N: Number>(&self, s: &Vector1<N>) -> (Matrix2<N>, Vector2<N>) {
        Embedding::matrices(&Pendulum, s)
    }
}

/// Of a map no stability in continuous time can be claimed.
#[test]
fn quadratic_stability_of_a_map_is_refused() {
    let error = TRUE.prove(&Sampled, MOST_BOXES, &|_| ()).unwrap_err();
    assert_eq!(error, ClaimError::DiscreteTime);
}

/// P of A'P + PA = -I for x_dot = (x_2, -a x_1 - b x_2).
fn lyapunov(a: f64, b: f64) -> Matrix2<f64> {
    let mixed = 1.0 / (2.0 * a);
    Matrix2::new(
        (b * b + a * (1.0 + a)) / (2.0 * a * b),
        mixed,
        mixed,
        (1.0 + a) / (2.0 * a * b),
    )
}

/// A law that is stable in continuous time, and whose sampled loop has the eigenvalues -1.2 and 0.5:
/// away from the origin it goes. P makes the diagonal of the claimed decrease true in the proof's
/// coordinates, and the antisymmetric part of Q, which costs nothing since x'Qx does not see it,
/// cancels the one entry off the diagonal in the triangle that a factorisation reads.
fn unstable_law_with_an_asymmetric_q() -> PendulumCertificate {
    let t_s = 0.05;
    let (a, b) = LpvModel::matrices(&Pendulum, &Vector1::new(0.0));
    let (a, b) = Rk4 { substeps: 100 }.discretize(&a, &b, t_s);
    // Pole placement: Ackermann's formula.
    let (first, second) = (-1.2, 0.5);
    let identity = Matrix2::identity();
    let wanted = (a - identity * first) * (a - identity * second);
    let controllability = Matrix2::from_columns(&[b, a * b]);
    let k = Matrix1x2::new(0.0, 1.0) * controllability.try_inverse().unwrap() * wanted;
    let closed = a - b * k;
    let poles = closed.complex_eigenvalues();
    assert!(poles.iter().any(|pole| pole.norm() > 1.19), "{poles}");
    // Eigenvectors as columns: (closed - second) maps onto that of the first, and vice versa.
    let onto = |other: f64| (closed - identity * other).column(0).normalize();
    let vectors = Matrix2::from_columns(&[onto(second), onto(first)]);
    let inverse = vectors.try_inverse().unwrap();
    let q = Matrix2::identity() * 1e-6;
    let r = Matrix1::new(1e-9);
    let best = (-40..=40).map(|exponent| {
        let ratio = 10.0_f64.powf(f64::from(exponent) / 10.0);
        let p = inverse.transpose() * Matrix2::from_diagonal(&Vector2::new(ratio, 1.0)) * inverse;
        let p = (p + p.transpose()) * 0.5;
        let t = p.cholesky().unwrap().l().transpose().try_inverse().unwrap();
        let rest =
            t.transpose() * (p - q - k.transpose() * r * k - closed.transpose() * p * closed) * t;
        (p, t, rest)
    });
    let least = |rest: &Matrix2<f64>| rest.diagonal().min();
    let (p, t, rest) = best
        .max_by(|a, b| least(&a.2).total_cmp(&least(&b.2)))
        .unwrap();
    assert!(
        least(&rest) > 0.05,
        "the diagonal claims a decrease: {rest}"
    );
    assert!(
        rest.symmetric_eigenvalues().min() < -0.1,
        "which is none: {rest}"
    );
    let skew = rest[(1, 0)] / t.determinant();
    let (stiffness, damping) = (k[0] - 9.81, k[1]);
    PendulumCertificate {
        q: q + Matrix2::new(0.0, -skew, skew, 0.0),
        r,
        state_limits: Vector2::repeat(f64::INFINITY),
        input_limits: Vector1::new(f64::INFINITY),
        scheduling_limits: Vector1::new(0.1),
        terminal: lpvmpc_certificate::TerminalClaim {
            k,
            p,
            level: 1e-6,
            contraction: 0.0,
        },
        continuous: lpvmpc_certificate::QuadraticClaim {
            p: lyapunov(stiffness, damping),
            rate_1_s: 1e-3,
        },
        ..TRUE.clone()
    }
}

/// This one was proved: definiteness reads one triangle, and Q's symmetry was not asked for.
#[test]
fn an_asymmetric_q_does_not_hide_an_unstable_law() {
    let mut forged = unstable_law_with_an_asymmetric_q();
    let error = refused(&forged);
    assert!(
        matches!(error, ClaimError::NotSymmetric { name: "q", .. }),
        "{error}"
    );
    // The same claim without the trick is false, at a state from which the robot moves away.
    forged.q = (forged.q + forged.q.transpose()) * 0.5;
    let error = refused(&forged);
    let ClaimError::NoDecrease { state, excess } = &error else {
        panic!("{error}");
    };
    let x = Vector2::new(state[0], state[1]);
    let u = Vector1::from(-forged.terminal.k * x);
    let next = Rk4 { substeps: 100 }.advance(&Pendulum, &x, &u, forged.t_s);
    let value = |x: &Vector2<f64>| (forged.terminal.p * x).dot(x);
    assert!(value(&x) <= forged.terminal.level);
    assert!(value(&next) > value(&x) * (1.0 + 0.99 * excess));
}

/// So was this one: V may grow by -x'Qx, and the law's spectral radius is 1.2.
#[test]
fn an_indefinite_q_does_not_pay_for_an_unstable_law() {
    let mut forged = unstable_law_with_an_asymmetric_q();
    forged.q = -forged.terminal.p;
    let error = refused(&forged);
    assert!(
        matches!(error, ClaimError::NotSemidefinite { name: "q" }),
        "{error}"
    );
    // Not even where the contraction makes up for it.
    let mut forged = TRUE.clone();
    forged.q = forged.terminal.p * -1e-6;
    let error = refused(&forged);
    assert!(
        matches!(error, ClaimError::NotSemidefinite { name: "q" }),
        "{error}"
    );
}

/// What is changed in a true certificate.
type Change = fn(&mut PendulumCertificate);

#[test]
fn every_forgery_is_refused_by_the_name_of_its_claim() {
    let cases: [(&str, Change, &str); 30] = [
        ("R zero", |c| c.r[0] = 0.0, "r could not"),
        ("R negative", |c| c.r[0] = -0.1, "r could not"),
        ("R without end", |c| c.r[0] = f64::INFINITY, "r[0][0]"),
        ("R NaN", |c| c.r[0] = f64::NAN, "r[0][0]"),
        (
            "P upside down",
            |c| c.terminal.p *= -1.0,
            "terminal.p could not",
        ),
        (
            "P indefinite",
            |c| c.terminal.p[(1, 1)] *= -1.0,
            "terminal.p could not",
        ),
        (
            "P singular, up to rounding",
            |c| c.terminal.p = Matrix2::new(1.0, 1.0, 1.0, 1.0 + 4.0 * f64::EPSILON),
            "terminal.p could not",
        ),
        (
            "P with sizes that overflow",
            |c| c.terminal.p *= 1e200,
            "terminal.p[0][0]",
        ),
        (
            "K infinite",
            |c| c.terminal.k[0] = f64::INFINITY,
            "terminal.k[0][0]",
        ),
        (
            "K at the end of the numbers",
            |c| c.terminal.k[0] = 1e308,
            "terminal.k[0][0]",
        ),
        (
            "K subnormal",
            |c| c.terminal.k[1] = 5e-324,
            "terminal.k[0][1]",
        ),
        (
            "K that pushes away",
            |c| c.terminal.k *= -1.0,
            "input_limits|continuous|terminal",
        ),
        ("K zero", |c| c.terminal.k *= 0.0, "continuous"),
        ("tiny t_s", |c| c.t_s = 1e-300, "t_s"),
        (
            "short t_s, in which nothing decreases",
            |c| c.t_s = 1e-9,
            "decrease",
        ),
        ("t_s zero", |c| c.t_s = -0.0, "t_s"),
        (
            "contraction below 0",
            |c| c.terminal.contraction = -0.5,
            "terminal.contraction",
        ),
        (
            "contraction 1",
            |c| c.terminal.contraction = 1.0,
            "terminal.contraction",
        ),
        (
            "contraction subnormal",
            |c| c.terminal.contraction = 1e-310,
            "terminal.contraction",
        ),
        (
            "contraction NaN",
            |c| c.terminal.contraction = f64::NAN,
            "terminal.contraction",
        ),
        ("huge level", |c| c.terminal.level = 1e300, "terminal.level"),
        ("large level", |c| c.terminal.level = 1e29, "limits["),
        (
            "subnormal level",
            |c| c.terminal.level = 1e-320,
            "terminal.level",
        ),
        ("level -0", |c| c.terminal.level = -0.0, "terminal.level"),
        (
            "no scheduling limit",
            |c| c.scheduling_limits[0] = f64::INFINITY,
            "scheduling_limits[0]",
        ),
        (
            "states without limits, schedulings with too narrow ones",
            |c| {
                c.state_limits = Vector2::repeat(f64::INFINITY);
                c.scheduling_limits[0] *= 0.9;
            },
            "scheduling_limits[0] = ",
        ),
        (
            "a limit below zero",
            |c| c.state_limits[0] = -1.0,
            "state_limits[0]",
        ),
        (
            "a limit NaN",
            |c| c.input_limits[0] = f64::NAN,
            "input_limits[0]",
        ),
        (
            "the two P swapped",
            |c| std::mem::swap(&mut c.terminal.p, &mut c.continuous.p),
            "",
        ),
        (
            "the reach between samples",
            |c| c.state_limits[1] *= 1.0 - 1e-4,
            "state_limits[1], between samples",
        ),
    ];
    for (forgery, change, parts) in cases {
        let mut forged = TRUE.clone();
        change(&mut forged);
        let message = refused(&forged).to_string();
        let named = parts.split('|').any(|part| message.contains(part));
        assert!(named, "{forgery}: none of `{parts}` is in: {message}");
    }
}

/// What is done to the text of a true certificate.
type Edit = fn(&str) -> String;

#[test]
fn text_that_is_no_certificate_is_refused() {
    let text = TRUE.to_json().unwrap();
    let cases: [(&str, Edit, &str); 13] = [
        (
            "a key twice",
            |t| t.replacen("\"t_s\": 0.05", "\"t_s\": 0.05, \"t_s\": 0.01", 1),
            "duplicate field `t_s`",
        ),
        (
            "the claim twice, so that digest and claim could differ",
            |t| t.replacen("\"digest\"", "\"certificate\": null, \"digest\"", 1),
            "duplicate field `certificate`",
        ),
        (
            "an unknown key",
            |t| t.replacen("\"t_s\"", "\"t_z\": 0, \"t_s\"", 1),
            "unknown field `t_z`",
        ),
        (
            "a missing key",
            |t| t.replacen("\"t_s\": 0.05,", "", 1),
            "missing field `t_s`",
        ),
        (
            "NaN",
            |t| t.replacen("\"t_s\": 0.05", "\"t_s\": NaN", 1),
            "not a certificate",
        ),
        (
            "NaN as text",
            |t| t.replacen("\"t_s\": 0.05", "\"t_s\": \"NaN\"", 1),
            "expected f64",
        ),
        (
            "no number",
            |t| t.replacen("\"t_s\": 0.05", "\"t_s\": null", 1),
            "expected f64",
        ),
        (
            "out of range",
            |t| t.replacen("\"t_s\": 0.05", "\"t_s\": 1e999", 1),
            "out of range",
        ),
        (
            "deep",
            |t| {
                t.replacen(
                    "\"t_s\": 0.05",
                    &format!("\"t_s\": {}", "[".repeat(100_000)),
                    1,
                )
            },
            "not a certificate",
        ),
        (
            "deep from the start",
            |_| "[".repeat(100_000),
            "not a certificate",
        ),
        (
            "something behind it",
            |t| format!("{t}{{}}"),
            "trailing characters",
        ),
        ("half of it", |t| t[..t.len() / 2].to_owned(), "EOF"),
        (
            "huge",
            |t| format!("{t}{}", " ".repeat(MOST_BYTES)),
            "more than 262144 bytes",
        ),
    ];
    for (what, edit, part) in cases {
        let edited = edit(&text);
        assert_ne!(edited, text, "{what}");
        for message in [
            PendulumCertificate::from_json(&edited)
                .unwrap_err()
                .to_string(),
            PendulumCertificate::check_digest(&edited)
                .unwrap_err()
                .to_string(),
        ] {
            assert!(
                message.contains(part),
                "{what}: `{part}` is not in: {message}"
            );
        }
    }
    // A matrix of another shape, and another plant's file.
    let mut claim = serde_json::to_value(&*TRUE).unwrap();
    claim["q"] = serde_json::json!([[1.0, 0.0], [0.0]]);
    let error = serde_json::from_value::<PendulumCertificate>(claim).unwrap_err();
    assert!(error.to_string().contains("2 rows of 2 numbers"), "{error}");
    let other = Certificate::<Pendulum, 3, 1, 1>::from_json(&text).unwrap_err();
    assert!(matches!(other, DocumentError::Syntax(_)), "{other}");
}

/// A plant whose matrices are 0/0: with zero times unbounded as zero it would have been at rest.
#[test]
fn zero_times_a_quotient_by_zero_is_unknown() {
    use lpvmpc::Number;
    use lpvmpc_certificate::{Arithmetic, Interval, TaylorModel};
    let over_zero = Interval::new(-1.0, 1.0).reciprocal();
    assert_eq!(Interval::point(0.0) * over_zero, Interval::EVERYTHING);
    assert_eq!(over_zero * Interval::point(0.0), Interval::EVERYTHING);
    let over_zero = TaylorModel::<1>::symbol(0.0, 1.0, 0).reciprocal();
    let product = TaylorModel::<1>::constant(0.0) * over_zero;
    assert_eq!(product.error, f64::INFINITY);
    assert_eq!(product.range(), Interval::EVERYTHING);
}

/// What is called false is false; a claim that this proof is too weak for is not.
#[test]
fn a_claim_that_is_not_shown_is_not_called_false() {
    let mut tight = TRUE.clone();
    tight.terminal.contraction = 0.034;
    let few = tight.prove(&Pendulum, 1, &|_| ()).unwrap_err();
    assert!(matches!(few, ClaimError::DecreaseNotShown { .. }), "{few}");
    assert!(!few.is_false());
    assert!(few.to_string().contains("could not be shown"), "{few}");
    tight.prove(&Pendulum, MOST_BOXES, &|_| ()).unwrap();
    let mut false_claim = TRUE.clone();
    false_claim.terminal.contraction = 0.9;
    assert!(refused(&false_claim).is_false());
    false_claim = TRUE.clone();
    false_claim.continuous.rate_1_s = 100.0;
    let error = refused(&false_claim);
    assert!(
        matches!(error, ClaimError::NotQuadraticallyStable { .. }),
        "{error}"
    );
    false_claim = TRUE.clone();
    false_claim.state_limits[0] = 0.99 * 0.6;
    let error = refused(&false_claim);
    let ClaimError::Limit { state, limit, .. } = &error else {
        panic!("{error}");
    };
    let x = Vector2::new(state[0], state[1]);
    let value = (false_claim.terminal.p * x).dot(&x);
    assert!(value <= false_claim.terminal.level && x[0].abs() > *limit);
}

#[test]
fn weights_are_compared_off_the_diagonal_too() {
    let diagonal = |a, b| Matrix2::from_diagonal(&Vector2::new(a, b));
    let mixed = |c| Matrix2::new(1.0, c, c, 1.0);
    let cases: [(Matrix2<f64>, Matrix2<f64>, bool); 8] = [
        (diagonal(1.0, 0.0), diagonal(1.0, 0.0), true),
        (diagonal(1.0, 0.0), diagonal(2.0, 0.0), true),
        (diagonal(1.0, 1e-300), diagonal(1.0, 0.0), false),
        // Larger entries on the diagonal, and yet not larger.
        (mixed(0.9), diagonal(1.5, 1.5), false),
        (mixed(0.9), diagonal(1.95, 1.95), true),
        (mixed(-0.9), mixed(0.9), false),
        (diagonal(1.0, 1.0), Matrix2::new(2.0, 5.0, -5.0, 2.0), false),
        (diagonal(f64::NAN, 1.0), diagonal(2.0, 2.0), false),
    ];
    for (smaller, larger, expected) in cases {
        assert_eq!(is_at_most(&smaller, &larger), expected, "{smaller}{larger}");
    }
    assert!(is_at_most(
        &SMatrix::<f64, 3, 3>::zeros(),
        &SMatrix::zeros()
    ));
}
