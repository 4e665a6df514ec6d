//! What results were made of, and by which program, as one digest.

use crate::distribution::Distribution;
use crate::inputs::Inputs;
use crate::results::hexadecimal;
use crate::source::Source;
use ballbot_scenario::{Document, words};
use sha2::{Digest, Sha256};
use std::collections::BTreeSet;
use std::path::Path;
use toml::Value;

/// A digest of a campaign, its scenario, all files that these name, and the program.
pub(crate) fn of(
    source: &Source,
    program: &str,
    campaign: &str,
    scenario: &Document,
    inputs: &Inputs,
) -> String {
    let mut names = BTreeSet::new();
    texts(scenario.root(), &mut names);
    source
        .file()
        .set
        .values()
        .for_each(|value| texts(value, &mut names));
    source
        .also()
        .iter()
        .for_each(|value| texts(value, &mut names));
    for input in &inputs.all {
        if let Distribution::List(values) | Distribution::Grid(values) = &input.distribution {
            values.iter().for_each(|value| texts(value, &mut names));
        }
    }
    let mut digest = Sha256::new();
    let mut add = |part: &[u8]| {
        digest.update((part.len() as u64).to_le_bytes());
        digest.update(part);
    };
    for part in [program, campaign, scenario.text()] {
        add(part.as_bytes());
    }
    for name in names {
        // A text that is no file's name is in the campaign or the scenario already.
        if let Ok(content) = words::read(&Path::new(source.folder()).join(name)) {
            add(name.as_bytes());
            add(&content);
        }
    }
    hexadecimal(&digest.finalize())
}

/// All texts in a value.
fn texts<'a>(value: &'a Value, into: &mut BTreeSet<&'a str>) {
    match value {
        Value::String(text) => {
            into.insert(text);
        }
        Value::Array(values) => values.iter().for_each(|value| texts(value, into)),
        Value::Table(table) => table.iter().for_each(|(_, value)| texts(value, into)),
        _ => {}
    }
}
