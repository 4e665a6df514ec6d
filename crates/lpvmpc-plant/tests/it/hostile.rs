//! Whatever a file holds, the answer is a plant or a message: soon, and in bounded memory.

use crate::reference::plant;
use crate::refused::valid;
use lpvmpc_plant::{Binary, Operation, Plant, PlantData, Signal};
use proptest::prelude::*;
use serde_json::{Value, json};

/// What was read can be evaluated and written.
fn use_it(text: &str) {
    if let Ok(plant) = Plant::from_json(text) {
        let data = plant.data();
        let (x, u) = (vec![0.5; data.states.len()], vec![0.5; data.inputs.len()]);
        plant.derivative(&x, &u).unwrap();
        plant.output(&x, &u).unwrap();
        assert_eq!(Plant::from_json(&plant.to_json()).unwrap(), plant);
    }
}

/// Any small piece of JSON.
fn piece() -> impl Strategy<Value = Value> {
    let number = prop_oneof![
        (0..20_u64).prop_map(Value::from),
        any::<i64>().prop_map(Value::from),
        any::<f64>().prop_map(Value::from),
    ];
    let name = prop::sample::select(vec![
        "state",
        "input",
        "constant",
        "mul",
        "sin",
        "pow",
        "scheduling",
        "sq",
        "",
        "\u{0}",
    ]);
    let leaf = prop_oneof![
        number,
        name.prop_map(Value::from),
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
    ];
    leaf.prop_recursive(3, 12, 4, |inner| {
        prop_oneof![
            prop::collection::vec(inner.clone(), 0..4).prop_map(Value::from),
            prop::collection::btree_map("[a-z]{1,4}", inner, 0..3)
                .prop_map(|map| Value::Object(map.into_iter().collect())),
        ]
    })
}

/// Every place in a value, by its pointer.
fn places(value: &Value, at: &str, found: &mut Vec<String>) {
    found.push(at.to_owned());
    match value {
        Value::Array(list) => {
            for (i, value) in list.iter().enumerate() {
                places(value, &format!("{at}/{i}"), found);
            }
        }
        Value::Object(map) => {
            for (key, value) in map {
                places(value, &format!("{at}/{key}"), found);
            }
        }
        _ => {}
    }
}

proptest! {
    #[test]
    fn random_bytes_are_no_harm(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        use_it(&String::from_utf8_lossy(&bytes));
    }

    #[test]
    fn a_file_with_other_bytes_is_no_harm(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
        cut in any::<prop::sample::Index>(),
        whole: bool,
    ) {
        let mut bytes = valid().to_string().into_bytes();
        for (place, byte) in changes {
            let place = place.index(bytes.len());
            bytes[place] = byte;
        }
        if !whole {
            bytes.truncate(cut.index(bytes.len()));
        }
        use_it(&String::from_utf8_lossy(&bytes));
    }

    #[test]
    fn a_file_with_other_pieces_is_no_harm(
        changes in prop::collection::vec((any::<prop::sample::Index>(), piece()), 1..3),
    ) {
        let mut plant = valid();
        for (place, piece) in changes {
            let mut found = Vec::new();
            places(&plant, "", &mut found);
            let pointer = &found[place.index(found.len())];
            *plant.pointer_mut(pointer).unwrap() = piece;
        }
        use_it(&plant.to_string());
    }

    /// Programs of any operations on any results, forward and of themselves, too.
    #[test]
    fn random_programs_are_no_harm(
        operations in prop::collection::vec((0..40_usize, 0..30_usize, 0..30_usize), 1..30),
        result in 0..30_usize,
    ) {
        let names = ["add", "mul", "div", "pow", "atan2", "min", "if_else_zero", "lt"];
        let unary = ["sin", "log", "sqrt", "acosh", "sq", "inv", "floor", "tan"];
        let operations: Vec<Value> = { operations.iter().enumerate() }
            .map(|(index, (kind, i, j))| {
                // Mostly backward.
                let back = |i: usize| if i < 28 && index > 0 { i % index } else { i };
                match kind {
                    0..16 => json!([names[kind % 8], back(*i), back(*j)]),
                    16..32 => json!([unary[kind % 8], back(*i)]),
                    32..35 => json!(["state", i % 3]),
                    35..38 => json!(["constant", *i as f64 - 4.5]),
                    _ => json!(["input", j % 2]),
                }
            })
            .collect();
        let plant = json!({
            "schema": 1, "name": "random", "states": [{"name": "x"}], "inputs": [{"name": "u"}],
            "operations": operations, "derivative": [result]
        });
        use_it(&plant.to_string());
    }
}

#[test]
fn deep_nesting_is_refused() {
    for part in ["operations", "name", "anything"] {
        let deep = "[".repeat(1_000_000);
        let text = format!("{{\"schema\": 1, \"{part}\": {deep}");
        assert!(Plant::from_json(&text).is_err());
    }
    assert!(Plant::from_json(&"[".repeat(1_000_000)).is_err());
    assert!(Plant::from_json(&"{\"schema\":".repeat(100_000)).is_err());
}

#[test]
fn too_much_is_refused() {
    let fault = |text: &str| Plant::from_json(text).unwrap_err().to_string();
    assert_eq!(
        fault(&" ".repeat((1 << 24) + 1)),
        "file: longer than 16777216 bytes"
    );
    let mut plant = valid();
    plant["operations"] = vec![json!(["constant", 0]); 100_001].into();
    assert!(fault(&plant.to_string()).contains("operations: more than 100000"));
    let mut plant = valid();
    let many: Vec<Value> = (0..1001)
        .map(|i| json!({"name": format!("p{i}"), "value": 0}))
        .collect();
    plant["parameters"] = many.into();
    assert_eq!(
        fault(&plant.to_string()),
        "parameters: 1001 of them, at most 1000"
    );
    let mut plant = valid();
    plant["operations"][5] = vec![json!("mul"); 1_000_000].into();
    assert!(fault(&plant.to_string()).starts_with("file: invalid type: string"));
    let mut plant = valid();
    plant["operations"][5] = json!(["x".repeat(1_000_000)]);
    assert!(fault(&plant.to_string()).len() < 1000);
}

/// The longest chains that a file may have, of which every result is needed: at once one number, and at
/// once all.
#[test]
fn long_programs_take_registers_as_they_need_them() {
    let count = 50_000;
    let plant = |operations: Vec<Operation>| {
        Plant::new(PlantData {
            name: "long".into(),
            states: vec![Signal::new("x", "")],
            derivative: vec![operations.len() - 1],
            operations,
            ..PlantData::default()
        })
        .unwrap()
    };
    let mut chain = vec![Operation::State(0), Operation::Constant(1.0)];
    (1..count).for_each(|i| chain.push(Operation::Binary(Binary::Add, i, 1)));
    assert_eq!(
        plant(chain).derivative(&[3.0], &[]).unwrap(),
        [count as f64]
    );
    // x + 1, x + 2, ... and their sum from the last one on.
    let mut wide = vec![Operation::State(0), Operation::Constant(1.0)];
    (1..count).for_each(|i| {
        wide.push(Operation::Binary(
            Binary::Add,
            if i == 1 { 0 } else { i },
            1,
        ))
    });
    let last = wide.len() - 1;
    (2..last).rev().for_each(|i| {
        let sum = wide.len() - 1;
        wide.push(Operation::Binary(Binary::Add, sum, i));
    });
    let n = (count - 1) as f64;
    assert_eq!(
        plant(wide).derivative(&[0.0], &[]).unwrap(),
        [n * (n + 1.0) / 2.0]
    );
}

#[test]
fn the_reference_plants_survive_any_cut() {
    let text = plant("functions").to_json();
    for cut in (0..text.len()).step_by(37) {
        assert!(Plant::from_json(&text[..cut]).is_err());
    }
}
