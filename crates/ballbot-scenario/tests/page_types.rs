//! The set-up as the page's TypeScript declares it (`web/src/scenario.ts`) is that of a scenario
//! file: no key that a file does not have, none missing that a file must have.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that cannot go on must fail, in its support functions too"
)]

use ballbot_scenario::Scenario;
use std::collections::BTreeSet;
use std::path::Path;
use toml::{Table, Value};

type Keys = BTreeSet<String>;

/// A scenario file as a table, with the robot in it.
fn file() -> Table {
    let scenario = Scenario::load("two-setpoints").unwrap();
    toml::to_string(&scenario).unwrap().parse().unwrap()
}

fn table<'a>(root: &'a mut Table, path: &[&str]) -> &'a mut Table {
    path.iter().fold(root, |table, key| {
        let place = table.get_mut(*key).expect("the file has it");
        place.as_table_mut().expect("a table")
    })
}

fn message(file: &Table) -> Option<String> {
    let text = toml::to_string(file).unwrap();
    toml::from_str::<Scenario>(&text)
        .err()
        .map(|error| error.to_string())
}

/// The keys that a table of a file may have, from the message about one that it has not.
fn known(path: &[&str]) -> Keys {
    let mut file = file();
    table(&mut file, path).insert("no_such_key".to_owned(), Value::Boolean(true));
    let message = message(&file).expect("an unknown key is refused");
    let (_, expected) = message.split_once("expected").expect("the keys are named");
    let quoted = expected.split('`').skip(1).step_by(2);
    quoted.map(str::to_owned).collect()
}

/// Those of them that it must have.
fn required(path: &[&str]) -> Keys {
    let without = |key: &String| {
        let mut file = file();
        table(&mut file, path).remove(key);
        message(&file).is_some()
    };
    known(path).into_iter().filter(without).collect()
}

/// The keys between the braces of `opening` in the page's source, with whether they may be left out.
fn declared(opening: &str) -> Vec<(String, bool)> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../web/src/scenario.ts");
    let source = std::fs::read_to_string(path).unwrap();
    let (_, rest) = source.split_once(opening).expect("the page declares it");
    let mut depth = 1;
    let mut keys = Vec::new();
    for line in rest.lines().map(str::trim) {
        if depth == 1
            && let Some((key, _)) = line.split_once(':')
            && !key.starts_with('[')
        {
            let optional = key.ends_with('?');
            keys.push((key.trim_end_matches('?').to_owned(), optional));
        }
        depth += line.matches('{').count();
        depth -= line.matches('}').count();
        if depth == 0 {
            break;
        }
    }
    assert!(!keys.is_empty(), "{opening}");
    keys
}

#[test]
fn the_page_declares_the_keys_of_a_scenario_file() {
    for (opening, path) in [
        ("export interface Scenario {", &[] as &[&str]),
        ("export interface Parameters {", &["parameters"]),
        ("  controller: {", &["controller"]),
        ("  bounds: {", &["bounds"]),
    ] {
        let (known, required) = (known(path), required(path));
        let declared = declared(opening);
        for (key, optional) in &declared {
            assert!(known.contains(key), "{opening} {key}: no key of a file");
            // What a file must have, the page has, too.
            assert!(
                !(*optional && required.contains(key)),
                "{opening} {key}: a file must have it"
            );
        }
        for key in &required {
            let found = declared.iter().any(|(declared, _)| declared == key);
            assert!(found, "{opening} lacks {key}");
        }
    }
}

/// The check can fail.
#[test]
fn a_key_that_is_none_would_be_found() {
    assert!(known(&["controller"]).contains("horizon"));
    assert!(!known(&["controller"]).contains("horizons"));
    assert!(required(&["parameters"]).contains("b1_m2"));
    assert!(!required(&["parameters"]).contains("zenith_angle_deg"));
}
