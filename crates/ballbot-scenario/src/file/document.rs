//! A scenario whose keys are read and changed one by one.

use crate::builtin;
use crate::error::ScenarioError;
use crate::file::schema::Scenario;
use crate::words;
use serde::Deserialize;
use std::path::Path;
use toml::{Table, Value};

/// A scenario as it is written, with the keys that were changed since. Every change is checked for its
/// form at once; what a value means is checked by [`Scenario::prepare`].
#[derive(Clone, Debug, PartialEq)]
pub struct Document {
    scenario: Scenario,
    /// The keys that are given.
    tree: Value,
    /// As it was written, with its comments; anew after a change.
    text: String,
    /// What messages call it.
    origin: String,
}

impl Document {
    /// A built-in scenario by its name, or a scenario file by its path.
    ///
    /// # Errors
    /// [`ScenarioError::Unknown`], `Read` or `Syntax`.
    pub fn load(name_or_path: &str) -> Result<Self, ScenarioError> {
        Self::parse(text(name_or_path)?, name_or_path)
    }

    /// A scenario from the text of a TOML file; `origin` names it in messages.
    ///
    /// # Errors
    /// [`ScenarioError::Syntax`] with line and column.
    pub fn parse(text: String, origin: &str) -> Result<Self, ScenarioError> {
        let scenario = Scenario::parse(&text, origin)?;
        let table: Table = text.parse().map_err(|error| syntax(origin, &error))?;
        Ok(Self {
            scenario,
            tree: Value::Table(table),
            text,
            origin: origin.to_owned(),
        })
    }

    /// The scenario.
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// What messages call it.
    pub fn origin(&self) -> &str {
        &self.origin
    }

    /// The text of its TOML file: as it was read, or, where something was changed since, with every
    /// default written out and without comments.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// What is given, without defaults.
    pub fn root(&self) -> &Value {
        &self.tree
    }

    /// What stands at `key`, with its tables and places in lists, separated by dots
    /// (`controller.t_s`, `bounds.torque_nm.1`), or its default; everything, with every default, at the
    /// empty key; a table with every default of its own. `None` where there is neither.
    pub fn value(&self, key: &str) -> Option<Value> {
        let given = entry(&self.tree, key);
        if let Some(value) = given.filter(|value| !has_table(value)) {
            return Some(value.clone());
        }
        let all = Value::try_from(&self.scenario).ok();
        let whole = all.as_ref().and_then(|all| entry(all, key));
        whole.or(given).cloned()
    }

    /// The scenario with values at keys replaced or added: what many runs that differ in a few values
    /// start from.
    ///
    /// # Errors
    /// As [`set`](Self::set).
    pub fn with(&self, changes: &[(&str, Value)]) -> Result<Scenario, ScenarioError> {
        let mut tree = self.tree.clone();
        for (key, value) in changes {
            set(&mut tree, key, value.clone())?;
        }
        let said: Vec<String> = changes.iter().map(|(k, v)| format!("{k}={v}")).collect();
        self.read(&tree, &format!("with {}", said.join(", ")))
    }

    /// Replaces or adds values at keys. On an error nothing is changed.
    ///
    /// # Errors
    /// A key that leads into a value, or [`ScenarioError::Syntax`]: what results is no scenario, since
    /// a key is none, or its value has the wrong type.
    pub fn set(&mut self, changes: &[(&str, Value)]) -> Result<(), ScenarioError> {
        let scenario = self.with(changes)?;
        for (key, value) in changes {
            set(&mut self.tree, key, value.clone())?;
        }
        self.replace(scenario)
    }

    /// Takes away what is given at `key`, so that its default holds. On an error nothing is changed.
    ///
    /// # Errors
    /// Nothing is given there, or [`ScenarioError::Syntax`]: a scenario needs it.
    pub fn remove(&mut self, key: &str) -> Result<(), ScenarioError> {
        let mut tree = self.tree.clone();
        let (above, last) = key.rsplit_once('.').unwrap_or(("", key));
        let parts = above.split('.').filter(|part| !part.is_empty());
        let place = parts
            .into_iter()
            .try_fold(&mut tree, |place, part| match place {
                Value::Table(table) => table.get_mut(part),
                Value::Array(list) => list.get_mut(part.parse::<usize>().ok()?),
                _ => None,
            });
        let removed = match place {
            Some(Value::Table(table)) => table.remove(last),
            Some(Value::Array(list)) => {
                let entry = last.parse().ok().filter(|entry| *entry < list.len());
                entry.map(|entry: usize| list.remove(entry))
            }
            _ => None,
        };
        if removed.is_none() {
            return Err(ScenarioError::value(
                key,
                "(not given)",
                "there is nothing to remove",
            ));
        }
        let scenario = self.read(&tree, &format!("without {key}"))?;
        self.tree = tree;
        self.replace(scenario)
    }

    fn read(&self, tree: &Value, change: &str) -> Result<Scenario, ScenarioError> {
        if let Ok(scenario) = Scenario::deserialize(tree.clone()) {
            scenario.check_tables(tree)?;
            return Ok(scenario);
        }
        // Once more as a text, whose messages have lines.
        let origin = format!("{} {change}", self.origin);
        let text = toml::to_string(tree).map_err(|error| syntax(&origin, &error))?;
        Scenario::parse(&text, &origin)
    }

    fn replace(&mut self, scenario: Scenario) -> Result<(), ScenarioError> {
        self.text = toml::to_string(&scenario).map_err(|error| syntax(&self.origin, &error))?;
        self.scenario = scenario;
        Ok(())
    }
}

/// Whether something is a table, or a list with one, which may leave out what has a default.
fn has_table(value: &Value) -> bool {
    match value {
        Value::Table(_) => true,
        Value::Array(list) => list.iter().any(has_table),
        _ => false,
    }
}

/// What stands at `key` below `root`.
fn entry<'a>(root: &'a Value, key: &str) -> Option<&'a Value> {
    let mut parts = key.split('.').filter(|part| !part.is_empty());
    parts.try_fold(root, |place, part| match place {
        Value::Table(table) => table.get(part),
        Value::Array(list) => list.get(part.parse::<usize>().ok()?),
        _ => None,
    })
}

fn syntax(origin: &str, error: &dyn std::fmt::Display) -> ScenarioError {
    ScenarioError::Syntax {
        origin: origin.to_owned(),
        message: words::toml_message(&error.to_string()),
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
    words::read_text(path).map_err(|source| ScenarioError::Read {
        path: path.to_owned(),
        source,
    })
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
