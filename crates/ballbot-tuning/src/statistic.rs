//! One number of many runs, and what it is at least while some of them are still to be run.

use crate::file::Statistic;

impl Statistic {
    /// The statistic of `of` values, none of which is negative, where only `values` are known: with
    /// the others 0. So it is the statistic when all are known, and no more than it before.
    pub fn at_least(self, values: &[f64], of: usize) -> f64 {
        let missing = of.saturating_sub(values.len());
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let at = |place: usize| match place.checked_sub(missing) {
            Some(place) => sorted.get(place).copied().unwrap_or(0.0),
            None => 0.0,
        };
        match self {
            Self::Mean | Self::FailureShare => values.iter().sum::<f64>() / of.max(1) as f64,
            Self::Median if of.is_multiple_of(2) => {
                0.5 * (at((of / 2).saturating_sub(1)) + at(of / 2))
            }
            Self::Median => at(of / 2),
            Self::Worst => at(of.saturating_sub(1)),
            // Of 100 values 0.55 is the 55th, though 0.55 * 100 is above 55 in floating point.
            Self::Quantile(share) => {
                at(((share * of as f64 - 1e-9).ceil() as usize).saturating_sub(1))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lpvmpc_sim::Random;

    #[test]
    fn the_statistics_of_known_values_are_the_usual_ones() {
        let values = [5.0, 1.0, 2.0, 4.0, 3.0, 10.0, 6.0, 9.0, 7.0, 8.0];
        let of = |statistic: Statistic| statistic.at_least(&values, 10);
        assert_eq!(of(Statistic::Mean), 5.5);
        assert_eq!(of(Statistic::Median), 5.5);
        assert_eq!(of(Statistic::Worst), 10.0);
        // 0.9 * 10 is above 9 in floating point on no machine.
        assert_eq!(of(Statistic::Quantile(0.9)), 9.0);
        // 0.55 * 100 and 0.28 * 25 are above whole numbers.
        let ranks: Vec<f64> = (1..=100).map(f64::from).collect();
        assert_eq!(Statistic::Quantile(0.55).at_least(&ranks, 100), 55.0);
        assert_eq!(Statistic::Quantile(0.28).at_least(&ranks[..25], 25), 7.0);
        assert_eq!(Statistic::Median.at_least(&values[..9], 9), 5.0);
        let failed = [1.0, 0.0, 0.0, 1.0];
        assert_eq!(Statistic::FailureShare.at_least(&failed, 4), 0.5);
    }

    #[test]
    fn what_a_part_says_is_never_taken_back() {
        let mut random = Random::new(3, 0);
        for _ in 0..200 {
            let draw = |random: &mut Random| match random.uniform() {
                u if u < 0.1 => f64::INFINITY,
                u => u,
            };
            let values: Vec<f64> = (0..11).map(|_| draw(&mut random)).collect();
            for statistic in [
                Statistic::Mean,
                Statistic::Median,
                Statistic::Worst,
                Statistic::Quantile(0.8),
            ] {
                let mut last = 0.0;
                for known in 0..=values.len() {
                    let now = statistic.at_least(&values[..known], values.len());
                    assert!(now >= last, "{statistic:?}: {now} after {last}");
                    last = now;
                }
            }
        }
    }
}
