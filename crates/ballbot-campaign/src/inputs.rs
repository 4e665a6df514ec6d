//! What varies from run to run, and the values of a run: a function of seed and number alone.

use crate::cell::{Cell, Column};
use crate::distribution::{Distribution, rounding};
use crate::error::CampaignError;
use crate::file::{Design, Keys, VaryTable};
use crate::permutation::Permutation;
use lpvmpc_sim::Random;
use sha2::{Digest, Sha256};
use sobol::Sobol;
use sobol::params::JoeKuoD6;
use toml::Value;

/// An input of the campaign.
#[derive(Clone, Debug)]
pub(crate) struct Input {
    /// The keys of the scenario that get its value.
    pub keys: Vec<String>,
    pub distribution: Distribution,
    pub round_to: Option<f64>,
    /// Seed of its streams: adding an input leaves the others' draws as they are.
    seed: u64,
    /// Direction numbers, where a Sobol sequence lays it out.
    directions: Vec<u64>,
}

/// All inputs, with the layout of their points.
#[derive(Clone, Debug)]
pub(crate) struct Inputs {
    pub all: Vec<Input>,
    design: Design,
    /// Points of the grids together; 1 without.
    pub grid_points: u64,
    /// Runs at each point of the grids.
    repeats: u64,
}

/// Dimensions of the Sobol sequence with direction numbers in the program.
const MOST_DIMENSIONS: usize = 100;
/// Runs of a campaign, at most: numbers of runs are exact in an f64.
pub const MOST_RUNS: u64 = 1 << 40;

impl Inputs {
    /// The inputs of a campaign of so many runs, or of one per point of its grids; and the runs.
    pub fn new(
        vary: &[VaryTable],
        design: Design,
        seed: u64,
        runs: Option<u64>,
    ) -> Result<(Self, u64), CampaignError> {
        let mut all = Vec::new();
        for (i, table) in vary.iter().enumerate() {
            all.push(Input::new(&format!("vary[{i}]"), table, seed)?);
        }
        check_keys(&all)?;
        lay_out(&mut all, design)?;
        let mut grid_points: u64 = 1;
        for input in &all {
            if let Distribution::Grid(values) = &input.distribution {
                grid_points = grid_points.saturating_mul(values.len() as u64);
            }
        }
        let runs = match runs {
            Some(runs) => runs,
            None if grid_points > 1 => grid_points,
            None => {
                let expected = "a number of runs is needed where there is no grid";
                return Err(CampaignError::value("runs", "(absent)", expected));
            }
        };
        if !(1..=MOST_RUNS).contains(&runs) {
            let expected = format!("it must be from 1 to {MOST_RUNS}");
            return Err(CampaignError::value("runs", runs.to_string(), expected));
        }
        if !runs.is_multiple_of(grid_points) {
            let expected = format!(
                "the grids have {grid_points} points together, so it must be a multiple of that"
            );
            return Err(CampaignError::value("runs", runs.to_string(), expected));
        }
        let inputs = Self {
            all,
            design,
            grid_points,
            repeats: runs / grid_points,
        };
        Ok((inputs, runs))
    }

    /// The keys of the scenario that vary.
    pub fn keys(&self) -> impl Iterator<Item = &String> {
        self.all.iter().flat_map(|input| &input.keys)
    }

    /// The columns of the inputs.
    pub fn columns(&self) -> impl Iterator<Item = Column> {
        let name = |input: &Input| input.keys.first().cloned().unwrap_or_default();
        let all = self.all.iter();
        all.map(move |input| Column::new(name(input), input.distribution.kind()))
    }

    /// The values of a run, in the order of the inputs.
    pub fn values(&self, run: u64) -> Vec<Value> {
        let (point, repeat) = (run % self.grid_points, run / self.grid_points);
        // The grids in turn, the last one fastest.
        let mut rest = self.grid_points;
        let value = |input: &Input| match &input.distribution {
            Distribution::Grid(values) => {
                rest /= values.len() as u64;
                values[(point / rest % values.len() as u64) as usize].clone()
            }
            distribution => {
                let u = input.unit(self, run, point, repeat);
                distribution.value(u, input.round_to)
            }
        };
        self.all.iter().map(value).collect()
    }

    /// The values at uniform numbers from 0 to 1, one for each input; seeds come from `noise`.
    pub fn values_at(&self, units: &[f64], noise: u64) -> Vec<Value> {
        let value = |(input, u): (&Input, &f64)| {
            let own = || Random::new(noise ^ input.seed, 0).uniform();
            let u = match input.distribution {
                Distribution::Seeds => inside(own()),
                _ => inside(*u),
            };
            input.distribution.value(u, input.round_to)
        };
        self.all.iter().zip(units).map(value).collect()
    }

    /// The values as cells.
    pub fn cells(&self, values: &[Value]) -> impl Iterator<Item = Cell> {
        let all = self.all.iter().zip(values);
        all.map(|(input, value)| Cell::of(value, input.distribution.kind()))
    }

    /// Key by key what a run gets.
    pub fn changes<'a>(&'a self, values: &'a [Value]) -> impl Iterator<Item = (&'a str, Value)> {
        let all = self.all.iter().zip(values);
        all.flat_map(|(input, value)| input.keys.iter().map(|key| (key.as_str(), value.clone())))
    }
}

impl Input {
    pub fn new(place: &str, table: &VaryTable, seed: u64) -> Result<Self, CampaignError> {
        let keys = match &table.key {
            Keys::One(key) => vec![key.clone()],
            Keys::Several(keys) => keys.clone(),
        };
        let place = match keys.first() {
            Some(key) => format!("{place} ({key})"),
            None => {
                let expected = "it needs one key of the scenario or more";
                return Err(CampaignError::value(format!("{place}.key"), "[]", expected));
            }
        };
        let distribution = Distribution::new(&place, table)?;
        Ok(Self {
            round_to: rounding(&place, table.round_to, &distribution)?,
            seed: named_seed(seed, &keys[0]),
            keys,
            distribution,
            directions: Vec::new(),
        })
    }

    /// The uniform number of a run.
    fn unit(&self, inputs: &Inputs, run: u64, point: u64, repeat: u64) -> f64 {
        let at = |stream: u64| Random::new(self.seed, stream as usize).uniform();
        // Each point of a grid has a layout of its own.
        let own = || child(self.seed, point);
        let u = match inputs.design {
            _ if !self.distribution.is_laid_out() => at(run),
            Design::Random => at(run),
            Design::Sobol => {
                let bits = (0..u64::BITS).filter(|bit| repeat >> bit & 1 == 1);
                let place = bits.fold(0, |sum, bit| sum ^ self.directions[bit as usize]);
                // The upper 53 bits, as many as a number has.
                ((place ^ own() << 11) >> 11) as f64 / MANTISSA
            }
            Design::LatinHypercube => {
                let place = Permutation::new(own(), inputs.repeats).at(repeat);
                (place as f64 + at(run)) / inputs.repeats as f64
            }
        };
        inside(u)
    }
}

/// In the middle of what `u` was rounded down from, so that neither end is met.
fn inside(u: f64) -> f64 {
    (u + 0.5 / MANTISSA).min(1.0 - 1.0 / MANTISSA)
}

const MANTISSA: f64 = (1_u64 << 53) as f64;

/// Seed number `index` of those that belong to `seed`, of 53 bits.
pub(crate) fn child(seed: u64, index: u64) -> u64 {
    (Random::new(seed, index as usize).uniform() * MANTISSA) as u64
}

/// The seed of what is called `name`.
pub fn named_seed(seed: u64, name: &str) -> u64 {
    let digest = Sha256::new_with_prefix(seed.to_le_bytes())
        .chain_update(name)
        .finalize();
    let first = digest.iter().take(8);
    first.fold(0, |sum, byte| sum << 8 | u64::from(*byte))
}

/// Whether a key of a scenario is another one or stands in it: `controller.q.0` in `controller.q`.
pub fn is_within(key: &str, other: &str) -> bool {
    key.strip_prefix(other)
        .is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}

fn check_keys(all: &[Input]) -> Result<(), CampaignError> {
    let keys: Vec<&String> = all.iter().flat_map(|input| &input.keys).collect();
    for (i, key) in keys.iter().enumerate() {
        let inside = |other: &str| is_within(key, other);
        if let Some(other) = keys
            .iter()
            .enumerate()
            .find(|(j, other)| i != *j && inside(other))
        {
            let expected = format!("`{}` varies it already", other.1);
            return Err(CampaignError::value(
                "vary.key",
                format!("{key:?}"),
                expected,
            ));
        }
    }
    Ok(())
}

/// Gives each input its dimension of the sequence.
fn lay_out(all: &mut [Input], design: Design) -> Result<(), CampaignError> {
    if design != Design::Sobol {
        return Ok(());
    }
    let laid_out = all
        .iter_mut()
        .filter(|input| input.distribution.is_laid_out());
    let laid_out: Vec<&mut Input> = laid_out.collect();
    if laid_out.len() > MOST_DIMENSIONS {
        return Err(CampaignError::value(
            "design",
            "sobol",
            format!("a Sobol sequence lays out at most {MOST_DIMENSIONS} inputs"),
        ));
    }
    let directions =
        Sobol::<f64>::init_direction_vals::<u32>(laid_out.len(), 64, &JoeKuoD6::minimal());
    for (input, directions) in laid_out.into_iter().zip(directions) {
        input.directions = directions;
    }
    Ok(())
}
