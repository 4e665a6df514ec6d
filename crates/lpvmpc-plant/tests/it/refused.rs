//! What is no plant is refused, with the place.

use lpvmpc_plant::Plant;
use serde_json::{Value, json};

/// A small plant with all parts.
pub fn valid() -> Value {
    json!({
        "schema": 1,
        "name": "pendulum",
        "states": [{"name": "angle", "unit": "rad"}, {"name": "rate", "unit": "rad/s"}],
        "inputs": [{"name": "torque", "unit": "N m", "lower": -8, "upper": 8}],
        "parameters": [{"name": "gravity", "unit": "m/s^2", "value": 9.81}],
        "outputs": [{"name": "height", "unit": "m"}],
        "operations": [
            ["state", 0], ["state", 1], ["input", 0], ["parameter", 0], ["sin", 0], ["mul", 3, 4],
            ["add", 5, 2], ["cos", 0], ["constant", 0], ["constant", 1], ["scheduling", 0],
            ["sinc", 10], ["mul", 3, 11]
        ],
        "derivative": [1, 6],
        "output": [7],
        "embedding": {"scheduling": [0], "a": [[8, 9], [12, 8]], "b": [[8], [9]], "c": [8, 8]},
        "equilibrium": {"x": [0, 0], "u": [0]}
    })
}

fn message(plant: &Value) -> String {
    Plant::from_json(&plant.to_string())
        .unwrap_err()
        .to_string()
}

/// The message about the plant with another value at `pointer`.
fn with(pointer: &str, value: Value) -> String {
    let mut plant = valid();
    *plant.pointer_mut(pointer).unwrap() = value;
    message(&plant)
}

#[test]
fn the_plant_is_fine_as_it_is() {
    Plant::from_json(&valid().to_string()).unwrap();
}

/// A plant is either in continuous or in discrete time.
#[test]
fn a_period_goes_with_next() {
    let with = |changes: &[(&str, Value)]| {
        let mut plant = valid();
        for (key, value) in changes {
            plant[*key] = value.clone();
        }
        message(&plant)
    };
    for (changes, expected) in [
        (
            vec![("period", json!(0.1))],
            "derivative: a plant with a `period` is in discrete time",
        ),
        (
            vec![("next", json!([1, 6]))],
            "next: it is of a plant in discrete time, which has a `period`",
        ),
        (
            vec![
                ("period", json!(0)),
                ("next", json!([1, 6])),
                ("derivative", json!([])),
            ],
            "period: it is 0 s; it must be a positive number",
        ),
        (
            vec![
                ("period", json!(0.1)),
                ("next", json!([1])),
                ("derivative", json!([])),
            ],
            "next: 1 results, one for each state makes 2",
        ),
        (vec![("derivative", json!([]))], "derivative: it is missing"),
        (
            // x+ = (rate, ...) is zero at zero; one radian off it is not where it was.
            vec![
                ("period", json!(0.1)),
                ("next", json!([1, 6])),
                ("derivative", json!([])),
                ("equilibrium", json!({"x": [1, 0], "u": [0]})),
            ],
            "equilibrium: it is none: angle changes by -1 per period there",
        ),
    ] {
        let said = with(&changes);
        assert!(said.starts_with(expected), "{said}");
    }
}

#[test]
fn a_wrong_operation_is_named() {
    for (operation, expected) in [
        (
            json!(["mul", 0, 1, 2]),
            "operation 5: mul takes two arguments, found 3",
        ),
        (
            json!(["mul", 0]),
            "operation 5: mul takes two arguments, found 1",
        ),
        (
            json!(["sin", 0, 1]),
            "operation 5: sin takes one argument, found 2",
        ),
        (
            json!(["constant"]),
            "operation 5: constant takes one argument, found 0",
        ),
        (
            json!(["erf", 0]),
            "operation 5: \"erf\" is no operation; there are constant, state, ",
        ),
        (
            json!(["sin", -1]),
            "operation 5: sin of -1, which is no index from 0 on",
        ),
        (
            json!(["sin", 0.5]),
            "operation 5: sin of 0.5, which is no index from 0 on",
        ),
        (
            json!(["sin", 5]),
            "operation 5: sin refers to operation 5, which is not before it",
        ),
        (
            json!(["sin", 9]),
            "operation 5: sin refers to operation 9, which is not before it",
        ),
        (
            json!(["sin", u64::MAX]),
            "operation 5: sin refers to operation 18446744073709551615, which",
        ),
        (
            json!(["state", 2]),
            "operation 5: state 2, but there are 2 states, counted from 0",
        ),
        (
            json!(["input", 1]),
            "operation 5: input 1, but there are 1 inputs, counted from 0",
        ),
        (
            json!(["scheduling", 1]),
            "operation 5: scheduling 1, but there are 1 scheduling parameters",
        ),
        (json!([]), "operation 5: \"\" is no operation"),
        (
            json!(7),
            "file: invalid type: integer `7`, expected operation 5 as an array of",
        ),
        (
            json!([["sin"], 0]),
            "file: invalid type: sequence, expected a string",
        ),
        (
            json!(["sin", "x"]),
            "file: invalid type: string \"x\", expected a JSON number",
        ),
    ] {
        let found = with("/operations/5", operation);
        assert!(found.starts_with(expected), "{found}");
    }
}

#[test]
fn a_wrong_list_is_named() {
    for (pointer, value, expected) in [
        (
            "/derivative",
            json!([1]),
            "derivative: 1 results, one for each state makes 2",
        ),
        (
            "/derivative",
            json!([1, 13]),
            "derivative[1]: operation 13, but there are 13, counted from 0",
        ),
        (
            "/derivative",
            json!([1, 12]),
            "derivative[1]: it is a formula of x, u and p, but depends on",
        ),
        (
            "/output",
            json!([]),
            "output: 0 results, one for each output makes 1",
        ),
        ("/states", json!([]), "states: a plant has at least one"),
        (
            "/states/1/name",
            json!("angle"),
            "states[1]: \"angle\" is also the name of states[0]",
        ),
        (
            "/inputs/0/name",
            json!("rate"),
            "inputs[0]: \"rate\" is also the name of states[1]",
        ),
        (
            "/outputs/0/name",
            json!("rate"),
            "outputs[0]: \"rate\" is also the name of states[1]",
        ),
        (
            "/inputs/0/name",
            json!(""),
            "inputs[0]: the name is missing",
        ),
        (
            "/inputs/0/name",
            json!("a\nb"),
            "inputs[0]: a name is one line of at most 200 bytes",
        ),
        (
            "/inputs/0/lower",
            json!(9),
            "inputs[0] (torque): its bounds are from 9 to 8",
        ),
        (
            "/embedding/a",
            json!([[8, 9]]),
            "embedding.a: 1 rows for 2 states",
        ),
        (
            "/embedding/a/1",
            json!([8]),
            "embedding.a[1]: 1 results, one for each state makes 2",
        ),
        (
            "/embedding/b/1",
            json!([2]),
            "embedding.b[1][0]: it is a formula of s and p, but depends on",
        ),
        (
            "/embedding/c",
            json!([8]),
            "embedding.c: 1 results, one for each state makes 2",
        ),
        (
            "/embedding/c/0",
            json!(9),
            "embedding: it is not f: at x = ",
        ),
        (
            "/equilibrium/x",
            json!([0]),
            "equilibrium.x: 1 numbers where 2 are needed",
        ),
        (
            "/equilibrium",
            json!({"x": [std::f64::consts::FRAC_PI_2, 0], "u": [-9.81]}),
            "equilibrium.u[0]: torque is -9.81; it must be from -8.0 to 8.0, its bounds",
        ),
        (
            "/equilibrium/x/0",
            json!(1),
            "equilibrium: it is none: the derivative of rate is 8.25",
        ),
        (
            "/schema",
            json!(2),
            "schema: version 2 of the format; this program reads version 1",
        ),
        (
            "/schema",
            json!("1"),
            "file: invalid type: string \"1\", expected u64",
        ),
    ] {
        let found = with(pointer, value);
        assert!(found.starts_with(expected), "{found}");
    }
}

#[test]
fn a_key_too_many_or_too_few_is_named() {
    let mut plant = valid();
    plant["outptu"] = json!([7]);
    assert!(message(&plant).starts_with("file: unknown field `outptu`, expected one of"));
    let mut plant = valid();
    plant.as_object_mut().unwrap().remove("derivative");
    assert!(message(&plant).starts_with("derivative: it is missing"));
    let mut plant = valid();
    plant.as_object_mut().unwrap().remove("schema");
    assert!(message(&plant).starts_with("file: missing field `schema`"));
}

/// sin(s)/s has no value at rest, though f has.
#[test]
fn an_embedding_without_a_value_is_refused() {
    let mut plant = valid();
    plant["operations"] = json!([
        ["state", 0],
        ["state", 1],
        ["input", 0],
        ["parameter", 0],
        ["sin", 0],
        ["mul", 3, 4],
        ["add", 5, 2],
        ["cos", 0],
        ["constant", 0],
        ["constant", 1],
        ["scheduling", 0],
        ["sin", 10],
        ["div", 11, 10],
        ["mul", 3, 12]
    ]);
    plant["embedding"]["a"][1][0] = json!(13);
    let found = message(&plant);
    assert!(
        found.starts_with("embedding: it is not f: at x = [0.0, 0.0]"),
        "{found}"
    );
}

#[test]
fn what_is_not_json_is_refused_in_words() {
    let text = valid().to_string();
    let cut = |n: usize| Plant::from_json(&text[..n]).unwrap_err().to_string();
    assert!(cut(text.len() - 1).starts_with("file: the file ends too early: "));
    assert!(cut(0).starts_with("file: the file ends too early: "));
    let nan = text.replace("9.81", "NaN");
    let found = Plant::from_json(&nan).unwrap_err().to_string();
    assert!(
        found.starts_with("file: JSON has no NaN and no Infinity: "),
        "{found}"
    );
    let large = text.replace("9.81", "1e999");
    let found = Plant::from_json(&large).unwrap_err().to_string();
    assert!(found.starts_with("file: number out of range"), "{found}");
    let error = Plant::load("/nowhere/at/all.json").unwrap_err();
    assert_eq!(error.place, "/nowhere/at/all.json");
}
