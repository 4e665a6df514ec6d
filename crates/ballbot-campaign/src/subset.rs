//! Probabilities of rare failures by subset simulation (Au and Beck 2001): a rare event is the last
//! of a few nested ones, none of which is rare given the one before.

use crate::intervals::{Interval, deviations};
use lpvmpc_sim::Random;
use rayon::prelude::*;
use serde::Serialize;

/// A point: standard normal coordinates, and what is drawn beside them.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// Independent standard normal coordinates of the inputs.
    pub normal: Vec<f64>,
    /// Seed of everything that has no coordinate, such as the sensors' noise.
    pub noise: u64,
}

/// What is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Subset {
    /// Coordinates of a point.
    pub dimension: usize,
    /// Points of a level.
    pub level_runs: usize,
    /// A probability below this is not followed.
    pub least: f64,
    /// Seed of everything random.
    pub seed: u64,
    /// Confidence of the interval.
    pub confidence: f64,
}

/// A level: an event that holds the next one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Level {
    /// How far from the failure its points are at most; 0 is the failure.
    pub distance: f64,
    /// Its probability, given the level before.
    pub probability: f64,
    /// Coefficient of variation of that.
    pub variation: f64,
    /// Share of the proposed points that were taken; `None` for the first level, whose are drawn.
    pub acceptance: Option<f64>,
}

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub struct RareEstimate {
    /// The probability of the failure with its interval; its value is 0 where it is below `least`,
    /// and the interval's upper end is what the last level followed bounds it by.
    pub probability: Interval,
    /// Points that were looked at.
    pub runs: u64,
    /// The levels.
    pub levels: Vec<Level>,
    /// Points of the last level that fail.
    pub failures: Vec<Point>,
}

/// The probability of a level, given the one before.
const SHARE: f64 = 0.1;
/// How far the first proposals go, and which share of them should be taken (Papaioannou, Betz,
/// Zwirglmaier and Straub 2015).
const FIRST_STEP: f64 = 0.6;
const WANTED_ACCEPTANCE: f64 = 0.44;
/// A proposal has new noise with this probability.
const NEW_NOISE: f64 = 0.5;

/// A point with its limit.
type Evaluated = (Point, f64);

impl Subset {
    /// Estimates how probable it is that `limit` is above zero. What is found depends on neither the
    /// threads nor their order. `None` where the limit does not tell points apart.
    ///
    /// # Errors
    /// What `limit` says.
    pub fn estimate<E: Send>(
        &self,
        limit: &(dyn Fn(&Point) -> Result<f64, E> + Sync),
    ) -> Result<Option<RareEstimate>, E> {
        let points = (0..self.level_runs).into_par_iter().map(|index| {
            let mut random = Random::new(self.seed, index);
            let normal = (0..self.dimension).map(|_| random.normal()).collect();
            let point = Point {
                normal,
                noise: seed(&mut random),
            };
            let value = limit(&point)?;
            Ok((point, value))
        });
        let mut chains: Vec<Vec<Evaluated>> = points
            .map(|point| point.map(|point| vec![point]))
            .collect::<Result<_, E>>()?;
        let mut levels: Vec<Level> = Vec::new();
        let (mut step, mut acceptance) = (FIRST_STEP, None);
        let (mut probability, mut runs) = (1.0, self.level_runs as u64);
        loop {
            let all = chains.iter().flatten();
            let mut values: Vec<f64> = all.map(|(_, value)| *value).collect();
            let count = values.len();
            values.sort_unstable_by(|a, b| b.total_cmp(a));
            let wanted = ((SHARE * count as f64) as usize).max(1);
            let failing = values.partition_point(|value| *value > 0.0);
            let last = failing >= wanted;
            let threshold = values.get(wanted - 1).copied().unwrap_or(f64::NEG_INFINITY);
            let belongs = |value: f64| {
                if last {
                    value > 0.0
                } else {
                    value >= threshold
                }
            };
            let inside = values.iter().filter(|value| belongs(**value)).count();
            let share = inside as f64 / count as f64;
            // All points are alike: there is no way down.
            if inside == count && !last {
                return Ok(None);
            }
            probability *= share;
            levels.push(Level {
                distance: if last { 0.0 } else { -threshold },
                probability: share,
                variation: variation(&chains, share, &belongs),
                acceptance,
            });
            if last || probability < self.least {
                let points = chains.into_iter().flatten();
                let failures = points
                    .filter(|(_, value)| *value > 0.0)
                    .map(|(point, _)| point);
                return Ok(Some(RareEstimate {
                    probability: self.interval(probability, last, &levels),
                    runs,
                    levels,
                    failures: failures.collect(),
                }));
            }
            let seeds: Vec<Evaluated> = chains
                .into_iter()
                .flatten()
                .filter(|(_, value)| belongs(*value))
                .collect();
            let level = levels.len();
            let (next, taken, proposed) = self.chains(level, seeds, threshold, step, limit)?;
            runs += proposed;
            let part = taken as f64 / proposed.max(1) as f64;
            step = (step * (part - WANTED_ACCEPTANCE).exp()).clamp(0.05, 1.0);
            acceptance = Some(part);
            chains = next;
        }
    }

    /// A Markov chain from each seed, as many points together as a level has, all at the threshold or
    /// beyond: with the points taken, and proposed.
    fn chains<E: Send>(
        &self,
        level: usize,
        seeds: Vec<Evaluated>,
        threshold: f64,
        step: f64,
        limit: &(dyn Fn(&Point) -> Result<f64, E> + Sync),
    ) -> Result<(Vec<Vec<Evaluated>>, u64, u64), E> {
        let (count, level_runs) = (seeds.len(), self.level_runs);
        let stay = (1.0 - step * step).sqrt();
        let chains = seeds.into_par_iter().enumerate().map(|(index, first)| {
            let mut random = Random::new(self.seed, level * level_runs + index);
            // What does not divide goes to the first chains.
            let length = level_runs / count + usize::from(index < level_runs % count);
            let mut taken = 0;
            let mut chain = vec![first];
            for _ in 1..length {
                let Some((point, value)) = chain.last() else {
                    break;
                };
                // Reversible with respect to the distribution of the point: normal and noise alike.
                let normal = point
                    .normal
                    .iter()
                    .map(|z| stay * z + step * random.normal());
                let normal = normal.collect();
                let (redraw, drawn) = (random.uniform() < NEW_NOISE, seed(&mut random));
                let noise = if redraw { drawn } else { point.noise };
                let candidate = Point { normal, noise };
                let found = limit(&candidate)?;
                let next = match found >= threshold {
                    true => (candidate, found),
                    false => (point.clone(), *value),
                };
                taken += u64::from(found >= threshold);
                chain.push(next);
            }
            Ok((chain, taken))
        });
        let chains: Vec<(Vec<Evaluated>, u64)> = chains.collect::<Result<_, E>>()?;
        let taken = chains.iter().map(|(_, taken)| taken).sum();
        let proposed = chains.iter().map(|(chain, _)| chain.len() as u64 - 1).sum();
        Ok((
            chains.into_iter().map(|(chain, _)| chain).collect(),
            taken,
            proposed,
        ))
    }

    /// The probability is a product of shares, so it is its logarithm that is spread evenly.
    fn interval(&self, probability: f64, reached: bool, levels: &[Level]) -> Interval {
        let squares = levels
            .iter()
            .map(|level| (1.0 + level.variation.powi(2)).ln());
        let spread = deviations(self.confidence) * squares.sum::<f64>().sqrt();
        let upper = (probability * spread.exp()).min(1.0);
        match reached {
            true => Interval {
                value: probability,
                lower: probability * (-spread).exp(),
                upper,
            },
            false => Interval {
                value: 0.0,
                lower: 0.0,
                upper,
            },
        }
    }
}

fn seed(random: &mut Random) -> u64 {
    (random.uniform() * (1_u64 << 53) as f64) as u64
}

/// The coefficient of variation of the share of points that belong, for points of chains that depend
/// on each other (Au and Beck 2001, section 5).
fn variation(chains: &[Vec<Evaluated>], share: f64, belongs: &dyn Fn(f64) -> bool) -> f64 {
    let count: usize = chains.iter().map(Vec::len).sum();
    let longest = chains.iter().map(Vec::len).max().unwrap_or(0);
    let variance = share * (1.0 - share);
    if !(variance > 0.0) {
        return 0.0;
    }
    let indicators: Vec<Vec<f64>> = chains
        .iter()
        .map(|chain| {
            chain
                .iter()
                .map(|(_, value)| f64::from(u8::from(belongs(*value))))
                .collect()
        })
        .collect();
    let mut dependence = 0.0;
    for lag in 1..longest {
        let pairs = indicators
            .iter()
            .flat_map(|chain| chain.iter().zip(chain.iter().skip(lag)));
        let (pairs, sum) = pairs.fold((0, 0.0), |(n, sum), (a, b)| (n + 1, sum + a * b));
        if pairs > 0 {
            let covariance = sum / pairs as f64 - share * share;
            dependence += 2.0 * (pairs as f64 / count as f64) * covariance / variance;
        }
    }
    ((1.0 - share) / (share * count as f64) * (1.0 + dependence).max(1.0)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::distribution::standard;
    use statrs::distribution::ContinuousCDF;
    use std::convert::Infallible;

    /// P(sum z_i / sqrt(d) > beta) is the tail of the normal distribution.
    fn linear(beta: f64) -> impl Fn(&Point) -> Result<f64, Infallible> + Sync {
        move |point: &Point| {
            let sum: f64 = point.normal.iter().sum();
            Ok(sum / (point.normal.len() as f64).sqrt() - beta)
        }
    }

    fn settings(seed: u64) -> Subset {
        Subset {
            dimension: 4,
            level_runs: 1000,
            least: 1e-9,
            seed,
            confidence: 0.95,
        }
    }

    /// One in a million, and a thousand: as often inside the interval as claimed, or nearly, and right
    /// on average.
    #[test]
    fn known_probabilities_are_found() {
        for beta in [3.090_232, 4.753_424] {
            let exact = 1.0 - standard().cdf(beta);
            let found = (0..60).map(|seed| {
                let found = settings(seed).estimate(&linear(beta)).unwrap();
                found.unwrap().probability
            });
            let found: Vec<Interval> = found.collect();
            let inside = found
                .iter()
                .filter(|i| i.lower <= exact && exact <= i.upper)
                .count();
            assert!(inside >= 51, "{inside} of 60 at {beta}");
            let mean = found.iter().map(|interval| interval.value).sum::<f64>() / 60.0;
            assert!((mean / exact - 1.0).abs() < 0.2, "{mean:e} for {exact:e}");
        }
    }

    /// The failure lies in two places, opposite each other.
    #[test]
    fn both_sides_are_found() {
        let limit = |point: &Point| -> Result<f64, Infallible> { Ok(point.normal[0].abs() - 4.0) };
        let exact = 2.0 * standard().cdf(-4.0);
        let found = (0..20).map(|seed| settings(seed).estimate(&limit).unwrap().unwrap());
        let mean = found.map(|found| found.probability.value).sum::<f64>() / 20.0;
        assert!((mean / exact - 1.0).abs() < 0.3, "{mean:e} for {exact:e}");
    }

    /// Noise that no coordinate moves: uniform in the seed, and summed with a normal one.
    #[test]
    fn noise_without_coordinates_counts() {
        let limit = |point: &Point| -> Result<f64, Infallible> {
            Ok(point.normal[0] + Random::new(point.noise, 0).normal() - 5.0)
        };
        let exact = standard().cdf(-5.0 / 2.0_f64.sqrt());
        let found = (0..20).map(|seed| settings(seed).estimate(&limit).unwrap().unwrap());
        let mean = found.map(|found| found.probability.value).sum::<f64>() / 20.0;
        assert!((mean / exact - 1.0).abs() < 0.3, "{mean:e} for {exact:e}");
    }

    #[test]
    fn what_never_fails_is_bounded_and_what_tells_nothing_is_said() {
        let found = settings(1).estimate(&linear(40.0)).unwrap().unwrap();
        assert_eq!(found.probability.value, 0.0);
        assert!(found.probability.upper < 1e-8 && found.failures.is_empty());
        let flat = |_: &Point| -> Result<f64, Infallible> { Ok(-1.0) };
        assert_eq!(settings(1).estimate(&flat).unwrap(), None);
    }

    #[test]
    fn the_threads_change_nothing() {
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            pool.install(|| settings(3).estimate(&linear(3.0)).unwrap())
        };
        assert_eq!(on(1), on(3));
    }
}
