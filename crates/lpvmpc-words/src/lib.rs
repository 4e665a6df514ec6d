//! Files that were written by people: their text, and messages about it.

use serde::de::DeserializeOwned;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Most bytes of a file that is read as a whole, 64 MiB: more than any set-up, plant or table of references has.
pub const MOST_BYTES: u64 = 64 << 20;

/// The content of a file.
///
/// # Errors
/// It cannot be read, or has more than [`MOST_BYTES`], as a device that never ends has.
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    let mut content = Vec::new();
    File::open(path)?
        .take(MOST_BYTES + 1)
        .read_to_end(&mut content)?;
    if content.len() as u64 > MOST_BYTES {
        let problem = "it has more than 64 MiB, which no file of this kind needs";
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, problem));
    }
    Ok(content)
}

/// The text of a file.
///
/// # Errors
/// As of [`read`], or it is no UTF-8.
pub fn read_text(path: &Path) -> io::Result<String> {
    let no_text = |_| io::Error::new(io::ErrorKind::InvalidData, "it is not text in UTF-8");
    String::from_utf8(read(path)?).map_err(no_text)
}

/// What a TOML text says, whose lists are as long as they must be: the reader by itself leaves out what is behind.
///
/// # Errors
/// As of [`toml::from_str`].
pub fn from_toml<T: DeserializeOwned>(text: &str) -> Result<T, toml::de::Error> {
    let content = toml::from_str(text)?;
    // What this reader says has no line, so it comes second.
    check_lists::<T>(toml::Value::Table(text.parse()?))?;
    Ok(content)
}

/// Whether the lists of a text that is a `T` are as long as they must be.
///
/// # Errors
/// One is longer.
pub fn check_lists<T: DeserializeOwned>(text: toml::Value) -> Result<(), toml::de::Error> {
    text.try_into::<T>().map(drop)
}

/// What the reader of a TOML file says, without the types of a programming language.
pub fn toml_message(message: &str) -> String {
    const PLAIN: [(&str, &str); 15] = [
        ("expected fewer elements in array", "which is too many here"),
        ("expected usize", "expected a whole number, 0 or more"),
        ("expected u64", "expected a whole number, 0 or more"),
        ("expected f64", "expected a number"),
        ("expected an array of length", "expected a list of length"),
        ("expected a sequence", "expected a list"),
        ("expected a map", "expected a table"),
        ("expected a boolean", "expected true or false"),
        ("expected a string", "expected a text in quotes"),
        ("unknown variant", "unknown name"),
        (
            "wanted exactly 1 element, more than 1 element",
            "one kind must be chosen here: of these tables or keys, only one may stand",
        ),
        (
            "wanted exactly 1 element, found 0 elements",
            "a kind must be chosen here: this table is empty",
        ),
        (
            "wanted string or table",
            "expected the name of a kind in quotes, or a table",
        ),
        (
            "invalid type: unit variant, expected struct variant",
            "this kind needs keys of its own: a table, not its name alone",
        ),
        (
            "invalid type: unit variant, expected newtype variant",
            "this kind needs a value or keys of its own, not its name alone",
        ),
    ];
    let plain = PLAIN
        .iter()
        .fold(message.trim_end().to_owned(), |text, (from, to)| {
            text.replace(from, to)
        });
    with_nearest(without_types(&plain))
}

/// The text with the name that is nearest to one that is none, where the text has names to choose from.
fn with_nearest(text: String) -> String {
    let last = text.lines().last().unwrap_or_default();
    let asked = ["unknown field ", "unknown name "]
        .iter()
        .find_map(|what| last.split_once(what));
    let mut names = asked
        .map_or("", |(_, names)| names)
        .split('`')
        .skip(1)
        .step_by(2);
    let nearest = names.next().and_then(|unknown| nearest(unknown, names));
    match nearest {
        Some(nearest) => format!("{text}; did you mean `{nearest}`?"),
        None => text,
    }
}

/// The name that is most like another, if one is like it.
pub fn nearest<'a>(name: &str, names: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    names
        .map(|one| (strsim::jaro_winkler(one, name), one))
        .filter(|(likeness, _)| *likeness > 0.7)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, name)| name)
}

/// The text with "a table" or "a text" in place of what a program's types are called.
fn without_types(text: &str) -> String {
    const TYPES: [(&str, &str); 4] = [
        ("expected struct variant ", "expected a table"),
        ("expected struct ", "expected a table"),
        ("expected tuple struct ", "expected a list"),
        (
            "expected enum ",
            "expected the name of a kind in quotes, or a table",
        ),
    ];
    let mut text = text.to_owned();
    for (kind, plain) in TYPES {
        while let Some(place) = text.find(kind) {
            let name = &text[place + kind.len()..];
            let is_name = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
            let end = name.find(|c| !is_name(c)).unwrap_or(name.len());
            text.replace_range(place..place + kind.len() + end, plain);
        }
    }
    text
}
