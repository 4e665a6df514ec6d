//! What is claimed of a rollout's error is proved where it holds, and refused where it does not.

use crate::pendulum::Pendulum;
use lpvmpc::{Bounds, Embedding, Number, Rk4, share_of_bounds};
use lpvmpc_certificate::{RolloutClaim, RolloutError};
use lpvmpc_sim::Tolerances;
use nalgebra::{Matrix1, Vector1, Vector2};

/// The pendulum's symbols: two states, the torque and the time.
const D: usize = 4;

/// Two steps of 50 ms, to 1 rad, 4 rad/s and 10 N m, where gravity is far from linear. Nothing is allowed yet.
fn of_pendulum(substeps: usize) -> RolloutClaim<2, 1> {
    let (x, u) = (Vector2::new(1.0, 4.0), Vector1::new(10.0));
    RolloutClaim {
        t_s: 0.1,
        substeps,
        x: Bounds {
            lower: -x,
            upper: x,
        },
        u: Bounds {
            lower: -u,
            upper: u,
        },
        error: Vector2::zeros(),
        between: Vector2::zeros(),
    }
}

/// A random sample that stays within the bounds: its start, its share of the bounds, how far the rollout is off
/// at the end, and how far the plant goes beyond the rollout's states at both ends of a step.
struct Motion {
    x: Vector2<f64>,
    u: Vector1<f64>,
    share: f64,
    off: Vector2<f64>,
    beyond: Vector2<f64>,
}

/// The plant is integrated adaptively, by another method, to 1e-12.
fn motion(claim: &RolloutClaim<2, 1>, random: &mut fastrand::Rng) -> Option<Motion> {
    // Small motions as well as large ones.
    let size = random.f64().sqrt();
    let mut part = |limit: f64| size * limit * (2.0 * random.f64() - 1.0);
    let x = claim.x.upper.map(&mut part);
    let u = claim.u.upper.map(&mut part);
    let tolerances = Tolerances {
        relative: 1e-12,
        absolute: 1e-12,
    };
    // No integration is no number, with which every comparison fails.
    let none = Vector2::repeat(f64::NAN);
    let plant = |t| lpvmpc_sim::advance(&Pendulum, &x, &u, t, tolerances).unwrap_or(none);
    let step = claim.t_s / claim.substeps as f64;
    let (mut here, mut beyond) = (x, Vector2::zeros());
    for i in 0..claim.substeps {
        let next = Rk4::step(&Pendulum, &here, &u, step);
        let inside = plant((i as f64 + random.f64()) * step);
        beyond = beyond.sup(&(inside - here.sup(&next)));
        beyond = beyond.sup(&(here.inf(&next) - inside));
        here = next;
        if !claim.x.contains(&here, 0.0) {
            return None;
        }
    }
    Some(Motion {
        x,
        u,
        share: share_of_bounds(&x, &claim.x, &u, &claim.u),
        off: here - plant(claim.t_s),
        beyond,
    })
}

fn motions(claim: &RolloutClaim<2, 1>, seed: u64, count: usize) -> Vec<Motion> {
    let mut random = fastrand::Rng::with_seed(seed);
    let drawn = std::iter::repeat_with(|| motion(claim, &mut random));
    drawn.flatten().take(count).collect()
}

/// The largest errors of motions, each per its share, and the largest ways beyond.
fn worst(motions: &[Motion]) -> (Vector2<f64>, Vector2<f64>) {
    let none = (Vector2::zeros(), Vector2::zeros());
    motions.iter().fold(none, |(off, beyond), motion| {
        // What the integration leaves is 1e-11 at most.
        let large = motion.share > 0.05;
        let share = if large { motion.share } else { f64::INFINITY };
        (
            off.sup(&(motion.off.abs() / share)),
            beyond.sup(&motion.beyond),
        )
    })
}

/// What is proved over the whole of the bounds is a quarter more than the worst of thousands of motions shows (twice as
/// much between the steps, where they are looked at at one instant each), and holds for thousands of others; less than
/// what they show is refused.
#[test]
fn the_error_of_every_motion_is_within_what_is_proved() {
    let mut claim = of_pendulum(2);
    let (error, between) = worst(&motions(&claim, 1, 4000));
    claim.error = error * 1.25;
    claim.between = between * 2.0;
    let prove = |claim: &RolloutClaim<2, 1>| claim.prove::<_, 1, D>(&Pendulum, 20_000, &|_| ());
    let proof = prove(&claim).unwrap();
    assert!(proof.boxes > 100 && proof.spare >= 0.0, "{proof:?}");
    for motion in motions(&claim, 2, 4000) {
        for i in 0..2 {
            assert!(motion.off[i].abs() <= claim.error[i] * motion.share + 1e-11);
            assert!(motion.beyond[i] <= claim.between[i]);
        }
    }

    for i in 0..2 {
        let with = |error: f64, between: f64| {
            let mut changed = claim;
            changed.error[i] *= error;
            changed.between[i] *= between;
            prove(&changed)
        };
        // A motion shows more than this.
        assert!(with(0.75, 1.0).is_err() && with(1.0, 0.45).is_err());
    }
    // One step where two are needed.
    let coarse = RolloutClaim {
        substeps: 1,
        ..claim
    };
    assert!(prove(&coarse).is_err());
}

/// The error of a single sample is enclosed so tightly that an enclosure of anything else would miss it.
#[test]
fn a_single_sample_is_enclosed_tightly() {
    for substeps in [2, 5] {
        let claim = of_pendulum(substeps);
        let motions = motions(&claim, 3, 300);
        let (largest, _) = worst(&motions);
        for motion in motions {
            let (x, u) = (&motion.x, &motion.u);
            let sample = claim.enclose::<_, 1, D>(&Pendulum, x, u).unwrap().unwrap();
            assert!(sample.stays);
            for i in 0..2 {
                let (error, off) = (sample.error[i], motion.off[i] / motion.share);
                let slack = 1e-11 / motion.share;
                let found = (error.lower - slack..=error.upper + slack).contains(&off);
                assert!(found, "{substeps}, {i}: {off:e} {error:?}");
                let largest = largest[i];
                assert!(
                    error.radius() < 0.07 * largest,
                    "{substeps}, {i}: {error:?} {largest:e}"
                );
                assert!(motion.beyond[i] <= sample.between[i] + 1e-11);
            }
        }
    }
}

/// x_dot = a x + b u.
struct Linear {
    a: f64,
    affine: bool,
    period: Option<f64>,
}

impl Embedding<1, 1, 1> for Linear {
    fn period(&self) -> Option<f64> {
        self.period
    }

    fn scheduling<N: Number>(&self, _: &Vector1<N>, _: &Vector1<N>) -> Vector1<N> {
        Vector1::new(N::constant(0.0))
    }

    fn matrices<N: Number>(&self, _: &Vector1<N>) -> (Matrix1<N>, Matrix1<N>) {
        (
            Matrix1::new(N::constant(self.a)),
            Matrix1::new(N::constant(1.0)),
        )
    }

    fn offset<N: Number>(&self, _: &Vector1<N>) -> Option<Vector1<N>> {
        self.affine.then(|| Vector1::new(N::constant(1.0)))
    }
}

const LINEAR: Linear = Linear {
    a: -2.0,
    affine: false,
    period: None,
};

fn of_linear(t_s: f64, error: f64) -> RolloutClaim<1, 1> {
    let one = Vector1::new(1.0);
    let bounds = Bounds {
        lower: -one,
        upper: one,
    };
    RolloutClaim {
        t_s,
        substeps: 3,
        x: bounds,
        u: bounds,
        error: Vector1::new(error),
        between: one,
    }
}

/// Of a linear plant the error is known in closed form: (p(a h)^n - e^(a t)) (x + u/a), with the Taylor polynomial
/// p of order four. The bound that can be proved is that, to a percent.
#[test]
fn the_error_of_a_linear_plant_is_that_of_its_closed_form() {
    let t_s = 0.6;
    let ah: f64 = LINEAR.a * t_s / 3.0;
    let step = 1.0 + ah + ah.powi(2) / 2.0 + ah.powi(3) / 6.0 + ah.powi(4) / 24.0;
    let off = step.powi(3) - (LINEAR.a * t_s).exp();
    // x = -1 and u = 1, which stays within the bounds.
    let most = off.abs() * 1.5;
    let prove = |error| of_linear(t_s, error).prove::<_, 1, 3>(&LINEAR, 5000, &|_| ());
    prove(most * 1.01).unwrap();
    assert!(prove(most * 0.99).is_err());
    assert!(matches!(prove(most * 0.5), Err(RolloutError::False { .. })));
    let (x, u) = (Vector1::new(0.3), Vector1::new(-0.5));
    let sample = of_linear(t_s, 0.0).enclose::<_, 1, 3>(&LINEAR, &x, &u);
    let error = sample.unwrap().unwrap().error[0];
    let expected = off * (x[0] + u[0] / LINEAR.a) / 0.5;
    assert!((error.lower..=error.upper).contains(&expected));
    assert!(error.radius() < 0.01 * expected.abs(), "{error:?}");
}

/// What is no claim is named.
#[test]
fn what_is_no_claim_is_refused() {
    let claim = of_linear(0.6, 1.0);
    let refused = |claim: RolloutClaim<1, 1>, plant: &Linear| {
        claim.prove::<_, 1, 3>(plant, 10, &|_| ()).unwrap_err()
    };
    let with = |change: fn(&mut RolloutClaim<1, 1>)| {
        let mut changed = claim;
        change(&mut changed);
        refused(changed, &LINEAR)
    };
    assert_eq!(with(|claim| claim.t_s = 0.0), RolloutError::Numbers);
    assert_eq!(with(|claim| claim.substeps = 0), RolloutError::Numbers);
    assert_eq!(
        with(|claim| claim.error[0] = f64::NAN),
        RolloutError::Numbers
    );
    assert_eq!(with(|claim| claim.between[0] = -1.0), RolloutError::Numbers);
    let half_open = |claim: &mut RolloutClaim<1, 1>| claim.x.upper[0] = f64::INFINITY;
    assert_eq!(with(half_open), RolloutError::Numbers);
    let mut free = claim;
    free.x = Bounds::none();
    let dimension = RolloutError::Dimension {
        given: 3,
        needed: 2,
    };
    assert_eq!(refused(free, &LINEAR), dimension);
    let affine = Linear {
        affine: true,
        ..LINEAR
    };
    assert_eq!(refused(claim, &affine), RolloutError::AffineTerm);
    let sampled = Linear {
        period: Some(0.6),
        ..LINEAR
    };
    assert_eq!(refused(claim, &sampled), RolloutError::DiscreteTime);
}
