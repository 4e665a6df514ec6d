//! Results as JSON, for other programs. Units are part of the keys.

use crate::input;
use ballbot::Ballbot;
use nalgebra::{Complex, DMatrix};
use serde::Serialize;
use serde_json::{Map, Value, json, to_value};
use std::path::Path;

/// The rows of a matrix.
pub fn matrix(matrix: &DMatrix<f64>) -> Value {
    let rows = matrix.row_iter();
    rows.map(|row| row.iter().copied().collect::<Vec<f64>>())
        .collect()
}

/// One pole as `{"re": .., "im": ..}`.
pub fn pole(pole: Complex<f64>) -> Value {
    json!({ "re": pole.re, "im": pole.im })
}

/// Poles in their order.
pub fn poles(poles: &[Complex<f64>]) -> Value {
    poles.iter().map(|value| pole(*value)).collect()
}

/// The robot with the keys of a `[parameters]` table.
pub fn parameters(ballbot: &Ballbot<f64>) -> Value {
    let entries = input::parameter_entries(ballbot).into_iter();
    let entries = entries.map(|(key, value)| (key.to_owned(), json!(value)));
    Value::Object(entries.collect::<Map<_, _>>())
}

/// Adds the fields of `more`, a table, to the document.
pub fn extend(document: &mut Value, more: &impl Serialize) {
    if let (Some(document), Ok(Value::Object(more))) = (document.as_object_mut(), to_value(more)) {
        document.extend(more);
    }
}

/// A path; what of it is no UTF-8, which JSON has no place for, is shown as a replacement character.
pub fn path(path: &Path) -> Value {
    path.to_string_lossy().into()
}

/// The document as text.
pub fn text(document: &Value) -> String {
    format!("{document:#}\n")
}
