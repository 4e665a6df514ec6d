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
pub(crate) fn accurate(
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
fn derivatives_error(ballbot: &Ballbot<f64>, plain: &ControllerSettings<f64>, rk4: Rk4) -> f64 {
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
fn motions(
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PredictorTable, Scenario};
    use lpvmpc_certificate::RolloutClaim;
    use lpvmpc_sim::{Random, Tolerances};
    use std::path::Path;

    /// A margin that no permitted number of steps keeps is refused with the number that would.
    #[test]
    fn steps_that_are_too_coarse_are_refused_with_the_number_needed() {
        let prepared = Scenario::load("far-setpoints").unwrap();
        let prepared = prepared.prepare(Path::new(".")).unwrap();
        let terminal = prepared.guaranteed().unwrap().terminal;
        let refused = |margin: f64, wanted: Option<usize>| {
            let (ballbot, plain) = (&prepared.ballbot, &prepared.settings);
            let rollout = accurate(ballbot, plain, &terminal, margin, wanted);
            rollout.map_or_else(|error| error.to_string(), |rollout| format!("{rollout:?}"))
        };
        assert!(refused(4e-3, Some(10)).contains("needs 12 integration steps"));
        assert!(refused(4e-3, Some(65)).contains("64 are the most"));
        assert!(refused(4e-3, Some(13)).contains("substeps: 13"));
        let fine = refused(1e-5, None);
        assert!(
            fine.contains("controller.t_s") && fine.contains("needs about 128"),
            "{fine}"
        );
    }

    /// Between the points of the grid the derivatives are off by no more than there, beside many fine steps;
    /// a prediction too coarse for them is refused with the number needed.
    #[test]
    fn derivatives_are_as_accurate_as_a_guarantee_needs() {
        let mut scenario = Scenario::load("far-setpoints").unwrap();
        let prepared = scenario.prepare(Path::new(".")).unwrap();
        let (ballbot, plain) = (prepared.ballbot, prepared.settings);
        let rk4 = prepared.guaranteed().unwrap().rk4;
        assert_eq!(rk4.substeps, 4);
        let grid = derivatives_error(&ballbot, &plain, rk4);
        assert!((0.003..0.005).contains(&grid), "{grid}");
        let fine = Rk4 { substeps: 48 };
        let mut random = Random::new(8, 0);
        let mut worst = 0.0_f64;
        for _ in 0..3000 {
            let start = plain.x.upper.map(|limit| {
                let part = random.symmetric();
                if limit.is_finite() { part * limit } else { 0.0 }
            });
            let u = plain.u.upper * random.symmetric();
            if !stays(&plain.x, &fine.advance(&ballbot, &start, &u, plain.t_s)) {
                continue;
            }
            let (a, b) = rk4.differentiate(&ballbot, &start, &u, plain.t_s);
            let (a_fine, b_fine) = fine.differentiate(&ballbot, &start, &u, plain.t_s);
            let unit = plain.x.upper;
            let unit = Vector4::new(unit[2] * plain.t_s, unit[1], unit[2], unit[3]);
            let scaled =
                |a: &Matrix4<f64>| Matrix4::from_fn(|i, j| a[(i, j)] * unit[j] / unit[i]).amax();
            let by_state = scaled(&(a - a_fine)) / scaled(&a_fine);
            let by_input = (b - b_fine).component_div(&unit).amax();
            let by_input = by_input / b_fine.component_div(&unit).amax();
            worst = worst.max(by_state).max(by_input);
        }
        assert!(worst < 1.3 * grid && worst > 0.5 * grid, "{worst} {grid}");

        scenario.controller.predictor = Some(PredictorTable::StageConsistent { substeps: Some(2) });
        let refused = scenario.prepare(Path::new(".")).unwrap_err().to_string();
        assert!(
            refused.contains("stage_consistent.substeps") && refused.contains("it needs 4"),
            "{refused}"
        );
    }

    /// At points of the grid the error is enclosed by machine, its own width included: the factor of 2 covers more
    /// than step doubling.
    #[test]
    fn the_error_at_points_of_the_grid_is_proved() {
        let prepared = Scenario::load("far-setpoints").unwrap();
        let prepared = prepared.prepare(Path::new(".")).unwrap();
        let settings = *prepared.guaranteed().unwrap();
        let Rollout {
            rk4,
            error,
            between,
        } = settings.rollout;
        let claim = RolloutClaim {
            t_s: settings.t_s,
            substeps: rk4.substeps,
            x: settings.x,
            u: settings.u,
            error,
            between,
        };
        let (mut largest, mut looked) = (0.0_f64, 0);
        for (x, u) in motions(&prepared.ballbot, &prepared.settings, rk4).step_by(7) {
            // Theta, both rates and the torque, and the time.
            let sample = claim.enclose::<_, 3, 5>(&prepared.ballbot, &x, &u).unwrap();
            // None at rest, and where the rollout leaves the bounds within the sample.
            let Some(sample) = sample.filter(|sample| sample.stays) else {
                continue;
            };
            looked += 1;
            for i in 0..4 {
                largest = largest.max(sample.error[i].magnitude() / error[i]);
                assert!(sample.between[i] <= between[i], "{i}: {x} {u}");
            }
        }
        assert!(looked > 50, "{looked}");
        assert!((0.45..0.85).contains(&largest), "{largest}");
    }

    /// From random states under random torques, the rollout is as close as is said to a plant that is
    /// integrated to 1e-12, and the plant is between two steps where it is said to be.
    #[test]
    fn the_error_is_within_its_bound() {
        let prepared = Scenario::load("far-setpoints").unwrap();
        let prepared = prepared.prepare(Path::new(".")).unwrap();
        let settings = *prepared.guaranteed().unwrap();
        let Rollout {
            rk4,
            error,
            between,
        } = settings.rollout;
        let tolerances = Tolerances {
            relative: 1e-12,
            absolute: 1e-12,
        };
        let mut random = Random::new(7, 0);
        let (mut largest, mut runs) = (0.0_f64, 0);
        while runs < 3000 {
            // Small motions as well as large ones.
            let size = random.uniform().powi(2);
            let part = |i: usize, random: &mut Random| {
                size * random.symmetric() * if i == 0 { 0.0 } else { settings.x.upper[i] }
            };
            let start = Vector4::from_fn(|i, _| part(i, &mut random));
            let u = Vector1::new(size * random.symmetric() * settings.u.upper[0]);
            let exact = |seconds: f64| {
                lpvmpc_sim::advance(&prepared.ballbot, &start, &u, seconds, tolerances).unwrap()
            };
            let end = exact(settings.t_s);
            if !stays(&settings.x, &end) {
                continue;
            }
            runs += 1;
            let share = lpvmpc::share_of_bounds(&start, &settings.x, &u, &settings.u);
            let off = (rk4.advance(&prepared.ballbot, &start, &u, settings.t_s) - end).abs();
            for i in 0..4 {
                let part = (off[i] - 1e-11) / (error[i] * share);
                largest = largest.max(part);
                assert!(part <= 1.0, "{start} {u}: {off}");
            }
            let step = settings.t_s / rk4.substeps as f64;
            let ends = [start, exact(step)];
            let inside = exact(step * random.uniform());
            for i in 0..4 {
                let [lower, upper] = [ends[0].inf(&ends[1])[i], ends[0].sup(&ends[1])[i]];
                assert!(inside[i] <= upper + between[i] && inside[i] >= lower - between[i]);
            }
        }
        // The factor of 2 is there, and little more.
        assert!((0.2..0.75).contains(&largest), "{largest}");
    }
}
