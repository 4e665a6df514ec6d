//! Numbers of a file that must lie in some range.

use crate::error::ScenarioError;

/// A number as a person would write it: at most twelve significant digits, which hides what rounding
/// adds, and a power of ten where it is very large or small.
pub fn text(value: f64) -> String {
    let rounded: f64 = format!("{value:.11e}").parse().unwrap_or(value);
    match rounded.abs() {
        0.0 => "0".to_owned(),
        size if (1e-4..1e9).contains(&size) => rounded.to_string(),
        _ => format!("{rounded:e}"),
    }
}

/// What a message says of a value.
pub(crate) trait Given {
    /// In words, or as a number for a person.
    fn given(&self) -> String;
}

impl Given for f64 {
    fn given(&self) -> String {
        text(*self)
    }
}

impl<T: Given + ?Sized> Given for &T {
    fn given(&self) -> String {
        (**self).given()
    }
}

macro_rules! given_as_it_is {
    ($($kind:ty),*) => { $(
        impl Given for $kind {
            fn given(&self) -> String {
                self.to_string()
            }
        }
    )* };
}

given_as_it_is!(str, String, i32, u64, usize);

/// `value`, if it is `right`.
///
/// # Errors
/// [`ScenarioError::Value`] with the key and what is `expected`.
pub fn check(key: &str, value: f64, right: bool, expected: &str) -> Result<f64, ScenarioError> {
    match right {
        true => Ok(value),
        false => Err(ScenarioError::value(key, value, expected)),
    }
}

/// `value`, if it is finite.
///
/// # Errors
/// [`ScenarioError::Value`] with the key.
pub fn finite(key: &str, value: f64) -> Result<f64, ScenarioError> {
    let right = value.is_finite();
    check(key, value, right, "it must be a finite number")
}

/// `value`, if it is finite and above zero.
///
/// # Errors
/// [`ScenarioError::Value`] with the key.
pub fn positive(key: &str, value: f64) -> Result<f64, ScenarioError> {
    let right = value > 0.0 && value.is_finite();
    check(key, value, right, "it must be a positive number")
}

/// `value`, if it is finite and not below zero.
///
/// # Errors
/// [`ScenarioError::Value`] with the key.
pub fn not_negative(key: &str, value: f64) -> Result<f64, ScenarioError> {
    let right = value >= 0.0 && value.is_finite();
    check(key, value, right, "it must be finite and not negative")
}

#[cfg(test)]
mod tests {
    use super::text;

    #[test]
    fn numbers_are_as_a_person_writes_them() {
        for (value, written) in [
            (0.0, "0"),
            (-0.0, "0"),
            (0.1 + 0.2, "0.3"),
            (-60.0, "-60"),
            (1e6, "1000000"),
            (1e200, "1e200"),
            (-2.5e-300, "-2.5e-300"),
            (1e-5, "1e-5"),
            (f64::INFINITY, "inf"),
            (f64::NEG_INFINITY, "-inf"),
            (f64::NAN, "NaN"),
            (std::f64::consts::PI, "3.14159265359"),
        ] {
            assert_eq!(text(value), written);
        }
    }
}
