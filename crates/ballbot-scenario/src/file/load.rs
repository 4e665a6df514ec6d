//! From a name or a path to a scenario.

use crate::error::ScenarioError;
use crate::file::document::Document;
use crate::file::schema::Scenario;
use crate::words;
use toml::Value;

impl Scenario {
    /// A built-in scenario by its name, or a scenario file by its path.
    ///
    /// # Errors
    /// [`ScenarioError::Unknown`], `Read` or `Syntax`.
    pub fn load(name_or_path: &str) -> Result<Self, ScenarioError> {
        Ok(Document::load(name_or_path)?.scenario().clone())
    }

    /// [`load`](Self::load), with values at keys replaced or added, as by [`Document::with`]: a key, and
    /// what would stand behind `=` in the file. What is no TOML value is taken as text.
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
        Document::load(name_or_path)?.with(&changes.collect::<Vec<_>>())
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

/// A TOML value, or the text itself.
fn parsed(text: &str) -> Value {
    text.parse()
        .unwrap_or_else(|_| Value::String(text.to_owned()))
}
