//! How exactly the guaranteed loop's plans are rolled out: the number of Runge-Kutta steps, and what is
//! known of their error.
//!
//! The number is the smallest whose error, with its factor of safety ([`search`](mod@search)), fits into the margin
//! along the horizon.
//!
//! Deviations from a plan are carried on by the derivatives of the prediction, whose Runge-Kutta steps
//! are coarser. Their error is that of step doubling on the same grid, and has to be small against the
//! factor of safety.

pub mod search;

use self::search::{Search, motions};
use crate::error::ScenarioError;
use crate::number::text;
use ballbot::{Ballbot, ControllerSettings};
use lpvmpc::{LpvModel, Rk4, Rollout, TerminalSet};
use nalgebra::{Matrix4, Vector1, Vector4};

/// More steps than this are not tried.
const MOST_SUBSTEPS: usize = 64;
/// How far the derivatives may be off by which deviations from a plan are carried on, relative to the
/// largest of the sample.
const DERIVATIVES: f64 = 0.01;

/// The coarsest rollout whose error fits into `margin`, or one with as many steps as are `wanted`.
///
/// # Errors
/// A bound of tilt, rates or torque is infinite, no motion stays within the bounds for a sample, no number of
/// steps suffices, or more steps than are wanted are needed.
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
    let finest = Rk4 {
        substeps: MOST_SUBSTEPS,
    };
    if motions(ballbot, plain, finest).next().is_none() {
        return Err(ScenarioError::value(
            "controller.t_s",
            plain.t_s,
            "with a certified terminal set there must be motions that stay within the bounds for so \
             long; take a shorter sampling time, or wider bounds",
        ));
    }
    let search = Search {
        ballbot,
        plain,
        metric: &terminal.p,
    };
    let fits = |rollout: &Rollout<f64, 4>| {
        let (drift, end) = drift(ballbot, plain, terminal, rollout);
        let width = plain.x.upper - plain.x.lower;
        let free = |i: usize| drift[i] + rollout.between[i] <= margin * width[i];
        (1..4).all(free) && end <= margin * terminal.level.sqrt()
    };
    let searched = |substeps: usize| {
        let rough = search.on_grid(Rk4 { substeps })?;
        Some(search.between_points(rough).rollout())
    };
    // Every second number of steps: what comes between saves little.
    let mut tried = (2..=MOST_SUBSTEPS).step_by(2).filter_map(|substeps| {
        // What does not fit on the grid alone does not fit.
        let rough = search.on_grid(Rk4 { substeps })?;
        fits(&rough.rollout()).then(|| search.between_points(rough).rollout())
    });
    let Some(coarsest) = tried.find(fits) else {
        let finest = searched(MOST_SUBSTEPS);
        let needed = finest.and_then(|finest| extrapolated(&finest, fits));
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
    let Some(wanted) = wanted else {
        return Ok(coarsest);
    };
    let permitted = (needed..=MOST_SUBSTEPS).contains(&wanted);
    let finer = permitted.then(|| searched(wanted)).flatten();
    finer.ok_or_else(|| {
        ScenarioError::value(
            "controller.terminal.certified.substeps",
            wanted,
            format!(
                "the guarantee needs {needed} integration steps per sample with these bounds, this \
                 sampling time and horizon; {MOST_SUBSTEPS} are the most"
            ),
        )
    })
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
        let axes: Matrix4<f64> = power * rollout.error;
        total += axes.abs().column_sum();
        // The corner of the parallelepiped that is largest in the norm of P is one of its 2^4.
        let corner = |signs: usize| {
            let sign = |i: usize| if signs >> i & 1 == 1 { -1.0 } else { 1.0 };
            let e: Vector4<f64> = axes * Vector4::from_fn(|i, _| sign(i));
            (terminal.p * e).dot(&e).sqrt()
        };
        end += (0..16).map(corner).fold(0.0, f64::max);
        power = closed * power;
    }
    (total, end)
}
