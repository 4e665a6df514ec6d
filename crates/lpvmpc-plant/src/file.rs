//! Plants as JSON.

pub(crate) mod operations;

use crate::data::PlantData;
use crate::error::PlantError;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// The version of the format.
const VERSION: u64 = 1;
/// A file is no longer than this.
const MOST_BYTES: usize = 1 << 24;

/// The version of a file's format, as a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(try_from = "u64", into = "u64")]
pub struct Schema;

impl From<Schema> for u64 {
    fn from(_: Schema) -> Self {
        VERSION
    }
}

impl TryFrom<u64> for Schema {
    type Error = String;

    fn try_from(version: u64) -> Result<Self, String> {
        if version == VERSION {
            Ok(Self)
        } else {
            Err(format!(
                "schema: version {version} of the format; this program reads version {VERSION}"
            ))
        }
    }
}

/// What every version of the format has.
#[derive(Deserialize)]
struct Header {
    #[serde(rename = "schema")]
    _schema: Schema,
}

/// The plant in `text`, checked for its form only.
pub(crate) fn read(text: &str) -> Result<PlantData, PlantError> {
    if text.len() > MOST_BYTES {
        return Err(too_long());
    }
    // First, since a newer format may have other parts, too.
    let _: Header = serde_json::from_str(text).map_err(|error| fault(&error, text))?;
    serde_json::from_str(text).map_err(|error| fault(&error, text))
}

/// The text of the file at `path`.
pub(crate) fn text(path: &Path) -> Result<String, PlantError> {
    let place = path.display().to_string();
    let failed = |error: std::io::Error| PlantError::new(&place, error.to_string());
    let file = File::open(path).map_err(failed)?;
    let mut bytes = Vec::new();
    let most = MOST_BYTES as u64 + 1;
    file.take(most).read_to_end(&mut bytes).map_err(failed)?;
    if bytes.len() > MOST_BYTES {
        return Err(too_long());
    }
    String::from_utf8(bytes).map_err(|_| PlantError::new(place, "this is no text in UTF-8"))
}

/// The text of a plant's file: always the same for the same plant, and read as the same numbers.
/// Every number of a checked plant is finite, and then nothing is left that JSON could not say.
pub(crate) fn write(plant: &PlantData) -> String {
    let mut text = serde_json::to_string(plant).unwrap_or_default();
    text.push('\n');
    text
}

fn too_long() -> PlantError {
    PlantError::new("file", format!("longer than {MOST_BYTES} bytes"))
}

/// In words, with the operation as its place where it is one's.
fn fault(error: &serde_json::Error, text: &str) -> PlantError {
    let message = error.to_string();
    if let Some((place, fault)) = message.split_once(": ")
        && (place.starts_with("operation") || place == "schema")
    {
        return PlantError::new(place, fault);
    }
    let hint = if error.is_eof() {
        "the file ends too early: "
    } else if error.is_syntax() && (text.contains("NaN") || text.contains("Infinity")) {
        "JSON has no NaN and no Infinity: "
    } else {
        ""
    };
    PlantError::new("file", format!("{hint}{message}"))
}
