//! What an estimator is set to, and what it says.

use lpvmpc::Gate;

/// An extended Kalman filter that finds state and disturbances, and the delay of the input.
#[derive(Debug, Clone, PartialEq)]
pub struct EstimatorSettings {
    /// What is measured: names of states or of outputs that do not depend on the input, in the order of the
    /// readings. No more than the smallest of 2, 4, 6, 8, 12 and 16 that is at least the number of states.
    pub measured: Vec<String>,
    /// Variances of the readings, in squared units, positive.
    pub measurement_noise: Vec<f64>,
    /// Variances that the states gain per second, in squared units per s: what the plant does not know.
    pub state_noise: Vec<f64>,
    /// Where the plant is believed to be before the first reading; without, at its equilibrium, or zero.
    pub start: Option<Vec<f64>>,
    /// Variances of the states about that.
    pub initial_state: Vec<f64>,
    /// What acts on the plant besides its inputs, constant or slow; no more than readings.
    pub disturbances: Vec<Disturbance>,
    /// Time from a measurement to the input that answers it, s; of a plant in discrete time a whole number of periods.
    pub delay: f64,
    /// Which readings are not believed; none as a rule.
    pub gate: Gate<f64>,
}

/// A disturbance that the filter finds, so that the controller tracks without offset.
#[derive(Debug, Clone, PartialEq)]
pub struct Disturbance {
    /// The input beside which it acts, or the state whose derivative (next value, in discrete time) it adds to.
    pub on: String,
    /// Variance that it gains per second: how fast it may wander.
    pub noise: f64,
    /// Its variance about zero at the start.
    pub initial: f64,
}

impl Disturbance {
    /// One that wanders by `noise` per second, with a variance of 1 at the start.
    pub fn new(on: &str, noise: f64) -> Self {
        Self {
            on: on.to_owned(),
            noise,
            initial: 1.0,
        }
    }
}

impl EstimatorSettings {
    /// Readings of these states or outputs with these variances, and noises of the states; no disturbances, no
    /// delay, large variances at the start.
    pub fn new(measured: &[&str], measurement_noise: &[f64], state_noise: &[f64]) -> Self {
        Self {
            measured: measured.iter().map(|name| (*name).to_owned()).collect(),
            measurement_noise: measurement_noise.to_vec(),
            state_noise: state_noise.to_vec(),
            start: None,
            initial_state: vec![1.0; state_noise.len()],
            disturbances: Vec::new(),
            delay: 0.0,
            gate: Gate {
                deviations: f64::INFINITY,
                patience: 0,
                oldest: f64::INFINITY,
                longest_gap: f64::INFINITY,
            },
        }
    }
}

/// What a filter knows.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// The state at the last measurement, in the plant's units.
    pub x: Vec<f64>,
    /// The disturbances, in the order of the settings.
    pub disturbances: Vec<f64>,
}
