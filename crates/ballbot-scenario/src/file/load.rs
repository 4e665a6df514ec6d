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
        let syntax = |error: toml::de::Error| ScenarioError::Syntax {
            origin: origin.to_owned(),
            message: words::toml_message(&error.to_string()),
        };
        let scenario: Self = toml::from_str(text).map_err(syntax)?;
        let given = Value::Table(text.parse().map_err(syntax)?);
        scenario.check_tables(&given)?;
        words::check_lists::<Self>(given).map_err(syntax)?;
        Ok(scenario)
    }

    /// Where this scenario, as it was `given`, has a list for a table: the entries of a list would be taken for the
    /// table's keys in the order in which the program has them.
    ///
    /// # Errors
    /// [`ScenarioError::Value`], with the key.
    pub(crate) fn check_tables(&self, given: &Value) -> Result<(), ScenarioError> {
        match Value::try_from(self) {
            Ok(all) => check_tables(given, &all, ""),
            Err(error) => Err(ScenarioError::value("", "", error.to_string())),
        }
    }
}

fn check_tables(given: &Value, all: &Value, key: &str) -> Result<(), ScenarioError> {
    let below = |part: &str| match key {
        "" => part.to_owned(),
        key => format!("{key}.{part}"),
    };
    match (given, all) {
        (Value::Array(_), Value::Table(table)) => {
            let keys: Vec<&str> = table.keys().map(String::as_str).collect();
            let problem = format!("it must be a table with the keys {}", keys.join(", "));
            Err(ScenarioError::value(key, given.to_string(), problem))
        }
        (Value::Table(given), Value::Table(all)) => given
            .iter()
            .filter_map(|(part, given)| Some((part, given, all.get(part)?)))
            .try_for_each(|(part, given, all)| check_tables(given, all, &below(part))),
        (Value::Array(given), Value::Array(all)) => { given.iter().zip(all).enumerate() }
            .try_for_each(|(i, (given, all))| check_tables(given, all, &below(&i.to_string()))),
        _ => Ok(()),
    }
}

/// A TOML value, or the text itself.
fn parsed(text: &str) -> Value {
    text.parse()
        .unwrap_or_else(|_| Value::String(text.to_owned()))
}
