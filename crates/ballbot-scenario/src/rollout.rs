//! How exactly the guaranteed loop's plans are rolled out: the number of Runge-Kutta steps, and what is
//! known of their error.
//!
//! The error of a sample is that of step doubling (Richardson): for a method of order four the
//! difference of n and 2 n steps is 15/16 of the error of n. The largest one is looked for on a grid of
//! tilts, rates and torques over their bounds, corners included, among the motions that stay within
//! them; twice that is taken for what lies between the points. It is an estimate with a safety factor,
//! not a proof. The same goes for how far a state lies beyond both ends of a step.

use crate::error::ScenarioError;
use ballbot::Ballbot;
use lpvmpc::{Bounds, ControllerSettings, LpvModel, Rk4, Rollout, TerminalSet};
use nalgebra::{Matrix4, Vector1, Vector4};

/// More steps than this are not tried.
const MOST_SUBSTEPS: usize = 64;
/// Points of the grid per state, and of the torque.
const STATES: usize = 9;
const TORQUES: usize = 5;
/// What the grid may miss.
const SAFETY: f64 = 2.0;

/// The coarsest rollout whose error fits into `margin`.
///
/// # Errors
/// A bound of tilt, rates or torque is infinite, or no number of steps suffices.
pub(crate) fn accurate(
    ballbot: &Ballbot<f64>,
    plain: &ControllerSettings<f64, 4, 1, 3>,
    terminal: &TerminalSet<f64, 4, 1>,
    margin: f64,
) -> Result<Rollout<f64, 4>, ScenarioError> {
    let names = ["theta_rad", "phi_dot_rad_s", "theta_dot_rad_s"];
    let states = (1..4).map(|i| (names[i - 1], plain.x.lower[i], plain.x.upper[i]));
    let torque = ("torque_nm", plain.u.lower[0], plain.u.upper[0]);
    for (name, lower, upper) in states.chain([torque]) {
        if !(lower.is_finite() && upper.is_finite()) {
            return Err(ScenarioError::value(
                format!("bounds.{name}"),
                format!("[{lower}, {upper}]"),
                "with a certified terminal set it must be finite, so that the error of the \
                 prediction has a bound",
            ));
        }
    }
    // Every second number of steps: what comes between saves little.
    let mut tried = (2..=MOST_SUBSTEPS).step_by(2).map(|substeps| {
        let rk4 = Rk4 { substeps };
        let (error, between) = error(ballbot, plain, rk4);
        Rollout {
            rk4,
            error: error * SAFETY,
            between: between * SAFETY,
        }
    });
    let fits = |rollout: &Rollout<f64, 4>| {
        let (drift, end) = drift(ballbot, plain, terminal, rollout);
        let width = plain.x.upper - plain.x.lower;
        let free = |i: usize| drift[i] + rollout.between[i] <= margin * width[i];
        (1..4).all(free) && end <= margin * terminal.level.sqrt()
    };
    tried.find(fits).ok_or_else(|| {
        ScenarioError::value(
            "controller.t_s",
            plain.t_s,
            format!(
                "{MOST_SUBSTEPS} integration steps per sample are too coarse for a guarantee; take \
                 a shorter sampling time, or narrower bounds"
            ),
        )
    })
}

/// The largest error of a sample, and the largest way beyond both ends of a step.
fn error(
    ballbot: &Ballbot<f64>,
    plain: &ControllerSettings<f64, 4, 1, 3>,
    rk4: Rk4,
) -> (Vector4<f64>, Vector4<f64>) {
    let fine = Rk4 {
        substeps: 2 * rk4.substeps,
    };
    let steps = rk4.substeps as f64;
    let (mut error, mut between) = (Vector4::zeros(), Vector4::zeros());
    let limits = [&plain.x.lower, &plain.x.upper];
    let [lower, upper] = limits.map(|limit| Vector4::new(0.0, limit[1], limit[2], limit[3]));
    let at = |i: usize, lower: f64, upper: f64, points: usize| {
        lower + (upper - lower) * i as f64 / (points - 1) as f64
    };
    for point in 0..STATES.pow(3) * TORQUES {
        let places = [
            point % STATES,
            point / STATES % STATES,
            point / STATES.pow(2) % STATES,
        ];
        let state = |i: usize| at(places[i - 1], lower[i], upper[i], STATES);
        let start = Vector4::new(0.0, state(1), state(2), state(3));
        let torque = at(
            point / STATES.pow(3),
            plain.u.lower[0],
            plain.u.upper[0],
            TORQUES,
        );
        let u = Vector1::new(torque);
        let end = fine.advance(ballbot, &start, &u, plain.t_s);
        if !stays(&plain.x, &end) {
            continue;
        }
        let coarse = rk4.advance(ballbot, &start, &u, plain.t_s);
        error = error.sup(&((coarse - end).abs() * (16.0 / 15.0)));
        let one = Rk4 { substeps: 1 };
        let mut x = start;
        for _ in 0..rk4.substeps {
            let middle = one.advance(ballbot, &x, &u, 0.5 * plain.t_s / steps);
            let next = one.advance(ballbot, &x, &u, plain.t_s / steps);
            between = between.sup(&(middle - x.sup(&next)));
            between = between.sup(&(x.inf(&next) - middle));
            x = next;
        }
    }
    (error, between)
}

/// Whether the tilt and the rates are within their bounds.
fn stays(bounds: &Bounds<f64, 4>, x: &Vector4<f64>) -> bool {
    (1..4).all(|i| x[i] >= bounds.lower[i] && x[i] <= bounds.upper[i])
}

/// How far the robot may be from a plan along the whole horizon, upright under the terminal law, and in
/// the norm of P: what the largest errors add up to, each as long as it lives.
fn drift(
    ballbot: &Ballbot<f64>,
    plain: &ControllerSettings<f64, 4, 1, 3>,
    terminal: &TerminalSet<f64, 4, 1>,
    rollout: &Rollout<f64, 4>,
) -> (Vector4<f64>, f64) {
    let (a, b) = ballbot.matrices(&ballbot.scheduling(&Vector4::zeros()));
    let (a, b) = rollout.rk4.discretize(&a, &b, plain.t_s);
    let closed = a - b * terminal.gain;
    let mut power = Matrix4::identity();
    let (mut total, mut end) = (Vector4::zeros(), 0.0);
    for _ in 0..plain.horizon {
        let part = power.abs() * rollout.error;
        total += part;
        // The corner of the box that is largest in the norm of P is one of its 2^4.
        let corner = |signs: usize| {
            let sign = |i: usize| if signs >> i & 1 == 1 { -1.0 } else { 1.0 };
            let e: Vector4<f64> = power * Vector4::from_fn(|i, _| sign(i) * rollout.error[i]);
            (terminal.p * e).dot(&e).sqrt()
        };
        end += (0..16).map(corner).fold(0.0, f64::max);
        power = closed * power;
    }
    (total, end)
}
