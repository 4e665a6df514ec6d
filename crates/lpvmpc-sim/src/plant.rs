//! The continuous plant between two samples.

use lpvmpc::LpvModel;
use nalgebra::SVector;
use ode_solvers::dop_shared::OutputType;
use ode_solvers::{Dopri5, System};
use thiserror::Error;

/// Tolerances of the adaptive integration: the local error of each step is kept below
/// `absolute + relative * |x|`, per component.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerances {
    /// Relative tolerance, from 1e-14 to 1.
    pub relative: f64,
    /// Absolute tolerance in state units, positive.
    pub absolute: f64,
}

/// The plant could not be integrated over a sample.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum PlantError {
    /// A tolerance out of range.
    #[error(
        "integration tolerances are relative {relative:e}, absolute {absolute:e}; the relative \
         one must be from 1e-14 to 1, the absolute one positive"
    )]
    Tolerances {
        /// The relative tolerance that was given.
        relative: f64,
        /// The absolute tolerance that was given.
        absolute: f64,
    },
    /// The state, the input or the duration is not finite at the start.
    #[error("the plant starts from a state, input or duration that is not finite")]
    NotFinite,
    /// The integrator gave up, or the state left the numbers.
    #[error("the plant's motion cannot be integrated {after:.6} s into the sample: {reason}")]
    Diverged {
        /// Time since the beginning of the sample, s.
        after: f64,
        /// What the integrator says.
        reason: String,
    },
}

impl Tolerances {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`PlantError::Tolerances`].
    pub fn check(self) -> Result<Self, PlantError> {
        let Self { relative, absolute } = self;
        if (1e-14..=1.0).contains(&relative) && absolute > 0.0 && absolute.is_finite() {
            Ok(self)
        } else {
            Err(PlantError::Tolerances { relative, absolute })
        }
    }
}

struct Held<'a, P, const NX: usize, const NU: usize, const NS: usize> {
    model: &'a P,
    u: SVector<f64, NU>,
}

impl<P, const NX: usize, const NU: usize, const NS: usize> System<f64, SVector<f64, NX>>
    for Held<'_, P, NX, NU, NS>
where
    P: LpvModel<f64, NX, NU, NS>,
{
    fn system(&self, _t: f64, x: &SVector<f64, NX>, x_dot: &mut SVector<f64, NX>) {
        *x_dot = self.model.derivative(x, &self.u);
    }
}

/// The state `duration` seconds after `x` under the constant input `u`, by the adaptive
/// Dormand-Prince 5(4) method (Dormand and Prince 1980; Hairer, Norsett, Wanner, Solving
/// Ordinary Differential Equations I, ch. II.5). Each call starts afresh, so a jump of the
/// input between two calls is never stepped across.
///
/// # Errors
/// [`PlantError`] if the tolerances are out of range, or the motion leaves the numbers.
pub fn advance<P, const NX: usize, const NU: usize, const NS: usize>(
    model: &P,
    x: &SVector<f64, NX>,
    u: &SVector<f64, NU>,
    duration: f64,
    tolerances: Tolerances,
) -> Result<SVector<f64, NX>, PlantError>
where
    P: LpvModel<f64, NX, NU, NS>,
{
    integrate(model, x, u, duration, tolerances, duration)
}

/// [`advance`] with no step longer than `longest_step` seconds.
fn integrate<P, const NX: usize, const NU: usize, const NS: usize>(
    model: &P,
    x: &SVector<f64, NX>,
    u: &SVector<f64, NU>,
    duration: f64,
    tolerances: Tolerances,
    longest_step: f64,
) -> Result<SVector<f64, NX>, PlantError>
where
    P: LpvModel<f64, NX, NU, NS>,
{
    let Tolerances { relative, absolute } = tolerances.check()?;
    let start = model.derivative(x, u);
    let finite = |v: &SVector<f64, NX>| v.iter().all(|entry| entry.is_finite());
    if !(finite(x) && finite(&start) && duration.is_finite() && duration >= 0.0) {
        return Err(PlantError::NotFinite);
    }
    if duration == 0.0 {
        return Ok(*x);
    }
    // Step-size controller of Hairer's DOPRI5: safety 0.9, beta 0.04, factors 0.2 to 10.
    let mut solver = Dopri5::from_param(
        Held { model, u: *u },
        0.0,
        duration,
        duration,
        *x,
        relative,
        absolute,
        0.9,
        0.04,
        0.2,
        10.0,
        longest_step,
        0.0,
        MOST_STEPS,
        STIFFNESS_TEST,
        OutputType::Sparse,
    );
    let outcome = solver.integrate();
    let (times, states) = solver.results().get();
    let reached = times.last().copied().unwrap_or(0.0);
    match (outcome, states.last()) {
        (Ok(_), Some(state)) if finite(state) => Ok(*state),
        (Err(reason), _) => Err(PlantError::Diverged {
            after: reached,
            reason: reason.to_string(),
        }),
        _ => Err(PlantError::Diverged {
            after: reached,
            reason: "the state is not finite".to_owned(),
        }),
    }
}

/// A sample that needs more steps than this is not going to end.
const MOST_STEPS: u32 = 100_000;
/// Steps between two looks at stiffness.
const STIFFNESS_TEST: u32 = 1_000;
