//! The simulated world around a plant of any size.

use crate::check::{Axis, Names};
use crate::error::MpcError;
use crate::size::{MOST_INPUTS, MOST_STATES};
use crate::tasks::outputs_of_input;
use lpvmpc::{Dynamics, Reading};
use lpvmpc_plant::{Plant, SizedPlant};
use lpvmpc_sim::{Actuator, PlantError, Tolerances, WorldError, WorldPart};
use nalgebra::SVector;

/// Everything about a [`World`] but its plant and its start. `n` states, `m` inputs.
#[derive(Debug, Clone, PartialEq)]
pub struct WorldSettings {
    /// Time from one sample of the sensors to the next, s.
    pub period: f64,
    /// The sensors, at most 16; `None` means a perfect one of each state.
    pub sensors: Option<Vec<Sensor>>,
    /// The actuators, one per input; `None` means perfect ones.
    pub actuators: Option<Vec<Actuator>>,
    /// Time from a command to its arrival at the actuators, s.
    pub delay: f64,
    /// What pushes the plant, in any order.
    pub pushes: Vec<Push>,
    /// Seed of all noise: the same seed, the same run.
    pub seed: u64,
    /// Tolerances of the plant's integration.
    pub tolerances: Tolerances,
}

impl WorldSettings {
    /// A world without any fault, in which all states are measured every `period` seconds.
    pub fn ideal(period: f64) -> Self {
        Self {
            period,
            sensors: None,
            actuators: None,
            delay: 0.0,
            pushes: Vec::new(),
            seed: 0,
            tolerances: Tolerances {
                relative: 1e-9,
                absolute: 1e-9,
            },
        }
    }
}

/// What a sensor measures.
#[derive(Debug, Clone, PartialEq)]
pub enum Quantity {
    /// A linear combination of the states: these coefficients times x, n entries.
    Row(Vec<f64>),
    /// The output of this name, which must not depend on the input.
    Output(String),
}

/// One measured quantity, and what is wrong with it. Its numbers are those of [`lpvmpc_sim::Sensor`].
#[derive(Debug, Clone, PartialEq)]
pub struct Sensor {
    /// What it measures.
    pub of: Quantity,
    /// Standard deviation of the white Gaussian noise of a sample, in the quantity's unit.
    pub noise: f64,
    /// Constant error that is added, in the quantity's unit.
    pub bias: f64,
    /// Step between two readings, in the quantity's unit; 0 for a continuous reading.
    pub resolution: f64,
    /// Probability from 0 to 1 that a sample is missing.
    pub dropout: f64,
    /// It measures at every `every`-th sample of the world, at least 1.
    pub every: usize,
    /// What it measures is delivered so many samples of the world later.
    pub late: usize,
}

impl Sensor {
    /// A perfect sensor.
    pub fn ideal(of: Quantity) -> Self {
        Self {
            of,
            noise: 0.0,
            bias: 0.0,
            resolution: 0.0,
            dropout: 0.0,
            every: 1,
            late: 0,
        }
    }
}

/// A push at a known time. A load is added to the derivative of the state: x_dot = f(x, u) + load.
#[derive(Debug, Clone, PartialEq)]
pub enum Push {
    /// The state jumps.
    Jump {
        /// When, s.
        time: f64,
        /// Added to the state, in state units.
        change: Vec<f64>,
    },
    /// A constant load for a while.
    Load {
        /// From when on, s.
        from: f64,
        /// Until when, s; infinite for ever.
        until: f64,
        /// The load, in state units per second.
        load: Vec<f64>,
    },
}

/// A plant whose load is added to its derivative, or its next state, and whose outputs are measured.
#[derive(Debug, Clone)]
struct Loaded {
    plant: SizedPlant<MOST_STATES, MOST_INPUTS>,
    /// The output that each sensor measures, where it does.
    measured: Vec<Option<usize>>,
}

impl lpvmpc_sim::Plant<MOST_STATES, MOST_INPUTS, MOST_STATES> for Loaded {
    fn derivative(
        &self,
        x: &SVector<f64, MOST_STATES>,
        u: &SVector<f64, MOST_INPUTS>,
        load: &SVector<f64, MOST_STATES>,
    ) -> SVector<f64, MOST_STATES> {
        self.plant.f(x, u) + load
    }

    fn period(&self) -> Option<f64> {
        self.plant.plant().period()
    }

    fn measured(&self, i: usize, x: &SVector<f64, MOST_STATES>) -> Option<f64> {
        let output = (*self.measured.get(i)?)?;
        let plant = self.plant.plant();
        let x = &x.as_slice()[..plant.data().states.len()];
        let u = [0.0; MOST_INPUTS];
        let y = plant.output(x, &u[..plant.data().inputs.len()]).ok()?;
        y.get(output).copied()
    }
}

type Inner = lpvmpc_sim::World<Loaded, MOST_STATES, MOST_INPUTS, MOST_STATES, MOST_STATES>;

/// A plant behind sensors, actuators and a delay, stepped from outside: [`readings`](Self::readings),
/// [`command`](Self::command), [`advance`](Self::advance). The plant moves in continuous time,
/// integrated adaptively from event to event, or in steps of its own period.
#[derive(Debug, Clone)]
pub struct World {
    names: Names,
    sensors: usize,
    inner: Inner,
}

impl World {
    /// `plant` with its present parameters at the state `x` at time zero, without input, its first
    /// readings taken.
    ///
    /// # Errors
    /// The setting that makes no sense, by its name.
    pub fn new(plant: &Plant, x: &[f64], settings: &WorldSettings) -> Result<Self, MpcError> {
        let names = Names::new(plant);
        let x = names.finite(Axis::States, "x", x)?;
        let (sensors, measured) = sensors(plant, &names, settings)?;
        let count = settings
            .sensors
            .as_ref()
            .map_or(names.states.len(), Vec::len);
        let actuators = actuators(&names, settings)?;
        let pushes = settings.pushes.iter().enumerate();
        let pushes: Result<Vec<_>, _> = pushes
            .map(|(i, push)| names.push(&format!("pushes[{i}]"), push))
            .collect();
        // The integrator's error is a mean over the places; those left over have none.
        let share = (names.states.len() as f64 / MOST_STATES as f64).sqrt();
        let Tolerances { relative, absolute } = settings.tolerances;
        settings
            .tolerances
            .check()
            .map_err(|error| MpcError::new("tolerances", error.to_string()))?;
        let inner = Inner::new(
            Loaded {
                plant: SizedPlant::new(plant.clone())?,
                measured,
            },
            x,
            lpvmpc_sim::WorldSettings {
                period: settings.period,
                sensors,
                actuators,
                delay: settings.delay,
                disturbances: pushes?,
                seed: settings.seed,
                tolerances: Tolerances {
                    relative: (relative * share).max(1e-14),
                    absolute: absolute * share,
                },
            },
        );
        Ok(Self {
            inner: inner.map_err(|error| names.refused(&error, settings.sensors.as_deref()))?,
            names,
            sensors: count,
        })
    }

    /// The time, s.
    pub fn time(&self) -> f64 {
        self.inner.time()
    }

    /// The true state, in the plant's order and units.
    pub fn state(&self) -> &[f64] {
        &self.inner.state().as_slice()[..self.names.states.len()]
    }

    /// What the sensors deliver now, in their order; `None` where nothing arrived.
    pub fn readings(&self) -> &[Option<Reading<f64>>] {
        &self.inner.measurement().readings[..self.sensors]
    }

    /// The mean of the actuators' outputs over the last period, in input units.
    pub fn applied(&self) -> &[f64] {
        &self.inner.applied().as_slice()[..self.names.inputs.len()]
    }

    /// Commands `u` from now on; it arrives after the delay.
    ///
    /// # Errors
    /// It has not the plant's size, or is not finite.
    pub fn command(&mut self, u: &[f64]) -> Result<(), MpcError> {
        self.inner.command(self.names.finite(Axis::Inputs, "u", u)?);
        Ok(())
    }

    /// Adds a push. One whose time has passed acts at once.
    ///
    /// # Errors
    /// Its numbers make no sense.
    pub fn push(&mut self, push: &Push) -> Result<(), MpcError> {
        let push = self.names.push("push", push)?;
        let disturbed = self.inner.disturb(push);
        disturbed.map_err(|error| self.names.refused(&error, None))
    }

    /// Moves on by one period, and measures.
    ///
    /// # Errors
    /// The motion cannot be integrated; the state and the time then stay as they were.
    pub fn advance(&mut self) -> Result<(), PlantError> {
        self.inner.advance()
    }
}

type Sensors = [lpvmpc_sim::Sensor<MOST_STATES>; MOST_STATES];

/// The sensors in places that were compiled, and which output each measures, if it does. Those left over read zero.
fn sensors(
    plant: &Plant,
    names: &Names,
    settings: &WorldSettings,
) -> Result<(Sensors, Vec<Option<usize>>), MpcError> {
    let mut places = [lpvmpc_sim::Sensor::ideal(SVector::zeros()); MOST_STATES];
    let Some(sensors) = &settings.sensors else {
        let ideal = lpvmpc_sim::Sensor::ideal_states();
        let count = names.states.len();
        places[..count].copy_from_slice(&ideal[..count]);
        return Ok((places, Vec::new()));
    };
    if sensors.len() > MOST_STATES {
        let fault = format!(
            "there are {}; at most {MOST_STATES} can be simulated",
            sensors.len()
        );
        return Err(MpcError::new("sensors", fault));
    }
    let of_input = outputs_of_input(plant.data());
    let mut measured = Vec::with_capacity(sensors.len());
    for (i, (place, sensor)) in places.iter_mut().zip(sensors).enumerate() {
        let (row, output) = match &sensor.of {
            Quantity::Row(row) => {
                let row = names.finite(Axis::States, &format!("sensors[{i}], row"), row)?;
                (row, None)
            }
            Quantity::Output(name) => {
                let place = format!("sensors[{i}]");
                let output = names.measurable_output(&place, name, &of_input)?;
                (SVector::zeros(), Some(output))
            }
        };
        measured.push(output);
        *place = lpvmpc_sim::Sensor {
            row,
            noise: sensor.noise,
            bias: sensor.bias,
            resolution: sensor.resolution,
            dropout: sensor.dropout,
            every: sensor.every,
            late: sensor.late,
            stale: 0.0,
        };
    }
    Ok((places, measured))
}

/// The actuators in places that were compiled.
fn actuators(names: &Names, settings: &WorldSettings) -> Result<[Actuator; MOST_INPUTS], MpcError> {
    let mut places = [Actuator::default(); MOST_INPUTS];
    if let Some(actuators) = &settings.actuators {
        if actuators.len() != names.inputs.len() {
            let fault = format!(
                "there are {} for {} inputs",
                actuators.len(),
                names.inputs.len()
            );
            return Err(MpcError::new("actuators", fault));
        }
        places[..actuators.len()].copy_from_slice(actuators);
    }
    Ok(places)
}

impl Names {
    /// What a world refuses, by the names of what is measured and of the inputs.
    fn refused(&self, error: &WorldError, sensors: Option<&[Sensor]>) -> MpcError {
        let WorldError::Setting {
            part,
            quantity,
            value,
            expected,
        } = error
        else {
            return MpcError::new("world", error.to_string());
        };
        let of = |i: usize| match &sensors?.get(i)?.of {
            Quantity::Output(name) => Some(name.clone()),
            Quantity::Row(row) => {
                // Of a single state, by its name.
                let mut read = (0..row.len()).filter(|i| row[*i] != 0.0);
                let (first, more) = (read.next()?, read.next());
                self.states.get(first).filter(|_| more.is_none()).cloned()
            }
        };
        let named =
            |name: Option<String>| name.map_or_else(String::new, |name| format!(" ({name})"));
        let place = match *part {
            WorldPart::World => "world".to_owned(),
            WorldPart::Sensor(i) => format!("sensors[{i}]{}", named(of(i))),
            WorldPart::Actuator(j) => {
                format!("actuators[{j}]{}", named(self.inputs.get(j).cloned()))
            }
        };
        MpcError::new(place, format!("the {quantity} is {value}; {expected}"))
    }

    /// A push in places that were compiled.
    fn push(
        &self,
        place: &str,
        push: &Push,
    ) -> Result<lpvmpc_sim::Disturbance<MOST_STATES, MOST_STATES>, MpcError> {
        Ok(match push {
            Push::Jump { time, change } => lpvmpc_sim::Disturbance::Jump {
                time: *time,
                change: self.finite(Axis::States, place, change)?,
            },
            Push::Load { from, until, load } => lpvmpc_sim::Disturbance::Load {
                from: *from,
                until: *until,
                load: self.finite(Axis::States, place, load)?,
            },
        })
    }
}
