//! Figures over many problems.

use std::collections::BTreeMap;
use std::fmt;

/// A sample of numbers: how many, and how large.
#[derive(Clone, Debug, Default)]
pub struct Distribution(Vec<f64>);

impl Distribution {
    pub fn add(&mut self, value: f64) {
        self.0.push(value);
    }

    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// The largest; NaN counts as larger than any number.
    pub fn max(&self) -> f64 {
        self.quantile(1.0)
    }

    pub fn quantile(&self, fraction: f64) -> f64 {
        let mut sorted = self.0.clone();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len().saturating_sub(1);
        sorted
            .get((fraction * last as f64).round() as usize)
            .copied()
            .unwrap_or(0.0)
    }
}

impl fmt::Display for Distribution {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (median, most, max) = (self.quantile(0.5), self.quantile(0.99), self.max());
        write!(f, "median {median:.1e}, 99 % {most:.1e}, max {max:.1e}")
    }
}

/// How often something happened, by name.
#[derive(Clone, Debug, Default)]
pub struct Counts(pub BTreeMap<String, usize>);

impl Counts {
    pub fn add(&mut self, name: impl Into<String>) {
        *self.0.entry(name.into()).or_default() += 1;
    }

    pub fn of(&self, name: &str) -> usize {
        self.0.get(name).copied().unwrap_or(0)
    }
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (name, count) in &self.0 {
            write!(f, "{count} {name}; ")?;
        }
        Ok(())
    }
}
