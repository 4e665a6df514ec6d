//! What defines an estimator besides its model, and what can be wrong with it.

use super::Covariance;
use super::history::Estimate;
use super::observation::Verdict;
use crate::model::Scalar;
use crate::predictor::Rk4;
use core::fmt;
use nalgebra::{SMatrix, SVector, convert};

/// Everything that defines an [`Estimator`](super::Estimator) besides its model.
///
/// A disturbance d shifts state and input of the model by constants that have to be found:
///
/// ```text
/// x_dot = f(x + E_x d, u + E_u d),     y = C x + noise
/// ```
///
/// With E_u = 1 it is a torque that acts besides u; with E_x = 1 at an angle it is the angle by
/// which the sensor, or the centre of mass, is off. In the model's own coordinates
/// z = x + E_x d, v = u + E_u d the motion is z_dot = f(z, v), without disturbance: a controller
/// that is given z and whose answer is v tracks without offset.
///
/// `NX` states, `NU` inputs, `NY` measured quantities, `ND` disturbances. The pair of plant and
/// disturbance must be observable: rank [I - A, -B_d; C, C_d] = `NX` + `ND` (Pannocchia and
/// Rawlings 2003).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EstimatorSettings<T, const NX: usize, const NU: usize, const NY: usize, const ND: usize>
{
    /// Longest Runge-Kutta step of the prediction, s.
    pub longest_step: T,
    /// C, `NY` x `NX`; a row is not read where the model has a [`sensor`](crate::LpvModel::sensor) in its place.
    pub c: SMatrix<T, NY, NX>,
    /// E_x, `NX` x `ND`.
    pub state_offset: SMatrix<T, NX, ND>,
    /// E_u, `NU` x `ND`.
    pub input_offset: SMatrix<T, NU, ND>,
    /// Variance that the state gains per second, in squared state units per s, >= 0: what the
    /// model does not know.
    pub state_noise: SVector<T, NX>,
    /// Variance that the disturbance gains per second, >= 0: how fast it may wander.
    pub disturbance_noise: SVector<T, ND>,
    /// Variances of the measurements, in squared units, > 0; infinite for a sensor that the filter
    /// does without.
    pub measurement_noise: SVector<T, NY>,
    /// Variances of the state at the start, >= 0.
    pub initial_state: SVector<T, NX>,
    /// Variances of the disturbance at the start, >= 0.
    pub initial_disturbance: SVector<T, ND>,
    /// Which readings are not believed.
    pub gate: Gate<T>,
}

/// When a reading is not believed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gate<T> {
    /// A reading further from its prediction than this many standard deviations is an outlier;
    /// infinite for none but those further than 1/eps of them (4.5e15 for `f64`, 8.4e6 for `f32`), which leave nothing of
    /// an estimate but rounding: three of these in a row are outliers whatever the gate.
    pub deviations: T,
    /// After this many outliers of one sensor in a row it is the state that must be wrong, as
    /// after a blow: the reading is believed, and the state's variance grows to fit it.
    pub patience: usize,
    /// A reading older than this is stale, s.
    pub oldest: T,
    /// Without a reading that is believed for longer than this, s, there is no estimate any more:
    /// of an unstable plant an error has grown to anything by then. Infinite for a plant that can
    /// be predicted for ever.
    pub longest_gap: T,
}

/// Of readings so far off that what they leave of the estimate is rounding, so many in a row are not believed, whatever the
/// gate says.
const UNBELIEVABLE: usize = 3;

impl<T: Scalar> Gate<T> {
    /// So many outliers in a row are not believed that are as far off as a reading whose squared distance from its prediction
    /// is `excess` variances; `None` where it is no outlier.
    pub(super) fn patience_with(&self, excess: T) -> Option<usize> {
        let rounding = T::default_epsilon().recip();
        let believable = rounding * rounding;
        if excess <= believable.min(self.deviations * self.deviations) {
            None
        } else if excess <= believable {
            Some(self.patience)
        } else {
            Some(self.patience.max(UNBELIEVABLE))
        }
    }

    /// What is wrong with a reading whatever the estimate, if anything.
    pub(super) fn refuses(&self, reading: &Reading<T>) -> Option<Verdict> {
        if !reading.value.is_finite() {
            Some(Verdict::NotFinite)
        } else if reading.age <= self.oldest {
            None
        } else {
            // An age that is NaN is too old, too.
            Some(Verdict::Stale)
        }
    }
}

/// A measured value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading<T> {
    /// The value, in the unit of the measured quantity.
    pub value: T,
    /// Time since it was taken, s: it corrects the state as it was then.
    pub age: T,
}

impl<T: Scalar> Reading<T> {
    /// A value of this instant.
    pub fn fresh(value: T) -> Self {
        Self {
            value,
            age: T::zero(),
        }
    }
}

/// A mistake in the [`EstimatorSettings`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EstimatorError {
    /// The longest step is not a positive number.
    LongestStep,
    /// C, E_x or E_u contains a number that is not finite: its name.
    Matrix(&'static str),
    /// A variance is negative (or zero, for a measurement) or not finite: what of, and its
    /// component from 0.
    Variance {
        /// What it is the variance of.
        quantity: &'static str,
        /// Component, from 0.
        component: usize,
    },
    /// The gate lets nothing through.
    Gate,
    /// There is no memory for the present instant.
    Memory,
}

impl fmt::Display for EstimatorError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::LongestStep => write!(f, "the longest step must be a positive number of seconds"),
            Self::Matrix(name) => write!(f, "the matrix {name} must have finite entries"),
            Self::Variance {
                quantity,
                component,
            } => write!(
                f,
                "the variance of {quantity} {component} must be finite and not negative, that of \
                 a measurement positive"
            ),
            Self::Memory => write!(
                f,
                "the estimator needs memory for one instant at least, the present"
            ),
            Self::Gate => write!(
                f,
                "the gate's deviations and longest gap must be positive, and its oldest age not \
                 negative"
            ),
        }
    }
}

impl core::error::Error for EstimatorError {}

impl<T: Scalar, const NX: usize, const NU: usize, const NY: usize, const ND: usize>
    EstimatorSettings<T, NX, NU, NY, ND>
{
    /// Enough steps for `duration` s.
    pub(super) fn predictor(&self, duration: T) -> Rk4 {
        Rk4::with_steps_up_to(self.longest_step, duration)
    }

    /// The readings of the sensors that the filter does not do without.
    pub(super) fn needed(&self, readings: &[Option<Reading<T>>; NY]) -> [Option<Reading<T>>; NY] {
        let mut needed = *readings;
        for (reading, noise) in needed.iter_mut().zip(&self.measurement_noise) {
            *reading = reading.filter(|_| noise.is_finite());
        }
        needed
    }

    /// Says of the other sensors that they are not needed.
    pub(super) fn mark_unneeded(&self, verdicts: &mut [Verdict; NY]) {
        for (verdict, noise) in verdicts.iter_mut().zip(&self.measurement_noise) {
            if !noise.is_finite() {
                *verdict = Verdict::NotNeeded;
            }
        }
    }

    /// What is known at the start from the state `x`.
    pub(super) fn initial(&self, x: SVector<T, NX>) -> Estimate<T, NX, ND> {
        Estimate {
            z: x,
            d: SVector::zeros(),
            covariance: self.spread(&self.initial_state, &self.initial_disturbance),
        }
    }

    /// Which states a blow may have changed: what noise drives, which are the rates as a rule, and
    /// what is read at the same instant, so that it is found again at once. To doubt another one
    /// would leave it to be guessed from errors of the model until a reading of it arrives. `shown` is
    /// how each reading depends on the states.
    pub(super) fn struck(&self, shown: impl Iterator<Item = SVector<T, NX>>) -> [bool; NX] {
        let mut struck = [false; NX];
        for (struck, noise) in struck.iter_mut().zip(&self.state_noise) {
            *struck = *noise > T::zero();
        }
        for row in shown {
            for (struck, c) in struck.iter_mut().zip(&row) {
                *struck |= *c != T::zero();
            }
        }
        struck
    }

    /// The covariance of (z, d) where x and d vary independently of each other. A disturbance
    /// that wanders moves z = x + E_x d, and leaves the state x that the sensors see.
    pub(super) fn spread(
        &self,
        state: &SVector<T, NX>,
        disturbance: &SVector<T, ND>,
    ) -> Covariance<T, NX, ND> {
        let offset = &self.state_offset;
        let dd = SMatrix::from_diagonal(disturbance);
        let zd = offset * dd;
        Covariance {
            zz: SMatrix::from_diagonal(state) + zd * offset.transpose(),
            zd,
            dd,
        }
    }

    pub(super) fn check(&self) -> Result<(), EstimatorError> {
        if !(self.longest_step > T::zero() && self.longest_step.is_finite()) {
            return Err(EstimatorError::LongestStep);
        }
        let finite = |entries: &[T]| entries.iter().all(|entry| entry.is_finite());
        for (name, entries) in [
            ("C", self.c.as_slice()),
            ("E_x", self.state_offset.as_slice()),
            ("E_u", self.input_offset.as_slice()),
        ] {
            if !finite(entries) {
                return Err(EstimatorError::Matrix(name));
            }
        }
        let variances: [(_, &[T]); 5] = [
            ("the state's noise", self.state_noise.as_slice()),
            ("the disturbance's noise", self.disturbance_noise.as_slice()),
            ("the initial state", self.initial_state.as_slice()),
            (
                "the initial disturbance",
                self.initial_disturbance.as_slice(),
            ),
            ("the measurement", self.measurement_noise.as_slice()),
        ];
        for (quantity, variances) in variances {
            let least_allowed = |variance: &T| match quantity {
                "the measurement" => *variance > T::zero(),
                _ => *variance >= T::zero(),
            };
            // A sensor of infinite variance is one that is not needed.
            let unneeded =
                |variance: &T| quantity == "the measurement" && *variance == convert(f64::INFINITY);
            let wrong = |variance: &T| {
                !(least_allowed(variance) && (variance.is_finite() || unneeded(variance)))
            };
            if let Some(component) = variances.iter().position(wrong) {
                return Err(EstimatorError::Variance {
                    quantity,
                    component,
                });
            }
        }
        let Gate {
            deviations,
            oldest,
            longest_gap,
            ..
        } = self.gate;
        if deviations > T::zero() && oldest >= T::zero() && longest_gap > T::zero() {
            Ok(())
        } else {
            Err(EstimatorError::Gate)
        }
    }
}
