//! The table of an experiment that says what is measured in place of the state, as `lpvmpc.Estimator` of the Python
//! package does.

use crate::experiment::{Table, check_name, components, names};
use lpvmpc_any::{Disturbance, EstimatorSettings, Gate};
use lpvmpc_plant::PlantData;
use serde::Deserialize;
use serde::de::{Deserializer, Error, MapAccess, SeqAccess, Visitor, value};
use std::collections::BTreeMap;
use std::fmt;
use toml::Spanned;

/// `[controller.estimator]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EstimatorTable {
    measured: InOrder<f64>,
    state_noise: ByState,
    #[serde(default)]
    disturbances: InOrder<Table<DisturbanceTable>>,
    delay: Option<f64>,
    start: Option<Vec<f64>>,
    initial_state: Option<ByState>,
    gate: Option<Table<GateTable>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct DisturbanceTable {
    noise: f64,
    initial: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GateTable {
    deviations: Option<f64>,
    patience: Option<usize>,
    oldest: Option<f64>,
    longest_gap: Option<f64>,
}

/// A table by name in the order of the file, which is that of the readings.
#[derive(Deserialize)]
#[serde(from = "BTreeMap<Spanned<String>, T>")]
struct InOrder<T>(Vec<(String, T)>);

impl<T> Default for InOrder<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T> From<BTreeMap<Spanned<String>, T>> for InOrder<T> {
    fn from(table: BTreeMap<Spanned<String>, T>) -> Self {
        let mut all: Vec<_> = table.into_iter().collect();
        all.sort_by_key(|(name, _)| name.span().start);
        let plain = |(name, value): (Spanned<String>, T)| (name.into_inner(), value);
        Self(all.into_iter().map(plain).collect())
    }
}

/// Variances of the states: the same for all, one for each, or some by name.
enum ByState {
    Same(f64),
    Each(Vec<f64>),
    Named(BTreeMap<String, f64>),
}

impl<'de> Deserialize<'de> for ByState {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Words;
        impl<'de> Visitor<'de> for Words {
            type Value = ByState;

            fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                formatter.write_str("a number, a list of one for each state, or a table by state")
            }

            fn visit_f64<E: Error>(self, value: f64) -> Result<ByState, E> {
                Ok(ByState::Same(value))
            }

            fn visit_i64<E: Error>(self, value: i64) -> Result<ByState, E> {
                Ok(ByState::Same(value as f64))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<ByState, A::Error> {
                let list = value::SeqAccessDeserializer::new(list);
                Ok(ByState::Each(Vec::deserialize(list)?))
            }

            fn visit_map<A: MapAccess<'de>>(self, table: A) -> Result<ByState, A::Error> {
                let table = value::MapAccessDeserializer::new(table);
                Ok(ByState::Named(BTreeMap::deserialize(table)?))
            }
        }
        deserializer.deserialize_any(Words)
    }
}

impl ByState {
    /// One for each state, the `usual` one for those that are not named.
    fn of(&self, place: &str, data: &PlantData, usual: f64) -> Result<Vec<f64>, String> {
        let states = &data.states;
        match self {
            Self::Same(value) => Ok(vec![*value; states.len()]),
            Self::Each(list) => components(place, list, states).map(|()| list.clone()),
            Self::Named(table) => {
                for name in table.keys() {
                    check_name(place, name, names(states).into_iter())?;
                }
                let of = |name: &str| table.get(name).copied().unwrap_or(usual);
                Ok(names(states).into_iter().map(of).collect())
            }
        }
    }
}

impl EstimatorTable {
    /// What the controller is given. Of its values the controller knows what is right.
    pub fn settings(&self, data: &PlantData) -> Result<EstimatorSettings, String> {
        let place = |key: &str| format!("controller.estimator.{key}");
        let readable = { data.states.iter() }.chain(&data.outputs);
        let readable: Vec<&str> = readable.map(|one| one.name.as_str()).collect();
        let pushed = [names(&data.inputs), names(&data.states)].concat();
        for (name, _) in &self.measured.0 {
            check_name(&place("measured"), name, readable.iter().copied())?;
        }
        for (name, _) in &self.disturbances.0 {
            check_name(&place("disturbances"), name, pushed.iter().copied())?;
        }
        let measured: Vec<&str> = { self.measured.0.iter() }
            .map(|(name, _)| name.as_str())
            .collect();
        let noise: Vec<f64> = self.measured.0.iter().map(|(_, noise)| *noise).collect();
        let state_noise = self.state_noise.of(&place("state_noise"), data, 0.0)?;
        let usual = EstimatorSettings::new(&measured, &noise, &state_noise);
        let initial_state = match &self.initial_state {
            None => usual.initial_state.clone(),
            Some(given) => {
                let usual = usual.initial_state.first().copied().unwrap_or_default();
                given.of(&place("initial_state"), data, usual)?
            }
        };
        if let Some(start) = &self.start {
            components(&place("start"), start, &data.states)?;
        }
        let disturbance = |(on, Table(table)): &(String, Table<DisturbanceTable>)| {
            let usual = Disturbance::new(on, table.noise);
            Disturbance {
                initial: table.initial.unwrap_or(usual.initial),
                ..usual
            }
        };
        let gate = match &self.gate {
            None => usual.gate,
            Some(Table(given)) => Gate {
                deviations: given.deviations.unwrap_or(usual.gate.deviations),
                patience: given.patience.unwrap_or(usual.gate.patience),
                oldest: given.oldest.unwrap_or(usual.gate.oldest),
                longest_gap: given.longest_gap.unwrap_or(usual.gate.longest_gap),
            },
        };
        Ok(EstimatorSettings {
            start: self.start.clone(),
            initial_state,
            disturbances: self.disturbances.0.iter().map(disturbance).collect(),
            delay: self.delay.unwrap_or(usual.delay),
            gate,
            ..usual
        })
    }
}
