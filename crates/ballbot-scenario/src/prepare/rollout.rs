//! How exactly the guaranteed loop's plans are rolled out: the number of Runge-Kutta steps, and what is
//! known of their error.
//!
//! The error of a sample is that of step doubling (Richardson): for a method of order four the
//! difference of n and 2 n steps is 15/16 of the error of n. Upright without rates and torque there is
//! none, and it grows with them, so what is bounded is the error per share of the bounds: the largest
//! of |tilt|, |rate| and |torque| over its bound. The largest value is looked for on a grid of tilts,
//! rates and torques over their bounds, corners included, among the motions that stay within them;
//! twice that is taken for what lies between the points. It is an estimate with a safety factor, not a
//! proof; a test encloses the error at points of the grid by machine. The same goes for how far a state lies
//! beyond both ends of a step, which is taken as it is.
//!
//! Deviations from a plan are carried on by the derivatives of the prediction, whose Runge-Kutta steps
//! are coarser. Their error is that of step doubling on the same grid, and has to be small against the
//! factor of 2.

use crate::error::ScenarioError;
use crate::number::text;
use ballbot::{Ballbot, ControllerSettings};
use lpvmpc::{Bounds, LpvModel, Rk4, Rollout, TerminalSet};
use nalgebra::{Matrix4, Vector1, Vector4};

/// More steps than this are not tried.
const MOST_SUBSTEPS: usize = 64;
/// Points of the grid per state, and of the torque.
const STATES: usize = 9;
const TORQUES: usize = 5;
/// What the grid may miss.
const SAFETY: f64 = 2.0;
/// How far the derivatives may be off by which deviations from a plan are carried on, relative to the
/// largest of the sample.
const DERIVATIVES: f64 = 0.01;

/// The coarsest rollout whose error fits into `margin`, or one with as many steps as are `wanted`.
///
/// # Errors
/// A bound of tilt, rates or torque is infinite, no number of steps suffices, or more steps than are
/// wanted are needed.
pub fn accurate(
    ballbot: &Ballbot<f64>,
    plain: &ControllerSettings<f64>,
    terminal: &TerminalSet<f64, 4, 1>,
    margin: f64,
    wanted: Option<usize>,
) -> Result<Rollout<f64, 4>, ScenarioError> {
    let names = ["theta_rad", "phi_dot_rad_s", "theta_dot_rad_s"];
    let states = (1..4).map(|i| (names[i - 1], plain.x.lower[i], plain.x.upper[i]));
    let torque = ("torque_nm", plain.u.lower[0], plain.u.upper[0]);
    for (name, lower, upper) in states.chain([torque]) {
        if !(lower.is_finite() && upper.is_finite()) {
            return Err(ScenarioError::value(
                format!("bounds.{name}"),
                format!("[{}, {}]", text(lower), text(upper)),
                "with a certified terminal set it must be finite, so that the error of the \
                 prediction has a bound",
            ));
        }
    }
    let with = |substeps: usize| {
        let rk4 = Rk4 { substeps };
        let (error, between) = error(ballbot, plain, rk4);
        Rollout {
            rk4,
            error: error * SAFETY,
            between: between * SAFETY,
        }
    };
    let fits = |rollout: &Rollout<f64, 4>| {
        let (drift, end) = drift(ballbot, plain, terminal, rollout);
        let width = plain.x.upper - plain.x.lower;
        let free = |i: usize| drift[i] + rollout.between[i] <= margin * width[i];
        (1..4).all(free) && end <= margin * terminal.level.sqrt()
    };
    // Every second number of steps: what comes between saves little.
    let mut tried = (2..=MOST_SUBSTEPS).step_by(2).map(with);
    let Some(coarsest) = tried.find(fits) else {
        let needed = extrapolated(&with(MOST_SUBSTEPS), fits);
        let needed = needed.map_or_else(|| "more".to_owned(), |needed| format!("about {needed}"));
        return Err(ScenarioError::value(
            "controller.t_s",
            plain.t_s,
            format!(
                "{MOST_SUBSTEPS} integration steps per sample, the most there are, are too coarse \
                 for a guarantee, which needs {needed}; take a shorter sampling time, or narrower \
                 bounds"
            ),
        ));
    };
    let needed = coarsest.rk4.substeps;
    match wanted {
        None => Ok(coarsest),
        Some(wanted) if (needed..=MOST_SUBSTEPS).contains(&wanted) => Ok(with(wanted)),
        Some(wanted) => Err(ScenarioError::value(
            "controller.terminal.certified.substeps",
            wanted,
            format!(
                "the guarantee needs {needed} integration steps per sample with these bounds, this \
                 sampling time and horizon; {MOST_SUBSTEPS} are the most"
            ),
        )),
    }
}

/// Whether the derivatives of the prediction, with `rk4`, are accurate enough to carry deviations on.
///
/// # Errors
/// They are too coarse.
pub(crate) fn check_derivatives(
    ballbot: &Ballbot<f64>,
    plain: &ControllerSettings<f64>,
    rk4: Rk4,
) -> Result<(), ScenarioError> {
    let off = |substeps: usize| derivatives_error(ballbot, plain, Rk4 { substeps });
    if off(rk4.substeps) <= DERIVATIVES {
        return Ok(());
    }
    let needed = (rk4.substeps..=MOST_SUBSTEPS).find(|substeps| off(*substeps) <= DERIVATIVES);
    let needed = needed.map_or_else(
        || "more; take a shorter sampling time, or narrower bounds".to_owned(),
        |needed| needed.to_string(),
    );
    Err(ScenarioError::value(
        "controller.predictor.stage_consistent.substeps",
        rk4.substeps,
        format!(
            "too coarse for the derivatives that a guarantee rests on: with these bounds and this \
             sampling time it needs {needed}"
        ),
    ))
}

/// The largest error of a sample's derivatives, relative to the largest of them, in units of the bounds
/// (for phi: what the largest rate makes of it in a sample).
pub fn derivatives_error(ballbot: &Ballbot<f64>, plain: &ControllerSettings<f64>, rk4: Rk4) -> f64 {
    let fine = Rk4 {
        substeps: 2 * rk4.substeps,
    };
    let width = plain.x.upper - plain.x.lower;
    let unit = Vector4::new(width[2] * plain.t_s, width[1], width[2], width[3]);
    let mut worst = 0.0_f64;
    for (start, u) in motions(ballbot, plain, fine) {
        let of = |rk4: Rk4| {
            let (a, b) = rk4.differentiate(ballbot, &start, &u, plain.t_s);
            let a = Matrix4::from_fn(|i, j| a[(i, j)] * unit[j] / unit[i]);
            (a, b.component_div(&unit))
        };
        let ((a, b), (a_fine, b_fine)) = (of(rk4), of(fine));
        let off = [
            (a - a_fine).amax() / a_fine.amax(),
            (b - b_fine).amax() / b_fine.amax(),
        ];
        worst = off.into_iter().fold(worst, f64::max);
    }
    worst * 16.0 / 15.0
}

/// The number of steps beyond those of `rollout` that fits, by the orders of the error, 4, and of what
/// lies beyond both ends of a step, 2.
fn extrapolated(
    rollout: &Rollout<f64, 4>,
    fits: impl Fn(&Rollout<f64, 4>) -> bool,
) -> Option<usize> {
    const FARTHEST: i32 = 20;
    let finer = (1..=FARTHEST).map(|doublings| Rollout {
        rk4: Rk4 {
            substeps: rollout.rk4.substeps << doublings,
        },
        error: rollout.error * 0.0625_f64.powi(doublings),
        between: rollout.between * 0.25_f64.powi(doublings),
    });
    let mut finer = finer.filter(fits);
    finer.next().map(|rollout| rollout.rk4.substeps)
}

/// The largest error of a sample per share of the bounds, and the largest way beyond both ends of a
/// step.
fn error(
    ballbot: &Ballbot<f64>,
    plain: &ControllerSettings<f64>,
    rk4: Rk4,
) -> (Vector4<f64>, Vector4<f64>) {
    let fine = Rk4 {
        substeps: 2 * rk4.substeps,
    };
    let steps = rk4.substeps as f64;
    let (mut error, mut between) = (Vector4::zeros(), Vector4::zeros());
    for (start, u) in motions(ballbot, plain, fine) {
        let end = fine.advance(ballbot, &start, &u, plain.t_s);
        let coarse = rk4.advance(ballbot, &start, &u, plain.t_s);
        let share = lpvmpc::share_of_bounds(&start, &plain.x, &u, &plain.u);
        if share > 0.0 {
            error = error.sup(&((coarse - end).abs() * (16.0 / 15.0 / share)));
        }
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

/// States and torques on a grid over their bounds from which a sample, with `rk4`, ends within the bounds.
pub fn motions(
    ballbot: &Ballbot<f64>,
    plain: &ControllerSettings<f64>,
    rk4: Rk4,
) -> impl Iterator<Item = (Vector4<f64>, Vector1<f64>)> {
    let limits = [&plain.x.lower, &plain.x.upper];
    let [lower, upper] = limits.map(|limit| Vector4::new(0.0, limit[1], limit[2], limit[3]));
    let at = |i: usize, lower: f64, upper: f64, points: usize| {
        lower + (upper - lower) * i as f64 / (points - 1) as f64
    };
    let point = move |point: usize| {
        let places = [
            point % STATES,
            point / STATES % STATES,
            point / STATES.pow(2) % STATES,
        ];
        let state = |i: usize| at(places[i - 1], lower[i], upper[i], STATES);
        let (least, most) = (plain.u.lower[0], plain.u.upper[0]);
        let torque = at(point / STATES.pow(3), least, most, TORQUES);
        let start = Vector4::new(0.0, state(1), state(2), state(3));
        (start, Vector1::new(torque))
    };
    let points = (0..STATES.pow(3) * TORQUES).map(point);
    points.filter(move |(start, u)| stays(&plain.x, &rk4.advance(ballbot, start, u, plain.t_s)))
}

/// Whether the tilt and the rates are within their bounds.
fn stays(bounds: &Bounds<f64, 4>, x: &Vector4<f64>) -> bool {
    (1..4).all(|i| x[i] >= bounds.lower[i] && x[i] <= bounds.upper[i])
}

/// How far the robot may be from a plan along the whole horizon, upright under the terminal law, and in
/// the norm of P: what the largest errors add up to, each as long as it lives.
fn drift(
    ballbot: &Ballbot<f64>,
    plain: &ControllerSettings<f64>,
    terminal: &TerminalSet<f64, 4, 1>,
    rollout: &Rollout<f64, 4>,
) -> (Vector4<f64>, f64) {
    let (a, b) = ballbot.matrices(&ballbot.scheduling(&Vector4::zeros(), &Vector1::zeros()));
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
