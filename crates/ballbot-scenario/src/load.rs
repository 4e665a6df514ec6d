//! From a name or a path to a scenario.

use crate::builtin;
use crate::error::ScenarioError;
use crate::schema::Scenario;
use std::path::Path;

impl Scenario {
    /// A built-in scenario by its name, or a scenario file by its path.
    ///
    /// # Errors
    /// [`ScenarioError::Unknown`], `Read` or `Syntax`.
    pub fn load(name_or_path: &str) -> Result<Self, ScenarioError> {
        if let Some(builtin) = builtin::find(name_or_path) {
            return Self::parse(builtin.text, builtin.name);
        }
        let path = Path::new(name_or_path);
        let looks_like_a_path = path.extension().is_some() || path.components().count() > 1;
        if !path.exists() && !looks_like_a_path {
            return Err(ScenarioError::unknown(name_or_path));
        }
        let text = std::fs::read_to_string(path).map_err(|source| ScenarioError::Read {
            path: path.to_owned(),
            source,
        })?;
        Self::parse(&text, name_or_path)
    }

    /// A scenario from the text of a TOML file; `origin` names it in messages.
    ///
    /// # Errors
    /// [`ScenarioError::Syntax`] with line and column.
    pub fn parse(text: &str, origin: &str) -> Result<Self, ScenarioError> {
        toml::from_str(text).map_err(|error| ScenarioError::Syntax {
            origin: origin.to_owned(),
            message: error.to_string(),
        })
    }
}
