//! The continuous plant between two samples.

use lpvmpc::{LpvModel, Rk4};
use nalgebra::SVector;
use ode_solvers::dop_shared::OutputType;
use ode_solvers::{Dopri5, System};
use thiserror::Error;

/// Tolerances of the adaptive integration: the local error of each step, every component of it
/// divided by its `absolute + relative * |x|`, is kept below 1 in root mean square.
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
    /// A duration that is not a number of seconds from zero on.
    #[error("the duration is {duration} s; it must be finite and not negative")]
    Duration {
        /// The duration that was given, s.
        duration: f64,
    },
    /// The state, the input or the rate of change is not finite at the start.
    #[error("the plant starts from a state, input or rate of change that is not finite")]
    NotFinite,
    /// The integrator gave up, or the state became non-finite.
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

/// A plant as the [`World`](crate::World) meets it: its motion under an input and a load.
///
/// `NX` states, `NU` inputs, `NL` components of the load. What a load is, is the plant's to
/// say: a force, a torque, an unwanted inflow. x_dot must be affine in it.
pub trait Plant<const NX: usize, const NU: usize, const NL: usize> {
    /// x_dot = f(x, u, load), in state units per second; the state one period later of a plant in discrete time.
    fn derivative(
        &self,
        x: &SVector<f64, NX>,
        u: &SVector<f64, NU>,
        load: &SVector<f64, NL>,
    ) -> SVector<f64, NX>;

    /// The period of a plant in discrete time, s; `None` in continuous time.
    fn period(&self) -> Option<f64> {
        None
    }

    /// What sensor `i` measures at the state `x`, in its unit, where that is not its row of the states.
    fn measured(&self, _i: usize, _x: &SVector<f64, NX>) -> Option<f64> {
        None
    }
}

/// An LPV model in continuous time as a plant that takes no load.
#[derive(Clone, Copy, Debug)]
pub struct Unloaded<'a, P, const NS: usize>(pub &'a P);

impl<P, const NX: usize, const NU: usize, const NS: usize> Plant<NX, NU, 0> for Unloaded<'_, P, NS>
where
    P: LpvModel<f64, NX, NU, NS>,
{
    fn derivative(
        &self,
        x: &SVector<f64, NX>,
        u: &SVector<f64, NU>,
        _load: &SVector<f64, 0>,
    ) -> SVector<f64, NX> {
        self.0.derivative(x, u)
    }
}

struct Motion<F>(F);

impl<F, const NX: usize> System<f64, SVector<f64, NX>> for Motion<F>
where
    F: Fn(f64, &SVector<f64, NX>) -> SVector<f64, NX>,
{
    fn system(&self, t: f64, x: &SVector<f64, NX>, x_dot: &mut SVector<f64, NX>) {
        *x_dot = (self.0)(t, x);
    }
}

/// The state `duration` seconds after `x` under the constant input `u`, by the adaptive
/// Dormand-Prince 5(4) method (Dormand and Prince 1980; Hairer, Norsett, Wanner, Solving
/// Ordinary Differential Equations I, ch. II.5). Each call starts afresh, so a jump of the
/// input between two calls is never stepped across. A model with a period moves by as many periods as are nearest
/// to the duration.
///
/// # Errors
/// [`PlantError`] if the tolerances are out of range, or the motion becomes non-finite.
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
    if model.period().is_some() {
        return if duration >= 0.0 && duration.is_finite() {
            Ok(Rk4 { substeps: 1 }.advance(model, x, u, duration))
        } else {
            Err(PlantError::Duration { duration })
        };
    }
    let motion = |_, x: &SVector<f64, NX>| model.derivative(x, u);
    integrate(motion, x, duration, tolerances, duration)
}

/// The state `duration` seconds after `x` with x_dot = `motion`(seconds since the start, x), in
/// steps of at most `longest_step` seconds.
pub(crate) fn integrate<const NX: usize>(
    motion: impl Fn(f64, &SVector<f64, NX>) -> SVector<f64, NX>,
    x: &SVector<f64, NX>,
    duration: f64,
    tolerances: Tolerances,
    longest_step: f64,
) -> Result<SVector<f64, NX>, PlantError> {
    let Tolerances { relative, absolute } = tolerances.check()?;
    if !(duration.is_finite() && duration >= 0.0) {
        return Err(PlantError::Duration { duration });
    }
    let start = motion(0.0, x);
    let finite = |v: &SVector<f64, NX>| v.iter().all(|entry| entry.is_finite());
    if !(finite(x) && finite(&start)) {
        return Err(PlantError::NotFinite);
    }
    if duration == 0.0 {
        return Ok(*x);
    }
    // Step-size controller of Hairer's DOPRI5: safety 0.9, beta 0.04, factors 0.2 to 10.
    let mut solver = Dopri5::from_param(
        Motion(motion),
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

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix1, Vector1};

    /// Logistic growth, x_dot = (1 - x) x: nonlinear, with a known motion.
    struct Growth;

    impl LpvModel<f64, 1, 1, 1> for Growth {
        fn scheduling(&self, x: &Vector1<f64>, _: &Vector1<f64>) -> Vector1<f64> {
            *x
        }

        fn matrices(&self, size: &Vector1<f64>) -> (Matrix1<f64>, Matrix1<f64>) {
            (Matrix1::new(1.0 - size[0]), Matrix1::zeros())
        }
    }

    const DURATION: f64 = 4.0;

    /// Distance from the exact motion after [`DURATION`], from 1/(1 + e).
    fn error(tolerance: f64, longest_step: f64) -> f64 {
        let tolerances = Tolerances {
            relative: tolerance,
            absolute: tolerance,
        };
        let exact = |t: f64| 1.0 / (1.0 + (1.0 - t).exp());
        let (start, u) = (Vector1::new(exact(0.0)), Vector1::zeros());
        let motion = |_, x: &Vector1<f64>| Growth.derivative(x, &u);
        let end = integrate(motion, &start, DURATION, tolerances, longest_step).unwrap();
        (end[0] - exact(DURATION)).abs()
    }

    /// The slope of the logarithms over the whole range.
    fn slope(points: &[(f64, f64)]) -> f64 {
        let (first, last) = (points[0], points[points.len() - 1]);
        (last.1 / first.1).ln() / (last.0 / first.0).ln()
    }

    #[test]
    fn order_five_in_the_step() {
        // A tolerance that is never in the way: all steps but the first are the longest.
        let points: Vec<(f64, f64)> = (5..=7)
            .map(|halvings| DURATION / f64::from(1 << halvings))
            .map(|step| (step, error(1.0, step)))
            .collect();
        let order = slope(&points);
        assert!((order - 5.0).abs() < 0.15, "order {order}: {points:?}");
    }

    #[test]
    fn error_follows_the_tolerance() {
        let points: Vec<(f64, f64)> = (3..=12)
            .map(|digits| 0.1_f64.powi(digits))
            .map(|tolerance| (tolerance, error(tolerance, DURATION)))
            .collect();
        // The local error of a step is kept at the tolerance; there are a few dozen steps.
        for (tolerance, error) in &points {
            assert!(error < &(100.0 * tolerance), "{error:e} at {tolerance:e}");
        }
        let order = slope(&points);
        assert!((order - 1.0).abs() < 0.15, "order {order}: {points:?}");
    }
}
