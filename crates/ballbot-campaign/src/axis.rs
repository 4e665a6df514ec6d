//! A key of the scenario with an interval or a list of values, as a coordinate from 0 to 1: what a
//! search moves along.

use crate::cell::{Cell, Column};
use crate::distribution::Distribution;
use crate::error::CampaignError;
use crate::file::VaryTable;
use crate::inputs::Input;
use toml::Value;

/// A key of the scenario, or several that get the same value, as a coordinate from 0 to 1. Equal steps
/// of it are equally likely values of the distribution.
#[derive(Clone, Debug)]
pub struct Axis {
    input: Input,
}

impl Axis {
    /// The coordinate of a table that stands at `place` of its file.
    ///
    /// # Errors
    /// Ends that make no sense; a distribution without ends.
    pub fn new(place: &str, table: &VaryTable) -> Result<Self, CampaignError> {
        let input = Input::new(place, table, 0)?;
        let bounded = !matches!(
            input.distribution,
            Distribution::Normal { .. } | Distribution::Grid(_) | Distribution::Seeds
        );
        if bounded {
            return Ok(Self { input });
        }
        let place = format!("{place} ({})", input.keys[0]);
        let expected = "a search needs uniform, log_uniform, integers or list";
        Err(CampaignError::value(place, "(another)", expected))
    }

    /// The keys, the first of which names it.
    pub fn keys(&self) -> &[String] {
        &self.input.keys
    }

    /// The value at a coordinate from 0 to 1.
    pub fn value(&self, u: f64) -> Value {
        self.input.distribution.value(u, self.input.round_to)
    }

    /// A coordinate of the value; none where it is not in the interval or the list.
    pub fn unit(&self, value: &Value) -> Option<f64> {
        self.input.distribution.unit(value)
    }

    /// Whether its values are multiples of a step.
    pub fn has_step(&self) -> bool {
        self.input.round_to.is_some()
    }

    /// Whether equal steps are equal ratios.
    pub fn is_logarithmic(&self) -> bool {
        matches!(self.input.distribution, Distribution::LogUniform { .. })
    }

    /// Its column.
    pub fn column(&self) -> Column {
        Column::new(&self.input.keys[0], self.input.distribution.kind())
    }

    /// A value in its column.
    pub fn cell(&self, value: &Value) -> Cell {
        Cell::of(value, self.input.distribution.kind())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> Result<Axis, CampaignError> {
        let table = toml::from_str(&format!("key = \"a\"\n{text}")).unwrap();
        Axis::new("parameter[0]", &table)
    }

    #[test]
    fn a_value_is_found_again_at_its_coordinate() {
        for (text, value) in [
            ("uniform = [-1.0, 3.0]", Value::Float(0.5)),
            ("log_uniform = [1e-3, 1e3]", Value::Float(200.0)),
            ("integers = [10, 60]", Value::Integer(60)),
            ("integers = [10, 60]", Value::Integer(10)),
            ("list = [\"a\", 3, 0.5]", Value::Integer(3)),
        ] {
            let axis = of(text).unwrap();
            let found = axis.value(axis.unit(&value).unwrap());
            match (&found, &value) {
                (Value::Float(found), Value::Float(value)) => {
                    assert!((found / value - 1.0).abs() < 1e-12, "{text}: {found}");
                }
                _ => assert_eq!(found, value, "{text}"),
            }
        }
        // A whole number stands for a number, where the key takes one.
        assert_eq!(
            of("uniform = [0.0, 4.0]").unwrap().unit(&Value::Integer(1)),
            Some(0.25)
        );
    }

    #[test]
    fn what_is_outside_has_no_coordinate() {
        for (text, value) in [
            ("uniform = [-1.0, 3.0]", Value::Float(3.1)),
            ("log_uniform = [1e-3, 1e3]", Value::Float(-1.0)),
            ("log_uniform = [1e-3, 1e3]", Value::String("a".to_owned())),
            ("integers = [10, 60]", Value::Integer(61)),
            ("integers = [10, 60]", Value::Float(20.0)),
            ("list = [1, 2]", Value::Integer(3)),
        ] {
            assert_eq!(of(text).unwrap().unit(&value), None, "{text}");
        }
        assert!(of("normal = { mean = 0.0, deviation = 1.0 }").is_err());
        assert!(of("grid = [1, 2]").is_err());
    }
}
