//! From a name or a path to a scenario.

use crate::builtin;
use crate::error::ScenarioError;
use crate::file::schema::Scenario;
use crate::file::template::Template;
use crate::words;
use std::path::Path;
use toml::Value;

impl Scenario {
    /// A built-in scenario by its name, or a scenario file by its path.
    ///
    /// # Errors
    /// [`ScenarioError::Unknown`], `Read` or `Syntax`.
    pub fn load(name_or_path: &str) -> Result<Self, ScenarioError> {
        Self::parse(&text(name_or_path)?, name_or_path)
    }

    /// [`load`](Self::load), with values at keys replaced or added: a key with its tables and
    /// places in lists, separated by dots (`controller.t_s`, `bounds.torque_nm.1`), and what would
    /// stand behind `=` in the file. What is no TOML value is taken as text.
    ///
    /// # Errors
    /// As [`load`](Self::load); or a key that leads into a value.
    pub fn load_with(
        name_or_path: &str,
        changes: &[(String, String)],
    ) -> Result<Self, ScenarioError> {
        if changes.is_empty() {
            return Self::load(name_or_path);
        }
        let changes = changes
            .iter()
            .map(|(key, value)| (key.as_str(), parsed(value)));
        Template::load(name_or_path)?.with(&changes.collect::<Vec<_>>())
    }

    /// A scenario from the text of a TOML file; `origin` names it in messages.
    ///
    /// # Errors
    /// [`ScenarioError::Syntax`] with line and column.
    pub fn parse(text: &str, origin: &str) -> Result<Self, ScenarioError> {
        toml::from_str(text).map_err(|error| ScenarioError::Syntax {
            origin: origin.to_owned(),
            message: words::toml_message(&error.to_string()),
        })
    }
}

/// The text of a built-in scenario by its name, or of a file.
pub(super) fn text(name_or_path: &str) -> Result<String, ScenarioError> {
    if let Some(builtin) = builtin::find(name_or_path) {
        return Ok(builtin.text.to_owned());
    }
    let path = Path::new(name_or_path);
    let looks_like_a_path = path.extension().is_some() || path.components().count() > 1;
    if !path.exists() && !looks_like_a_path {
        return Err(ScenarioError::unknown(name_or_path));
    }
    std::fs::read_to_string(path).map_err(|source| ScenarioError::Read {
        path: path.to_owned(),
        source,
    })
}

/// A TOML value, or the text itself.
fn parsed(text: &str) -> Value {
    text.parse()
        .unwrap_or_else(|_| Value::String(text.to_owned()))
}
