//! Intervals of what many runs say.

use crate::distribution::standard;
use serde::Serialize;
use statrs::distribution::{Binomial, ContinuousCDF, DiscreteCDF};

/// A number with an interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// The estimate.
    pub value: f64,
    /// Its lower end.
    pub lower: f64,
    /// Its upper end.
    pub upper: f64,
}

impl Interval {
    /// The larger of the distances from the estimate to the ends.
    pub fn reach(&self) -> f64 {
        (self.upper - self.value).max(self.value - self.lower)
    }
}

/// How many standard deviations to either side of its mean hold so much of a normal distribution.
pub fn deviations(confidence: f64) -> f64 {
    standard().inverse_cdf(0.5 + 0.5 * confidence)
}

/// The share `count` of `of`, with its interval after Wilson (1927). Of none, it is anything.
pub fn share(count: u64, of: u64, confidence: f64) -> Interval {
    if of == 0 {
        return Interval {
            value: 0.0,
            lower: 0.0,
            upper: 1.0,
        };
    }
    let (n, z) = (of as f64, deviations(confidence));
    let p = count as f64 / n;
    let shrink = 1.0 + z * z / n;
    let middle = (p + z * z / (2.0 * n)) / shrink;
    let half = z / shrink * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
    Interval {
        value: p,
        // At none and at all, rounding alone keeps the ends away.
        lower: if count == 0 {
            0.0
        } else {
            (middle - half).max(0.0)
        },
        upper: if count == of {
            1.0
        } else {
            (middle + half).min(1.0)
        },
    }
}

/// The median of values in rising order, with the percentile interval of its bootstrap: without
/// drawing samples, since a value is the median of one with a probability that is known (Efron 1982,
/// section 10.1). `None` for no values.
pub fn median(sorted: &[f64], confidence: f64) -> Option<Interval> {
    let n = sorted.len();
    let middle = |i: usize| sorted.get(i).copied();
    let value = match n % 2 {
        1 => middle(n / 2)?,
        _ => 0.5 * (middle((n / 2).checked_sub(1)?)? + middle(n / 2)?),
    };
    let tail = 0.5 * (1.0 - confidence);
    let place = |share: f64| middle(bootstrap_place(n, share).min(n - 1));
    Some(Interval {
        value,
        lower: place(tail)?,
        upper: place(1.0 - tail)?,
    })
}

/// Beyond so many values the binomial distribution is taken for the normal one.
const LARGE: usize = 10_000;

/// The place of the value below or at which a bootstrap's median is with probability `share`.
fn bootstrap_place(n: usize, share: f64) -> usize {
    if n > LARGE {
        let half = n as f64 / 2.0;
        let place = half + standard().inverse_cdf(share) * half.sqrt() / std::f64::consts::SQRT_2;
        return place.max(0.0) as usize;
    }
    // A bootstrap's median is at or below the value with index k if the middle of its n draws and
    // all before it are among the first k + 1 values.
    let middle = n.div_ceil(2) as u64;
    let below = |k: usize| {
        let draws = Binomial::new((k + 1) as f64 / n as f64, n as u64);
        draws.map_or(1.0, |draws| draws.sf(middle - 1))
    };
    let (mut from, mut until) = (0, n - 1);
    while from < until {
        let k = usize::midpoint(from, until);
        if below(k) >= share {
            until = k;
        } else {
            from = k + 1;
        }
    }
    from
}

#[cfg(test)]
mod tests {
    use super::*;
    use lpvmpc_sim::Random;

    /// Brown, Cai and DasGupta (2001) have no table; these are of the quadratic that Wilson solves:
    /// (p - x)^2 = z^2 x (1 - x) / n at both ends.
    #[test]
    fn wilson_s_ends_solve_his_equation() {
        let z = deviations(0.95);
        assert!((z - 1.959_963_985).abs() < 1e-8);
        for (count, of) in [(1, 10), (5, 10), (3, 1000), (999, 1000)] {
            let Interval {
                value,
                lower,
                upper,
            } = share(count, of, 0.95);
            for x in [lower, upper] {
                let residual = (value - x).powi(2) - z * z * x * (1.0 - x) / of as f64;
                assert!(residual.abs() < 1e-12, "{count} of {of}: {residual}");
            }
            assert!(lower < value && value < upper);
        }
        assert_eq!(share(0, 50, 0.95).lower, 0.0);
        assert_eq!(share(50, 50, 0.95).upper, 1.0);
    }

    /// Against the bootstrap as it is usually done.
    #[test]
    fn the_median_s_interval_is_that_of_many_resamples() {
        let mut random = Random::new(5, 0);
        for n in [9_usize, 50, 401] {
            let mut values: Vec<f64> = (0..n).map(|_| random.normal()).collect();
            values.sort_by(f64::total_cmp);
            let found = median(&values, 0.9).unwrap();
            let mut medians: Vec<f64> = (0..4000)
                .map(|_| {
                    let draw = |_| values[(random.uniform() * n as f64) as usize];
                    let mut sample: Vec<f64> = (0..n).map(draw).collect();
                    sample.sort_by(f64::total_cmp);
                    sample[n.div_ceil(2) - 1]
                })
                .collect();
            medians.sort_by(f64::total_cmp);
            // The share of the resamples below each end, four standard deviations of a share wide.
            for (end, share) in [(found.lower, 0.05), (found.upper, 0.95)] {
                let below = medians.partition_point(|m| *m < end) as f64 / 4000.0;
                let up_to = medians.partition_point(|m| *m <= end) as f64 / 4000.0;
                assert!(
                    below <= share + 0.014 && up_to >= share - 0.014,
                    "{n}: {below} {up_to}"
                );
            }
        }
    }

    /// The normal distribution takes over without a jump.
    #[test]
    fn many_values_go_on_as_few_do() {
        for share in [0.025, 0.5, 0.975] {
            let (few, many) = (
                bootstrap_place(LARGE, share),
                bootstrap_place(LARGE + 1, share),
            );
            assert!(few.abs_diff(many) <= 2, "{few} {many}");
        }
    }
}
