//! A Kalman filter on the LPV model, with disturbances for offset-free tracking.

use crate::model::{LpvModel, Scalar};
use crate::predictor::Rk4;
use core::fmt;
use nalgebra::{SMatrix, SVector, convert};

/// Everything that defines an [`Estimator`] besides its model.
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
    /// C, `NY` x `NX`.
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
    /// Variances of the measurements, in squared units, > 0.
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
    /// infinite for none.
    pub deviations: T,
    /// After this many outliers of one sensor in a row it is the state that must be wrong, as
    /// after a blow: the reading is believed, and the state's variance grows to fit it.
    pub patience: usize,
    /// A reading older than this is stale, s.
    pub oldest: T,
}

/// A measured value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading<T> {
    /// The value, in the unit of the measured quantity.
    pub value: T,
    /// Time since it was taken, s.
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

/// What became of a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It has corrected the estimate.
    Used,
    /// It has corrected the estimate after the state's variance was raised.
    UsedAfterBlow,
    /// There was none, or no number.
    Missing,
    /// It was too old.
    Stale,
    /// It was too far from the prediction.
    Outlier,
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
            Self::Gate => write!(
                f,
                "the gate's deviations must be positive, and its oldest age not negative"
            ),
        }
    }
}

impl core::error::Error for EstimatorError {}

/// An extended Kalman filter whose covariance follows the LPV model at the estimated scheduling,
/// updated one sensor at a time in Joseph's form (Bucy and Joseph 1968; Simon, Optimal State
/// Estimation, 2006, ch. 6.1 and 5).
///
/// Sensors may come and go: each update uses what there is.
#[derive(Clone, Debug)]
pub struct Estimator<
    P,
    T,
    const NX: usize,
    const NU: usize,
    const NS: usize,
    const NY: usize,
    const ND: usize,
> {
    model: P,
    settings: EstimatorSettings<T, NX, NU, NY, ND>,
    /// x + E_x d.
    z: SVector<T, NX>,
    d: SVector<T, ND>,
    covariance: Covariance<T, NX, ND>,
    rejected: [usize; NY],
}

/// The covariance of (z, d) in blocks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Covariance<T, const NX: usize, const ND: usize> {
    /// Of z, `NX` x `NX`, symmetric positive semidefinite.
    pub zz: SMatrix<T, NX, NX>,
    /// Of z with d, `NX` x `ND`.
    pub zd: SMatrix<T, NX, ND>,
    /// Of d, `ND` x `ND`, symmetric positive semidefinite.
    pub dd: SMatrix<T, ND, ND>,
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize, const NY: usize, const ND: usize>
    Estimator<P, T, NX, NU, NS, NY, ND>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// An estimator that starts from the state `x` without disturbance.
    ///
    /// # Errors
    /// An [`EstimatorError`] names the first setting that makes no sense.
    pub fn new(
        model: P,
        settings: EstimatorSettings<T, NX, NU, NY, ND>,
        x: SVector<T, NX>,
    ) -> Result<Self, EstimatorError> {
        settings.check()?;
        Ok(Self {
            model,
            settings,
            z: x,
            d: SVector::zeros(),
            covariance: settings.initial_covariance(),
            rejected: [0; NY],
        })
    }

    /// Starts again from the state `x`.
    pub fn reset(&mut self, x: SVector<T, NX>) {
        self.z = x;
        self.d = SVector::zeros();
        self.covariance = self.settings.initial_covariance();
        self.rejected = [0; NY];
    }

    /// The estimated state x, as the sensors see it.
    pub fn state(&self) -> SVector<T, NX> {
        self.z - self.settings.state_offset * self.d
    }

    /// The estimated state z = x + E_x d, as the model sees it.
    pub fn model_state(&self) -> &SVector<T, NX> {
        &self.z
    }

    /// The estimated disturbance d.
    pub fn disturbance(&self) -> &SVector<T, ND> {
        &self.d
    }

    /// E_u d: what acts on the plant besides the input, in input units.
    pub fn input_disturbance(&self) -> SVector<T, NU> {
        self.settings.input_offset * self.d
    }

    /// The covariance of the estimate.
    pub fn covariance(&self) -> &Covariance<T, NX, ND> {
        &self.covariance
    }

    /// The settings.
    pub fn settings(&self) -> &EstimatorSettings<T, NX, NU, NY, ND> {
        &self.settings
    }

    /// The model's state `duration` s after `z`, under the input `u` and the estimated
    /// disturbance.
    pub fn predict(&self, z: &SVector<T, NX>, u: &SVector<T, NU>, duration: T) -> SVector<T, NX> {
        let v = u + self.input_disturbance();
        let predictor = self.settings.predictor(duration);
        predictor.advance(&self.model, z, &v, duration)
    }

    /// Moves the estimate on by `duration` s under the constant input `u`.
    pub fn advance(&mut self, u: &SVector<T, NU>, duration: T) {
        let settings = &self.settings;
        let predictor = settings.predictor(duration);
        let (a, b) = self.model.matrices(&self.model.scheduling(&self.z));
        let (a, b) = predictor.discretize(&a, &b, duration);
        let g = b * settings.input_offset;
        let Covariance { zz, zd, dd } = self.covariance;
        let mixed = a * zd * g.transpose();
        let mut moved = Covariance {
            zz: a * zz * a.transpose() + mixed + mixed.transpose() + g * dd * g.transpose(),
            zd: a * zd + g * dd,
            dd,
        };
        let wandered = settings.spread(
            &(settings.state_noise * duration),
            &(settings.disturbance_noise * duration),
        );
        moved.zz += wandered.zz;
        moved.zd += wandered.zd;
        moved.dd += wandered.dd;
        self.z = self.predict(&self.z, u, duration);
        self.covariance = moved;
    }

    /// Corrects the estimate with what the sensors delivered, and says what became of each
    /// reading.
    pub fn update(&mut self, readings: &[Option<Reading<T>>; NY]) -> [Verdict; NY] {
        let mut verdicts = [Verdict::Missing; NY];
        for (i, (verdict, reading)) in verdicts.iter_mut().zip(readings).enumerate() {
            *verdict = match reading {
                Some(reading) if reading.value.is_finite() => self.correct(i, reading),
                _ => Verdict::Missing,
            };
        }
        verdicts
    }

    /// Corrects with the reading of sensor `i`.
    fn correct(&mut self, i: usize, reading: &Reading<T>) -> Verdict {
        let gate = self.settings.gate;
        // Negated, so that an age that is not a number is too old.
        if !(reading.age <= gate.oldest) {
            return Verdict::Stale;
        }
        let c_z = self.settings.c.row(i).transpose();
        let c_d = -(self.settings.state_offset.transpose() * c_z);
        let noise = self.settings.measurement_noise[i];
        let error = reading.value - c_z.dot(&self.z) - c_d.dot(&self.d);
        let variance = self.covariance.of(&c_z, &c_d) + noise;
        let excess = error * error / variance;
        let mut verdict = Verdict::Used;
        if !(excess <= gate.deviations * gate.deviations) {
            if self.rejected[i] < gate.patience || !excess.is_finite() {
                self.rejected[i] += 1;
                return Verdict::Outlier;
            }
            // What the reading exceeds its variance by, the state's variance has to explain.
            let state_variance = c_z.dot(&(self.covariance.zz * c_z));
            if state_variance > T::zero() {
                self.covariance.zz *= T::one() + error * error / state_variance;
            }
            verdict = Verdict::UsedAfterBlow;
        }
        self.rejected[i] = 0;
        let (k_z, k_d) = self.covariance.correct(&c_z, &c_d, noise);
        self.z += k_z * error;
        self.d += k_d * error;
        verdict
    }
}

impl<T: Scalar, const NX: usize, const ND: usize> Covariance<T, NX, ND> {
    /// The variance of c_z'z + c_d'd.
    fn of(&self, c_z: &SVector<T, NX>, c_d: &SVector<T, ND>) -> T {
        let (p_z, p_d) = self.times(c_z, c_d);
        c_z.dot(&p_z) + c_d.dot(&p_d)
    }

    /// P (c_z, c_d).
    fn times(
        &self,
        c_z: &SVector<T, NX>,
        c_d: &SVector<T, ND>,
    ) -> (SVector<T, NX>, SVector<T, ND>) {
        (
            self.zz * c_z + self.zd * c_d,
            self.zd.transpose() * c_z + self.dd * c_d,
        )
    }

    /// Takes in a measurement of c_z'z + c_d'd with the variance `noise`, and returns the gain:
    /// P <- (I - K c')P(I - K c')' + K noise K', which stays positive semidefinite whatever the
    /// rounding of K.
    fn correct(
        &mut self,
        c_z: &SVector<T, NX>,
        c_d: &SVector<T, ND>,
        noise: T,
    ) -> (SVector<T, NX>, SVector<T, ND>) {
        let (p_z, p_d) = self.times(c_z, c_d);
        let variance = c_z.dot(&p_z) + c_d.dot(&p_d) + noise;
        let (k_z, k_d) = (p_z / variance, p_d / variance);
        // M = (I - K c') P, and then M (I - K c')' + K noise K' = M + (K noise - M c) K'.
        let m_zz = self.zz - k_z * p_z.transpose();
        let m_zd = self.zd - k_z * p_d.transpose();
        let m_dz = self.zd.transpose() - k_d * p_z.transpose();
        let m_dd = self.dd - k_d * p_d.transpose();
        let rest_z = k_z * noise - m_zz * c_z - m_zd * c_d;
        let rest_d = k_d * noise - m_dz * c_z - m_dd * c_d;
        self.zz = symmetric(&(m_zz + rest_z * k_z.transpose()));
        self.zd = m_zd + rest_z * k_d.transpose();
        self.dd = symmetric(&(m_dd + rest_d * k_d.transpose()));
        (k_z, k_d)
    }
}

fn symmetric<T: Scalar, const K: usize>(matrix: &SMatrix<T, K, K>) -> SMatrix<T, K, K> {
    (matrix + matrix.transpose()) * convert::<f64, T>(0.5)
}

impl<T: Scalar, const NX: usize, const NU: usize, const NY: usize, const ND: usize>
    EstimatorSettings<T, NX, NU, NY, ND>
{
    /// Enough steps for `duration` s.
    fn predictor(&self, duration: T) -> Rk4 {
        let mut substeps = 1;
        while convert::<f64, T>(substeps as f64) * self.longest_step < duration
            && substeps < MOST_STEPS
        {
            substeps += 1;
        }
        Rk4 { substeps }
    }

    fn initial_covariance(&self) -> Covariance<T, NX, ND> {
        self.spread(&self.initial_state, &self.initial_disturbance)
    }

    /// The covariance of (z, d) where x and d vary independently of each other. A disturbance
    /// that wanders moves z = x + E_x d, and leaves the state x that the sensors see.
    fn spread(
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

    fn check(&self) -> Result<(), EstimatorError> {
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
            let wrong = |variance: &T| !(least_allowed(variance) && variance.is_finite());
            if let Some(component) = variances.iter().position(wrong) {
                return Err(EstimatorError::Variance {
                    quantity,
                    component,
                });
            }
        }
        if self.gate.deviations > T::zero() && self.gate.oldest >= T::zero() {
            Ok(())
        } else {
            Err(EstimatorError::Gate)
        }
    }
}

/// A prediction over more steps than this is not worth its time.
const MOST_STEPS: usize = 1_000;
