//! Terminal ingredients and their certificates.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on must fail, in its support functions too"
)]

use lpvmpc::{Embedding, LpvModel, Number, Rk4};
use lpvmpc_certificate::{
    Certificate, CertificateProblem, CertifyError, ClaimError, MOST_BOXES, SampledClaim,
    SynthesisError, TerminalClaim, TerminalIngredients, TerminalProblem, certify_terminal,
    synthesize_terminal,
};
use lpvmpc_design::{SchedulingGrid, lqr_discrete, zero_order_hold};
use nalgebra::{DMatrix, Matrix1, Matrix1x2, Matrix2, Vector1, Vector2};
use proptest::prelude::*;

use crate::pendulum::Pendulum;

fn terminal(contraction: f64) -> TerminalProblem<2, 1> {
    TerminalProblem {
        t_s: 0.05,
        q: Matrix2::from_diagonal(&Vector2::new(10.0, 1.0)),
        r: Matrix1::new(0.1),
        state_limits: Vector2::new(f64::INFINITY, f64::INFINITY),
        input_limits: Vector1::new(1e3),
        contraction,
        level: 1.0,
    }
}

fn problem() -> CertificateProblem<2, 1, 1> {
    CertificateProblem {
        terminal: TerminalProblem {
            state_limits: Vector2::new(0.6, 4.0),
            input_limits: Vector1::new(30.0),
            level: 100.0,
            ..terminal(0.05)
        },
        state_limits: Vector2::new(1.0, 5.0),
        scheduling_limits: Vector1::new(0.6),
        written_by: "test".to_owned(),
    }
}

/// What is done to a certificate.
type Change = fn(&mut PendulumCertificate);

pub type PendulumCertificate = Certificate<Pendulum, 2, 1, 1>;

pub fn certificate() -> PendulumCertificate {
    certify_terminal(Pendulum, &problem(), MOST_BOXES, &|_| ())
        .unwrap()
        .0
}

/// With one grid point and slack limits, the largest det P^-1 is that of the Riccati solution,
/// whose P is the smallest that satisfies the inequality. A contraction eta is the Riccati
/// equation of (A, B) / sqrt(1 - eta), with weights divided by 1 - eta.
#[test]
fn one_grid_point_gives_the_riccati_solution() {
    for contraction in [0.0, 0.1] {
        let grid = SchedulingGrid::new(Vector1::new(0.2), Vector1::new(0.2), [1]).unwrap();
        let problem = terminal(contraction);
        let found = synthesize_terminal(&Pendulum, &grid, &problem).unwrap();
        let (a, b) = LpvModel::matrices(&Pendulum, &Vector1::new(0.2));
        let dense = |m: &[f64], c| DMatrix::from_column_slice(2, c, m);
        let (a, b) =
            zero_order_hold(&dense(a.as_slice(), 2), &dense(b.as_slice(), 1), 0.05).unwrap();
        let kept = 1.0 - contraction;
        let q = DMatrix::from_diagonal(&nalgebra::dvector![10.0, 1.0]) / kept;
        let r = nalgebra::dmatrix![0.1] / kept;
        let lqr = lqr_discrete(&(a / kept.sqrt()), &(b / kept.sqrt()), &q, &r).unwrap();
        // No set is larger than that of the Riccati solution, and the gap says how much is missing.
        let p = Matrix2::from_column_slice(lqr.p.as_slice());
        let largest = TerminalIngredients { p, ..found }.log_det();
        let missing = largest - found.log_det();
        assert!(
            missing > -1e-9 && missing <= found.log_det_gap,
            "{missing:e}"
        );
        for i in 0..4 {
            let (p, expected) = (found.p.as_slice()[i], lqr.p.as_slice()[i]);
            // log det is flat at its maximum: a gap of 1e-4 leaves sqrt(1e-4) in the entries.
            assert!(
                (p - expected).abs() < 0.01 * expected.abs(),
                "{p} for {expected}"
            );
        }
        for i in 0..2 {
            let (k, expected) = (found.k[i], lqr.k[i]);
            assert!(
                (k - expected).abs() < 0.01 * expected.abs(),
                "{k} for {expected}"
            );
        }
    }
}

#[test]
fn a_pendulum_is_certified_and_comes_back_from_its_file() {
    let certificate = certificate();
    let text = certificate.to_json().unwrap();
    PendulumCertificate::check_digest(&text).unwrap();
    let read = PendulumCertificate::from_json(&text).unwrap();
    assert_eq!(read, certificate, "to the bit");
    let proof = read.prove(&Pendulum, MOST_BOXES, &|_| ()).unwrap();
    assert!(proof.smallest_contraction > read.terminal.contraction);
}

proptest! {
    #[test]
    fn a_certified_pendulum_decreases_its_cost(
        angle in 0.0..std::f64::consts::TAU, radius in 0.0..1.0_f64,
    ) {
        static CERTIFICATE: std::sync::LazyLock<PendulumCertificate> =
            std::sync::LazyLock::new(certificate);
        let found = &*CERTIFICATE;
        let factor = found.terminal.p.cholesky().unwrap().l().transpose();
        let y = Vector2::new(angle.cos(), angle.sin()) * radius * found.terminal.level.sqrt();
        let x = factor.solve_upper_triangular(&y).unwrap();
        let u = Vector1::from(-found.terminal.k * x);
        let next = Rk4 { substeps: 100 }.advance(&Pendulum, &x, &u, found.t_s);
        let cost = |x: &Vector2<f64>| (found.terminal.p * x).dot(x);
        let stage = (found.q * x).dot(&x) + (found.r * u).dot(&u);
        let allowed = (1.0 - found.terminal.contraction) * cost(&x) - stage;
        prop_assert!(cost(&next) <= allowed + 1e-9 * found.terminal.level);
        prop_assert!(u[0].abs() <= found.input_limits[0]);
    }
}

/// Stable at each frozen scheduling: the poles are -0.1 +- i w. Unstable when it moves at the
/// right moments, for one of the two motions turns energy into angle and the other one back.
#[derive(Clone, Copy, Debug)]
struct Swing;

impl Embedding<2, 1, 1> for Swing {
    fn scheduling<N: Number>(&self, x: &Vector2<N>, _: &Vector1<N>) -> Vector1<N> {
        Vector1::new(x[0])
    }

    fn matrices<N: Number>(&self, s: &Vector1<N>) -> (Matrix2<N>, Vector2<N>) {
        let damping = N::constant(-0.1);
        let (half, slope) = (N::constant(5.5), N::constant(4.5) * s[0]);
        (
            Matrix2::new(damping, half + slope, slope - half, damping),
            Vector2::new(N::constant(0.0), N::constant(1e-6)),
        )
    }
}

#[test]
fn stable_when_frozen_but_not_when_it_moves_is_rejected() {
    let problem = CertificateProblem {
        terminal: TerminalProblem {
            state_limits: Vector2::new(1.0, 1.0),
            ..terminal(0.0)
        },
        scheduling_limits: Vector1::new(1.0),
        ..problem()
    };
    let grid = SchedulingGrid::new(Vector1::new(-1.0), Vector1::new(1.0), [21]).unwrap();
    let frozen = lpvmpc_design::frozen_stability(&Swing, &Matrix1x2::zeros(), &grid).unwrap();
    assert!(frozen.is_hurwitz());
    let grid = SchedulingGrid::new(Vector1::new(-1.0), Vector1::new(1.0), [7]).unwrap();
    let error = synthesize_terminal(&Swing, &grid, &problem.terminal).unwrap_err();
    assert!(
        matches!(error, SynthesisError::Infeasible { .. }),
        "{error}"
    );
    // And whatever P is claimed: here the best for the middle.
    let mut claimed = serde_json::to_value(certificate()).unwrap();
    claimed["plant"] = serde_json::Value::Null;
    claimed["terminal"]["k"] = serde_json::json!([[0.0, 0.0]]);
    claimed["continuous"] = serde_json::json!({"p": [[1.0, 0.0], [0.0, 1.0]], "rate_1_s": 0.01});
    let claimed: Certificate<(), 2, 1, 1> = serde_json::from_value(claimed).unwrap();
    let error = claimed.prove(&Swing, MOST_BOXES, &|_| ()).unwrap_err();
    assert!(
        matches!(error, ClaimError::NotQuadraticallyStable { .. }),
        "{error}"
    );
}

#[test]
fn every_tampered_claim_is_named() {
    let good = certificate();
    let tamper = |change: Change| {
        let mut bad = good.clone();
        change(&mut bad);
        let proof = bad.prove(&Pendulum, MOST_BOXES, &|_| ());
        proof.map_err(|error| error.to_string())
    };
    let cases: [(Change, &str); 13] = [
        (|c| c.terminal.contraction = 0.3, "decrease"),
        (|c| c.terminal.level *= 1.01, "limit"),
        (|c| c.terminal.k *= 0.1, ""),
        (|c| c.terminal.p[(0, 1)] *= 1.001, "terminal.p"),
        (|c| c.terminal.p *= 0.5, ""),
        (|c| c.q *= 100.0, "decrease"),
        (|c| c.r *= 1000.0, "decrease"),
        (|c| c.t_s *= 8.0, ""),
        (|c| c.state_limits[0] = 0.5, "state_limits[0]"),
        (|c| c.input_limits[0] *= 0.1, "input_limits[0]"),
        (|c| c.scheduling_limits[0] = 0.5, "scheduling_limits[0]"),
        (|c| c.continuous.rate_1_s *= 50.0, "continuous"),
        (|c| c.continuous.p[(0, 0)] = -1.0, "continuous.p"),
    ];
    for (index, (change, part)) in cases.into_iter().enumerate() {
        let message = tamper(change).expect_err(&format!("case {index} must fail"));
        assert!(
            message.contains(part),
            "case {index}: `{part}` is not in: {message}"
        );
    }
}

#[test]
fn a_changed_digit_is_found_by_the_digest() {
    let text = certificate().to_json().unwrap();
    for (from, to) in [
        ("\"t_s\": 0.05", "\"t_s\": 0.050000000000000003"),
        ("test", "best"),
    ] {
        let changed = text.replacen(from, to, 1);
        assert_ne!(changed, text);
        let same = PendulumCertificate::from_json(&changed).unwrap() == certificate();
        assert_eq!(PendulumCertificate::check_digest(&changed).is_ok(), same);
    }
}

#[test]
fn too_large_a_set_is_refused_with_a_message() {
    let mut problem = problem();
    problem.terminal.input_limits = Vector1::new(0.1);
    problem.terminal.contraction = 0.9;
    let error = certify_terminal(Pendulum, &problem, MOST_BOXES, &|_| ()).unwrap_err();
    assert!(matches!(error, CertifyError::Synthesis(_)), "{error}");
}

#[test]
fn a_plant_with_an_affine_term_has_no_certificate() {
    #[derive(Debug)]
    struct Windy;
    impl Embedding<2, 1, 1> for Windy {
        fn scheduling<N: Number>(&self, x: &Vector2<N>, u: &Vector1<N>) -> Vector1<N> {
            Embedding::scheduling(&Pendulum, x, u)
        }

        fn matrices<N: Number>(&self, s: &Vector1<N>) -> (Matrix2<N>, Vector2<N>) {
            Embedding::matrices(&Pendulum, s)
        }

        fn offset<N: Number>(&self, _: &Vector1<N>) -> Option<Vector2<N>> {
            Some(Vector2::new(0.0, 0.01).map(N::constant))
        }
    }
    let error = certify_terminal(Windy, &problem(), MOST_BOXES, &|_| ()).unwrap_err();
    assert!(
        matches!(error, CertifyError::Claim(ClaimError::AffineTerm)),
        "{error}"
    );
}

/// x+ = 0.9 (sin^2 + cos^2)(waves x) x: enclosures see that this decreases when a box has less than a wave.
struct Ripple {
    waves: f64,
}

impl Embedding<1, 1, 1> for Ripple {
    fn period(&self) -> Option<f64> {
        Some(1.0)
    }

    fn scheduling<N: Number>(&self, x: &Vector1<N>, _: &Vector1<N>) -> Vector1<N> {
        let angle = x[0] * N::constant(self.waves);
        let (sin, cos) = (angle.sin(), angle.cos());
        Vector1::new(sin * sin + cos * cos)
    }

    fn matrices<N: Number>(&self, one: &Vector1<N>) -> (Matrix1<N>, Matrix1<N>) {
        (
            Matrix1::new(N::constant(0.9) * one[0]),
            Matrix1::new(N::constant(0.0)),
        )
    }
}

/// A proof that would need far more boxes than it may have does not use them up.
#[test]
fn a_proof_that_is_out_of_reach_ends_early() {
    let claim = SampledClaim {
        t_s: 1.0,
        q: Matrix1::new(0.05),
        r: Matrix1::new(1.0),
        state_limits: Vector1::new(1.0),
        input_limits: Vector1::new(1.0),
        terminal: TerminalClaim {
            k: Matrix1::new(0.0),
            p: Matrix1::new(1.0),
            level: 0.99,
            contraction: 0.0,
        },
        states: 1,
    };
    let prove = |waves, most_boxes| claim.prove(&Ripple { waves }, most_boxes, &|_| ());
    assert_eq!(prove(400.0, 4000).unwrap().boxes, 1024);
    // It would need 2048.
    match prove(900.0, 200).unwrap_err() {
        ClaimError::DecreaseNotShown { boxes, .. } => assert!(boxes < 100, "{boxes}"),
        error => panic!("{error}"),
    }
    // Twice as many as it may have are not out of reach: it tries.
    match prove(400.0, 1000).unwrap_err() {
        ClaimError::DecreaseNotShown { boxes, .. } => assert!(boxes >= 1000, "{boxes}"),
        error => panic!("{error}"),
    }
}
