//! Starting values by linear regression.
//!
//! The linear model phi_ddot = p1 theta + p2 phi_dot + p3 tau + p7 theta_dot + const, and the same
//! for theta_ddot, is multiplied by smooth bumps w(t) and integrated by parts over windows, which
//! moves the derivatives from the noisy signals to w (modulating functions, Shinbrot 1957). It is a
//! start, not a result: small errors of a regression with noise on both sides remain.

use crate::log::{BallAngle, Run};
use crate::parameter::{Parameter, Values};
use crate::segments::Stretch;
use ballbot::Geometry;
use nalgebra::{DMatrix, DVector, Matrix4x2, Vector2, Vector4};
use std::ops::Range;

/// Length of a window, s: some time constants of tilting.
const WINDOW: f64 = 0.4;

/// Windows of a regression, at most; they are spread evenly over the log.
const MOST_WINDOWS: usize = 2000;

/// Delays that are tried, s.
const DELAYS: [f64; 6] = [0.0, 0.005, 0.01, 0.02, 0.03, 0.05];

/// The linear model with friction on both speeds, in the order of its regressors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearFit {
    /// Factors of (theta, phi_dot, theta_dot, tau, 1) in phi_ddot.
    pub ball: [f64; 5],
    /// The same in theta_ddot.
    pub body: [f64; 5],
    /// Sum of squares that is left, each equation over its own variance.
    pub unexplained: f64,
    /// The delay it was fitted with, s.
    pub delay: f64,
}

/// The best linear fits at a few delays, the best first; none if the log does not tell them.
pub fn linear_fits(
    runs: &[Run],
    stretches: &[Stretch],
    ball_angle: BallAngle,
    delays: Option<f64>,
) -> Vec<LinearFit> {
    let tried = delays.map_or(DELAYS.to_vec(), |delay| vec![delay]);
    let fits = tried
        .iter()
        .filter_map(|delay| linear_fit(runs, stretches, ball_angle, *delay));
    let mut fits: Vec<LinearFit> = fits.collect();
    fits.sort_by(|a, b| a.unexplained.total_cmp(&b.unexplained));
    fits
}

fn linear_fit(
    runs: &[Run],
    stretches: &[Stretch],
    ball_angle: BallAngle,
    delay: f64,
) -> Option<LinearFit> {
    let mut rows: Vec<[f64; 5]> = Vec::new();
    let (mut ball, mut body) = (Vec::new(), Vec::new());
    let all: usize = stretches.iter().map(|(_, stretch)| stretch.len()).sum();
    for (run, stretch) in stretches {
        let run = &runs[*run];
        let mut first = stretch.start;
        while first + 4 < stretch.end {
            let until = run.time[first] + WINDOW;
            let end = first + run.time[first..stretch.end].partition_point(|time| *time <= until);
            if end == stretch.end {
                break;
            }
            if let Some(window) = window(run, first..end, ball_angle, delay) {
                rows.push(window.regressors);
                ball.push(window.ball);
                body.push(window.body);
            }
            first += ((end - first) / 4).max(all / MOST_WINDOWS).max(1);
        }
    }
    let regressors = DMatrix::from_fn(rows.len(), 5, |row, column| rows[row][column]);
    let square = regressors.tr_mul(&regressors);
    let solve = |target: &Vec<f64>| {
        let target = DVector::from_column_slice(target);
        let solution = square
            .clone()
            .cholesky()?
            .solve(&regressors.tr_mul(&target));
        let left = (&target - &regressors * &solution).norm_squared() / target.norm_squared();
        let factors: Vec<f64> = solution.iter().copied().collect();
        let factors: [f64; 5] = factors.try_into().ok()?;
        let finite = factors.iter().all(|factor| factor.is_finite());
        finite.then_some((factors, left))
    };
    let ((ball, ball_left), (body, body_left)) = (solve(&ball)?, solve(&body)?);
    Some(LinearFit {
        ball,
        body,
        unexplained: ball_left + body_left,
        delay,
    })
}

struct Window {
    regressors: [f64; 5],
    ball: f64,
    body: f64,
}

/// The integrals over one window; none where a value is missing.
fn window(run: &Run, rows: Range<usize>, ball_angle: BallAngle, delay: f64) -> Option<Window> {
    let start = run.time[rows.start];
    let length = run.time[rows.end - 1] - start;
    let mut torque = run.torque_before(rows.start, delay);
    let mut sums = Window {
        regressors: [0.0; 5],
        ball: 0.0,
        body: 0.0,
    };
    for row in rows.start..rows.end - 1 {
        let duration = run.time[row + 1] - run.time[row];
        let mean = (run.outputs[row] + run.outputs[row + 1]) * 0.5;
        let (theta, theta_dot) = (mean[1], mean[2]);
        let phi = match ball_angle {
            BallAngle::Inertial => mean[0],
            BallAngle::RelativeToBody => mean[0] + theta,
        };
        let (w, w_dot, w_ddot) = bump((run.time[row] + 0.5 * duration - start) / length);
        let (w_dot, w_ddot) = (w_dot / length, w_ddot / length.powi(2));
        // Without a gyroscope the tilt alone has to do.
        let (rate, acceleration) = if theta_dot.is_nan() {
            (-w_dot * theta, w_ddot * theta)
        } else {
            (w * theta_dot, -w_dot * theta_dot)
        };
        let torque = torque.mean_over(duration);
        let terms = [w * theta, -w_dot * phi, rate, w * torque, w];
        for (sum, term) in sums.regressors.iter_mut().zip(terms) {
            *sum += term * duration;
        }
        sums.ball += w_ddot * phi * duration;
        sums.body += acceleration * duration;
    }
    let finite = (sums.ball + sums.body + sums.regressors.iter().sum::<f64>()).is_finite();
    finite.then_some(sums)
}

/// 64 u^3 (1 - u)^3 with its first two derivatives, all zero at both ends.
fn bump(u: f64) -> (f64, f64, f64) {
    let v = u * (1.0 - u);
    let slope = 1.0 - 2.0 * u;
    (
        64.0 * v.powi(3),
        192.0 * v * v * slope,
        384.0 * v * slope * slope - 384.0 * v * v,
    )
}

impl LinearFit {
    /// The robot of this linear model: b1, k, b3 and the gain from p1, p3, p4, p6, friction from
    /// the rest. `None` if no robot has it.
    pub fn robot(&self, geometry: &Geometry<f64>) -> Option<Values> {
        let [p1, p2, p7, p3, c1] = self.ball;
        let [p4, p5, p8, p6, c2] = self.body;
        let Geometry {
            centre_of_mass,
            ball_radius,
            wheel_radius,
            gravity,
        } = *geometry;
        let weight = centre_of_mass * gravity;
        let gear = ball_radius / wheel_radius;
        // With a = l g / d and c = gain gear / d: p1 = a k, p4 = a b1, p3 = c (b3 - k),
        // p6 = c (k - b1), and d = b1 b3 - k^2 gives a.
        let c_over_a = p6 / (p1 - p4);
        let a = (p4 * (p1 + p3 / c_over_a) - p1 * p1) / weight;
        let (k, b1) = (p1 / a, p4 / a);
        let b3 = k + p3 / (c_over_a * a);
        let determinant = weight / a;
        let mut values = Values([0.0; Parameter::ALL.len()]);
        values[Parameter::B1] = b1;
        values[Parameter::B2] = k + centre_of_mass * ball_radius;
        values[Parameter::B3] = b3;
        values[Parameter::TorqueGain] = c_over_a * weight / gear;
        values[Parameter::Delay] = self.delay;
        // (p2, p5, p7, p8) d are linear in the rolling and the drive's friction.
        let friction = Matrix4x2::new(-b3, k - b3, -k, b1 - k, 0.0, b3 - k, 0.0, k - b1);
        let measured = Vector4::new(p2, p5, p7, p8) * determinant;
        let normal = (friction.transpose() * friction).try_inverse()?;
        let found: Vector2<f64> = normal * friction.transpose() * measured;
        values[Parameter::RollingFriction] = found[0];
        values[Parameter::DriveFriction] = found[1];
        // The offset o enters as -p1 o and -p4 o.
        values[Parameter::TiltOffset] = -(p1 * c1 + p4 * c2) / (p1 * p1 + p4 * p4);
        let finite = values.0.iter().all(|value| value.is_finite());
        // What mechanics forbids is brought within bounds by the fit, if they are wanted.
        (finite && values[Parameter::TorqueGain] > 0.0).then_some(values)
    }
}

/// A robot of middling mass distribution with these lengths: where nothing better is known.
pub fn typical(geometry: &Geometry<f64>, delay: f64) -> Values {
    let ball = geometry.ball_radius.powi(2);
    let body = geometry.centre_of_mass.powi(2);
    let mut values = Values([0.0; Parameter::ALL.len()]);
    values[Parameter::B2] = 0.5 * ball;
    values[Parameter::B1] = 2.0 * ball;
    values[Parameter::B3] = 0.5 * ball + 1.4 * body;
    values[Parameter::RollingFriction] = 0.5 * ball;
    values[Parameter::DriveFriction] = 0.5 * ball;
    values[Parameter::TorqueGain] = 0.1;
    values[Parameter::Delay] = delay;
    values
}
