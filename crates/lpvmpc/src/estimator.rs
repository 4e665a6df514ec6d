//! A Kalman filter on the LPV model, with disturbances for offset-free tracking.

mod covariance;
mod settings;

use crate::model::{LpvModel, Scalar};
pub use covariance::Covariance;
use nalgebra::SVector;
pub use settings::{EstimatorError, EstimatorSettings, Gate, Reading, Verdict};

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
    /// The input of the last [`Estimator::advance`].
    input: SVector<T, NU>,
    rejected: [usize; NY],
}

/// A reading as it is expected, and how it depends on the present z and on d.
struct Expected<T, const NX: usize, const ND: usize> {
    value: T,
    c_z: SVector<T, NX>,
    c_d: SVector<T, ND>,
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
            input: SVector::zeros(),
            rejected: [0; NY],
        })
    }

    /// Starts again from the state `x`.
    pub fn reset(&mut self, x: SVector<T, NX>) {
        self.z = x;
        self.d = SVector::zeros();
        self.covariance = self.settings.initial_covariance();
        self.input = SVector::zeros();
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
        self.input = *u;
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

    /// What sensor `i` would have read `age` s ago, as far as the estimate knows.
    ///
    /// The model is followed back from the present, under the last input. What the estimate has
    /// learnt since is then learnt about the past, too; only what the model does not know counts as
    /// certain in between.
    fn expected(&self, i: usize, age: T) -> Expected<T, NX, ND> {
        let settings = &self.settings;
        let row = settings.c.row(i).transpose();
        let offset = -(settings.state_offset.transpose() * row);
        let now = Expected {
            value: row.dot(&self.z) + offset.dot(&self.d),
            c_z: row,
            c_d: offset,
        };
        if !(age > T::zero()) {
            return now;
        }
        let predictor = settings.predictor(age);
        let v = self.input + self.input_disturbance();
        let z = predictor.advance(&self.model, &self.z, &v, -age);
        let (a, b) = self.model.matrices(&self.model.scheduling(&self.z));
        let (a, b) = predictor.discretize(&a, &b, -age);
        Expected {
            value: row.dot(&z) + offset.dot(&self.d),
            c_z: a.transpose() * row,
            c_d: offset + (b * settings.input_offset).transpose() * row,
        }
    }

    /// Corrects with the reading of sensor `i`.
    fn correct(&mut self, i: usize, reading: &Reading<T>) -> Verdict {
        let gate = self.settings.gate;
        // Negated, so that an age that is not a number is too old.
        if !(reading.age <= gate.oldest) {
            return Verdict::Stale;
        }
        let Expected { value, c_z, c_d } = self.expected(i, reading.age);
        let noise = self.settings.measurement_noise[i];
        let error = reading.value - value;
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
