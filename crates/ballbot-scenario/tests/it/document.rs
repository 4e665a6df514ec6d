//! A scenario whose keys are read and changed.

use ballbot_scenario::{Document, Scenario};
use toml::Value;

fn two_setpoints() -> Document {
    Document::load("two-setpoints").unwrap()
}

#[test]
fn a_change_is_the_same_wherever_it_is_made() {
    let changes = [
        ("controller.horizon", Value::Integer(30)),
        ("bounds.torque_nm.1", Value::Float(0.1 + 0.2)),
    ];
    let of_command_line = changes
        .iter()
        .map(|(key, value)| ((*key).to_owned(), value.to_string()));
    let wanted =
        Scenario::load_with("two-setpoints", &of_command_line.collect::<Vec<_>>()).unwrap();
    let mut document = two_setpoints();
    assert_eq!(document.with(&changes).unwrap(), wanted);
    assert_eq!(document, two_setpoints());
    document.set(&changes).unwrap();
    assert_eq!(document.scenario(), &wanted);
    let written = Document::parse(document.text().to_owned(), "again").unwrap();
    assert_eq!(written.scenario(), &wanted);
}

#[test]
fn a_text_keeps_its_comments_until_it_is_changed() {
    let mut document = two_setpoints();
    assert!(document.text().contains('#'));
    document
        .set(&[("controller.horizon", Value::Integer(30))])
        .unwrap();
    assert!(!document.text().contains('#'));
}

#[test]
fn what_is_not_given_has_its_default() {
    let mut document = two_setpoints();
    let key = "bounds.theta_rad";
    let given = document.value(key);
    document.remove(key).unwrap();
    assert!(document.root()["bounds"].get("theta_rad").is_none());
    let default = document.value(key).unwrap();
    let ends = default.as_array().unwrap().iter();
    assert!(
        ends.map(Value::as_float)
            .all(|end| end.is_some_and(f64::is_infinite))
    );
    assert_ne!(given, Some(default));
    assert!(document.remove(key).is_err());
    assert_eq!(document.value("controller.nothing"), None);
}

/// Tables were without what they leave out, unless they were left out themselves.
#[test]
fn a_table_has_every_default() {
    let document = two_setpoints();
    let all = document.value("").unwrap();
    let key = "controller";
    let (given, whole) = (&document.root()[key], document.value(key).unwrap());
    assert_eq!(whole, all[key]);
    assert!(whole.as_table().unwrap().len() > given.as_table().unwrap().len());
    for (key, value) in given.as_table().unwrap() {
        assert!(whole.get(key).is_some(), "{key} = {value}");
    }
}

/// Whose entries would be taken for the table's keys in the order in which they happen to be declared.
#[test]
fn a_list_in_place_of_a_table_is_refused() {
    let mut document = two_setpoints();
    let list = Value::Array(vec![Value::Float(0.1); 5]);
    let of_change = document.set(&[("initial_state", list.clone())]);
    assert_eq!(document, two_setpoints());
    let mut table: toml::Table = document.text().parse().unwrap();
    table.insert("initial_state".to_owned(), list);
    let of_file = Scenario::parse(&table.to_string(), "a file");
    for message in [
        of_change.unwrap_err().to_string(),
        of_file.unwrap_err().to_string(),
    ] {
        for said in ["initial_state", "it must be a table", "theta_rad"] {
            assert!(message.contains(said), "{message}");
        }
    }
}

#[test]
fn what_makes_no_scenario_changes_nothing_and_is_told_with_the_nearest_word() {
    let mut document = two_setpoints();
    for (key, value, said) in [
        (
            "controller.horizn",
            Value::Integer(3),
            "did you mean `horizon`?",
        ),
        (
            "controller.model",
            Value::String("linaer".to_owned()),
            "did you mean `linear`?",
        ),
        ("controller.horizon", Value::Boolean(true), "a whole number"),
        (
            "duration_s.x",
            Value::Integer(3),
            "would stand below a value",
        ),
    ] {
        let error = document.set(&[("title", Value::String("t".to_owned())), (key, value)]);
        let message = error.unwrap_err().to_string();
        assert!(message.contains(said), "{key}: {message}");
        assert_eq!(document, two_setpoints());
    }
    // Nothing that is far from all of them is offered.
    let error = document.set(&[("zzz", Value::Integer(3))]).unwrap_err();
    assert!(!error.to_string().contains("did you mean"), "{error}");
    assert!(document.remove("controller.t_s").is_err());
    assert_eq!(document, two_setpoints());
}
