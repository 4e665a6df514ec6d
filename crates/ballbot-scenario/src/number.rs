//! Numbers of a file that must lie in some range.

use crate::error::ScenarioError;
pub use crate::given::text;

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
