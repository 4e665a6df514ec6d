//! `[set]`: what is the same in all runs, key by key.

use ballbot_scenario::Document;
use toml::{Table, Value};

/// The keys of a table `[set]` with their values. Tables in it are keys with dots, as anywhere in TOML,
/// and leave what the scenario has beside them. A table of another kind (`reference.lissajous` for
/// `reference.set_points`), beside which nothing can stay, is a value by itself.
pub(crate) fn fixed(scenario: &Document, set: &Table) -> Vec<(String, Value)> {
    let entries = set.iter();
    entries
        .flat_map(|(key, value)| entry(scenario, key.clone(), value))
        .collect()
}

fn entry(scenario: &Document, key: String, value: &Value) -> Vec<(String, Value)> {
    let parts = value.as_table().map(|table| {
        let parts = table.iter();
        let parts = parts.flat_map(|(name, part)| entry(scenario, format!("{key}.{name}"), part));
        parts.collect::<Vec<_>>()
    });
    let fits = |parts: &Vec<(String, Value)>| {
        let changes = parts
            .iter()
            .map(|(key, value)| (key.as_str(), value.clone()));
        scenario.with(&changes.collect::<Vec<_>>()).is_ok()
    };
    match parts.filter(fits) {
        Some(parts) if !parts.is_empty() => parts,
        _ => vec![(key, value.clone())],
    }
}
