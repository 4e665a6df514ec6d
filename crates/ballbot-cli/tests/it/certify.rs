//! `ballbot certify` and `ballbot verify`.

use crate::{assert_says, failure, text};
use ballbot_scenario::TerminalCertificate;
use serde_json::Value;
use std::path::Path;
use std::process::Command;
use std::sync::LazyLock;

/// What the program writes for a small set, once for all tests: the certificate and its page.
static WRITTEN: LazyLock<[String; 2]> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    let said = text(&["certify", "--size", "0.05", "--raise", "0", "--out", out]);
    assert_says(
        &said,
        &["the exact state and no delay", "|theta| <= 3.000000 deg"],
    );
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    [read("certificate.json"), read("certificate.html")]
});

/// The certificate of a small set, and its path in a folder of the test's own.
fn certified(folder: &Path) -> (Value, String) {
    let [document, _] = &*WRITTEN;
    let path = folder.join("certificate.json");
    std::fs::write(&path, document).unwrap();
    (
        serde_json::from_str(document).unwrap(),
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
    assert_says(
        &text(&["verify", &path]),
        &["The certificate holds, for the model, the exact state and no delay."],
    );
    let verified: Value = crate::json(&["verify", &path, "--json"]);
    assert_eq!(verified["holds"], true);
    assert_eq!(verified["level"], claim["terminal"]["level"]);
    let [_, page] = &*WRITTEN;
    assert_says(page, &["<svg", "θ", "level"]);
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
fn a_file_that_is_no_certificate_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("empty.json");
    std::fs::write(&path, "").unwrap();
    let message = failure(&["verify", path.to_str().unwrap()], 1);
    assert_says(&message, &["empty.json: not a certificate"]);
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
        &[
            "the certificate is false",
            "state_limits[0]",
            "the set reaches",
        ],
    );
    assert_says(
        &refused("/certificate/terminal/contraction", 0.5),
        &["the certificate is false", "decrease", "from the state ["],
    );
    assert_says(
        &refused("/certificate/t_s", 0.2),
        &["the certificate is false", "decrease"],
    );
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

/// What is designed for a box of tilts holds in a larger set.
/// A robot whose tilt rate has no bound: the key is named, and what would be right.
#[test]
fn a_bound_that_a_set_needs_is_asked_for_by_its_key() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("certificate");
    let message = failure(&["certify", "one-metre", "--out", out.to_str().unwrap()], 1);
    let expected = [
        "bounds.theta_dot_rad_s = [-inf, inf]",
        "--set bounds.theta_dot_rad_s=[-4,4]",
    ];
    assert_says(&message, &expected);
    assert!(!out.exists());
}

#[test]
fn the_level_is_raised_after_the_design() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    text(&["certify", "--size", "0.05", "--raise", "1", "--out", out]);
    let path = folder.path().join("certificate.json");
    let raised: Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
    let claim = &raised["certificate"];
    let of = |pointer: &str| claim.pointer(pointer).unwrap().as_f64().unwrap();
    // The design's level is 2000, for 0.05 of 60 degrees.
    let factor = of("/terminal/level") / 2000.0;
    let widened = of("/scheduling_limits/0") / (0.05 * std::f64::consts::FRAC_PI_3);
    assert!(factor > 1.5, "{factor}");
    assert!(
        (widened - factor.sqrt()).abs() < 0.01 * widened,
        "{widened}"
    );
    text(&["verify", path.to_str().unwrap()]);
}

/// `ballbot` with a cache folder of its own: standard output, or what went wrong.
fn with_cache(cache: &Path, arguments: &[&str]) -> Result<String, String> {
    let output = Command::new(env!("CARGO_BIN_EXE_ballbot"))
        .args(arguments)
        .env("XDG_CACHE_HOME", cache)
        .output()
        .unwrap();
    if output.status.success() {
        Ok(String::from_utf8(output.stdout).unwrap())
    } else {
        Err(String::from_utf8(output.stderr).unwrap())
    }
}

/// A certificate from a file is proved when a scenario with it is loaded, and remembered by its
/// content: another one does not profit from it.
#[test]
fn a_scenario_proves_its_certificate_once() {
    let folder = tempfile::tempdir().unwrap();
    certified(folder.path());
    let cache = folder.path().join("cache");
    let scenario = folder.path().join("far.toml");
    let table = "[controller.terminal.certified]\n";
    let far = text(&["scenario", "show", "far-setpoints"]);
    let far = far.replacen(
        table,
        &format!("{table}certificate = \"certificate.json\"\n"),
        1,
    );
    let far = far.replacen("duration_s = 80.0", "duration_s = 1.0", 1);
    std::fs::write(&scenario, far).unwrap();
    let out = folder.path().join("run");
    let arguments = [
        "simulate",
        scenario.to_str().unwrap(),
        "--out",
        out.to_str().unwrap(),
    ];
    let proved = "terminal certificate: proved by this version of the program";
    assert_says(&with_cache(&cache, &arguments).unwrap(), &[proved]);
    let remembered = || std::fs::read_dir(cache.join("ballbot/proved")).unwrap();
    let first: Vec<_> = remembered().map(|entry| entry.unwrap().path()).collect();
    assert_eq!(first.len(), 1);
    let name = first[0].file_name().unwrap().to_str().unwrap();
    assert!(
        name.len() == 64 && name.chars().all(|c| c.is_ascii_hexdigit()),
        "{name}"
    );
    // Again, from memory; and without a place to remember it.
    assert_says(&with_cache(&cache, &arguments).unwrap(), &[proved]);
    assert_eq!(remembered().count(), 1);
    assert_says(
        &with_cache(Path::new("/dev/null"), &arguments).unwrap(),
        &[proved],
    );
    // A false claim with the digest that belongs to it, beside the remembered one.
    let path = folder.path().join("certificate.json");
    let text = std::fs::read_to_string(&path).unwrap();
    let mut forged = TerminalCertificate::from_json(&text).unwrap();
    forged.terminal.contraction = 0.9;
    std::fs::write(&path, forged.to_json().unwrap()).unwrap();
    assert_says(
        &with_cache(&cache, &arguments).unwrap_err(),
        &["the certificate is false", "decrease", "certificate.json"],
    );
    assert_eq!(remembered().count(), 1);
}
