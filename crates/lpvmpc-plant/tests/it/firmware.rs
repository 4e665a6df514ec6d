//! The program around a plant; `.ci/firmware.sh` builds and runs one.

use crate::reference::plant;
use crate::round_trip::drift;
use lpvmpc_plant::{FirmwareSettings, Operation, Plant, PlantData, PlantError};

fn settings(states: usize, inputs: usize) -> FirmwareSettings {
    FirmwareSettings {
        lpvmpc: "../lpvmpc \"here\"".into(),
        t_s: 0.05,
        horizon: 20,
        q: vec![1.0; states],
        r: vec![0.1; inputs],
        p: vec![vec![2.5; states]; states],
        target: vec![0.0; states],
        start: vec![0.5; states],
        samples: 10,
    }
}

fn file(plant: &Plant, path: &str) -> String {
    let sizes = (plant.data().states.len(), plant.data().inputs.len());
    let files = plant.to_firmware(&settings(sizes.0, sizes.1)).unwrap();
    let (_, text) = files.into_iter().find(|(name, _)| *name == path).unwrap();
    text
}

#[test]
fn the_program_is_that_of_the_plant() {
    let cart_pole = plant("cart-pole");
    let main = file(&cart_pole, "src/main.rs");
    assert!(!main.contains('@'), "{main}");
    for expected in [
        "type Model = plant::CartPole;",
        "plant::CartPole::default()",
        "const NX: usize = 4;",
        "const NS: usize = 2;",
        "const M: usize = 24;",
        "lower: SVector::from([-15.0]),",
    ] {
        assert!(main.contains(expected), "{expected}: {main}");
    }
    assert!(!main.contains("soft_bounds"));
    // The types of a program have names such as `Controller`, which may be a plant's, too.
    assert!(!main.contains("use plant::"), "{main}");
    assert_eq!(file(&cart_pole, "src/plant.rs"), cart_pole.to_rust());
    let manifest = file(&cart_pole, "Cargo.toml");
    assert!(
        manifest.contains(r#"path = "../lpvmpc \"here\"""#),
        "{manifest}"
    );
    assert!(!file(&cart_pole, "build.rs").contains("examples"));
    // Known by its f alone, with a bounded state.
    let mut data = plant("functions").data().clone();
    data.states[1].lower = Some(-2.0);
    let main = file(&Plant::new(data).unwrap(), "src/main.rs");
    for expected in [
        "type Model = lpvmpc::AlongMotion<plant::Functions, NS>;",
        "lpvmpc::AlongMotion(plant::Functions::default())",
        "const NS: usize = 5;",
        "lower: SVector::from([f32::NEG_INFINITY, -2.0, f32::NEG_INFINITY]),",
    ] {
        assert!(main.contains(expected), "{expected}: {main}");
    }
}

/// The program said `-inf`, which is no Rust.
#[test]
fn a_bound_beyond_the_numbers_of_f32_is_none() {
    let mut data = plant("cart-pole").data().clone();
    (data.inputs[0].lower, data.inputs[0].upper) = (Some(-1e39), Some(1e39));
    (data.states[0].lower, data.states[0].upper) = (Some(-1e39), Some(1e39));
    let main = file(&Plant::new(data.clone()).unwrap(), "src/main.rs");
    for expected in [
        "lower: SVector::from([f32::NEG_INFINITY]),",
        "upper: SVector::from([f32::INFINITY]),",
    ] {
        assert!(main.contains(expected), "{expected}: {main}");
    }
    assert!(!main.contains("soft_bounds"), "{main}");
    let refused = |data: PlantData| {
        let plant = Plant::new(data).unwrap();
        let sizes = (plant.data().states.len(), plant.data().inputs.len());
        let error = plant.to_firmware(&settings(sizes.0, sizes.1)).unwrap_err();
        error.to_string()
    };
    (data.inputs[0].lower, data.inputs[0].upper) = (Some(1e39), None);
    data.equilibrium = None;
    assert_eq!(
        refused(data.clone()),
        "inputs[0] (force): no number of f32 is from 1e39 to inf, its bounds"
    );
    // What is no bound must be a number.
    data.inputs[0].lower = None;
    data.parameters[0].value = 1e39;
    let message = refused(data);
    assert!(
        message.ends_with(": 1e39 is no finite number in f32"),
        "{message}"
    );
    let mut data = plant("functions").data().clone();
    let is_constant = |one: &&mut Operation| matches!(one, Operation::Constant(_));
    *data.operations.iter_mut().find(is_constant).unwrap() = Operation::Constant(1e39);
    let message = refused(data);
    assert!(
        message.starts_with("operations[") && message.ends_with("1e39 is no finite number in f32"),
        "{message}"
    );
}

#[test]
fn settings_that_do_not_fit_are_refused() {
    let plant = plant("cart-pole");
    let refused = |change: fn(&mut FirmwareSettings)| {
        let mut settings = settings(4, 1);
        change(&mut settings);
        plant.to_firmware(&settings).unwrap_err().to_string()
    };
    for (found, expected) in [
        (
            refused(|s| s.q.truncate(3)),
            "q: 3 numbers where 4 are needed",
        ),
        (refused(|s| s.p.truncate(3)), "p: 3 rows for 4 states"),
        (
            refused(|s| s.p[2].push(0.0)),
            "p[2]: 5 numbers where 4 are needed",
        ),
        (
            refused(|s| s.r[0] = 1e60),
            "r: 1e60 is no finite number in f32",
        ),
        (
            refused(|s| s.t_s = f64::NAN),
            "t_s: NaN is no finite number in f32",
        ),
        (
            refused(|s| s.q[2] = 1e-48),
            "q: 1e-48 vanishes in f32, whose smallest number is 1.1754944e-38; multiply all weights by a common factor, \
             which changes nothing",
        ),
        (
            refused(|s| s.r[0] = 1e-40),
            "r: 1e-40 vanishes in f32, whose smallest number is 1.1754944e-38; multiply all weights by a common factor, \
             which changes nothing",
        ),
        (
            refused(|s| s.t_s = 1e-50),
            "t_s: 1e-50 s is no time between samples",
        ),
        (
            refused(|s| s.t_s = 0.0),
            "t_s: 0.0 s is no time between samples",
        ),
        (
            refused(|s| s.horizon = 0),
            "horizon: it has at least one sample",
        ),
    ] {
        assert_eq!(found, expected);
    }
    let drift = Plant::new(drift(1.0, 2.0)).unwrap();
    let error = drift.to_firmware(&settings(1, 0)).unwrap_err();
    assert_eq!(
        error.to_string(),
        "inputs: there is none to control the plant with"
    );
}

#[test]
fn a_folder_that_is_there_is_left_alone() {
    let folder = std::env::temp_dir().join(format!("lpvmpc-plant-firmware-{}", std::process::id()));
    let write = || plant("cart-pole").save_firmware(&settings(4, 1), &folder);
    write().unwrap();
    assert!(folder.join("src/plant.rs").is_file() && folder.join(".cargo/config.toml").is_file());
    std::fs::remove_file(folder.join("memory.x")).unwrap();
    let again: Result<(), PlantError> = write();
    assert!(again.is_err() && !folder.join("memory.x").exists());
    std::fs::remove_dir_all(&folder).unwrap();
    // Where its folder is not there, or a file, nothing is left beside it.
    let above = folder.with_extension("above");
    std::fs::write(&above, "").unwrap();
    let below = plant("cart-pole").save_firmware(&settings(4, 1), above.join("robot"));
    assert!(below.is_err() && above.is_file());
    std::fs::remove_file(&above).unwrap();
}
