//! `ballbot scenario`.

use super::files;
use crate::{assert_says, fail, succeed};
use ballbot_scenario::{Scenario, builtin};
use std::path::Path;

#[test]
fn every_built_in_scenario_is_listed_with_its_title() {
    let list = succeed(Path::new("."), &["scenario", "list"]);
    for builtin in builtin::ALL {
        let title = Scenario::load(builtin.name).unwrap().title;
        let line = list.lines().find(|line| {
            let name = line.split_whitespace().next();
            name == Some(builtin.name)
        });
        assert_says(line.unwrap(), &[&title]);
    }
    assert_eq!(list.lines().count(), builtin::ALL.len() + 1, "{list}");
}

#[test]
fn what_is_shown_is_the_scenario() {
    for builtin in builtin::ALL {
        let shown = succeed(Path::new("."), &["scenario", "show", builtin.name]);
        let scenario = Scenario::load(builtin.name).unwrap();
        assert_eq!(Scenario::parse(&shown, "shown").unwrap(), scenario);
        // It is commented, and it is what another program would write, too.
        assert!(shown.starts_with('#'), "{}", builtin.name);
        let written = toml::to_string(&scenario).unwrap();
        let read = Scenario::parse(&written, "written").unwrap();
        assert_eq!(read, scenario, "{written}");
    }
}

#[test]
fn a_name_that_does_not_exist_brings_the_nearest() {
    let folder = tempfile::tempdir().unwrap();
    for (name, nearest) in [
        ("lisajous", "lissajous"),
        ("two-setpoint", "two-setpoints"),
        ("tightbounds", "tight-bounds"),
    ] {
        let suggestion = format!("did you mean `{nearest}`?");
        for arguments in [&["simulate", name][..], &["scenario", "show", name]] {
            let message = fail(folder.path(), arguments, 1);
            assert_says(
                &message,
                &[&format!("`{name}`"), &suggestion, "single-setpoint"],
            );
        }
    }
    // Nothing is like this one.
    let message = fail(folder.path(), &["simulate", "qqqq"], 1);
    assert!(!message.contains("did you mean"), "{message}");
    assert!(files(folder.path()).is_empty());
}
