//! Smooth moves: continuous, within their limits, and no longer than needed.

use lpvmpc::{MoveLimits, SmoothMove};

const CASES: [(f64, f64, f64); 3] = [(1.0, 10.0, 1.0), (-3.0, 0.5, 8.0), (6.0, 5.0, 20.0)];

fn planned((distance, speed, acceleration): (f64, f64, f64)) -> SmoothMove<f64> {
    let limits = MoveLimits {
        speed,
        acceleration,
    };
    SmoothMove::within(2.0, 2.0 + distance, limits)
}

#[test]
fn one_limit_is_reached_and_none_exceeded() {
    for case in CASES {
        let planned = planned(case);
        let (mut fastest, mut hardest) = (0.0_f64, 0.0_f64);
        for i in 0..=10_000 {
            let motion = planned.at(planned.duration * f64::from(i) / 1e4);
            fastest = fastest.max(motion.speed.abs() / case.1);
            hardest = hardest.max(motion.acceleration.abs() / case.2);
        }
        let most = fastest.max(hardest);
        assert!(
            (most - 1.0).abs() < 1e-6,
            "{fastest} and {hardest} of the limits"
        );
    }
}

#[test]
fn speed_and_acceleration_are_those_of_the_position() {
    for case in CASES {
        let planned = planned(case);
        let h = 1e-4 * planned.duration;
        for i in 0..=100 {
            let t = planned.duration * (f64::from(i) / 50.0 - 0.5);
            let (before, motion, after) = (planned.at(t - h), planned.at(t), planned.at(t + h));
            let slope = (after.position - before.position) / (2.0 * h);
            let bend = (after.speed - before.speed) / (2.0 * h);
            // Central differences: the third derivatives times h^2, jerk at the ends included.
            assert!((slope - motion.speed).abs() < 1e-6 * case.0.abs() / planned.duration);
            let jerk = 60.0 * case.0.abs() / planned.duration.powi(3);
            assert!(
                (bend - motion.acceleration).abs() <= jerk * h,
                "{bend} {motion:?}"
            );
        }
        assert_eq!(planned.at(-1.0).position, 2.0);
        assert_eq!(planned.at(1e9).position, 2.0 + case.0);
    }
}

#[test]
fn no_distance_takes_no_time() {
    let still = planned((0.0, 1.0, 1.0));
    for t in [-1.0, 0.0, 0.5, 1e9] {
        assert_eq!((still.at(t).position, still.at(t).speed), (2.0, 0.0));
    }
}
