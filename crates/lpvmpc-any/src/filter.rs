//! The estimator of a plant of any size, behind one size that was chosen, and the inputs on their way.

use crate::check::{Axis, Names};
use crate::error::MpcError;
use crate::estimator::{Disturbance, Estimate, EstimatorSettings};
use crate::model::Model;
use crate::settings::{LinearModels, MpcSettings};
use crate::size::{smallest, too_many};
use crate::target::output_tangent;
use lpvmpc::{
    DelayLine, Dual, Estimator, EstimatorError, EstimatorSettings as OfEstimator, LpvModel,
    Reading, Verdict,
};
use lpvmpc_design::check_offset_free;
use lpvmpc_plant::{Plant, SizedPlant};
use nalgebra::{DMatrix, SMatrix, SVector};
use std::any::Any;

/// Where a reading comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Source {
    State(usize),
    Output(usize),
}

/// A plant with its sensors. Its inputs are those of the plant, and then a push on each state: x_dot = f(x, u) + w, or
/// x+ = F(x, u) + w.
#[derive(Debug, Clone)]
struct Sensed<const NX: usize, const NU: usize, const NS: usize> {
    model: Model<NX, NU, NS>,
    plant: Plant,
    measured: Vec<Source>,
}

impl<const NX: usize, const NU: usize, const NS: usize> LpvModel<f64, NX, NS, NS>
    for Sensed<NX, NU, NS>
{
    fn period(&self) -> Option<f64> {
        self.model.period()
    }

    fn scheduling(&self, x: &SVector<f64, NX>, w: &SVector<f64, NS>) -> SVector<f64, NS> {
        self.model.scheduling(x, &input(w))
    }

    fn matrices(
        &self,
        scheduling: &SVector<f64, NS>,
    ) -> (SMatrix<f64, NX, NX>, SMatrix<f64, NX, NS>) {
        let (a, b) = self.model.matrices(scheduling);
        let joint = SMatrix::from_fn(|i, j| match j.checked_sub(NU) {
            None => b[(i, j)],
            Some(j) => f64::from(u8::from(i == j)),
        });
        (a, joint)
    }

    fn derivative(&self, x: &SVector<f64, NX>, w: &SVector<f64, NS>) -> SVector<f64, NX> {
        self.model.derivative(x, &input(w)) + push(w)
    }

    fn sensor(&self, i: usize, x: &SVector<f64, NX>) -> Option<(f64, SVector<f64, NX>)> {
        let Some(Source::Output(k)) = self.measured.get(i) else {
            return None;
        };
        let data = self.plant.data();
        let states: Vec<Dual<f64, NX>> = Dual::variables(x).iter().copied().collect();
        let inputs = vec![Dual::fixed(0.0); data.inputs.len()];
        let y = self
            .plant
            .output(&states[..data.states.len()], &inputs)
            .ok()?;
        let y = y.get(*k)?;
        Some((y.value, SVector::from(y.slopes)))
    }
}

fn input<const NU: usize, const NS: usize>(w: &SVector<f64, NS>) -> SVector<f64, NU> {
    SVector::from_fn(|j, _| w[j])
}

fn push<const NX: usize, const NS: usize>(w: &SVector<f64, NS>) -> SVector<f64, NX> {
    SVector::from_fn(|i, _| w[NS - NX + i])
}

/// What acts on the inputs and on the states as one input.
fn joint<const NU: usize, const NS: usize>(u: &[f64], push: &[f64]) -> SVector<f64, NS> {
    SVector::from_fn(|i, _| {
        let entry = match i.checked_sub(NU) {
            None => u.get(i),
            Some(i) => push.get(i),
        };
        entry.copied().unwrap_or(0.0)
    })
}

/// A filter in the smallest size with places for the plant's states, whatever the controller adds to them.
///
/// # Errors
/// The setting that makes no sense.
pub(crate) fn filter(
    plant: &Plant,
    mpc: &MpcSettings,
    settings: &EstimatorSettings,
) -> Result<Box<dyn AnyFilter>, MpcError> {
    let data = plant.data();
    let places = (data.states.len(), data.inputs.len());
    smallest!(places, filter_of_size(plant, mpc, settings))
        .unwrap_or_else(|| Err(too_many(places, 0)))
}

fn filter_of_size<const NX: usize, const NU: usize, const NS: usize>(
    plant: &Plant,
    mpc: &MpcSettings,
    settings: &EstimatorSettings,
) -> Result<Box<dyn AnyFilter>, MpcError> {
    Ok(Box::new(Filter::<NX, NU, NS>::new(plant, mpc, settings)?))
}

/// A filter whose size nobody sees, and the inputs on their way; its vectors have the plant's sizes.
pub(crate) trait AnyFilter: Any + Send + Sync {
    fn settings(&self) -> &EstimatorSettings;
    /// Starts again, without a reading and without inputs on their way.
    fn reset(&mut self);
    /// Goes on from where `previous` stands, a filter of the same plant with other settings or parameters.
    fn take_over(&mut self, previous: &dyn AnyFilter);
    /// Takes in readings: what became of each, and whether the filter has begun anew.
    fn observe(
        &mut self,
        t: f64,
        readings: &[Option<f64>],
    ) -> Result<(Vec<Verdict>, bool), MpcError>;
    /// The state when the next input will act; not a number where there is no estimate.
    fn ahead(&self) -> Vec<f64>;
    /// What acts beside the input, and on the states.
    fn disturbance(&self) -> (Vec<f64>, Vec<f64>);
    /// The input `u` was sent, and the disturbance `d` on the states is known to act with it.
    fn send(&mut self, u: &[f64], d: &[f64]);
    /// The input `u` was sent in place of the last one, under the same known disturbance; before the first one it acts
    /// already.
    fn correct(&mut self, u: &[f64]);
    fn estimate(&self) -> Estimate;
}

struct Filter<const NX: usize, const NU: usize, const NS: usize> {
    settings: EstimatorSettings,
    /// The plant's states and inputs.
    sizes: (usize, usize),
    estimator: Estimator<Sensed<NX, NU, NS>, f64, NX, NS, NS, NX, NX>,
    line: DelayLine<f64, NS>,
    /// The disturbance on the states that is known to act with the last input.
    known: Vec<f64>,
    /// The plant's period in discrete time, s.
    period: Option<f64>,
    /// The time of the first readings, s, from which its periods count.
    first: Option<f64>,
    start: SVector<f64, NX>,
}

impl<const NX: usize, const NU: usize, const NS: usize> Filter<NX, NU, NS> {
    fn new(
        plant: &Plant,
        mpc: &MpcSettings,
        settings: &EstimatorSettings,
    ) -> Result<Self, MpcError> {
        let names = &Names::new(plant);
        let equilibrium = SizedPlant::<NX, NU>::new(plant.clone())?.equilibrium();
        let rest = equilibrium.unwrap_or((SVector::zeros(), SVector::zeros()));
        let place = |part: &str| format!("estimator, {part}");
        let measured = sources(plant, names, settings, NX)?;
        let count = measured.len();
        let same = |part: &str, found: usize, needed: usize, of: &str| {
            if found == needed {
                return Ok(());
            }
            let fault =
                format!("it has {found} entries; there must be {needed}, one for each {of}");
            Err(MpcError::new(place(part), fault))
        };
        let (n, m) = (names.states.len(), names.inputs.len());
        same(
            "measurement_noise",
            settings.measurement_noise.len(),
            count,
            "reading",
        )?;
        same("state_noise", settings.state_noise.len(), n, "state")?;
        same("initial_state", settings.initial_state.len(), n, "state")?;
        check_variances(names, settings)?;
        let delay = settings.delay;
        if !(delay >= 0.0 && delay <= 1000.0 * mpc.t_s) {
            let fault = format!("it is {delay} s; it must be from 0 to 1000 samples");
            return Err(MpcError::new(place("delay"), fault));
        }
        if let Some(period) = plant.period()
            && ((delay / period).round() * period - delay).abs() > 1e-9 * period
        {
            let fault =
                format!("it is {delay} s; it must be a whole number of periods of {period} s");
            return Err(MpcError::new(place("delay"), fault));
        }
        let mut offset = SMatrix::<f64, NS, NX>::zeros();
        for (k, disturbance) in settings.disturbances.iter().enumerate() {
            let of = |list: &[String]| list.iter().position(|name| *name == disturbance.on);
            let place = match (of(&names.inputs), of(&names.states)) {
                (Some(j), _) => j,
                (None, Some(i)) => NU + i,
                (None, None) => {
                    let known: Vec<String> = [&names.inputs[..], &names.states[..]].concat();
                    let fault = format!(
                        "{:?} is no input or state; there are {}",
                        disturbance.on,
                        known.join(", ")
                    );
                    return Err(MpcError::new(place("disturbances"), fault));
                }
            };
            if k >= NX {
                let fault = format!("there are more than {NX}");
                return Err(MpcError::new("estimator, disturbances", fault));
            }
            offset[(place, k)] = 1.0;
        }
        let model = Model::new(plant, LinearModels::AlongMotion, rest)?;
        let sensed = Sensed {
            model,
            plant: plant.clone(),
            measured,
        };
        sensed.check_observable(settings, (n, m), rest, &offset)?;
        let of_disturbances = |of: &dyn Fn(&Disturbance) -> f64| {
            let all: Vec<f64> = settings.disturbances.iter().map(of).collect();
            filled(&all)
        };
        let noise = &settings.measurement_noise;
        let of_estimator = OfEstimator {
            longest_step: mpc.t_s / mpc.substeps.max(1) as f64,
            c: SMatrix::from_fn(|i, j| match sensed.measured.get(i) {
                Some(Source::State(k)) => f64::from(u8::from(*k == j)),
                _ => 0.0,
            }),
            state_offset: SMatrix::zeros(),
            input_offset: offset,
            state_noise: filled(&settings.state_noise),
            disturbance_noise: of_disturbances(&|one| one.noise),
            // What is left over is no sensor.
            measurement_noise: SVector::from_fn(|i, _| {
                noise.get(i).copied().unwrap_or(f64::INFINITY)
            }),
            initial_state: filled(&settings.initial_state),
            initial_disturbance: of_disturbances(&|one| one.initial),
            gate: settings.gate,
        };
        let start = match &settings.start {
            Some(start) => names.finite(Axis::States, "estimator, start", start)?,
            None => rest.0,
        };
        let estimator =
            Estimator::allocate(sensed, of_estimator, start, 1).map_err(|error| match error {
                EstimatorError::Gate => MpcError::new(place("gate"), error.to_string()),
                _ => MpcError::new("estimator", error.to_string()),
            })?;
        let commands = DelayLine::<f64, NS>::places(delay, mpc.t_s);
        Ok(Self {
            settings: settings.clone(),
            sizes: (n, m),
            estimator,
            line: DelayLine::allocate(commands),
            known: Vec::new(),
            period: plant.period(),
            first: None,
            start,
        })
    }

    /// The time of readings that were taken at `t`. In discrete time, where the plant has no state in between, it is the
    /// nearest of its periods: rounded from reading to reading, several within a period would take none or too many.
    fn instant(&mut self, t: f64) -> f64 {
        match self.period {
            Some(period) if t.is_finite() => {
                let first = *self.first.get_or_insert(t);
                first + ((t - first) / period).round() * period
            }
            _ => t,
        }
    }
}

impl<const NX: usize, const NU: usize, const NS: usize> AnyFilter for Filter<NX, NU, NS> {
    fn settings(&self) -> &EstimatorSettings {
        &self.settings
    }

    fn reset(&mut self) {
        self.estimator.begin_at(None, self.start);
        self.line.clear();
        self.known.clear();
        self.first = None;
    }

    fn take_over(&mut self, previous: &dyn AnyFilter) {
        let previous: &dyn Any = previous;
        if let Some(previous) = previous.downcast_ref::<Self>() {
            self.estimator.take_over(&previous.estimator);
            self.line.copy_from(&previous.line);
            self.known.clone_from(&previous.known);
            self.first = previous.first;
        }
    }

    fn observe(
        &mut self,
        t: f64,
        readings: &[Option<f64>],
    ) -> Result<(Vec<Verdict>, bool), MpcError> {
        let count = self.settings.measured.len();
        if readings.len() != count {
            let names = self.settings.measured.join(", ");
            let fault = format!(
                "{} readings; there must be {count} ({names})",
                readings.len()
            );
            return Err(MpcError::new("readings", fault));
        }
        let readings = std::array::from_fn(|i| {
            let reading = readings.get(i).copied().flatten();
            reading.map(Reading::fresh)
        });
        let t = self.instant(t);
        let observation = self.estimator.observe(t, &mut self.line, &readings);
        let verdicts = observation.verdicts[..count].to_vec();
        Ok((verdicts, observation.restart.is_some()))
    }

    fn ahead(&self) -> Vec<f64> {
        let states = self.sizes.0;
        if self.estimator.time().is_none() || self.estimator.is_lost() {
            return vec![f64::NAN; states];
        }
        let mut z = *self.estimator.model_state();
        self.line.for_each(self.settings.delay, |duration, w| {
            z = self.estimator.predict(&z, w, duration);
        });
        z.as_slice()[..states].to_vec()
    }

    fn disturbance(&self) -> (Vec<f64>, Vec<f64>) {
        let w = self.estimator.input_disturbance();
        let (states, inputs) = self.sizes;
        (
            w.as_slice()[..inputs].to_vec(),
            w.as_slice()[NU..][..states].to_vec(),
        )
    }

    fn send(&mut self, u: &[f64], d: &[f64]) {
        let sent = joint::<NU, NS>(u, d);
        self.line.command(sent, self.settings.delay);
        self.known = d.to_vec();
    }

    fn correct(&mut self, u: &[f64]) {
        self.line.correct(joint::<NU, NS>(u, &self.known));
    }

    fn estimate(&self) -> Estimate {
        let d = self.estimator.disturbance();
        Estimate {
            x: self.estimator.state().as_slice()[..self.sizes.0].to_vec(),
            disturbances: d.as_slice()[..self.settings.disturbances.len()].to_vec(),
        }
    }
}

/// The entries, with zero in the places that are left over.
fn filled<const K: usize>(entries: &[f64]) -> SVector<f64, K> {
    SVector::from_fn(|i, _| entries.get(i).copied().unwrap_or(0.0))
}

impl<const NX: usize, const NU: usize, const NS: usize> Sensed<NX, NU, NS> {
    /// Whether the disturbances can be told from the readings where the plant stands.
    fn check_observable(
        &self,
        settings: &EstimatorSettings,
        (n, m): (usize, usize),
        (x, u): (SVector<f64, NX>, SVector<f64, NU>),
        offset: &SMatrix<f64, NS, NX>,
    ) -> Result<(), MpcError> {
        let (a, b) = self.model.jacobian(&x, &u);
        let discrete = f64::from(u8::from(self.period().is_some()));
        let unit = |i: usize, j: usize| f64::from(u8::from(i == j));
        let a = DMatrix::from_fn(n, n, |i, j| a[(i, j)] - discrete * unit(i, j));
        let b_d = DMatrix::from_fn(n, settings.disturbances.len(), |i, k| {
            let of_inputs: f64 = (0..m).map(|j| b[(i, j)] * offset[(j, k)]).sum();
            of_inputs + offset[(NU + i, k)]
        });
        let outputs = output_tangent(&self.plant, &x.as_slice()[..n], &u.as_slice()[..m]);
        let c = DMatrix::from_fn(self.measured.len(), n, |i, j| match self.measured[i] {
            Source::State(k) => unit(k, j),
            Source::Output(k) => outputs
                .as_ref()
                .map_or(f64::NAN, |(_, slopes)| slopes[(k, j)]),
        });
        let c_d = DMatrix::zeros(c.nrows(), b_d.ncols());
        check_offset_free(&a, &b_d, &c, &c_d).map_err(|error| {
            if settings.disturbances.is_empty() {
                let fault = "steady states of the plant cannot be told from each other by what is \
                             measured: measure more";
                return MpcError::new("estimator, measured", fault);
            }
            MpcError::new("estimator, disturbances", error.to_string())
        })
    }
}

/// Variances that are none, by name; the estimator itself knows them by number.
fn check_variances(names: &Names, settings: &EstimatorSettings) -> Result<(), MpcError> {
    let check = |part: &str, name: &str, variance: f64, least: &str, is_right: bool| {
        if is_right {
            return Ok(());
        }
        let fault = format!("the variance of {name} is {variance}; it must be {least}");
        Err(MpcError::new(format!("estimator, {part}"), fault))
    };
    for (name, variance) in settings.measured.iter().zip(&settings.measurement_noise) {
        // An infinite one is that of a sensor that the filter does without.
        let is_right = *variance > 0.0;
        check("measured", name, *variance, "a positive number", is_right)?;
    }
    let of_states = [
        ("state_noise", &settings.state_noise),
        ("initial_state", &settings.initial_state),
    ];
    let of_states = of_states.into_iter().flat_map(|(part, variances)| {
        let pairs = names.states.iter().zip(variances);
        pairs.map(move |(name, variance)| (part, name, *variance))
    });
    let of_disturbances = settings.disturbances.iter().flat_map(|one| {
        [
            ("disturbances, noise", &one.on, one.noise),
            ("disturbances, initial", &one.on, one.initial),
        ]
    });
    for (part, name, variance) in of_states.chain(of_disturbances) {
        let is_right = variance >= 0.0 && variance.is_finite();
        check(part, name, variance, "a number from 0 on", is_right)?;
    }
    Ok(())
}

/// Where the readings come from.
fn sources(
    plant: &Plant,
    names: &Names,
    settings: &EstimatorSettings,
    most: usize,
) -> Result<Vec<Source>, MpcError> {
    let place = "estimator, measured";
    if settings.measured.is_empty() || settings.measured.len() > most {
        let fault = format!(
            "there are {}; there must be from 1 to {most}",
            settings.measured.len()
        );
        return Err(MpcError::new(place, fault));
    }
    let of_input = crate::tasks::outputs_of_input(plant.data());
    let source = |name: &String| match names.states.iter().position(|known| known == name) {
        Some(i) => Ok(Source::State(i)),
        None => {
            let output = names.measurable_output(place, name, &of_input)?;
            Ok(Source::Output(output))
        }
    };
    settings.measured.iter().map(source).collect()
}
