//! What people are told: bounds, readings and mistakes in files, in plain words.

use ballbot_scenario::words::{active_bounds, readings, toml_message};
use lpvmpc::{BoundId, Observation, Quantity, Restart, Side, Verdict};

#[test]
fn an_active_bound_is_named_once_with_the_time_at_which_it_begins() {
    let bound = |stage, quantity, side| BoundId {
        stage,
        quantity,
        side,
    };
    let bounds = [
        bound(8, Quantity::State(1), Side::Upper),
        bound(7, Quantity::State(1), Side::Upper),
        bound(0, Quantity::Input(0), Side::Lower),
    ];
    assert_eq!(
        active_bounds(&bounds, 0.05),
        "theta upper 0.35 s ahead, torque lower 0.00 s ahead"
    );
}

#[test]
fn no_type_of_a_programming_language_is_named() {
    for (message, plain) in [
        (
            "invalid type: integer `3`, expected struct GeometryTable\n",
            "invalid type: integer `3`, expected a table",
        ),
        (
            "expected struct variant ChoiceTable::Prior, or",
            "expected a table, or",
        ),
        ("expected usize", "expected a whole number, 0 or more"),
    ] {
        assert_eq!(toml_message(message), plain);
    }
}

#[test]
fn a_name_that_is_like_one_of_those_expected_is_asked_for() {
    let said = toml_message("unknown field `horizn`, expected one of `t_s`, `horizon`");
    assert!(
        said.ends_with("`horizon`; did you mean `horizon`?"),
        "{said}"
    );
    let said = toml_message("unknown variant `medain`, expected `median` or `mean`");
    assert!(said.ends_with("did you mean `median`?"), "{said}");
    let other = "unknown field `xyz`, expected one of `t_s`, `horizon`";
    assert_eq!(toml_message(other), other);
}

#[test]
fn readings_that_are_not_believed_are_told_by_sensor() {
    let seen = |theta, restart| Observation {
        verdicts: [Verdict::Used, theta, Verdict::NotNeeded, Verdict::Missing],
        restart,
    };
    let run = [
        (0.0, seen(Verdict::Used, Some(Restart::Start))),
        (0.1, seen(Verdict::Outlier, None)),
        (0.2, seen(Verdict::Outlier, None)),
        (40.0, seen(Verdict::Used, Some(Restart::Gap))),
    ];
    assert_eq!(
        readings(run.into_iter()),
        "theta outlier 2 times, the estimate began anew at t = 40.000 s: no reading was believed \
         for too long"
    );
    assert_eq!(readings(run.into_iter().take(1)), "");
}
