//! The set-up as the page's TypeScript declares it (`web/src/scenario.ts`) is that of a scenario
//! file: no key that a file does not have, none missing that a file must have.

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

/// A key of a set-up as the page declares it.
struct Declared {
    key: String,
    optional: bool,
    /// Its type, up to the end of the line.
    kind: String,
}

/// The keys between the braces of `opening` in the page's source.
fn declared(opening: &str) -> Vec<Declared> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../web/src/scenario.ts");
    let source = std::fs::read_to_string(path).unwrap();
    let (_, rest) = source.split_once(opening).expect("the page declares it");
    let mut depth = 1;
    let mut keys = Vec::new();
    for line in rest.lines().map(str::trim) {
        if depth == 1
            && let Some((key, kind)) = line.split_once(':')
            && !key.starts_with('[')
        {
            keys.push(Declared {
                key: key.trim_end_matches('?').to_owned(),
                optional: key.ends_with('?'),
                kind: kind.trim().trim_end_matches(';').to_owned(),
            });
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

/// Where the page declares the tables of a file.
const TABLES: [(&str, &[&str]); 4] = [
    ("export interface Scenario {", &[]),
    ("export interface Parameters {", &["parameters"]),
    ("  controller: {", &["controller"]),
    ("  bounds: {", &["bounds"]),
];

#[test]
fn the_page_declares_the_keys_of_a_scenario_file() {
    for (opening, path) in TABLES {
        let (known, required) = (known(path), required(path));
        let declared = declared(opening);
        for Declared { key, optional, .. } in &declared {
            assert!(known.contains(key), "{opening} {key}: no key of a file");
            // What a file must have, the page has, too.
            assert!(
                !(*optional && required.contains(key)),
                "{opening} {key}: a file must have it"
            );
        }
        for key in &required {
            let found = declared.iter().any(|declared| &declared.key == key);
            assert!(found, "{opening} lacks {key}");
        }
    }
}

/// A value of a type of the page's, if it is one that can be written down here.
fn value_of(kind: &str) -> Option<Value> {
    let number = || Value::Integer(1);
    match kind {
        "number" => Some(number()),
        "string" => Some(Value::String("text".to_owned())),
        "boolean" => Some(Value::Boolean(true)),
        "Range" => Some(Value::Array(vec![number(); 2])),
        list if list.starts_with("[number") => {
            Some(Value::Array(vec![number(); list.matches("number").count()]))
        }
        _ => None,
    }
}

/// Whether a file may have `value` at a key, as far as its type goes.
fn fits(path: &[&str], key: &str, value: Value) -> bool {
    let mut file = file();
    table(&mut file, path).insert(key.to_owned(), value);
    let message = message(&file).unwrap_or_default();
    !message.contains("invalid type") && !message.contains("invalid length")
}

/// What the page holds at a key is what a file holds there, and what it does not hold is refused.
#[test]
fn the_page_declares_the_types_of_a_scenario_file() {
    let mut compared = 0;
    for (opening, path) in TABLES {
        for Declared { key, kind, .. } in declared(opening) {
            let Some(value) = value_of(&kind) else {
                continue;
            };
            assert!(fits(path, &key, value), "{opening} {key}: no {kind}");
            let other = match kind.as_str() {
                "string" => Value::Integer(1),
                _ => Value::String("text".to_owned()),
            };
            assert!(!fits(path, &key, other), "{opening} {key}: not only {kind}");
            compared += 1;
        }
    }
    assert_eq!(compared, 22, "the types that are compared");
}

/// The check can fail.
#[test]
fn a_type_that_is_another_would_be_found() {
    assert!(!fits(&["controller"], "horizon", Value::Boolean(true)));
    assert!(!fits(
        &["controller"],
        "q",
        value_of("[number, number, number]").unwrap()
    ));
    assert!(fits(
        &["controller"],
        "q",
        value_of("[number, number, number, number]").unwrap()
    ));
}

/// The check can fail.
#[test]
fn a_key_that_is_none_would_be_found() {
    assert!(known(&["controller"]).contains("horizon"));
    assert!(!known(&["controller"]).contains("horizons"));
    assert!(required(&["parameters"]).contains("b1_m2"));
    assert!(!required(&["parameters"]).contains("zenith_angle_deg"));
}
