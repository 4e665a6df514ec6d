//! Whether a Runge-Kutta step is short enough for the poles it has to follow.

use crate::number_text;
use nalgebra::{Complex, DMatrix};
use thiserror::Error;

use crate::matrix_check::MatrixError;
use crate::modes::{pole_text, poles};

/// A step of the classical fourth-order Runge-Kutta method that every decaying pole allows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rk4Step {
    /// The length of one step: sampling time / substeps, s.
    pub step: f64,
    /// The longest step that the decaying poles allow, s; infinite if no pole decays.
    pub longest_step: f64,
    /// The fewest substeps of the sampling time that are stable.
    pub fewest_substeps: usize,
}

/// A step that is too long, or not a step.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Rk4StepError {
    /// The state matrix is not square, not finite, or has no eigenvalues.
    #[error(transparent)]
    Matrix(#[from] MatrixError),
    /// The sampling time is not a positive, finite number.
    #[error(
        "the sampling time is {value} s: it must be finite and > 0",
        value = number_text(*value)
    )]
    SampleTime {
        /// The sampling time, s.
        value: f64,
    },
    /// No substeps.
    #[error("the number of substeps is 0: it must be at least 1")]
    NoSubsteps,
    /// The fastest mode asks for more substeps than anybody would wait for.
    #[error(
        "the sampling time of {sample_time} s would take {substeps:e} Runge-Kutta steps, at most \
         {MOST_RK4_SUBSTEPS} are taken: the fastest pole is {fastest:.4} 1/s. Take a shorter \
         sampling time (it is in seconds)", sample_time = number_text(*sample_time))]
    TooMany {
        /// Sampling time, s.
        sample_time: f64,
        /// The steps that the fastest pole asks for.
        substeps: f64,
        /// Its absolute value, 1/s.
        fastest: f64,
    },
    /// An unstable mode grows so far within one sample that no number can follow it.
    #[error(
        "the sampling time of {sample_time} s is too long for the unstable pole {} 1/s: within one \
         sample its mode grows by e^{exponent:.0}, beyond the digits of a number. Take less than \
         {longest:.2} s (the sampling time is in seconds: {sample_time} ms are {} s)",
        pole_text(*pole),
        sample_time / 1e3, sample_time = number_text(*sample_time))]
    Outgrown {
        /// Sampling time, s.
        sample_time: f64,
        /// The fastest growing pole, 1/s.
        pole: Complex<f64>,
        /// Sampling time times its real part.
        exponent: f64,
        /// The sampling time at which the growth uses up the digits, s.
        longest: f64,
    },
    /// A mode that decays in the plant grows in the predictor.
    #[error(
        "the Runge-Kutta step of {step} s (sampling time {sample_time} s in {substeps} substeps) \
         is too long for the pole {} 1/s: this decaying mode is multiplied by \
         {amplification:.4} in each step, allowed is 1. The longest stable step is \
         {longest_step:.6} s: take at least {fewest_substeps} substeps",
        pole_text(*pole), sample_time = number_text(*sample_time), step = number_text(*step))]
    TooLong {
        /// Sampling time, s.
        sample_time: f64,
        /// Substeps asked for.
        substeps: usize,
        /// Length of one step, s.
        step: f64,
        /// The pole that bears the shortest step, 1/s.
        pole: Complex<f64>,
        /// |R(step * pole)|.
        amplification: f64,
        /// The longest stable step, s.
        longest_step: f64,
        /// The fewest substeps of the sampling time that are stable.
        fewest_substeps: usize,
    },
}

/// More Runge-Kutta steps per sample than these are a slip of the pen.
pub const MOST_RK4_SUBSTEPS: usize = 100_000;

/// Checks that `substeps` classical Runge-Kutta steps in `sample_time` (s) keep every decaying
/// mode of x_dot = A x decaying, and every other one within the digits of a number.
///
/// One step of length h multiplies the mode of a pole lambda (1/s) by R(h lambda),
/// R(z) = 1 + z + z^2/2 + z^3/6 + z^4/24; for each pole with negative real part |R| <= 1 is
/// required. Poles with real part >= 0 belong to modes that do not decay in the plant either and
/// set no limit. A stable step is not yet an accurate one: near the limit the fastest mode decays
/// far too slowly, at -2.785 on the real axis not at all.
///
/// # Errors
/// [`Rk4StepError::TooLong`] with the pole, the step, its limit and the substeps that would do;
/// [`Rk4StepError::Outgrown`] if a growing mode leaves the digits of a number within one sample; or
/// an argument is out of range.
pub fn check_rk4_step(
    a: &DMatrix<f64>,
    sample_time: f64,
    substeps: usize,
) -> Result<Rk4Step, Rk4StepError> {
    if !(sample_time.is_finite() && sample_time > 0.0) {
        return Err(Rk4StepError::SampleTime { value: sample_time });
    }
    if substeps == 0 {
        return Err(Rk4StepError::NoSubsteps);
    }
    let step = sample_time / substeps as f64;
    let poles = poles(a)?;
    check_growth(&poles, sample_time, substeps, DIGITS)?;
    let tightest = poles
        .into_iter()
        .filter(|pole| pole.re < 0.0)
        .map(|pole| (pole, longest_step(pole)))
        .min_by(|x, y| x.1.total_cmp(&y.1));
    let Some((pole, longest_step)) = tightest else {
        return Ok(Rk4Step {
            step,
            longest_step: f64::INFINITY,
            fewest_substeps: 1,
        });
    };
    let fewest_substeps = (sample_time / longest_step).ceil() as usize;
    if step > longest_step {
        return Err(Rk4StepError::TooLong {
            sample_time,
            substeps,
            step,
            pole,
            amplification: amplification(pole * step),
            longest_step,
            fewest_substeps,
        });
    }
    Ok(Rk4Step {
        step,
        longest_step,
        fewest_substeps,
    })
}

/// The substeps of `sample_time` (s) with which the classical Runge-Kutta method follows every mode
/// of x_dot = A x well, where nothing else is said: |step * fastest pole| is at most 0.7.
///
/// # Errors
/// A has no eigenvalues, the sampling time is not positive, more than [`MOST_RK4_SUBSTEPS`] were
/// needed, or a mode grows so far within one sample that no regulator could be designed.
pub fn accurate_rk4_substeps(a: &DMatrix<f64>, sample_time: f64) -> Result<usize, Rk4StepError> {
    const ACCURATE_STEP: f64 = 0.7;
    if !(sample_time.is_finite() && sample_time > 0.0) {
        return Err(Rk4StepError::SampleTime { value: sample_time });
    }
    let poles = poles(a)?;
    let fastest = poles.iter().map(|pole| pole.norm()).fold(0.0, f64::max);
    let substeps = (sample_time * fastest / ACCURATE_STEP).ceil().max(1.0);
    let taken = substeps.min(MOST_RK4_SUBSTEPS as f64) as usize;
    // A Riccati equation squares the growth, so half of the digits are left for it. The likelier
    // cause first, where there are two.
    check_growth(&poles, sample_time, taken, 0.5 * DIGITS)?;
    if substeps <= MOST_RK4_SUBSTEPS as f64 {
        return Ok(taken);
    }
    Err(Rk4StepError::TooMany {
        sample_time,
        substeps,
        fastest,
    })
}

/// The logarithm of 1 / machine epsilon.
const DIGITS: f64 = 52.0 * std::f64::consts::LN_2;

/// No mode grows by more than e^`most` in the plant, if `substeps` steps follow it.
fn check_growth(
    poles: &[Complex<f64>],
    sample_time: f64,
    substeps: usize,
    most: f64,
) -> Result<(), Rk4StepError> {
    let step = sample_time / substeps as f64;
    for pole in poles {
        let predicted = substeps as f64 * amplification(pole * step).ln();
        let exponent = sample_time * pole.re;
        // An overflow of the prediction may end in a NaN.
        if exponent > most && (predicted > most || predicted.is_nan()) {
            return Err(Rk4StepError::Outgrown {
                sample_time,
                pole: *pole,
                exponent,
                longest: most / pole.re,
            });
        }
    }
    Ok(())
}

/// |R(z)|.
fn amplification(z: Complex<f64>) -> f64 {
    ((((z / 24.0 + 1.0 / 6.0) * z + 0.5) * z + 1.0) * z + 1.0).norm()
}

/// The longest h with |R(h pole)| <= 1 for a pole with negative real part.
///
/// From zero into the left half plane every ray leaves the stability region once, and the region
/// ends before |z| = 4, so bisection finds the limit.
fn longest_step(pole: Complex<f64>) -> f64 {
    let direction = pole / pole.norm();
    let (mut stable, mut unstable) = (0.0, 4.0);
    while unstable - stable > f64::EPSILON * unstable {
        let middle = 0.5 * (stable + unstable);
        if amplification(direction * middle) <= 1.0 {
            stable = middle;
        } else {
            unstable = middle;
        }
    }
    stable / pole.norm()
}
