//! The verdict on b against mechanics.

use crate::robots;
use ballbot::{Ballbot, DriveFriction, Geometry};
use fastrand::Rng;
use std::f64::consts::{FRAC_PI_3, PI, TAU};

/// det M and the eigenvalues of M at so many tilts over the range: the verdict's second route.
fn sampled(robot: &Ballbot<f64>, tilt: f64) -> Vec<(f64, f64)> {
    let tilts = (-2000..=2000).map(|step| tilt * f64::from(step) / 2000.0);
    tilts
        .map(|theta| {
            let mass = robot.mass(theta);
            (mass.determinant(), mass.symmetric_eigenvalues().min())
        })
        .collect()
}

#[test]
fn the_papers_b_is_no_rigid_body() {
    let robot = Ballbot::paper();
    let verdict = robot.consistency(FRAC_PI_3);
    assert!(!verdict.is_physical());
    assert!(!verdict.mass_positive);
    assert!(verdict.mass_invertible, "det M has no zero in the range");
    assert!(verdict.determinant.1 < 0.0, "{:?}", verdict.determinant);
    assert!(!verdict.rolling_dissipative);
    let (ball, body) = (verdict.ball_inertia, verdict.body_inertia);
    assert!(
        ball.0 < ball.1 && (ball.1 - 0.0737).abs() < 5e-5,
        "{ball:?}"
    );
    assert!(body.0 < body.1 && (body.1 - 0.148).abs() < 5e-4, "{body:?}");
    let eigenvalues = robot.mass(0.0).symmetric_eigenvalues();
    assert!((eigenvalues.min() + 0.0014).abs() < 5e-5, "{eigenvalues}");
    assert!((eigenvalues.max() - 0.147).abs() < 5e-4, "{eigenvalues}");
    let words = verdict.to_string();
    for finding in [
        "no rigid ballbot",
        "mass matrix is not positive definite",
        "never crosses zero",
        "b4 is negative",
        "b1 = 0.0025 m^2 is below b2 + r_b^2 = 0.0737 m^2",
        "b3 = 0.1431 m^2 is below b2 + l^2 = 0.1480 m^2",
        "do not use them for another robot",
    ] {
        assert!(words.contains(finding), "`{finding}` is not in: {words}");
    }
}

#[test]
fn robots_made_of_masses_are_physical() {
    let mut rng = Rng::with_seed(7);
    for _ in 0..10_000 {
        let robot = robots::rigid(&mut rng);
        let verdict = robot.consistency(PI);
        assert!(verdict.is_physical(), "{robot:?}: {verdict}");
        assert!(verdict.to_string().starts_with("physically consistent"));
        // For M > 0 a tilted body falls further: p4 = b1 l g / d > 0. The paper has -36.
        assert!(robot.linear_parameters().p4 > 0.0);
    }
}

#[test]
fn each_violation_alone_is_found() {
    let mut rng = Rng::with_seed(8);
    let good = robots::rigid(&mut rng);
    let least = good.consistency(PI);
    for (bad, finding) in [
        (Ballbot { b4: -1e-9, ..good }, "friction b4 is negative"),
        (
            Ballbot {
                drive: DriveFriction {
                    viscous: -1e-9,
                    coulomb: 0.1,
                },
                ..good
            },
            "friction in the drive is negative",
        ),
        (
            Ballbot {
                drive: DriveFriction {
                    viscous: 0.1,
                    coulomb: f64::NAN,
                },
                ..good
            },
            "friction in the drive is negative",
        ),
        (
            Ballbot {
                b1: 0.999 * least.ball_inertia.1,
                ..good
            },
            "b1 = ",
        ),
        (
            Ballbot {
                b3: 0.999 * least.body_inertia.1,
                ..good
            },
            "b3 = ",
        ),
        (
            Ballbot {
                b1: f64::NAN,
                ..good
            },
            "not positive definite",
        ),
    ] {
        let verdict = bad.consistency(FRAC_PI_3);
        assert!(!verdict.is_physical(), "{bad:?}");
        let words = verdict.to_string();
        assert!(words.contains(finding), "`{finding}` is not in: {words}");
    }
}

#[test]
fn a_determinant_that_crosses_zero_is_found() {
    // b1 b3 lies between the smallest and the largest (b2 - l r_b cos(theta))^2 of the range.
    let crossing = Ballbot {
        b1: 0.009,
        ..Ballbot::paper()
    };
    let verdict = crossing.consistency(FRAC_PI_3);
    assert!(verdict.determinant.0 < 0.0 && verdict.determinant.1 > 0.0);
    assert!(!verdict.mass_invertible && !verdict.mass_positive);
    assert!(verdict.to_string().contains("it crosses zero there"));
    // Upright alone there is no such tilt.
    assert!(crossing.consistency(0.0).mass_invertible);
}

#[test]
fn the_verdict_is_what_sampling_the_range_shows() {
    let mut rng = Rng::with_seed(9);
    for _ in 0..300 {
        let robot = Ballbot {
            b1: robots::uniform(&mut rng, -0.02, 0.1),
            b2: robots::uniform(&mut rng, -0.05, 0.1),
            b3: robots::uniform(&mut rng, -0.02, 0.2),
            b4: 0.1,
            drive: DriveFriction::none(),
            geometry: Geometry::paper(),
        };
        // A tilt beyond pi was once folded back: 2 pi was checked as upright alone.
        let tilt = robots::uniform(&mut rng, 0.1, TAU);
        let verdict = robot.consistency(tilt);
        let samples = sampled(&robot, tilt);
        let fold = |start, choose: fn(f64, f64) -> f64| {
            let determinants = samples.iter().map(|sample| sample.0);
            determinants.fold(start, choose)
        };
        let (low, high) = (
            fold(f64::INFINITY, f64::min),
            fold(f64::NEG_INFINITY, f64::max),
        );
        // det M changes by 2 k l r_b sin(theta) per rad; samples are up to pi/1000 apart.
        for (found, sampled) in [(verdict.determinant.0, low), (verdict.determinant.1, high)] {
            assert!(
                (found - sampled).abs() < 1e-5,
                "{found} for {sampled}, {robot:?}"
            );
        }
        let positive = samples.iter().all(|sample| sample.1 > 0.0);
        // Within 1e-5 of zero the samples may miss what the verdict sees.
        if low.abs() > 1e-5 && high.abs() > 1e-5 {
            assert_eq!(verdict.mass_positive, positive, "{robot:?}, {tilt}");
            assert_eq!(
                verdict.mass_invertible,
                low * high > 0.0,
                "{robot:?}, {tilt}"
            );
        }
    }
}
