//! `ballbot certify` and `ballbot verify`.

use crate::{assert_says, failure, text};
use serde_json::Value;
use std::path::Path;

/// A certificate of a small set, and its path.
fn certified(folder: &Path) -> (Value, String) {
    let out = folder.to_str().unwrap();
    let said = text(&["certify", "--size", "0.05", "--out", out]);
    assert_says(&said, &["Proved for the nonlinear robot", "3.000000 deg"]);
    let path = folder.join("certificate.json");
    let document = std::fs::read_to_string(&path).unwrap();
    (
        serde_json::from_str(&document).unwrap(),
        path.to_str().unwrap().to_owned(),
    )
}

/// Every number below `value`, as JSON pointers.
fn numbers_of(value: &Value, pointer: &str, found: &mut Vec<String>) {
    match value {
        Value::Number(_) => found.push(pointer.to_owned()),
        Value::Array(items) => {
            for (i, item) in items.iter().enumerate() {
                numbers_of(item, &format!("{pointer}/{i}"), found);
            }
        }
        Value::Object(items) => {
            for (key, item) in items {
                numbers_of(item, &format!("{pointer}/{key}"), found);
            }
        }
        _ => {}
    }
}

#[test]
fn a_certificate_is_written_and_verified_again() {
    let folder = tempfile::tempdir().unwrap();
    let (document, path) = certified(folder.path());
    let claim = &document["certificate"];
    assert_eq!(claim["t_s"], 0.05);
    let written_by = claim["written_by"].as_str().unwrap();
    assert!(written_by.starts_with("ballbot "), "{written_by}");
    assert_says(&text(&["verify", &path]), &["The certificate holds."]);
    let page = std::fs::read_to_string(folder.path().join("certificate.html")).unwrap();
    assert_says(&page, &["<svg", "θ", "level"]);
}

#[test]
fn every_changed_number_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (document, _) = certified(folder.path());
    let mut pointers = Vec::new();
    numbers_of(&document["certificate"], "/certificate", &mut pointers);
    // Parameters, cost, limits, law, cost and rate: some 70 of them.
    assert!(pointers.len() > 60, "{}", pointers.len());
    let path = folder.path().join("changed.json");
    for pointer in pointers {
        let mut changed = document.clone();
        let place = changed.pointer_mut(&pointer).unwrap();
        *place = match place.as_u64() {
            Some(count) => (count + 1).into(),
            None => {
                let value = place.as_f64().unwrap();
                (value * (1.0 + 1e-9) + if value == 0.0 { 1e-9 } else { 0.0 }).into()
            }
        };
        std::fs::write(&path, changed.to_string()).unwrap();
        failure(&["verify", path.to_str().unwrap()], 1);
    }
}

#[test]
fn a_false_claim_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let (document, _) = certified(folder.path());
    let path = folder.path().join("changed.json");
    let refused = |pointer: &str, value: f64| {
        let mut changed = document.clone();
        *changed.pointer_mut(pointer).unwrap() = value.into();
        std::fs::write(&path, changed.to_string()).unwrap();
        failure(&["verify", path.to_str().unwrap()], 1)
    };
    let of = |pointer: &str| document.pointer(pointer).unwrap().as_f64().unwrap();
    let level = of("/certificate/terminal/level");
    assert_says(
        &refused("/certificate/terminal/level", 4.0 * level),
        &["scheduling_limits[0]", "the set reaches"],
    );
    assert_says(
        &refused("/certificate/terminal/contraction", 0.5),
        &["decrease"],
    );
    assert_says(&refused("/certificate/t_s", 0.2), &["decrease"]);
    assert_says(
        &refused("/certificate/continuous/rate_1_s", 50.0),
        &["continuous"],
    );
    assert_says(
        &refused("/certificate/input_limits/0", 0.01),
        &["input_limits[0]"],
    );
    assert_says(&refused("/certificate/terminal/level", -1.0), &["positive"]);
}

#[test]
fn what_cannot_be_proved_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let message = failure(
        &[
            "certify",
            "--size",
            "0.5",
            "--boxes",
            "200",
            "--out",
            out.to_str().unwrap(),
        ],
        1,
    );
    assert_says(&message, &["error: "]);
    assert!(!out.exists());
    let message = failure(&["verify", out.to_str().unwrap()], 1);
    assert_says(&message, &["cannot read"]);
}
