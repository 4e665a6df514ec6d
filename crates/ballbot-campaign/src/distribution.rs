//! How an input is distributed: from a uniform number to its value.

mod of_table;

pub(crate) use of_table::rounding;

use crate::cell::Kind;
use statrs::distribution::{ContinuousCDF, Normal};
use toml::Value;

/// How an input is distributed.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Distribution {
    Uniform {
        from: f64,
        to: f64,
    },
    LogUniform {
        from: f64,
        to: f64,
    },
    Normal {
        mean: f64,
        deviation: f64,
        /// No value outside of these; infinite where there is no bound.
        bounds: (f64, f64),
        /// The shares of the whole distribution below the two.
        shares: (f64, f64),
    },
    Integers {
        from: i64,
        to: i64,
    },
    List(Vec<Value>),
    /// All values in turn, together with those of the other grids.
    Grid(Vec<Value>),
    /// A seed for each run.
    Seeds,
}

impl Distribution {
    /// The value at a uniform number from 0 to 1, both excluded, rounded to a multiple of `step`.
    /// A grid's are taken by their places instead.
    pub fn value(&self, u: f64, step: Option<f64>) -> Value {
        let number = match self {
            Self::Uniform { from, to } => from + u * (to - from),
            Self::LogUniform { from, to } => from * (to / from).powf(u),
            Self::Normal {
                mean,
                deviation,
                bounds: (lower, upper),
                shares: (below, above),
            } => {
                let share = below + u * (above - below);
                let number = mean + deviation * standard().inverse_cdf(share);
                number.max(*lower).min(*upper)
            }
            Self::Integers { from, to } => {
                let count = (*to as f64 - *from as f64) + 1.0;
                return Value::Integer(from.saturating_add((u * count) as i64).min(*to));
            }
            Self::Seeds => return Value::Integer((u * SEEDS) as i64),
            Self::List(values) | Self::Grid(values) => {
                let index = ((u * values.len() as f64) as usize).min(values.len() - 1);
                return values[index].clone();
            }
        };
        Value::Float(match step {
            Some(step) => {
                let (from, to) = self.steps(step);
                tidy((number / step).round().max(from).min(to) * step)
            }
            None => number,
        })
    }

    /// The least and the largest number of steps that are in its range.
    fn steps(&self, step: f64) -> (f64, f64) {
        let (from, to) = match self {
            Self::Uniform { from, to } | Self::LogUniform { from, to } => (*from, *to),
            Self::Normal { bounds, .. } => *bounds,
            _ => (f64::NEG_INFINITY, f64::INFINITY),
        };
        // What is a multiple but for rounding is one.
        let slack = 1e-9;
        ((from / step - slack).ceil(), (to / step + slack).floor())
    }

    /// The number from 0 to 1 whose value this is, in the middle of those that give it; none where
    /// nothing does, or the values have no order of their own.
    pub fn unit(&self, value: &Value) -> Option<f64> {
        let number = match value {
            Value::Integer(number) => *number as f64,
            Value::Float(number) => *number,
            _ => f64::NAN,
        };
        let u = match self {
            Self::Uniform { from, to } => (number - from) / (to - from),
            Self::LogUniform { from, to } => (number / from).ln() / (to / from).ln(),
            Self::Integers { from, to } => {
                let count = (*to as f64 - *from as f64) + 1.0;
                (value.as_integer()? as f64 - *from as f64 + 0.5) / count
            }
            Self::List(values) => {
                let place = values.iter().position(|other| other == value)?;
                (place as f64 + 0.5) / values.len() as f64
            }
            Self::Normal { .. } | Self::Grid(_) | Self::Seeds => return None,
        };
        (0.0..=1.0).contains(&u).then_some(u)
    }

    /// Whether its values follow from a uniform number that a sequence can lay out.
    pub fn is_laid_out(&self) -> bool {
        !matches!(self, Self::Grid(_) | Self::Seeds)
    }

    /// Whether a small change of the uniform number is a small change of the value.
    pub fn is_continuous(&self) -> bool {
        matches!(
            self,
            Self::Uniform { .. } | Self::LogUniform { .. } | Self::Normal { .. }
        )
    }

    /// What its column holds.
    pub fn kind(&self) -> Kind {
        match self {
            Self::Uniform { .. } | Self::LogUniform { .. } | Self::Normal { .. } => Kind::Real,
            Self::Integers { .. } | Self::Seeds => Kind::Whole,
            Self::List(values) | Self::Grid(values) => {
                let all = |fits: fn(&Value) -> bool| values.iter().all(fits);
                if all(Value::is_integer) {
                    Kind::Whole
                } else if all(|value| value.is_integer() || value.is_float()) {
                    Kind::Real
                } else if all(Value::is_bool) {
                    Kind::Flag
                } else {
                    Kind::Text
                }
            }
        }
    }
}

/// As many seeds: each is a whole number that an f64 holds exactly.
const SEEDS: f64 = (1_u64 << 53) as f64;

/// The standard normal distribution.
pub(crate) fn standard() -> Normal {
    Normal::standard()
}

/// 0.3, not 0.30000000000000004.
fn tidy(number: f64) -> f64 {
    format!("{number:.12e}").parse().unwrap_or(number)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::CampaignError;
    use crate::file::VaryTable;

    fn of(text: &str) -> Result<Distribution, CampaignError> {
        let table: VaryTable = toml::from_str(&format!("key = \"a\"\n{text}")).unwrap();
        Distribution::new("vary[0]", &table)
    }

    #[test]
    fn what_is_rounded_stays_in_its_range() {
        for text in [
            "uniform = [0.003, 0.041]",
            "log_uniform = [0.003, 0.041]",
            "normal = { mean = 0.02, deviation = 0.03, lower = 0.003, upper = 0.041 }",
        ] {
            let distribution = of(text).unwrap();
            for i in 0..1000 {
                let value = distribution.value((f64::from(i) + 0.5) / 1000.0, Some(0.01));
                let steps = value.as_float().unwrap() / 0.01;
                assert!(
                    (1.0 - 1e-9..=4.0 + 1e-9).contains(&steps),
                    "{text}: {steps}"
                );
            }
            let message = rounding("vary[0]", Some(0.1), &distribution)
                .unwrap_err()
                .to_string();
            assert!(
                message.contains("no multiple of it is in the range"),
                "{message}"
            );
        }
    }

    /// A campaign drew zero a thousand times, and nothing was said.
    #[test]
    fn a_rounding_that_leaves_one_value_is_refused() {
        let distribution = of("uniform = [0.0, 0.05]").unwrap();
        let error = rounding("vary[0]", Some(5.0), &distribution).unwrap_err();
        let message = error.to_string();
        assert!(
            message.starts_with("vary[0].round_to = 5.0: a single multiple of it is in the range"),
            "{message}"
        );
        assert_eq!(
            rounding("vary[0]", Some(0.05), &distribution).unwrap(),
            Some(0.05)
        );
        let normal = of("normal = { mean = 2.0, deviation = 3.0 }").unwrap();
        assert_eq!(rounding("vary[0]", Some(5.0), &normal).unwrap(), Some(5.0));
    }

    fn numbers(text: &str) -> Vec<f64> {
        let distribution = of(text).unwrap();
        let at = |i: i32| (f64::from(i) + 0.5) / 10_000.0;
        let value = |i| distribution.value(at(i), None).as_float().unwrap();
        (0..10_000).map(value).collect()
    }

    /// Mean and variance by the midpoint rule, beside those of the textbook.
    #[test]
    fn moments_are_those_of_the_distributions() {
        for (text, mean, variance) in [
            ("uniform = [1.0, 4.0]", 2.5, 9.0 / 12.0),
            // (b - a)/ln(b/a) and (b^2 - a^2)/(2 ln(b/a)) - mean^2
            ("log_uniform = [1.0, 100.0]", 21.497_576, 623.450_0),
            ("normal = { mean = 2.0, deviation = 3.0 }", 2.0, 9.0),
            // Half a normal distribution: sqrt(2/pi) and 1 - 2/pi.
            (
                "normal = { mean = 0.0, deviation = 1.0, lower = 0.0 }",
                0.797_885,
                0.363_380,
            ),
        ] {
            let numbers = numbers(text);
            let count = numbers.len() as f64;
            let found = numbers.iter().sum::<f64>() / count;
            let spread = numbers.iter().map(|x| (x - found).powi(2)).sum::<f64>() / count;
            assert!((found / mean - 1.0).abs() < 1e-3, "{text}: mean {found}");
            assert!(
                (spread / variance - 1.0).abs() < 5e-3,
                "{text}: variance {spread}"
            );
        }
    }

    #[test]
    fn discrete_values_are_all_as_likely() {
        for (text, count) in [("integers = [-2, 5]", 8), ("list = [1, 5, \"a\", true]", 4)] {
            let distribution = of(text).unwrap();
            let mut found = std::collections::BTreeMap::new();
            for i in 0..800 {
                let value = distribution.value((f64::from(i) + 0.5) / 800.0, None);
                *found.entry(value.to_string()).or_insert(0) += 1;
            }
            assert!(
                found.len() == count && found.values().all(|n| *n == 800 / count),
                "{found:?}"
            );
        }
    }

    #[test]
    fn the_ends_stay_inside() {
        let smallest = f64::EPSILON / 4.0;
        for u in [smallest, 1.0 - f64::EPSILON / 2.0] {
            for text in [
                "uniform = [1.0, 2.0]",
                "log_uniform = [1.0, 2.0]",
                "integers = [1, 2]",
            ] {
                let value = of(text).unwrap().value(u, None);
                let number = value
                    .as_float()
                    .or(value.as_integer().map(|n| n as f64))
                    .unwrap();
                assert!((1.0..=2.0).contains(&number), "{text}: {number}");
            }
            let normal = of("normal = { mean = 0.0, deviation = 1.0 }").unwrap();
            assert!(normal.value(u, None).as_float().unwrap().is_finite());
        }
    }

    #[test]
    fn rounding_gives_tidy_multiples() {
        let distribution = of("uniform = [0.0, 1.0]").unwrap();
        assert_eq!(distribution.value(0.31, Some(0.1)), Value::Float(0.3));
        assert_eq!(distribution.value(0.0349, Some(0.005)), Value::Float(0.035));
    }

    #[test]
    fn what_makes_no_sense_is_refused_with_its_place() {
        for (text, part) in [
            ("uniform = [2.0, 1.0]", "vary[0].uniform = [2.0, 1.0]"),
            ("uniform = [0.0, nan]", "finite"),
            ("uniform = [0.0, inf]", "finite"),
            ("uniform = [-1e308, 1e308]", "finite"),
            ("log_uniform = [0.0, 1.0]", "positive"),
            (
                "normal = { mean = 0.0, deviation = -1.0 }",
                "vary[0].normal.deviation = -1.0",
            ),
            (
                "normal = { mean = nan, deviation = 1.0 }",
                "vary[0].normal.mean",
            ),
            (
                "normal = { mean = 0.0, deviation = 1.0, lower = 2.0, upper = 1.0 }",
                "lower 2.0",
            ),
            (
                "normal = { mean = 0.0, deviation = 1.0, lower = 90.0 }",
                "millionth",
            ),
            ("integers = [5, 5]", "[5, 5]"),
            ("list = []", "(0 values)"),
            ("grid = [1, 1]", "differ"),
            ("range = { from = 0.0, to = 1.0, points = 1 }", "2 to"),
            ("seeds = false", "exactly one"),
            ("uniform = [0.0, 1.0]\nlist = [1]", "several"),
        ] {
            let message = of(text).unwrap_err().to_string();
            assert!(message.contains(part), "{text}: {message}");
        }
    }
}
