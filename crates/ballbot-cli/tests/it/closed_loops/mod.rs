//! The commands of the program `ballbot` that run closed loops: `simulate`, `scenario`,
//! `rehearse`, `reproduce`, `campaign`, `tune`.

mod both_planes;
mod campaign;
mod failures;
mod interrupt;
mod own_campaign;
mod recorded;
mod rehearsal;
mod reproduce;
mod scenario;
mod simulate;
mod tuning;

use std::path::Path;

/// The text with one part of it, which must be there, replaced.
fn edited(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "`{from}` is not in: {text}");
    text.replacen(from, to, 1)
}

/// The text with everything from `from` to just before `to` replaced.
fn with_section(text: &str, from: &str, to: &str, new: &str) -> String {
    let start = text.find(from).unwrap();
    let end = start + text[start..].find(to).unwrap();
    format!("{}{new}\n\n{}", &text[..start], &text[end..])
}

/// The files below `folder` but for the lists of them, sorted, with `/` between the parts of their
/// paths.
fn files(folder: &Path) -> Vec<String> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap();
        if name == ".ballbot-files" {
            continue;
        }
        if path.is_dir() {
            found.extend(files(&path).iter().map(|inner| format!("{name}/{inner}")));
        } else {
            found.push(name.to_owned());
        }
    }
    found.sort();
    found
}
