//! The world as it is: a plant behind sensors, actuators and a delay, which is pushed.

use crate::actuator::Actuator;
use crate::disturbance::Disturbance;
use crate::plant::{Plant, PlantError, Tolerances, integrate};
use crate::sensor::{Channel, Sensor};
use lpvmpc::{Measurement, Reading};
use nalgebra::SVector;
use std::collections::VecDeque;
use std::fmt;
use thiserror::Error;

/// Everything about a [`World`] but its plant and its start.
#[derive(Clone, Debug, PartialEq)]
pub struct WorldSettings<const NX: usize, const NU: usize, const NY: usize, const NL: usize> {
    /// Time from one sample of the sensors to the next, s.
    pub period: f64,
    /// The sensors.
    pub sensors: [Sensor<NX>; NY],
    /// The actuators, one per input.
    pub actuators: [Actuator; NU],
    /// Time from a command to its arrival at the actuators, s: computation and transport.
    pub delay: f64,
    /// What pushes the plant, in any order.
    pub disturbances: Vec<Disturbance<NX, NL>>,
    /// Seed of all noise: the same seed, the same run.
    pub seed: u64,
    /// Tolerances of the plant's integration.
    pub tolerances: Tolerances,
}

/// What of a world a setting is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WorldPart {
    /// The world itself.
    World,
    /// The sensor with this number, from 0.
    Sensor(usize),
    /// The actuator with this number, from 0.
    Actuator(usize),
}

impl fmt::Display for WorldPart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::World => f.write_str("world"),
            Self::Sensor(i) => write!(f, "sensor {i}"),
            Self::Actuator(j) => write!(f, "actuator {j}"),
        }
    }
}

/// A world that cannot be.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum WorldError {
    /// A setting out of range.
    #[error("{part}: the {quantity} is {value}; {expected}")]
    Setting {
        /// What it is of.
        part: WorldPart,
        /// The quantity.
        quantity: &'static str,
        /// Its value.
        value: f64,
        /// What would be right.
        expected: &'static str,
    },
    /// The plant moves in steps that do not fill the time between two samples.
    #[error(
        "the period of the sensors is {period} s; it must be a whole number of the plant's periods \
         of {of_plant} s"
    )]
    Steps {
        /// Period of the sensors, s.
        period: f64,
        /// Period of the plant, s.
        of_plant: f64,
    },
    /// A disturbance with numbers that make no sense: its place in the list, from 0.
    #[error("disturbance {0}: its times must be in order, and all its numbers finite")]
    Disturbance(usize),
    /// The control samples at other times than the sensors.
    #[error(
        "the sampling time of the control is {t_s} s; it must be a whole number of periods of \
         the sensors, {period} s"
    )]
    Rates {
        /// Sampling time of the control, s.
        t_s: f64,
        /// Period of the sensors, s.
        period: f64,
    },
    /// The tolerances are out of range.
    #[error(transparent)]
    Tolerances(#[from] PlantError),
}

impl<const NX: usize, const NU: usize, const NL: usize> WorldSettings<NX, NU, NX, NL> {
    /// A world without any fault, in which all states are measured every `period` seconds.
    pub fn ideal(period: f64, tolerances: Tolerances) -> Self {
        Self {
            period,
            sensors: Sensor::ideal_states(),
            actuators: [Actuator::default(); NU],
            delay: 0.0,
            disturbances: Vec::new(),
            seed: 0,
            tolerances,
        }
    }
}

impl<P, const NX: usize, const NU: usize, const NL: usize> World<P, NX, NU, NX, NL>
where
    P: Plant<NX, NU, NL>,
{
    /// `plant` in a world without any fault, in which all states are measured every `period`
    /// seconds. What is wrong with the numbers, the first [`advance`](Self::advance) says.
    pub fn ideal(plant: P, x: SVector<f64, NX>, period: f64, tolerances: Tolerances) -> Self {
        Self::unchecked(plant, x, WorldSettings::ideal(period, tolerances))
    }
}

impl<const NX: usize, const NU: usize, const NY: usize, const NL: usize>
    WorldSettings<NX, NU, NY, NL>
{
    fn check(&self) -> Result<(), WorldError> {
        let world = |quantity, value, expected| WorldError::Setting {
            part: WorldPart::World,
            quantity,
            value,
            expected,
        };
        if !(self.period > 0.0 && self.period.is_finite()) {
            return Err(world("period", self.period, "it must be positive"));
        }
        if !(self.delay >= 0.0 && self.delay.is_finite()) {
            return Err(world(
                "delay",
                self.delay,
                "it must be finite and not negative",
            ));
        }
        let sensors = self.sensors.iter().map(Sensor::mistake);
        let actuators = self.actuators.iter().map(Actuator::mistake);
        let sensors = { sensors.enumerate() }.map(|(i, mistake)| (WorldPart::Sensor(i), mistake));
        let actuators =
            { actuators.enumerate() }.map(|(j, mistake)| (WorldPart::Actuator(j), mistake));
        for (part, mistake) in sensors.chain(actuators) {
            if let Some((quantity, value, expected)) = mistake {
                return Err(WorldError::Setting {
                    part,
                    quantity,
                    value,
                    expected,
                });
            }
        }
        if let Some(place) = self.disturbances.iter().position(|push| !push.is_valid()) {
            return Err(WorldError::Disturbance(place));
        }
        self.tolerances.check()?;
        Ok(())
    }
}

/// A plant behind sensors, actuators and a delay, stepped from outside:
/// [`measurement`](Self::measurement), [`command`](Self::command), [`advance`](Self::advance).
///
/// Time moves by one period of the sensors per [`advance`](Self::advance). The plant's motion
/// is integrated from event to event (a command arrives, a push begins), never across one. A plant in
/// discrete time moves in steps of its period; what happens within one counts from the next on.
#[derive(Clone, Debug)]
pub struct World<P, const NX: usize, const NU: usize, const NY: usize, const NL: usize> {
    plant: P,
    period: f64,
    delay: f64,
    tolerances: Tolerances,
    actuators: [Actuator; NU],
    channels: [Channel<NX>; NY],
    pending: Vec<Disturbance<NX, NL>>,
    seed: u64,
    /// Time at which the steps began to be counted, s.
    start: f64,
    steps: u64,
    x: SVector<f64, NX>,
    commanded: SVector<f64, NU>,
    /// Commands on their way, with the time of their arrival.
    travelling: VecDeque<(f64, SVector<f64, NU>)>,
    arrived: SVector<f64, NU>,
    output: SVector<f64, NU>,
    mean_output: SVector<f64, NU>,
    measurement: Measurement<f64, NY>,
}

/// Events closer together than this are one, s.
const SAME_TIME: f64 = 1e-9;

impl<P, const NX: usize, const NU: usize, const NY: usize, const NL: usize> World<P, NX, NU, NY, NL>
where
    P: Plant<NX, NU, NL>,
{
    /// `plant` at the state `x` at time zero, without input, its first measurement taken.
    ///
    /// # Errors
    /// [`WorldError`] names the setting that makes no sense.
    pub fn new(
        plant: P,
        x: SVector<f64, NX>,
        settings: WorldSettings<NX, NU, NY, NL>,
    ) -> Result<Self, WorldError> {
        settings.check()?;
        if let Some(of_plant) = plant.period() {
            let period = settings.period;
            let steps = (period / of_plant).round();
            if !(steps >= 1.0 && (steps * of_plant - period).abs() <= SAME_TIME * period.max(1.0)) {
                return Err(WorldError::Steps { period, of_plant });
            }
        }
        Ok(Self::unchecked(plant, x, settings))
    }

    /// The same world where it stands, at the same time, with another plant or other settings.
    /// What has happened stays: the state, commands on their way, the actuators' outputs, readings
    /// that have been taken, the noise to come. Pushes are those of the `settings` whose time has
    /// not passed. With another period the sensors start anew.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn continued(
        &self,
        plant: P,
        settings: WorldSettings<NX, NU, NY, NL>,
    ) -> Result<Self, WorldError> {
        let mut world = Self::new(plant, self.x, settings)?;
        world.commanded = self.commanded;
        world.travelling = self.travelling.clone();
        (world.arrived, world.output) = (self.arrived, self.output);
        world.mean_output = self.mean_output;
        let same_period = world.period == self.period;
        for (channel, before) in world.channels.iter_mut().zip(&self.channels) {
            channel.go_on_from(before, world.seed == self.seed, same_period);
        }
        if same_period {
            (world.start, world.steps) = (self.start, self.steps);
            world.measurement = self.measurement;
            world.drop_past_pushes();
            Ok(world)
        } else {
            Ok(world.at_time(self.time()))
        }
    }

    /// This world, which has not moved yet, at the time `time` (s) instead of zero, without the
    /// pushes that lie before.
    pub fn at_time(mut self, time: f64) -> Self {
        self.start = time;
        self.measurement.t = time;
        self.drop_past_pushes();
        self
    }

    fn drop_past_pushes(&mut self) {
        let now = self.time() - SAME_TIME;
        self.pending.retain(|push| match push {
            Disturbance::Jump { time, .. } | Disturbance::Impulse { time, .. } => *time >= now,
            Disturbance::Load { until, .. } => *until > now,
        });
    }

    fn unchecked(plant: P, x: SVector<f64, NX>, settings: WorldSettings<NX, NU, NY, NL>) -> Self {
        let channel = |i| Channel::new(settings.sensors[i], settings.seed, i);
        let mut world = Self {
            plant,
            period: settings.period,
            delay: settings.delay,
            tolerances: settings.tolerances,
            actuators: settings.actuators,
            channels: std::array::from_fn(channel),
            pending: settings.disturbances,
            seed: settings.seed,
            start: 0.0,
            steps: 0,
            x,
            commanded: SVector::zeros(),
            travelling: VecDeque::new(),
            arrived: SVector::zeros(),
            output: SVector::zeros(),
            mean_output: SVector::zeros(),
            measurement: Measurement {
                t: 0.0,
                readings: [None; NY],
            },
        };
        world.measure();
        world
    }

    /// The time, s.
    pub fn time(&self) -> f64 {
        self.start + self.steps as f64 * self.period
    }

    /// Time from one sample of the sensors to the next, s.
    pub fn period(&self) -> f64 {
        self.period
    }

    /// The true state, which no controller gets to see.
    pub fn state(&self) -> &SVector<f64, NX> {
        &self.x
    }

    /// The plant.
    pub fn plant(&self) -> &P {
        &self.plant
    }

    /// What the sensors deliver now.
    pub fn measurement(&self) -> &Measurement<f64, NY> {
        &self.measurement
    }

    /// The last command, in input units.
    pub fn commanded(&self) -> &SVector<f64, NU> {
        &self.commanded
    }

    /// The mean of the actuators' outputs over the last period, in input units: what a current
    /// sensor would show.
    pub fn applied(&self) -> &SVector<f64, NU> {
        &self.mean_output
    }

    /// Commands `u` from now on; it arrives after the delay.
    pub fn command(&mut self, u: SVector<f64, NU>) {
        self.commanded = u;
        self.travelling.push_back((self.time() + self.delay, u));
    }

    /// Adds a push. One whose time has passed acts at once.
    ///
    /// # Errors
    /// [`WorldError::Disturbance`] if its numbers make no sense.
    pub fn disturb(&mut self, push: Disturbance<NX, NL>) -> Result<(), WorldError> {
        if !push.is_valid() {
            return Err(WorldError::Disturbance(self.pending.len()));
        }
        self.pending.push(push);
        Ok(())
    }

    /// Moves on by one period, and measures.
    ///
    /// # Errors
    /// [`PlantError`] if the motion cannot be integrated, or a command was not finite. The
    /// state and the time then stay as they were.
    pub fn advance(&mut self) -> Result<(), PlantError> {
        let (x, output, arrived) = (self.x, self.output, self.arrived);
        let (pending, travelling) = (self.pending.clone(), self.travelling.clone());
        let moved = self.move_on();
        if moved.is_err() {
            (self.x, self.output, self.arrived) = (x, output, arrived);
            (self.pending, self.travelling) = (pending, travelling);
        }
        moved
    }

    fn move_on(&mut self) -> Result<(), PlantError> {
        let start = self.time();
        let mut since = 0.0;
        let mut integral = SVector::zeros();
        while since < self.period {
            let load = self.take_effect(start + since);
            let next = match self.plant.period() {
                None => self.next_event(start + since) - start,
                Some(step) => since + step,
            };
            let end = if next < self.period - SAME_TIME {
                next
            } else {
                self.period
            };
            integral += self.glide(end - since, &load)?;
            since = end;
        }
        self.mean_output = integral / self.period;
        self.steps += 1;
        self.measure();
        Ok(())
    }

    fn measure(&mut self) {
        self.measurement.t = self.time();
        for (i, channel) in self.channels.iter_mut().enumerate() {
            let other = self.plant.measured(i, &self.x);
            let reading = channel.read(&self.x, other, self.steps);
            self.measurement.readings[i] = reading.map(|(value, age)| Reading {
                value,
                age: age as f64 * self.period,
            });
        }
    }

    /// Lets everything happen that is due at the time `now`, and returns the load from there.
    fn take_effect(&mut self, now: f64) -> SVector<f64, NL> {
        let due = now + SAME_TIME;
        while let Some((_, u)) = self.travelling.pop_front_if(|(time, _)| *time <= due) {
            self.arrived = u;
        }
        let (x, arrived, plant) = (&mut self.x, &self.arrived, &self.plant);
        let mut total = SVector::zeros();
        self.pending.retain(|push| match push {
            Disturbance::Jump { time, change } if *time <= due => {
                *x += change;
                false
            }
            Disturbance::Impulse { time, impulse } if *time <= due => {
                let without = plant.derivative(x, arrived, &SVector::zeros());
                *x += plant.derivative(x, arrived, impulse) - without;
                false
            }
            Disturbance::Load { from, until, load } if *from <= due => {
                let lasting = *until > due;
                if lasting {
                    total += load;
                }
                lasting
            }
            _ => true,
        });
        total
    }

    /// The time of the first event after `now`, infinite if there is none.
    fn next_event(&self, now: f64) -> f64 {
        let arrivals = self.travelling.iter().map(|(time, _)| *time);
        let pushes = self.pending.iter().flat_map(Disturbance::times);
        arrivals
            .chain(pushes)
            .filter(|time| *time > now + SAME_TIME)
            .fold(f64::INFINITY, f64::min)
    }

    /// Moves the plant on by `duration` seconds without events, and returns the integral of the
    /// actuators' outputs.
    fn glide(
        &mut self,
        duration: f64,
        load: &SVector<f64, NL>,
    ) -> Result<SVector<f64, NU>, PlantError> {
        let Self {
            plant,
            actuators,
            output,
            arrived,
            ..
        } = self;
        let target = SVector::<f64, NU>::from_fn(|i, _| actuators[i].target(arrived[i]));
        let at = |after: f64| {
            SVector::<f64, NU>::from_fn(|i, _| actuators[i].output(output[i], target[i], after))
        };
        let end = at(duration);
        let integral =
            SVector::from_fn(|i, _| actuators[i].integral(output[i], target[i], duration));
        self.x = match plant.period() {
            None => {
                let motion =
                    |after: f64, x: &SVector<f64, NX>| plant.derivative(x, &at(after), load);
                integrate(motion, &self.x, duration, self.tolerances, duration)?
            }
            Some(_) => {
                let next = plant.derivative(&self.x, &(integral / duration), load);
                if !next.iter().all(|entry| entry.is_finite()) {
                    return Err(PlantError::Diverged {
                        after: duration,
                        reason: "the next state is not finite".to_owned(),
                    });
                }
                next
            }
        };
        self.output = end;
        Ok(integral)
    }
}
