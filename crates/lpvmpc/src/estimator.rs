//! A Kalman filter on the LPV model, with disturbances for offset-free tracking.

mod covariance;
mod history;
mod innovation;
mod memory;
mod observation;
mod settings;

use crate::clock::{Clock, Tick};
use crate::delay::DelayLine;
use crate::model::{LpvModel, Scalar};
use crate::predictor::{over_periods, periods};
pub use covariance::Covariance;
use history::{Estimate, History, Instant, Taken, Trust};
pub use memory::{EstimatorArrays, EstimatorMemory};
use nalgebra::{SMatrix, SVector};
pub use observation::{Observation, Restart, Verdict};
pub use settings::{EstimatorError, EstimatorSettings, Gate, Reading};

/// An extended Kalman filter whose covariance follows the LPV model at the estimated scheduling,
/// updated one sensor at a time in Joseph's form (Bucy and Joseph 1968; Simon, Optimal State
/// Estimation, 2006, ch. 6.1 and 5).
///
/// Sensors may come and go: each update uses what there is. A reading that comes late is taken in
/// at the instant when it was taken, and the filter goes through the time since again; so the
/// estimate is that of a filter that had every reading in time (Bar-Shalom, Li and Kirubarajan,
/// Estimation with Applications to Tracking and Navigation, 2001, ch. 6.9). For this it remembers
/// its last instants, one per [`advance`](Self::advance) and one per reading that was taken between
/// two: what is older is stale. 1 does where no reading is ever late.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub struct Estimator<
    P,
    T: 'static,
    const NX: usize,
    const NU: usize,
    const NS: usize,
    const NY: usize,
    const ND: usize,
> {
    model: P,
    settings: EstimatorSettings<T, NX, NU, NY, ND>,
    /// The state that it begins from, and begins anew from.
    start: SVector<T, NX>,
    now: Estimate<T, NX, ND>,
    history: History<T, NX, NU, NY, ND>,
    rejected: [usize; NY],
    /// Which sensors have been believed since the beginning.
    heard: [bool; NY],
    clock: Clock,
    /// Time since a reading was believed, s.
    silence: T,
    /// Why there is no estimate, if there is none.
    lost: Option<Restart>,
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize, const NY: usize, const ND: usize>
    Estimator<P, T, NX, NU, NS, NY, ND>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    /// An estimator that starts from the state `x` without disturbance, also when it begins anew
    /// after a gap, and remembers as many instants as there is memory for, at least 1.
    ///
    /// # Errors
    /// An [`EstimatorError`] names the first setting that makes no sense.
    pub fn new(
        model: P,
        settings: EstimatorSettings<T, NX, NU, NY, ND>,
        x: SVector<T, NX>,
        memory: EstimatorMemory<T, NX, NU, NY, ND>,
    ) -> Result<Self, EstimatorError> {
        settings.check()?;
        if memory.0.is_empty() {
            return Err(EstimatorError::Memory);
        }
        let now = settings.initial(x);
        Ok(Self {
            model,
            settings,
            start: x,
            now,
            history: History::new(memory.0, now),
            rejected: [0; NY],
            heard: [false; NY],
            clock: Clock::default(),
            silence: T::zero(),
            lost: None,
        })
    }

    /// The same with memory of its own, for so many `instants`.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    #[cfg(feature = "alloc")]
    pub fn allocate(
        model: P,
        settings: EstimatorSettings<T, NX, NU, NY, ND>,
        x: SVector<T, NX>,
        instants: usize,
    ) -> Result<Self, EstimatorError> {
        Self::new(model, settings, x, EstimatorMemory::allocate(instants))
    }

    /// Starts again from the state `x`, this time: after a gap it is the one that it was made with.
    /// The clock goes on.
    pub fn reset(&mut self, x: SVector<T, NX>) {
        self.begin(self.settings.initial(x));
        self.heard = [false; NY];
    }

    /// Starts again from the state `x` at the time `stamp` (s), if that is known.
    pub fn begin_at(&mut self, stamp: Option<f64>, x: SVector<T, NX>) {
        self.reset(x);
        self.clock.reset();
        if let Some(stamp) = stamp {
            self.clock.tick::<T>(stamp);
        }
    }

    /// Goes on from where `previous` stands, which has other settings or another model: state,
    /// covariance, past and clock. The disturbance is taken over if it acts in the same way, else
    /// it is to be found anew.
    pub fn take_over(&mut self, previous: &Self) {
        let offsets = |of: &Self| (of.settings.state_offset, of.settings.input_offset);
        if offsets(self) == offsets(previous) {
            self.now = previous.now;
            self.history.copy_from(&previous.history);
        } else {
            let disturbance = &self.settings.initial_disturbance;
            let mut covariance = self.settings.spread(&SVector::zeros(), disturbance);
            covariance.zz += previous.state_covariance();
            self.begin(Estimate {
                z: previous.state(),
                d: SVector::zeros(),
                covariance,
            });
        }
        self.clock = previous.clock;
        self.silence = previous.silence;
        self.lost = previous.lost;
        self.heard = previous.heard;
        self.rejected = previous.rejected;
    }

    fn begin(&mut self, now: Estimate<T, NX, ND>) {
        self.now = now;
        self.history.begin(now);
        self.rejected = [0; NY];
        self.silence = T::zero();
        self.lost = None;
    }

    /// The estimated state x, as the sensors see it.
    pub fn state(&self) -> SVector<T, NX> {
        self.now.z - self.settings.state_offset * self.now.d
    }

    /// The estimated state z = x + E_x d, as the model sees it.
    pub fn model_state(&self) -> &SVector<T, NX> {
        &self.now.z
    }

    /// The estimated disturbance d.
    pub fn disturbance(&self) -> &SVector<T, ND> {
        &self.now.d
    }

    /// E_u d: what acts on the plant besides the input, in input units.
    pub fn input_disturbance(&self) -> SVector<T, NU> {
        self.settings.input_offset * self.now.d
    }

    /// The covariance of the estimate.
    pub fn covariance(&self) -> &Covariance<T, NX, ND> {
        &self.now.covariance
    }

    /// The covariance of the state x, `NX` x `NX`.
    fn state_covariance(&self) -> SMatrix<T, NX, NX> {
        let Covariance { zz, zd, dd } = self.now.covariance;
        let offset = &self.settings.state_offset;
        let mixed = zd * offset.transpose();
        zz - mixed - mixed.transpose() + offset * dd * offset.transpose()
    }

    /// The settings.
    pub fn settings(&self) -> &EstimatorSettings<T, NX, NU, NY, ND> {
        &self.settings
    }

    /// The stamp of the last measurement that was [observed](Self::observe), s; `None` before the
    /// first.
    pub fn time(&self) -> Option<f64> {
        self.clock.now()
    }

    /// Whether there is no estimate: there were measurements but no reading yet, none was believed for
    /// longer than [`Gate::longest_gap`], or the last estimate became non-finite. It begins anew with the
    /// next measurement that has a reading.
    pub fn is_lost(&self) -> bool {
        self.lost.is_some()
    }

    /// The model's state `duration` s after `z`, under the input `u` and the estimated
    /// disturbance.
    pub fn predict(&self, z: &SVector<T, NX>, u: &SVector<T, NU>, duration: T) -> SVector<T, NX> {
        self.flow(z, &self.now.d, u, duration)
    }

    fn flow(
        &self,
        z: &SVector<T, NX>,
        d: &SVector<T, ND>,
        u: &SVector<T, NU>,
        duration: T,
    ) -> SVector<T, NX> {
        let v = u + self.settings.input_offset * d;
        let predictor = self.settings.predictor(duration);
        predictor.advance(&self.model, z, &v, duration)
    }

    /// Takes in a measurement by its `stamp` (s, see [`Clock`]): moves the estimate on to it under
    /// the inputs of `line`, which elapses, and corrects it with the `readings`, whose ages count
    /// from the stamp.
    ///
    /// Time begins with the first measurement, the estimate with the first reading, which corrects
    /// the state that it starts from as it was when the reading was taken. An estimate that no reading has corrected for
    /// longer than [`Gate::longest_gap`], or that is not finite any more, is given up, and begins
    /// anew, from the state that the estimator was made with, with the first measurement that has a reading; so it does when the stamps go back by
    /// more than that. A measurement out of order changes nothing.
    pub fn observe(
        &mut self,
        stamp: f64,
        line: &mut DelayLine<T, NU>,
        readings: &[Option<Reading<T>>; NY],
    ) -> Observation<NY> {
        let needed = self.settings.needed(readings);
        let mut observation = self.observe_needed(stamp, line, &needed);
        self.settings.mark_unneeded(&mut observation.verdicts);
        observation
    }

    fn observe_needed(
        &mut self,
        stamp: f64,
        line: &mut DelayLine<T, NU>,
        readings: &[Option<Reading<T>>; NY],
    ) -> Observation<NY> {
        let longest_gap = self.settings.gate.longest_gap;
        let mut begins = None;
        match self.clock.tick(stamp) {
            Tick::First => self.lost = Some(Restart::Start),
            Tick::Elapsed(duration) => self.elapse(duration, line),
            Tick::Backward(by) if by <= longest_gap => {
                return Observation::refused(readings, Verdict::Stale);
            }
            Tick::Backward(_) => {
                self.clock.reset();
                self.clock.tick::<T>(stamp);
                self.lost = Some(Restart::ClockSetBack);
            }
            Tick::NotFinite => return Observation::refused(readings, Verdict::NotFinite),
        }
        if self.lost.is_some() {
            let gate = &self.settings.gate;
            let usable = |reading: &&Reading<T>| {
                gate.refuses(reading).is_none() && reading.age < longest_gap
            };
            let ages = readings.iter().flatten().filter(usable).map(|one| one.age);
            let Some(oldest) = ages.reduce(|a, b| if a > b { a } else { b }) else {
                return Observation::useless(readings, gate);
            };
            begins = self.lost.take();
            if begins != Some(Restart::Start) {
                self.reset(self.start);
            }
            self.begin_earlier(oldest, line);
        }
        let verdicts = self.update(readings);
        if begins.is_some() && !verdicts.iter().any(|verdict| verdict.is_used()) {
            self.reset(self.start);
            self.lost = begins.take();
        }
        Observation {
            verdicts,
            restart: begins,
        }
    }

    /// The past begins `age` s ago: a late reading corrects the state as it was then.
    #[cold] // Seldom: its room on the stack is not that of every measurement.
    #[inline(never)]
    fn begin_earlier(&mut self, age: T, line: &DelayLine<T, NU>) {
        if age > T::zero() {
            self.advance(&line.acting(), age);
        }
    }

    /// Moves the estimate on by `duration` s under the inputs of `line`.
    fn elapse(&mut self, duration: T, line: &mut DelayLine<T, NU>) {
        self.silence += duration;
        // Negated, so that a time that is NaN is too long.
        if self.lost.is_none() && !(self.silence <= self.settings.gate.longest_gap) {
            self.lost = Some(Restart::Gap);
        }
        if self.lost.is_none() {
            line.for_each(duration, |duration, u| self.advance(u, duration));
            if !self.now.is_finite() {
                self.lost = Some(Restart::NotFinite);
            }
        }
        line.elapse(duration);
    }

    /// Moves the estimate on by `duration` s, positive, under the constant input `u`.
    pub fn advance(&mut self, u: &SVector<T, NU>, duration: T) {
        self.now = self.moved(&self.now, u, duration);
        self.history.advance(u, duration, self.now);
    }

    /// The estimate `duration` s after `from`, under the input `u`.
    fn moved(
        &self,
        from: &Estimate<T, NX, ND>,
        u: &SVector<T, NU>,
        duration: T,
    ) -> Estimate<T, NX, ND> {
        let settings = &self.settings;
        let predictor = settings.predictor(duration);
        let v = u + settings.input_offset * from.d;
        let (a, b) = self.model.matrices(&self.model.scheduling(&from.z, &v));
        let (a, b) = match self.model.period() {
            Some(period) => over_periods(&a, &b, periods(period, duration)),
            None => predictor.discretize(&a, &b, duration),
        };
        let g = b * settings.input_offset;
        let Covariance { zz, zd, dd } = from.covariance;
        let mixed = a * zd * g.transpose();
        let mut covariance = Covariance {
            zz: a * zz * a.transpose() + mixed + mixed.transpose() + g * dd * g.transpose(),
            zd: a * zd + g * dd,
            dd,
        };
        let wandered = settings.spread(
            &(settings.state_noise * duration),
            &(settings.disturbance_noise * duration),
        );
        covariance.zz += wandered.zz;
        covariance.zd += wandered.zd;
        covariance.dd += wandered.dd;
        Estimate {
            z: self.flow(&from.z, &from.d, u, duration),
            d: from.d,
            covariance,
        }
    }

    /// Corrects the estimate with what the sensors delivered, and says what became of each
    /// reading. The work is at most one prediction for each instant that is remembered.
    pub fn update(&mut self, readings: &[Option<Reading<T>>; NY]) -> [Verdict; NY] {
        let mut verdicts = [Verdict::Missing; NY];
        let needed = self.settings.needed(readings);
        for (i, (verdict, reading)) in verdicts.iter_mut().zip(&needed).enumerate() {
            if let Some(reading) = reading {
                *verdict = self.file(i, reading);
            }
        }
        self.go_through_again(&mut verdicts);
        self.settings.mark_unneeded(&mut verdicts);
        if verdicts.iter().any(|verdict| verdict.is_used()) {
            self.silence = T::zero();
        }
        verdicts
    }

    /// Puts the reading of sensor `i` to the instant when it was taken; `Used` until it is judged.
    fn file(&mut self, i: usize, reading: &Reading<T>) -> Verdict {
        if let Some(refused) = self.settings.gate.refuses(reading) {
            return refused;
        }
        // Instants closer together than rounding tells are one.
        let resolution = T::default_epsilon().sqrt() * self.settings.longest_step;
        let instant = self.history.at(reading.age, resolution);
        let place = instant
            .and_then(|instant| self.history.get_mut(instant))
            .and_then(|instant| instant.readings.get_mut(i));
        match place {
            None => Verdict::Stale,
            Some(Some(_)) => Verdict::Repeated,
            Some(place) => {
                *place = Some(Taken {
                    value: reading.value,
                    trust: Trust::New,
                });
                Verdict::Used
            }
        }
    }

    /// Filters again from the first instant that has something new, whose readings are judged.
    fn go_through_again(&mut self, verdicts: &mut [Verdict; NY]) {
        let Some(first) = self.history.first_with_news() else {
            return;
        };
        let mut prior = None;
        let last = self.history.len() - 1;
        for i in first..=last {
            let Some(mut instant) = self.history.get(i).copied() else {
                return;
            };
            instant.prior = prior.or(instant.prior);
            let Some(mut estimate) = instant.prior else {
                return;
            };
            // Each further time because one more reading speaks of a blow.
            while !self.take_in(&mut instant.readings, &mut estimate, verdicts) {
                estimate = instant.prior.unwrap_or(estimate);
            }
            if i < last {
                prior = Some(self.moved(&estimate, &instant.u, instant.duration));
            } else {
                self.now = estimate;
            }
            if let Some(place) = self.history.get_mut(i) {
                *place = instant;
            }
        }
    }

    /// Whether the estimate makes the `value` of sensor `i` likely, and what follows from that.
    fn judge(&mut self, i: usize, value: T, estimate: &Estimate<T, NX, ND>) -> (Verdict, Trust) {
        let (error, c_z, c_d) = self.error(i, value, estimate);
        let variance = estimate.covariance.of(&c_z, &c_d) + self.settings.measurement_noise[i];
        let excess = error * error / variance;
        let mut judgement = (Verdict::Used, Trust::Plain);
        if let Some(patience) = self.settings.gate.patience_with(excess) {
            let patient = self.heard[i] && self.rejected[i] < patience;
            if patient || !excess.is_finite() {
                self.rejected[i] += 1;
                return (Verdict::Outlier, Trust::New);
            }
            judgement = (Verdict::UsedAfterBlow, Trust::AfterBlow);
        }
        self.rejected[i] = 0;
        self.heard[i] = true;
        judgement
    }

    /// Corrects an estimate with the readings of an instant, and judges those that are new. `false`,
    /// and the estimate of no use, if one of these says that there was a blow: the state's variance
    /// has to be raised before all readings of the instant.
    fn take_in(
        &mut self,
        readings: &mut [Option<Taken<T>>; NY],
        estimate: &mut Estimate<T, NX, ND>,
        verdicts: &mut [Verdict; NY],
    ) -> bool {
        let after_blow = |taken: &&Taken<T>| taken.trust == Trust::AfterBlow;
        let struck = readings.iter().flatten().any(|taken| after_blow(&taken));
        let struck = struck.then(|| {
            let shown = readings.iter().enumerate().filter_map(|(i, taken)| {
                let taken = taken.as_ref()?;
                Some(self.error(i, taken.value, estimate).1)
            });
            self.settings.struck(shown)
        });
        for (i, taken) in readings.iter().enumerate() {
            if let (Some(taken), Some(struck)) = (taken.as_ref().filter(after_blow), &struck) {
                let (error, c_z, _) = self.error(i, taken.value, estimate);
                estimate.covariance.open(struck, &c_z, error);
            }
        }
        for (i, (place, verdict)) in readings.iter_mut().zip(verdicts).enumerate() {
            let Some(taken) = place else {
                continue;
            };
            if taken.trust == Trust::New {
                (*verdict, taken.trust) = self.judge(i, taken.value, estimate);
                match taken.trust {
                    Trust::Plain => {}
                    Trust::AfterBlow => return false,
                    Trust::New => {
                        *place = None;
                        continue;
                    }
                }
            }
            let (error, c_z, c_d) = self.error(i, taken.value, estimate);
            let noise = self.settings.measurement_noise[i];
            let (k_z, k_d) = estimate.covariance.correct(&c_z, &c_d, noise);
            estimate.z += k_z * error;
            estimate.d += k_d * error;
        }
        true
    }
}
