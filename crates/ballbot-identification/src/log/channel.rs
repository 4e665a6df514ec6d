//! One column of a log: its name, its unit, and what its values are multiplied by.

use super::columns::{Columns, Unit};
use serde::{Deserialize, Deserializer, Serialize};

/// One column.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Channel {
    /// Name in the header.
    #[serde(default)]
    pub column: String,
    /// Unit of the file.
    pub unit: Unit,
    /// Multiplies the value, for example r_w / r_b for a wheel's angle, a motor's torque per
    /// ampere, or -1 for the other sign.
    #[serde(default = "one")]
    pub factor: f64,
}

fn one() -> f64 {
    1.0
}

impl Channel {
    pub(super) fn new(column: &str, unit: Unit) -> Self {
        Self {
            column: column.to_owned(),
            unit,
            factor: 1.0,
        }
    }

    /// Whether a torque is in N m once the factor is applied: a current or a voltage is by a factor
    /// that was measured.
    pub(super) fn is_torque(&self) -> bool {
        let newton_metres = [Unit::NewtonMetre, Unit::MillinewtonMetre];
        newton_metres.contains(&self.unit) || self.factor.abs() != 1.0
    }

    /// SI units for one of the file's.
    pub(super) fn scale(&self) -> f64 {
        self.unit.in_si() * self.factor
    }
}

/// What a configuration says of one of the plane's own columns; what it leaves out is the default's.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Given {
    column: Option<String>,
    unit: Option<Unit>,
    factor: Option<f64>,
}

fn over<'de, D: Deserializer<'de>>(default: Channel, given: D) -> Result<Channel, D::Error> {
    let Given {
        column,
        unit,
        factor,
    } = Given::deserialize(given)?;
    Ok(Channel {
        column: column.unwrap_or(default.column),
        unit: unit.unwrap_or(default.unit),
        factor: factor.unwrap_or(default.factor),
    })
}

pub(super) fn time<'de, D: Deserializer<'de>>(given: D) -> Result<Channel, D::Error> {
    over(Columns::default().time, given)
}

pub(super) fn phi<'de, D: Deserializer<'de>>(given: D) -> Result<Channel, D::Error> {
    over(Columns::default().phi, given)
}

pub(super) fn theta<'de, D: Deserializer<'de>>(given: D) -> Result<Channel, D::Error> {
    over(Columns::default().theta, given)
}

pub(super) fn theta_dot<'de, D: Deserializer<'de>>(given: D) -> Result<Channel, D::Error> {
    over(Columns::default().theta_dot, given)
}

pub(super) fn torque<'de, D: Deserializer<'de>>(given: D) -> Result<Channel, D::Error> {
    over(Columns::default().torque, given)
}
