//! Before and after, in the same worlds, which the search has not seen.

use crate::judge::{Quantity, Ran};
use ballbot_campaign::Interval;
use lpvmpc_sim::Random;
use serde::Serialize;

/// A goal or a limit before and after, with percentile intervals of the bootstrap.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// The statistic and its measure.
    pub name: String,
    /// The target or limit.
    pub at_most: Option<f64>,
    /// Of the start.
    pub before: Interval,
    /// Of the candidate.
    pub after: Interval,
    /// After less before, run by run of the same worlds.
    pub difference: Interval,
    /// Each run's values, before and after.
    #[serde(skip)]
    pub pairs: Vec<(f64, f64)>,
}

impl Comparison {
    /// Whether the interval of the difference is below 0.
    pub fn is_better(&self) -> bool {
        self.difference.upper < 0.0
    }

    /// Whether it is above 0.
    pub fn is_worse(&self) -> bool {
        self.difference.lower > 0.0
    }
}

/// Resamples of the bootstrap.
const RESAMPLES: usize = 2000;

/// A goal or a limit in the same worlds before and after. The bootstrap draws worlds, each with its
/// two runs, so that what the worlds have in common cancels in the difference; and of each point of a
/// grid, of which there are `points`, as many as there are, if these are several.
pub fn compare(
    quantity: &Quantity,
    (before, after): (&[Ran], &[Ran]),
    points: usize,
    confidence: f64,
    seed: u64,
) -> Comparison {
    let (before, after) = (quantity.values(before), quantity.values(after));
    let n = before.len().min(after.len());
    let of = |values: &[f64], places: &[usize]| {
        let drawn: Vec<f64> = places.iter().map(|place| values[*place]).collect();
        quantity.statistic.at_least(&drawn, places.len())
    };
    let all: Vec<usize> = (0..n).collect();
    let estimates = |places: &[usize]| {
        let (before, after) = (of(&before, places), of(&after, places));
        [before, after, difference(before, after)]
    };
    let found = estimates(&all);
    // Of one world there is nothing to draw.
    let points = if n >= 2 * points { points } else { 1 };
    let repeats = n / points;
    let mut random = Random::new(seed, 0);
    let mut drawn = [const { Vec::new() }; 3];
    for _ in 0..RESAMPLES {
        let draw = |place: usize| {
            let repeat = (random.uniform() * repeats as f64) as usize;
            place % points + points * repeat
        };
        let places: Vec<usize> = (0..n).map(draw).collect();
        for (all, one) in drawn.iter_mut().zip(estimates(&places)) {
            all.push(one);
        }
    }
    let tail = 0.5 * (1.0 - confidence);
    let mut intervals = found.into_iter().zip(drawn).map(|(value, mut drawn)| {
        drawn.sort_by(f64::total_cmp);
        let at = |share: f64| drawn[((share * RESAMPLES as f64) as usize).min(RESAMPLES - 1)];
        Interval {
            value,
            lower: at(tail),
            upper: at(1.0 - tail),
        }
    });
    let mut next = || {
        intervals.next().unwrap_or(Interval {
            value: 0.0,
            lower: 0.0,
            upper: 0.0,
        })
    };
    Comparison {
        name: quantity.to_string(),
        at_most: quantity.at_most,
        before: next(),
        after: next(),
        difference: next(),
        pairs: before.iter().copied().zip(after.iter().copied()).collect(),
    }
}

/// Of two that are infinite neither is better.
fn difference(before: f64, after: f64) -> f64 {
    if before == after { 0.0 } else { after - before }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::file::TuningFile;
    use crate::judge::Judge;

    fn quantity() -> Quantity {
        let file: TuningFile = toml::from_str(
            "title = \"x\"\nscenario = \"x\"\n[parameters]\n[[goal]]\nmeasure = \"rms_error_rad\"\n\
             statistic = \"mean\"\n",
        )
        .unwrap();
        Judge::new(&file, 1.0).unwrap().goals[0]
    }

    fn ran(numbers: impl Iterator<Item = f64>) -> Vec<Ran> {
        let one = |number| Ran {
            success: true,
            lost: 0.0,
            numbers: vec![1.0, number],
        };
        numbers.map(one).collect()
    }

    /// What all worlds have in common cancels; of a normal difference the interval is the usual one.
    #[test]
    fn the_difference_is_that_of_pairs() {
        let mut random = Random::new(4, 0);
        let worlds: Vec<f64> = (0..200).map(|_| 10.0 + 3.0 * random.normal()).collect();
        let shifted = worlds
            .iter()
            .map(|world| world - 0.5 + 0.1 * random.normal());
        let (before, after) = (
            ran(worlds.iter().copied()),
            ran(shifted.collect::<Vec<_>>().into_iter()),
        );
        let found = compare(&quantity(), (&before, &after), 1, 0.95, 1);
        assert!(found.is_better() && !found.is_worse());
        assert!((found.difference.value + 0.5).abs() < 0.03, "{found:?}");
        let width = found.difference.upper - found.difference.lower;
        let usual = 2.0 * 1.96 * 0.1 / 200.0_f64.sqrt();
        assert!((width / usual - 1.0).abs() < 0.25, "{width} {usual}");
        // Unpaired, nothing could be told.
        assert!(found.before.upper - found.before.lower > 0.6);
        assert_eq!(compare(&quantity(), (&before, &after), 1, 0.95, 1), found);
    }

    /// Two points of a grid that differ much: what differs between them is no uncertainty.
    #[test]
    fn each_point_of_a_grid_keeps_its_share() {
        let mut random = Random::new(6, 0);
        let mut values = |shift: f64| {
            let noisy = (0..40).map(|i| 10.0 * f64::from(i % 2) + shift + 0.1 * random.normal());
            ran(noisy.collect::<Vec<_>>().into_iter())
        };
        let (before, after) = (values(1.0), values(0.9));
        let width = |points| {
            let found = compare(&quantity(), (&before, &after), points, 0.95, 1);
            found.before.upper - found.before.lower
        };
        let usual = 2.0 * 1.96 * 0.1 / 40.0_f64.sqrt();
        assert!((width(2) / usual - 1.0).abs() < 0.3, "{} {usual}", width(2));
        assert!(width(1) > 2.0);
    }

    #[test]
    fn runs_that_fell_before_and_after_make_no_difference() {
        let fell = ran([f64::INFINITY, 1.0].into_iter());
        let found = compare(&quantity(), (&fell, &fell), 1, 0.95, 1);
        assert_eq!(found.difference.value, 0.0);
        assert!(!found.is_better() && !found.is_worse());
        let better = compare(
            &quantity(),
            (&fell, &ran([1.0, 1.0].into_iter())),
            1,
            0.95,
            1,
        );
        assert_eq!(better.difference.value, f64::NEG_INFINITY);
    }
}
