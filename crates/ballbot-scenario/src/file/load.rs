//! From a name or a path to a scenario.

use crate::builtin;
use crate::error::ScenarioError;
use crate::file::schema::Scenario;
use crate::words;
use std::path::Path;
use toml::{Table, Value};

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
        let text = text(name_or_path)?;
        // First as it is, for messages with its own lines.
        let unchanged = Self::parse(&text, name_or_path)?;
        if changes.is_empty() {
            return Ok(unchanged);
        }
        let syntax = |message: String| ScenarioError::Syntax {
            origin: name_or_path.to_owned(),
            message,
        };
        let table = text.parse::<Table>();
        let mut root = Value::Table(table.map_err(|error| syntax(error.to_string()))?);
        for (key, value) in changes {
            set(&mut root, key, parsed(value))?;
        }
        let text = toml::to_string(&root).map_err(|error| syntax(error.to_string()))?;
        let changed: Vec<String> = changes.iter().map(|(k, v)| format!("{k}={v}")).collect();
        Self::parse(
            &text,
            &format!("{name_or_path} with {}", changed.join(", ")),
        )
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
fn text(name_or_path: &str) -> Result<String, ScenarioError> {
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
