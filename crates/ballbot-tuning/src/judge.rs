//! What a candidate is worth: its goals and limits over the worlds, and one number for the search.

use crate::comparable;
use crate::error::TuningError;
use crate::file::{GoalTable, Statistic, TuningFile};
use ballbot_campaign::{Cell, Column, Ending, Measure, Row};
use serde::{Deserialize, Serialize};
use std::fmt;

/// What the goals and limits need of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ran {
    /// Whether it came to its end and kept what a success must.
    pub success: bool,
    /// The share of its time that it did not last.
    pub lost: f64,
    /// The measures, in the judge's order; infinite where the run did not come to its end, or has none.
    #[serde(with = "infinite")]
    pub numbers: Vec<f64>,
}

/// Numbers in JSON, which has no infinite ones: `null`.
pub(crate) mod infinite {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub fn serialize<S: Serializer>(numbers: &[f64], to: S) -> Result<S::Ok, S::Error> {
        let finite = |number: &f64| Some(*number).filter(|number| number.is_finite());
        numbers.iter().map(finite).collect::<Vec<_>>().serialize(to)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<f64>, D::Error> {
        let numbers = Vec::<Option<f64>>::deserialize(from)?;
        let number = |number: Option<f64>| number.unwrap_or(f64::INFINITY);
        Ok(numbers.into_iter().map(number).collect())
    }
}

/// A statistic of a measure, with what it must or should not exceed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantity {
    /// The measure; none for the share of failures.
    pub measure: Option<Measure>,
    /// Its statistic.
    pub statistic: Statistic,
    /// A target or a limit.
    pub at_most: Option<f64>,
    /// Place of the measure in the runs' numbers.
    index: usize,
}

impl Quantity {
    /// Its values, run by run: a failure is 1.
    pub fn values(&self, runs: &[Ran]) -> Vec<f64> {
        let value = |run: &Ran| match self.measure {
            Some(_) => run
                .numbers
                .get(self.index)
                .copied()
                .unwrap_or(f64::INFINITY),
            None => f64::from(u8::from(!run.success)),
        };
        runs.iter().map(value).collect()
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let measure = self.measure.map_or("", Measure::name);
        match self.statistic {
            Statistic::Mean => write!(f, "mean {measure}"),
            Statistic::Median => write!(f, "median {measure}"),
            Statistic::Worst => write!(f, "worst {measure}"),
            Statistic::Quantile(share) => write!(f, "{} % quantile {measure}", 100.0 * share),
            Statistic::FailureShare => write!(f, "share of failures"),
        }
    }
}

/// Goals and limits.
#[derive(Clone, Debug)]
pub struct Judge {
    /// What is to become small.
    pub goals: Vec<Quantity>,
    /// What must be kept.
    pub limits: Vec<Quantity>,
    /// What is measured of a run.
    pub measures: Vec<Measure>,
    /// What a run lasts, s.
    duration: f64,
}

/// The goals and limits of a candidate; lower bounds of them while runs are missing.
#[derive(Clone, Debug, PartialEq)]
pub struct Judged {
    /// In the order of the file.
    pub goals: Vec<f64>,
    /// In the order of the file.
    pub limits: Vec<f64>,
    /// The mean share of a run's time that it did not last.
    pub lost: f64,
    /// Whether all runs are in it.
    pub exact: bool,
}

/// What a candidate is worth to the search.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Each goal above its target, in units of what the start is above it; 0 where it is reached.
    pub goals: Vec<f64>,
    /// How far limits are exceeded; 0 for a candidate that keeps all.
    pub violation: f64,
    /// Whether it is of all runs; a lower bound otherwise.
    pub exact: bool,
}

/// Goals at most: a front of more cannot be looked at, and takes too many candidates.
const MOST_GOALS: usize = 3;

impl Judge {
    /// The goals and limits of a file; a run lasts `duration` s.
    ///
    /// # Errors
    /// A goal or a limit that makes no sense.
    pub fn new(file: &TuningFile, duration: f64) -> Result<Self, TuningError> {
        if !(1..=MOST_GOALS).contains(&file.goal.len()) {
            let expected =
                format!("1 to {MOST_GOALS} goals are possible; what else matters is a [[limit]]");
            return Err(TuningError::value(
                "goal",
                format!("({})", file.goal.len()),
                expected,
            ));
        }
        let mut judge = Self {
            goals: Vec::new(),
            limits: Vec::new(),
            measures: vec![Measure::EndS],
            duration,
        };
        for (i, goal) in file.goal.iter().enumerate() {
            let quantity = judge.quantity(
                &format!("goal[{i}]"),
                goal.measure,
                goal.statistic,
                goal.at_most,
            )?;
            comparable::check_goal(&format!("goal[{i}]"), &quantity, file)?;
            let is_same = |other: &GoalTable| {
                (other.measure, other.statistic) == (goal.measure, goal.statistic)
            };
            if let Some(first) = file.goal[..i].iter().position(is_same) {
                let expected = format!("goal[{first}] is the same; leave one of them out");
                return Err(TuningError::value(
                    format!("goal[{i}]"),
                    quantity.to_string(),
                    expected,
                ));
            }
            judge.goals.push(quantity);
        }
        for (i, limit) in file.limit.iter().enumerate() {
            let place = format!("limit[{i}]");
            let quantity =
                judge.quantity(&place, limit.measure, limit.statistic, Some(limit.at_most))?;
            comparable::check_limit(&place, &quantity, file)?;
            judge.limits.push(quantity);
        }
        for (measure, limits) in &file.worlds.success {
            comparable::check_success(*measure, limits, file)?;
            judge.index(*measure);
        }
        Ok(judge)
    }

    /// The place of a measure in the runs' numbers.
    fn index(&mut self, measure: Measure) -> usize {
        let found = self.measures.iter().position(|other| *other == measure);
        found.unwrap_or_else(|| {
            self.measures.push(measure);
            self.measures.len() - 1
        })
    }

    fn quantity(
        &mut self,
        place: &str,
        measure: Option<Measure>,
        statistic: Statistic,
        at_most: Option<f64>,
    ) -> Result<Quantity, TuningError> {
        let refused = |key: &str, value: String, expected: &str| {
            Err(TuningError::value(
                format!("{place}.{key}"),
                value,
                expected,
            ))
        };
        match (measure, statistic) {
            (None, Statistic::FailureShare) => {}
            (Some(measure), Statistic::FailureShare) => {
                let expected =
                    "a share of failures is of no measure; [worlds.success] says what fails";
                return refused("measure", measure.to_string(), expected);
            }
            (None, _) => {
                let expected = "this statistic needs a measure; only failure_share is without";
                return refused("measure", "(absent)".to_owned(), expected);
            }
            _ => {}
        }
        if let Statistic::Quantile(share) = statistic
            && !(share > 0.0 && share < 1.0)
        {
            let expected = "it must be above 0 and below 1, such as 0.9; the largest is \"worst\"";
            return refused("statistic.quantile", format!("{share:?}"), expected);
        }
        if let Some(most) = at_most
            && !(most >= 0.0 && most.is_finite())
        {
            let expected = "it must be 0 or more, and finite, as measures are";
            return refused("at_most", format!("{most:?}"), expected);
        }
        Ok(Quantity {
            measure,
            statistic,
            at_most,
            index: measure.map_or(0, |measure| self.index(measure)),
        })
    }

    /// What is needed of a run's row.
    pub fn ran(&self, columns: &[Column], row: &Row) -> Ran {
        let cell = |name: &str| {
            let place = columns.iter().position(|column| column.name == name);
            place
                .and_then(|place| row.get(place))
                .unwrap_or(&Cell::Missing)
        };
        let complete = *cell("outcome") == Cell::Text(Ending::Complete.name().to_owned());
        let number = |measure: &Measure| match complete {
            true => cell(measure.name()).number().unwrap_or(f64::INFINITY),
            false => f64::INFINITY,
        };
        let end = cell(Measure::EndS.name()).number().unwrap_or(0.0);
        Ran {
            success: *cell("success") == Cell::Flag(true),
            lost: match complete {
                true => 0.0,
                false => (1.0 - end / self.duration).clamp(0.0, 1.0),
            },
            numbers: self.measures.iter().map(number).collect(),
        }
    }

    /// Goals and limits over `of` runs, some of which may be missing.
    pub fn judged(&self, runs: &[Ran], of: usize) -> Judged {
        let all = |quantities: &[Quantity]| {
            let each = quantities.iter();
            let each = each.map(|each| each.statistic.at_least(&each.values(runs), of));
            each.collect()
        };
        Judged {
            goals: all(&self.goals),
            limits: all(&self.limits),
            lost: runs.iter().map(|run| run.lost).sum::<f64>() / of.max(1) as f64,
            exact: runs.len() >= of,
        }
    }

    /// What that is worth. More runs make it no better. A limit that is exceeded counts less than
    /// 1; a statistic that is not finite, since runs ended early, 1 and the time that they lost.
    pub fn outcome(&self, judged: &Judged, scale: &[f64]) -> Outcome {
        let unending = |value: f64| {
            if value.is_finite() {
                0.0
            } else {
                1.0 + judged.lost
            }
        };
        let excess = |(quantity, value): (&Quantity, &f64)| {
            let most = quantity.at_most.unwrap_or(f64::INFINITY);
            let unit = if most > 0.0 { most } else { 1.0 };
            match (value - most) / unit {
                excess if !value.is_finite() || !excess.is_finite() => unending(*value),
                excess => excess.max(0.0) / (1.0 + excess.max(0.0)),
            }
        };
        let limits = self.limits.iter().zip(&judged.limits).map(excess);
        let goals = judged.goals.iter().map(|value| unending(*value));
        let reached = |((quantity, value), scale): ((&Quantity, &f64), &f64)| {
            ((value - quantity.at_most.unwrap_or(0.0)) / scale).max(0.0)
        };
        Outcome {
            violation: limits.chain(goals).sum(),
            goals: self
                .goals
                .iter()
                .zip(&judged.goals)
                .zip(scale)
                .map(reached)
                .collect(),
            exact: judged.exact,
        }
    }

    /// The units of the goals: what the start is above their targets, so that all begin at 1; where it
    /// is not, the target, or 1.
    pub fn scale(&self, start: &Judged) -> Vec<f64> {
        let unit = |(quantity, value): (&Quantity, &f64)| {
            let target = quantity.at_most.unwrap_or(0.0);
            let positive = |unit: f64| Some(unit).filter(|unit| *unit > 0.0 && unit.is_finite());
            positive(value - target).or(positive(target)).unwrap_or(1.0)
        };
        self.goals.iter().zip(&start.goals).map(unit).collect()
    }

    /// Goals and limits for people.
    pub fn words(&self, judged: &Judged) -> String {
        let goals = self.goals.iter().zip(&judged.goals);
        let limits = self.limits.iter().zip(&judged.limits);
        let words = goals.chain(limits).map(|(quantity, value)| {
            let most = quantity
                .at_most
                .map_or(String::new(), |most| format!(" (at most {most})"));
            format!("{quantity} {value:.4}{most}")
        });
        words.collect::<Vec<_>>().join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::{value, weightings};
    use lpvmpc_sim::Random;

    /// What a candidate is worth gets no better by more runs, so it can be given up.
    #[test]
    fn more_runs_make_no_candidate_better() {
        let file: TuningFile = toml::from_str(
            "title = \"x\"\nscenario = \"x\"\n[parameters]\n\
             [[goal]]\nmeasure = \"rms_error_rad\"\nstatistic = \"median\"\n\
             [[goal]]\nmeasure = \"settling_s\"\nstatistic = { quantile = 0.8 }\nat_most = 0.2\n\
             [[limit]]\nstatistic = \"failure_share\"\nat_most = 0.2\n\
             [[limit]]\nmeasure = \"largest_tilt_rad\"\nstatistic = \"worst\"\nat_most = 0.97\n",
        )
        .unwrap();
        let judge = Judge::new(&file, 2.0).unwrap();
        let mut random = Random::new(9, 0);
        let mut exceeded = 0;
        for _ in 0..300 {
            let ran = |random: &mut Random| {
                let complete = random.uniform() > 0.03;
                let measure = |random: &mut Random| match complete {
                    true => random.uniform(),
                    false => f64::INFINITY,
                };
                Ran {
                    success: complete && random.uniform() > 0.02,
                    lost: if complete { 0.0 } else { random.uniform() },
                    numbers: judge.measures.iter().map(|_| measure(random)).collect(),
                }
            };
            let runs: Vec<Ran> = (0..12).map(|_| ran(&mut random)).collect();
            let whole = judge.judged(&runs, runs.len());
            let scale = judge.scale(&whole);
            for weights in weightings(2) {
                let mut last = 0.0;
                for known in 0..=runs.len() {
                    let judged = judge.judged(&runs[..known], runs.len());
                    assert_eq!(judged.exact, known == runs.len());
                    let now = value(&judge.outcome(&judged, &scale), &weights);
                    assert!(now >= last, "{now} after {last}: {judged:?}");
                    last = now;
                }
                exceeded += u32::from(last > 1.0);
            }
        }
        assert!(
            (150..1350).contains(&exceeded),
            "some keep their limits: {exceeded}"
        );
    }
}
