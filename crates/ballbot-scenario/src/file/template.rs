//! A scenario as TOML values, which are changed before it is read.

use crate::error::ScenarioError;
use crate::file::load;
use crate::file::schema::Scenario;
use serde::Deserialize;
use toml::{Table, Value};

/// A scenario whose values can be changed by their keys, any number of times: what many runs that
/// differ in a few values start from.
#[derive(Clone, Debug, PartialEq)]
pub struct Template {
    origin: String,
    text: String,
    root: Value,
}

impl Template {
    /// A built-in scenario by its name, or a scenario file by its path; it must be a scenario as it is.
    ///
    /// # Errors
    /// As [`Scenario::load`].
    pub fn load(name_or_path: &str) -> Result<Self, ScenarioError> {
        let text = load::text(name_or_path)?;
        // For messages with its own lines.
        Scenario::parse(&text, name_or_path)?;
        let table = text.parse::<Table>();
        Ok(Self {
            origin: name_or_path.to_owned(),
            root: Value::Table(table.map_err(|error| syntax(name_or_path, error.to_string()))?),
            text,
        })
    }

    /// The text that it was read from.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// What stands in it.
    pub fn root(&self) -> &Value {
        &self.root
    }

    /// The scenario with values at keys replaced or added: a key with its tables and places in lists,
    /// separated by dots (`controller.t_s`, `bounds.torque_nm.1`).
    ///
    /// # Errors
    /// A key that leads into a value, or that no scenario has; a value of the wrong type.
    pub fn with(&self, changes: &[(&str, Value)]) -> Result<Scenario, ScenarioError> {
        let mut root = self.root.clone();
        for (key, value) in changes {
            set(&mut root, key, value.clone())?;
        }
        if let Ok(scenario) = Scenario::deserialize(root.clone()) {
            return Ok(scenario);
        }
        // Once more as a text, whose messages have lines.
        let text =
            toml::to_string(&root).map_err(|error| syntax(&self.origin, error.to_string()))?;
        let changed: Vec<String> = changes.iter().map(|(k, v)| format!("{k}={v}")).collect();
        Scenario::parse(
            &text,
            &format!("{} with {}", self.origin, changed.join(", ")),
        )
    }
}

fn syntax(origin: &str, message: String) -> ScenarioError {
    ScenarioError::Syntax {
        origin: origin.to_owned(),
        message,
    }
}

/// Puts `value` at `key` below `root`, making tables on the way.
fn set(root: &mut Value, key: &str, value: Value) -> Result<(), ScenarioError> {
    let refused = |part: &str, problem: &str| {
        Err(ScenarioError::value(
            key,
            value.to_string(),
            format!(
                "`{part}` {problem}; keys are as in `ballbot scenario show`, with dots between"
            ),
        ))
    };
    let mut place = root;
    for part in key.split('.') {
        if part.is_empty() {
            return refused(part, "is not the name of a key");
        }
        place = match place {
            Value::Table(table) => table
                .entry(part)
                .or_insert_with(|| Value::Table(Table::new())),
            Value::Array(list) => {
                let length = list.len();
                let entry = part.parse().ok().and_then(|i: usize| list.get_mut(i));
                match entry {
                    Some(entry) => entry,
                    None => {
                        let problem = format!("is not a place in a list of {length}, from 0 on");
                        return refused(part, &problem);
                    }
                }
            }
            // The name of a kind gives way to a table with its keys.
            Value::String(_) => {
                *place = Value::Table(Table::new());
                let Value::Table(table) = place else {
                    return refused(part, "leads nowhere");
                };
                table
                    .entry(part)
                    .or_insert_with(|| Value::Table(Table::new()))
            }
            _ => return refused(part, "would stand below a value"),
        };
    }
    *place = value;
    Ok(())
}
