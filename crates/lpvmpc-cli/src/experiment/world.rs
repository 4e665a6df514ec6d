//! The table `[world]`: what happens to the plant.

use super::signals::{check_name, components, names};
use super::{Experiment, Table};
use lpvmpc_any::{Push, Quantity, Sensor, WorldSettings};
use lpvmpc_plant::Signal;
use lpvmpc_terminal::table::short;
use serde::Deserialize;
use std::collections::BTreeMap;

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
pub(super) struct World {
    pub parameters: BTreeMap<String, f64>,
    delay: f64,
    noise: BTreeMap<String, f64>,
    seed: u64,
    jump: Vec<Table<Jump>>,
    load: Vec<Table<Load>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Jump {
    time: f64,
    change: Vec<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Load {
    start: f64,
    end: f64,
    load: Vec<f64>,
}

impl World {
    /// `measured` are the states and outputs that an estimator reads; without one, it is the states.
    pub(super) fn settings(
        self,
        period: f64,
        states: &[Signal],
        measured: Option<&[String]>,
    ) -> Result<WorldSettings, String> {
        let begins = |place: &str, key: &str, time: f64| match time < 0.0 {
            true => Err(format!("{place}.{key} = {time}: the run begins at 0 s")),
            false => Ok(()),
        };
        for (i, Table(jump)) in self.jump.iter().enumerate() {
            let place = format!("world.jump {}", i + 1);
            components(&place, &jump.change, states)?;
            begins(&place, "time", jump.time)?;
        }
        for (i, Table(load)) in self.load.iter().enumerate() {
            let place = format!("world.load {}", i + 1);
            components(&place, &load.load, states)?;
            begins(&place, "end", load.end)?;
        }
        let states = names(states);
        let sensed: Vec<&str> = match measured {
            Some(measured) => measured.iter().map(String::as_str).collect(),
            None => states.clone(),
        };
        for name in self.noise.keys() {
            check_name("world.noise", name, sensed.iter().copied())?;
        }
        let sensor = |name: &&str| {
            let row = states.iter().map(|one| if one == name { 1.0 } else { 0.0 });
            let of = match states.contains(name) {
                true => Quantity::Row(row.collect()),
                false => Quantity::Output((*name).to_owned()),
            };
            Sensor {
                noise: self.noise.get(*name).copied().unwrap_or(0.0),
                ..Sensor::ideal(of)
            }
        };
        let is_ideal = measured.is_none() && self.noise.is_empty();
        let jumps = self.jump.into_iter().map(|Table(jump)| Push::Jump {
            time: jump.time,
            change: jump.change,
        });
        let loads = self.load.into_iter().map(|Table(load)| Push::Load {
            from: load.start,
            until: load.end,
            load: load.load,
        });
        Ok(WorldSettings {
            sensors: (!is_ideal).then(|| sensed.iter().map(sensor).collect()),
            delay: self.delay,
            pushes: jumps.chain(loads).collect(),
            seed: self.seed,
            ..WorldSettings::ideal(period)
        })
    }
}

impl Experiment {
    /// Jumps and loads that the run ends before, a sentence each.
    pub fn too_late(&self) -> Vec<String> {
        let end = self.samples as f64 * self.settings.t_s;
        let (mut jumps, mut loads) = (0, 0);
        let begin = self.world.pushes.iter().map(|push| match push {
            Push::Jump { time, .. } => {
                jumps += 1;
                (format!("world.jump {jumps}.time"), *time)
            }
            Push::Load { from, .. } => {
                loads += 1;
                (format!("world.load {loads}.start"), *from)
            }
        });
        let late = begin.filter(|(_, time)| *time >= end);
        let told = late.map(|(key, time)| {
            let (time, end) = (short(time), short(end));
            format!("{key} = {time}: the run ends at {end} s and does not come to it")
        });
        told.collect()
    }
}
