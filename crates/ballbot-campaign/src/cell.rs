//! Rows of results, and what their columns hold.

use toml::Value;

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Numbers: of measures finite ones.
    Real,
    /// Whole numbers.
    Whole,
    /// Words.
    Text,
    /// Yes or no.
    Flag,
}

/// A column of results.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    /// Its name, with its unit.
    pub name: String,
    /// What it holds.
    pub kind: Kind,
}

impl Column {
    /// A column.
    pub fn new(name: impl Into<String>, kind: Kind) -> Self {
        Self {
            name: name.into(),
            kind,
        }
    }
}

/// A value in a row.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// There is none: a run that was refused has no measures.
    Missing,
    /// A number, and no NaN. A value of the scenario may be infinite, such as a bound that is none.
    Real(f64),
    /// A whole number.
    Whole(i64),
    /// A word.
    Text(String),
    /// Yes or no.
    Flag(bool),
}

/// A row: as many cells as there are columns.
pub type Row = Vec<Cell>;

impl Cell {
    /// The value in a column of this kind.
    pub(crate) fn of(value: &Value, kind: Kind) -> Self {
        match (value, kind) {
            (Value::Float(number), _) if number.is_nan() => Self::Missing,
            (Value::Float(number), _) => Self::Real(*number),
            (Value::Integer(number), Kind::Real) => Self::Real(*number as f64),
            (Value::Integer(number), _) => Self::Whole(*number),
            (Value::Boolean(flag), _) => Self::Flag(*flag),
            (Value::String(text), _) => Self::Text(text.clone()),
            (other, _) => Self::Text(other.to_string()),
        }
    }

    /// What was measured, or nothing where it is no finite number.
    pub(crate) fn measured(number: f64) -> Self {
        match number.is_finite() {
            true => Self::Real(number),
            false => Self::Missing,
        }
    }

    /// As a number: yes is 1 and no is 0.
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Real(number) => Some(*number),
            Self::Whole(number) => Some(*number as f64),
            Self::Flag(flag) => Some(f64::from(u8::from(*flag))),
            Self::Missing | Self::Text(_) => None,
        }
    }

    /// As it stands in a CSV file: numbers in as few digits as give the same number again.
    pub fn text(&self) -> String {
        match self {
            Self::Missing => String::new(),
            Self::Real(number) => format!("{number:?}"),
            Self::Whole(number) => number.to_string(),
            Self::Text(text) => text.clone(),
            Self::Flag(flag) => flag.to_string(),
        }
    }

    /// Its bytes, by which a row is known again.
    pub(crate) fn bytes(&self, into: &mut Vec<u8>) {
        match self {
            Self::Missing => into.push(0),
            Self::Real(number) => {
                into.push(1);
                into.extend(number.to_bits().to_le_bytes());
            }
            Self::Whole(number) => {
                into.push(2);
                into.extend(number.to_le_bytes());
            }
            Self::Text(text) => {
                into.push(3);
                into.extend((text.len() as u64).to_le_bytes());
                into.extend(text.as_bytes());
            }
            Self::Flag(flag) => into.extend([4, u8::from(*flag)]),
        }
    }
}
