//! A scenario with other values at some keys, with the comments that it has.

use crate::error::TuningError;
use toml::Value;
use toml_edit::{DocumentMut, Item, Table, TableLike, value};

/// The text of a scenario with these values at their keys. Comments and order stay.
///
/// # Errors
/// The text is no TOML, or a key leads into a value.
pub fn with_values(text: &str, values: &[(String, Value)]) -> Result<String, TuningError> {
    let refused = |key: &str, problem: String| TuningError::value(key, "(found)", problem);
    let parsed = text.parse::<DocumentMut>();
    let mut document = parsed.map_err(|error| refused("scenario", error.to_string()))?;
    for (key, found) in values {
        let new = found.to_string().parse::<toml_edit::Value>();
        let new = new.map_err(|error| refused(key, error.to_string()))?;
        let parts: Vec<&str> = key.split('.').collect();
        put(document.as_table_mut(), &parts, new)
            .ok_or_else(|| refused(key, "the scenario's text has no place for it".to_owned()))?;
    }
    Ok(document.to_string())
}

/// Puts a value at the end of a path, making tables on the way.
fn put(table: &mut dyn TableLike, path: &[&str], new: toml_edit::Value) -> Option<()> {
    let (first, rest) = path.split_first()?;
    let item = table.entry(first).or_insert(Item::None);
    if rest.is_empty() {
        match item {
            Item::Value(old) => replace(old, new),
            item => *item = value(new),
        }
        return Some(());
    }
    match item {
        Item::Value(toml_edit::Value::Array(_)) | Item::Value(toml_edit::Value::InlineTable(_)) => {
            put_in_value(item.as_value_mut()?, rest, new)
        }
        Item::ArrayOfTables(tables) => {
            let (place, rest) = rest.split_first()?;
            put(tables.get_mut(place.parse().ok()?)?, rest, new)
        }
        Item::Table(table) => put(table, rest, new),
        // The name of a kind gives way to a table with its keys, as in a scenario whose keys are changed.
        Item::None | Item::Value(toml_edit::Value::String(_)) => {
            let mut made = Table::new();
            put(&mut made, rest, new)?;
            *item = Item::Table(made);
            Some(())
        }
        Item::Value(_) => None,
    }
}

fn put_in_value(place: &mut toml_edit::Value, path: &[&str], new: toml_edit::Value) -> Option<()> {
    let Some((first, rest)) = path.split_first() else {
        replace(place, new);
        return Some(());
    };
    match place {
        toml_edit::Value::Array(list) => {
            put_in_value(list.get_mut(first.parse().ok()?)?, rest, new)
        }
        toml_edit::Value::InlineTable(table) => put(table, path, new),
        _ => None,
    }
}

/// The new value where the old one stood, with the comment behind it.
fn replace(old: &mut toml_edit::Value, mut new: toml_edit::Value) {
    *new.decor_mut() = old.decor().clone();
    *old = new;
}

/// The text with each value that names a file, as `is_file` says, replaced by what `renamed` makes of
/// it: for a scenario that moves to another folder.
///
/// # Errors
/// The text is no TOML.
pub fn with_files(
    text: &str,
    renamed: &dyn Fn(&str) -> Option<String>,
) -> Result<String, TuningError> {
    let parsed = text.parse::<DocumentMut>();
    let mut document =
        parsed.map_err(|error| TuningError::value("scenario", "(found)", error.to_string()))?;
    rename(document.as_table_mut(), renamed);
    Ok(document.to_string())
}

fn rename(table: &mut dyn TableLike, renamed: &dyn Fn(&str) -> Option<String>) {
    for (_, item) in table.iter_mut() {
        match item {
            Item::Value(value) => rename_value(value, renamed),
            Item::Table(table) => rename(table, renamed),
            Item::ArrayOfTables(tables) => {
                tables.iter_mut().for_each(|table| rename(table, renamed))
            }
            Item::None => {}
        }
    }
}

fn rename_value(value: &mut toml_edit::Value, renamed: &dyn Fn(&str) -> Option<String>) {
    match value {
        toml_edit::Value::String(text) => {
            if let Some(name) = renamed(text.value()) {
                replace(value, name.into());
            }
        }
        toml_edit::Value::Array(list) => {
            list.iter_mut()
                .for_each(|value| rename_value(value, renamed));
        }
        toml_edit::Value::InlineTable(table) => rename(table, renamed),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "\
# what it is
[controller]
q = [1.0, 2.0] # weights
r = 3.0 # torque
terminal = \"none\"
estimator = { noise = 0.1, file = \"a.toml\" }
[[world.pushes]]
time_s = 1.0
";

    #[test]
    fn values_change_and_comments_stay() {
        let number = |number: f64| Value::Float(number);
        let values = [
            ("controller.q.1", number(5.0)),
            ("controller.r", number(300.0)),
            ("controller.estimator.noise", number(0.2)),
            ("controller.terminal.cost.p", Value::Integer(1)),
            ("controller.new.key", Value::Boolean(true)),
            ("world.pushes.0.time_s", number(2.0)),
        ];
        let values = values.map(|(key, value)| (key.to_owned(), value));
        let text = with_values(TEXT, &values).unwrap();
        assert!(text.starts_with("# what it is\n"), "{text}");
        assert!(
            text.contains("q = [1.0, 5.0] # weights\nr = 300.0 # torque\n"),
            "{text}"
        );
        let table: toml::Table = text.parse().unwrap();
        let at = |path: &str| {
            let parts = path.split('.');
            let root = Value::Table(table.clone());
            parts.fold(root, |value, part| match part.parse::<usize>() {
                Ok(place) => value[place].clone(),
                Err(_) => value[part].clone(),
            })
        };
        for (key, value) in values {
            assert_eq!(at(&key), value, "{key}: {text}");
        }
        let into = [("controller.r.deep".to_owned(), number(1.0))];
        assert!(with_values(TEXT, &into).is_err());
    }

    #[test]
    fn names_of_files_are_replaced_and_others_are_not() {
        let renamed = |name: &str| (name == "a.toml").then(|| "../a.toml".to_owned());
        let text = with_files(TEXT, &renamed).unwrap();
        assert_eq!(text, TEXT.replace("a.toml", "../a.toml"));
    }
}
