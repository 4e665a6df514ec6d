//! The program `lpvmpc` as its users run it.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on must fail, in its support functions too"
)]

use nalgebra::{DMatrix, DVector};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use tempfile::TempDir;

fn lpvmpc(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_lpvmpc"))
        .current_dir(folder)
        .args(arguments)
        .output()
        .unwrap()
}

/// Standard output of a run that succeeds.
fn succeed(folder: &Path, arguments: &[&str]) -> String {
    let output = lpvmpc(folder, arguments);
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {message}");
    String::from_utf8(output.stdout).unwrap()
}

/// The message of a run that has no result.
fn fail(folder: &Path, arguments: &[&str]) -> String {
    let output = lpvmpc(folder, arguments);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{arguments:?}: {message}");
    assert!(output.stdout.is_empty(), "{arguments:?} printed a result");
    assert!(message.starts_with("error: "), "{arguments:?}: {message}");
    message
}

/// A folder with the example, shortened to 1 s and pushed within it.
fn example() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let plant = succeed(folder.path(), &["example", "plant"]);
    fs::write(folder.path().join("cart-pole.json"), plant).unwrap();
    let text = succeed(folder.path(), &["example"]);
    let text = changed(&text, "duration = 6.0", "duration = 1.0");
    let text = changed(&text, "time = 3.0", "time = 0.8");
    fs::write(folder.path().join("cart-pole.toml"), text).unwrap();
    folder
}

fn changed(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "`{from}` is not in: {text}");
    text.replacen(from, to, 1)
}

fn numbers(rows: &Value) -> DMatrix<f64> {
    let rows: Vec<Vec<f64>> = serde_json::from_value(rows.clone()).unwrap();
    DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j])
}

#[test]
fn an_experiment_is_recorded_from_end_to_end() {
    let folder = example();
    let summary = succeed(folder.path(), &["simulate", "cart-pole.toml", "--json"]);
    let summary: Value = serde_json::from_str(&summary).unwrap();
    assert_eq!(summary["samples"], 25);
    assert_eq!(summary["statuses"]["converged"], 25);
    let out = folder.path().join("out").join("cart-pole");
    let written = fs::read_to_string(out.join("summary.json")).unwrap();
    assert_eq!(summary, serde_json::from_str::<Value>(&written).unwrap());
    let table = fs::read_to_string(out.join("trajectory.csv")).unwrap();
    let lines: Vec<Vec<&str>> = table
        .lines()
        .map(|line| line.split(',').collect())
        .collect();
    assert_eq!(lines.len(), 27);
    assert!(lines.iter().all(|line| line.len() == lines[0].len()));
    assert_eq!(lines[0][5], "force [N]");
    let forces = lines[1..26]
        .iter()
        .map(|line| line[5].parse::<f64>().unwrap());
    assert!(forces.into_iter().all(|force| force.abs() <= 15.0));
    assert!(
        fs::read(out.join("figure.png"))
            .unwrap()
            .starts_with(b"\x89PNG")
    );
    // Again, in place of its own files, and the same to the last bit.
    assert_eq!(
        succeed(folder.path(), &["-q", "simulate", "cart-pole.toml"]),
        ""
    );
    assert_eq!(
        fs::read_to_string(out.join("trajectory.csv")).unwrap(),
        table
    );
}

#[test]
fn the_regulator_is_the_limit_of_the_backward_recursion() {
    let folder = example();
    let json = |arguments: &[&str]| -> Value {
        serde_json::from_str(&succeed(folder.path(), arguments)).unwrap()
    };
    let found = json(&["lqr", "cart-pole.toml", "--json"]);
    let plant = json(&["plant", "cart-pole.json", "--json"]);
    assert_eq!(plant["controllability_rank"], 4);
    // exp([A B; 0 0] t_s) by its series.
    let (a, b) = (numbers(&plant["a"]), numbers(&plant["b"]));
    let mut joint = DMatrix::zeros(5, 5);
    joint.view_mut((0, 0), (4, 4)).copy_from(&(a * 0.04));
    joint.view_mut((0, 4), (4, 1)).copy_from(&(b * 0.04));
    let mut sum = DMatrix::identity(5, 5);
    let mut term = DMatrix::identity(5, 5);
    for k in 1..20 {
        term = &term * &joint / f64::from(k);
        sum += &term;
    }
    let (a, b) = (
        sum.view((0, 0), (4, 4)).into_owned(),
        sum.view((0, 4), (4, 1)).into_owned(),
    );
    let q = DMatrix::from_diagonal(&DVector::from_vec(vec![10.0, 10.0, 0.1, 0.1]));
    let (mut p, mut k) = (q.clone(), DMatrix::zeros(1, 4));
    for _ in 0..2000 {
        let r = (b.transpose() * &p * &b)[(0, 0)] + 0.01;
        k = b.transpose() * &p * &a / r;
        p = &q + a.transpose() * &p * (&a - &b * &k);
    }
    let error = (numbers(&found["k"]) - &k).amax() / k.amax();
    assert!(error < 1e-9, "{error}");
    let error = (numbers(&found["p"]) - &p).amax() / p.amax();
    assert!(error < 1e-9, "{error}");
}

#[test]
fn what_is_wrong_is_named_and_nothing_is_written() {
    let folder = example();
    let text = fs::read_to_string(folder.path().join("cart-pole.toml")).unwrap();
    for (from, to, parts) in [
        (
            "horizon =",
            "horizn =",
            vec!["line 10", "did you mean `horizon`?"],
        ),
        (
            "\"cart-pole.json\"",
            "\"none.json\"",
            vec!["cannot read none.json"],
        ),
        (
            "x0 = [0.0",
            "x0 = [3.0",
            vec!["x0: position = 3", "-0.2 to 1.2"],
        ),
        (
            "x0 = [0.0",
            "x0 = [nan",
            vec!["x0: position = NaN is not finite"],
        ),
        ("r = [0.01]", "r = [-1]", vec!["the weight of force is -1"]),
        (
            "r = [0.01]",
            "r = [0]",
            vec!["controller: ", "positive definite"],
        ),
        (
            "q = [10.0, ",
            "q = [",
            vec!["3 numbers", "position, tilt, speed, rate"],
        ),
        (
            "position = [",
            "positon = [",
            vec!["did you mean \"position\"?"],
        ),
        (
            "pole_mass =",
            "pole_mas =",
            vec!["did you mean \"pole_mass\"?"],
        ),
        (
            "horizon = 40",
            "horizon = 0",
            vec!["controller: horizon: it is 0"],
        ),
        ("t_s = 0.04", "t_s = 0.0", vec!["controller: t_s: it is 0"]),
        (
            "t_s = 0.04",
            "t_s = nan",
            vec!["controller: t_s: it is NaN"],
        ),
        ("duration = 1.0", "duration = inf", vec!["duration = inf"]),
        (
            "duration = 1.0",
            "duration = 1.0\n[[world.jump]]\ntime = -3.0\nchange = [0, 0, 0, 0]",
            vec!["world.jump 1.time = -3", "begins at 0 s"],
        ),
        ("time = 0.5", "time = 0.0", vec!["reference 2, time = 0"]),
        ("\"cart-pole\"", "\"../a\"", vec!["it names a folder"]),
        (
            "position = [",
            "position = [0.0, ",
            vec!["line 15", "3 numbers", "[lower, upper]"],
        ),
        (
            "# delay = 0.04                    # from a command",
            "delay = -1 #",
            vec!["bad.toml: world: the delay is -1"],
        ),
    ] {
        fs::write(folder.path().join("bad.toml"), changed(&text, from, to)).unwrap();
        let message = fail(folder.path(), &["simulate", "bad.toml"]);
        for part in parts {
            assert!(message.contains(part), "`{part}` is not in: {message}");
        }
    }
    assert!(!folder.path().join("out").exists());
    let plant = fs::read_to_string(folder.path().join("cart-pole.json")).unwrap();
    fs::write(folder.path().join("cut.json"), &plant[..500]).unwrap();
    let message = fail(folder.path(), &["plant", "cut.json"]);
    assert!(message.contains("the file ends too early"), "{message}");
}

#[test]
fn no_regulator_is_designed_where_the_plant_does_not_stand() {
    let folder = example();
    // x_dot = u + 1 without an equilibrium in its file: it does not stand at zero.
    let plant = r#"{"schema": 1, "name": "pushed", "states": [{"name": "a"}], "inputs": [{"name": "u"}],
        "operations": [["input", 0], ["constant", 1.0], ["add", 0, 1]], "derivative": [2]}"#;
    fs::write(folder.path().join("pushed.json"), plant).unwrap();
    let said = succeed(folder.path(), &["plant", "pushed.json"]);
    assert!(said.contains("this is no equilibrium"), "{said}");
    let experiment = "name = \"a\"\nplant = \"pushed.json\"\nx0 = [0]\nduration = 1\n\
                      [controller]\nt_s = 0.1\nhorizon = 5\nq = [1]\nr = [1]\n";
    fs::write(folder.path().join("pushed.toml"), experiment).unwrap();
    let message = fail(folder.path(), &["lqr", "pushed.toml"]);
    assert!(message.contains("needs an equilibrium"), "{message}");
}

/// x+ = 2 ln(1 + x) + u, which is unstable at 0.
#[test]
fn a_plant_in_discrete_time_is_certified_and_proved_again() {
    let folder = tempfile::tempdir().unwrap();
    let plant = r#"{"schema": 1, "name": "map", "states": [{"name": "a", "lower": -0.4}],
        "inputs": [{"name": "u", "lower": -1, "upper": 1}], "period": 0.1, "operations": [["state", 0],
        ["log1p", 0], ["constant", 2], ["mul", 1, 2], ["input", 0], ["add", 3, 4]], "next": [5]}"#;
    fs::write(folder.path().join("map.json"), plant).unwrap();
    let experiment = "name = \"a\"\nplant = \"map.json\"\nx0 = [0]\nduration = 1\n\
                      [controller]\nt_s = 0.1\nhorizon = 5\nq = [1]\nr = [1]\n";
    fs::write(folder.path().join("map.toml"), experiment).unwrap();
    for file in ["map.toml", "map.json"] {
        let message = fail(folder.path(), &["certify", "map.toml", "--out", file]);
        assert!(message.contains("would be lost"), "{message}");
    }
    let arguments = ["certify", "map.toml", "-o", "certificate.json"];
    succeed(folder.path(), &arguments);
    let arguments = ["verify", "certificate.json", "map.json", "--json"];
    let verified: Value = serde_json::from_str(&succeed(folder.path(), &arguments)).unwrap();
    let reach = verified["reach"]["a"].as_f64().unwrap();
    assert!(reach > 0.2 && reach <= 0.4, "{verified}");
    fs::write(
        folder.path().join("map.toml"),
        changed(experiment, "0.1", "0.2"),
    )
    .unwrap();
    let message = fail(folder.path(), &["certify", "map.toml"]);
    assert!(message.contains("period of 0.1 s"), "{message}");
}

/// They were dropped in silence.
#[test]
fn jumps_and_loads_after_the_end_are_told() {
    let folder = example();
    let text = fs::read_to_string(folder.path().join("cart-pole.toml")).unwrap();
    let late = "[[world.jump]]\ntime = 3.0\nchange = [0, 0, 0, 0.1]\n[[world.load]]\nstart = 100.0\nend = 101.0\n\
                load = [0, 0, 0.1, 0]\n";
    fs::write(folder.path().join("late.toml"), text + late).unwrap();
    let output = lpvmpc(folder.path(), &["simulate", "late.toml"]);
    assert!(output.status.success());
    assert_eq!(
        String::from_utf8(output.stderr).unwrap(),
        "note: world.jump 2.time = 3: the run ends at 1 s and does not come to it\n\
         note: world.load 1.start = 100: the run ends at 1 s and does not come to it\n"
    );
}

/// What is called a cost is that of states alone, as its name says; the reference's weights are in the file.
#[test]
fn the_cost_of_states_is_without_the_inputs() {
    let folder = example();
    let said = succeed(folder.path(), &["simulate", "cart-pole.toml"]);
    let out = folder.path().join("out/cart-pole");
    let summary = fs::read_to_string(out.join("summary.json")).unwrap();
    let summary: Value = serde_json::from_str(&summary).unwrap();
    assert!(
        said.contains("cost of states") && said.contains("without the inputs"),
        "{said}"
    );
    let table = fs::read_to_string(out.join("trajectory.csv")).unwrap();
    let rows = table.lines().skip(1).take(25).map(|line| {
        let cells = line.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN));
        cells.collect::<Vec<f64>>()
    });
    let header: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    let reference = header
        .iter()
        .position(|name| name.contains(" reference"))
        .unwrap();
    let cost: f64 = rows
        .map(|row| {
            let errors = (0..4).map(|i| row[1 + i] - row[reference + i]);
            errors
                .zip([10.0, 10.0, 0.1, 0.1])
                .map(|(e, q)| q * e * e)
                .sum::<f64>()
        })
        .sum();
    let found = summary["state_cost"].as_f64().unwrap();
    assert!((found - cost).abs() < 1e-9 * cost, "{found} for {cost}");
}

#[test]
fn weights_of_inputs_that_a_plant_has_none_of_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let plant = r#"{"schema": 1, "name": "drift", "states": [{"name": "place", "unit": "m"}],
        "operations": [["state", 0], ["neg", 0]], "derivative": [1]}"#;
    fs::write(folder.path().join("drift.json"), plant).unwrap();
    let experiment = "name = \"drift\"\nplant = \"drift.json\"\nx0 = [1.0]\nduration = 1.0\n[controller]\n\
                      t_s = 0.1\nhorizon = 5\nq = [1.0]\nr = [0.01]\n";
    fs::write(folder.path().join("drift.toml"), experiment).unwrap();
    let message = fail(folder.path(), &["simulate", "drift.toml"]);
    let expected = "controller.r: the plant has nothing that it could be for; it must be []";
    assert!(message.contains(expected), "{message}");
}

/// An input that is switched off has one bound on both sides, which once could not be drawn.
#[test]
fn an_input_that_is_switched_off_is_drawn() {
    let folder = example();
    let path = folder.path().join("cart-pole.toml");
    let text = fs::read_to_string(&path).unwrap();
    let bounds = "u_bounds = { force = [";
    let off = changed(
        &text,
        &format!("# {bounds}-10.0, 10.0]"),
        &format!("{bounds}0, 0]"),
    );
    fs::write(&path, off).unwrap();
    lpvmpc(folder.path(), &["simulate", "cart-pole.toml", "-o", "off"]);
    assert!(folder.path().join("off").join("trajectory.csv").exists());
    assert!(folder.path().join("off").join("figure.svg").exists());
}

#[test]
fn files_of_others_stay() {
    let folder = example();
    let out = folder.path().join("mine");
    fs::create_dir(&out).unwrap();
    fs::write(out.join("summary.json"), "mine").unwrap();
    let message = fail(
        folder.path(),
        &["simulate", "cart-pole.toml", "--out", "mine"],
    );
    assert!(
        message.contains("does not say that lpvmpc wrote it"),
        "{message}"
    );
    assert_eq!(fs::read_dir(&out).unwrap().count(), 1);
    assert_eq!(
        fs::read_to_string(out.join("summary.json")).unwrap(),
        "mine"
    );
}

/// A pendulum held upright by a torque, with its experiment: rate' = 9 sin(tilt) + torque.
fn pendulum() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let plant = r#"{"schema": 1, "name": "pendulum", "equilibrium": {"x": [0, 0], "u": [0]},
        "states": [{"name": "tilt", "lower": -0.5, "upper": 0.5}, {"name": "rate", "lower": -3, "upper": 3}],
        "inputs": [{"name": "torque", "lower": -6, "upper": 6}],
        "operations": [["state", 0], ["state", 1], ["input", 0], ["sin", 0], ["constant", 9.0], ["mul", 3, 4],
                       ["add", 5, 2]],
        "derivative": [1, 6]}"#;
    fs::write(folder.path().join("pendulum.json"), plant).unwrap();
    let experiment = "name = \"pendulum\"\nplant = \"pendulum.json\"\nx0 = [0.4, 0]\nduration = 2\n\
                      [controller]\nt_s = 0.05\nhorizon = 15\nq = [10, 1]\nr = [0.1]\n";
    fs::write(folder.path().join("pendulum.toml"), experiment).unwrap();
    folder
}

#[test]
fn a_loop_is_guaranteed_by_a_certificate_that_is_proved_first() {
    let folder = pendulum();
    let path = folder.path();
    succeed(path, &["certify", "pendulum.toml", "--out", "c.json"]);
    let said = succeed(path, &["verify", "c.json", "pendulum.json"]);
    assert!(said.starts_with("Proved on "), "{said}");
    let text = fs::read_to_string(path.join("pendulum.toml")).unwrap();
    let with = changed(&text, "r = [0.1]", "r = [0.1]\ncertificate = \"c.json\"");
    fs::write(path.join("with.toml"), &with).unwrap();
    let summary = succeed(path, &["simulate", "with.toml", "--json"]);
    let summary: Value = serde_json::from_str(&summary).unwrap();
    let tilt = summary["final_state"][0].as_f64().unwrap();
    assert!(tilt.abs() < 0.02, "{summary}");

    // From where no plan is known, nothing is called good.
    let far = changed(&with, "[0.4, 0]", "[0.45, 2.9]");
    fs::write(path.join("far.toml"), far).unwrap();
    let message = fail(path, &["simulate", "far.toml", "--out", "far"]);
    assert!(message.contains("not guaranteed"), "{message}");

    // Neither that of another plant nor an altered one is relied upon.
    let plant = fs::read_to_string(path.join("pendulum.json")).unwrap();
    let other = changed(&plant, "9.0", "8.0");
    fs::write(path.join("pendulum.json"), other).unwrap();
    let of_another = fail(path, &["simulate", "with.toml", "--out", "other"]);
    fs::write(path.join("pendulum.json"), plant).unwrap();
    let claimed = fs::read_to_string(path.join("c.json")).unwrap();
    let mut altered: Value = serde_json::from_str(&claimed).unwrap();
    altered["certificate"]["contraction"] = 0.9.into();
    fs::write(path.join("c.json"), altered.to_string()).unwrap();
    let altered = fail(path, &["simulate", "with.toml", "--out", "other"]);
    for (message, said) in [
        (of_another, "c.json: "),
        (
            altered,
            "c.json: terminal: the claimed decrease of x'Px is false",
        ),
    ] {
        assert!(message.contains(said), "`{said}` is not in: {message}");
    }
    assert!(!path.join("other").exists());

    let both = changed(&with, "certificate", "terminal = \"lqr\"\ncertificate");
    fs::write(path.join("both.toml"), both).unwrap();
    let message = fail(path, &["simulate", "both.toml"]);
    assert!(message.contains("stands in place of terminal"), "{message}");

    // A certificate that was not proved is designed anew in its place, and the sources are not.
    let again = ["certify", "with.toml", "--out"];
    let message = fail(path, &[&again[..], &["pendulum.json"]].concat());
    assert!(message.contains("would be lost"), "{message}");
    let said = succeed(path, &[&again[..], &["c.json", "--quiet"]].concat());
    assert!(said.is_empty(), "{said}");
    succeed(path, &["verify", "c.json", "pendulum.json"]);
}

/// A cart whose position no formula reads: its references are seen ahead, and one that the certificate says nothing of is
/// refused by its place.
#[test]
fn a_guaranteed_loop_sees_its_references_ahead() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let plant = r#"{"schema": 1, "name": "cart", "equilibrium": {"x": [0, 0], "u": [0]},
        "states": [{"name": "position", "lower": -5, "upper": 5}, {"name": "speed", "lower": -1, "upper": 1}],
        "inputs": [{"name": "force", "lower": -1, "upper": 1}],
        "operations": [["state", 1], ["input", 0]], "derivative": [0, 1]}"#;
    fs::write(path.join("cart.json"), plant).unwrap();
    let text = "name = \"cart\"\nplant = \"cart.json\"\nx0 = [0, 0]\nduration = 6\n\
                [controller]\nt_s = 0.1\nhorizon = 20\nq = [1, 0.1]\nr = [0.1]\n\
                [[reference]]\ntime = 0\nx = [0, 0]\n[[reference]]\ntime = 2\nx = [2, 0]\n";
    fs::write(path.join("cart.toml"), text).unwrap();
    succeed(path, &["certify", "cart.toml", "--out", "c.json"]);
    let with = changed(text, "r = [0.1]", "r = [0.1]\ncertificate = \"c.json\"");
    fs::write(path.join("with.toml"), &with).unwrap();
    let summary = succeed(path, &["simulate", "with.toml", "--json", "--out", "ahead"]);
    let summary: Value = serde_json::from_str(&summary).unwrap();
    assert!(
        (summary["final_state"][0].as_f64().unwrap() - 2.0).abs() < 0.05,
        "{summary}"
    );
    assert_eq!(summary["bounds_exceeded"], serde_json::json!([]));
    let rows = fs::read_to_string(path.join("ahead/trajectory.csv")).unwrap();
    let header: Vec<&str> = rows.lines().next().unwrap().split(',').collect();
    let column = header
        .iter()
        .position(|name| name.starts_with("position"))
        .unwrap();
    let before: f64 = rows
        .lines()
        .nth(1 + 19)
        .unwrap()
        .split(',')
        .nth(column)
        .unwrap()
        .parse()
        .unwrap();
    assert!(before > 0.05, "{before} m at 1.9 s, {header:?}");

    let moving = changed(&with, "x = [2, 0]", "x = [2, 0.5]");
    fs::write(path.join("moving.toml"), moving).unwrap();
    let message = fail(path, &["simulate", "moving.toml", "--out", "moving"]);
    let expected = "speed is 0.5, and the certificate is about 0; elsewhere may be what no formula of the plant reads: position";
    assert!(message.contains(expected), "{message}");

    // From readings the guarantee is the model's. What the certificate says nothing of is refused here, too.
    let estimator =
        "estimator = { measured = { position = 1e-6 }, state_noise = 1e-4, initial_state = 1e-6 }";
    let estimated = changed(
        &with,
        "[[reference]]\ntime = 0",
        &format!("{estimator}\n[[reference]]\ntime = 0"),
    );
    fs::write(path.join("estimated.toml"), &estimated).unwrap();
    succeed(path, &["simulate", "estimated.toml", "--out", "estimated"]);
    let moved = "1e-4, disturbances = { speed = { noise = 0.1 } }";
    let moved = changed(&estimated, "1e-4", moved);
    fs::write(path.join("moved.toml"), moved).unwrap();
    let message = fail(path, &["simulate", "moved.toml", "--out", "moved"]);
    assert!(message.contains("speed is a state"), "{message}");
}

/// A cart under a load, of which its position is measured: the load is what adds to the force, and the filter finds it.
#[test]
fn an_estimator_finds_what_disturbs_the_plant() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let plant = r#"{"schema": 1, "name": "cart", "equilibrium": {"x": [0, 0], "u": [0]},
        "states": [{"name": "position", "unit": "m"}, {"name": "speed", "unit": "m/s"}],
        "inputs": [{"name": "force", "unit": "N", "lower": -2, "upper": 2}],
        "outputs": [{"name": "end"}], "output": [3],
        "operations": [["state", 1], ["input", 0], ["state", 0], ["add", 2, 2]], "derivative": [0, 1]}"#;
    fs::write(path.join("cart.json"), plant).unwrap();
    let text = "name = \"cart\"\nplant = \"cart.json\"\nx0 = [0, 0]\nduration = 20\n\
                [controller]\nt_s = 0.1\nhorizon = 30\nq = [1, 0.1]\nr = [0.01]\n\
                [controller.estimator]\nmeasured = { end = 1e-6, position = 1e-6 }\n\
                state_noise = { speed = 1e-3 }\ndisturbances = { force = { noise = 0.1 } }\ndelay = 0.2\n\
                [[reference]]\ntime = 0\nx = [0, 0]\n[[reference]]\ntime = 5\nx = [1, 0]\n\
                [world]\ndelay = 0.2\nnoise = { end = 1e-3 }\n\
                [[world.load]]\nstart = 0\nend = inf\nload = [0, -0.4]\n";
    fs::write(path.join("cart.toml"), text).unwrap();
    let said = succeed(path, &["simulate", "cart.toml"]);
    assert!(
        said.contains("found at the end force disturbance -0."),
        "{said}"
    );
    let table = fs::read_to_string(path.join("out/cart/trajectory.csv")).unwrap();
    let rows: Vec<Vec<&str>> = table
        .lines()
        .map(|line| line.split(',').collect())
        .collect();
    let header = rows[0].clone();
    assert_eq!(
        header[header.len() - 3..],
        [
            "position estimate [m]",
            "speed estimate [m/s]",
            "force disturbance [N]"
        ]
    );
    let at = |row: usize, name: &str| -> f64 {
        let column = header.iter().position(|one| *one == name).unwrap();
        rows[1 + row][column].parse().unwrap()
    };
    for row in 180..200 {
        assert!((at(row, "position [m]") - 1.0).abs() < 0.01);
        let error = at(row, "speed estimate [m/s]") - at(row, "speed [m/s]");
        assert!(error.abs() < 0.05, "{error}");
    }
    // Of single estimates the noise of the readings makes some hundredths.
    let found = (100..200).map(|row| at(row, "force disturbance [N]"));
    let mean = found.sum::<f64>() / 100.0;
    assert!((mean + 0.4).abs() < 0.02, "{mean}");
    // The reference that is written down is that of the sample, not of when its input acts.
    assert_eq!(at(49, "position reference [m]"), 0.0);
    assert_eq!(at(50, "position reference [m]"), 1.0);

    // The table of the example, whose lines are comments there, is one, too.
    let example = example();
    let text_of_example = fs::read_to_string(example.path().join("cart-pole.toml")).unwrap();
    let (before, rest) = text_of_example
        .split_once("# [controller.estimator]")
        .unwrap();
    let (table, after) = rest.split_once("\n\n").unwrap();
    let table = table.replace("\n# ", "\n");
    let whole = format!("{before}[controller.estimator]{table}\n\n{after}");
    fs::write(example.path().join("cart-pole.toml"), whole).unwrap();
    let summary = succeed(example.path(), &["simulate", "cart-pole.toml", "--json"]);
    let summary: Value = serde_json::from_str(&summary).unwrap();
    assert!(
        summary["final_disturbances"]["force"].is_number(),
        "{summary}"
    );

    // Without the disturbance in its model the loop stands aside.
    let unaware = changed(text, "disturbances", "# disturbances");
    fs::write(path.join("unaware.toml"), unaware).unwrap();
    let summary = succeed(path, &["simulate", "unaware.toml", "--json"]);
    let summary: Value = serde_json::from_str(&summary).unwrap();
    let position = summary["final_state"][0].as_f64().unwrap();
    assert!((position - 1.0).abs() > 0.05, "{summary}");
    assert_eq!(summary["final_disturbances"], serde_json::json!({}));

    for (from, to, said) in [
        (
            "{ end =",
            "{ emd =",
            "controller.estimator.measured: there is no \"emd\"; there are position, speed, end; did you mean \"end\"?",
        ),
        (
            "position = 1e-6",
            "position = 0",
            "controller: estimator, measured: the variance of position is 0; it must be a positive number",
        ),
        (
            "measured =",
            "mesured =",
            "unknown field `mesured`, expected one of `measured`",
        ),
        (
            "{ noise = 0.1 }",
            "{ noise = 0.1 }, speed = { noise = 0.1 }",
            "controller: estimator, disturbances: ",
        ),
        (
            "{ speed = 1e-3 }",
            "{ sped = 1e-3 }",
            "controller.estimator.state_noise: there is no \"sped\"; there are position, speed; did you mean",
        ),
        (
            "{ speed = 1e-3 }",
            "[1e-3]",
            "controller.estimator.state_noise: 1 numbers; it needs 2, for position, speed",
        ),
        (
            "{ speed = 1e-3 }",
            "\"much\"",
            "expected a number, a list of one for each state, or a table by state",
        ),
        (
            "{ speed = 1e-3 }",
            "nan",
            "controller: estimator, state_noise: the variance of position is NaN; it must be a number from 0 on",
        ),
        (
            "{ speed = 1e-3 }",
            "1\ninitial_state = [1, -1]",
            "controller: estimator, initial_state: the variance of speed is -1",
        ),
        (
            "{ speed = 1e-3 }",
            "1\nstart = [1]",
            "controller.estimator.start: 1 numbers; it needs 2",
        ),
        (
            "{ speed = 1e-3 }",
            "1\ngate = { deviations = 0 }",
            "controller: estimator, gate: the gate's deviations and longest gap must be positive",
        ),
        (
            "{ speed = 1e-3 }",
            "1\ngate = { patience = -1 }",
            "expected a whole number",
        ),
        (
            "{ force = {",
            "{ wind = {",
            "controller.estimator.disturbances: there is no \"wind\"; there are force, position, speed",
        ),
        (
            "noise = 0.1",
            "noise = inf",
            "estimator, disturbances, noise: the variance of force is inf; it must be a number from 0 on",
        ),
        ("{ noise = 0.1 }", "0.1", "expected a table"),
        (
            "delay = 0.2",
            "delay = -0.1",
            "controller: estimator, delay: it is -0.1 s; it must be from 0 to 1000 samples",
        ),
        (
            "noise = { end",
            "noise = { speed",
            "world.noise: there is no \"speed\"; there are end, position",
        ),
    ] {
        fs::write(path.join("bad.toml"), changed(text, from, to)).unwrap();
        let message = fail(path, &["simulate", "bad.toml", "--out", "bad"]);
        assert!(message.contains("bad.toml"), "{message}");
        assert!(message.contains(said), "`{said}` is not in: {message}");
    }
    assert!(!path.join("bad").exists());
}

#[test]
fn a_controller_is_printed_as_a_program() {
    let folder = pendulum();
    let path = folder.path();
    let crate_folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../lpvmpc");
    let print = |experiment: &str, crate_folder: &str| {
        lpvmpc(
            path,
            &[
                "firmware",
                experiment,
                "--lpvmpc",
                crate_folder,
                "--out",
                "robot",
            ],
        )
    };
    let refuse = |experiment: &str, crate_folder: &str, said: &str| {
        let output = print(experiment, crate_folder);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{message}");
        assert!(message.contains(said), "`{said}` is not in: {message}");
        assert!(!path.join("robot").exists());
    };
    refuse("pendulum.toml", "..", "Cargo.toml");
    let text = fs::read_to_string(path.join("pendulum.toml")).unwrap();
    for (added, said) in [
        (
            "state_bounds = \"hard\"",
            "state_bounds: on a microcontroller",
        ),
        (
            "substeps = 2",
            "substeps: on a microcontroller it must be 1",
        ),
        ("terminal = \"equality\"", "terminal: on a microcontroller"),
        ("r_du = [0.1]", "r_du: on a microcontroller"),
        (
            "first_programs = 20",
            "first_programs: on a microcontroller it must be left out",
        ),
        ("certificate = \"c.json\"", "there is no guaranteed loop"),
        (
            "estimator = { measured = { tilt = 1 }, state_noise = 1 }",
            "controller: estimator: on a microcontroller it must be left out",
        ),
    ] {
        let changed = changed(&text, "r = [0.1]", &format!("r = [0.1]\n{added}"));
        fs::write(path.join("bad.toml"), changed).unwrap();
        refuse("bad.toml", crate_folder, said);
    }

    assert!(print("pendulum.toml", crate_folder).status.success());
    let main = fs::read_to_string(path.join("robot/src/main.rs")).unwrap();
    // The terminal weight is the regulator's.
    let regulator = succeed(path, &["lqr", "pendulum.toml", "--json"]);
    let regulator: Value = serde_json::from_str(&regulator).unwrap();
    for weight in numbers(&regulator["p"]).iter() {
        let weight = format!("{}", *weight as f32);
        assert!(main.contains(&weight), "{weight} is not in {main}");
    }
    let quiet = [
        "firmware",
        "pendulum.toml",
        "--lpvmpc",
        crate_folder,
        "-q",
        "--out",
        "quiet",
    ];
    assert!(succeed(path, &quiet).is_empty());
    let again = print("pendulum.toml", crate_folder);
    let message = String::from_utf8_lossy(&again.stderr);
    assert!(message.contains("robot: it is there already"), "{message}");
}

/// What stands in a list behind the entries of a table was left out.
#[test]
fn a_list_does_not_stand_for_a_table() {
    let folder = pendulum();
    let path = folder.path();
    let text = fs::read_to_string(path.join("pendulum.toml")).unwrap();
    let estimator = |more: &str| {
        let table = format!("estimator = {{ measured = {{ tilt = 1 }}, state_noise = 1, {more} }}");
        changed(&text, "r = [0.1]", &format!("r = [0.1]\n{table}"))
    };
    for refused in [
        estimator("gate = [5.0, 3, 0.1, 0.5, 99]"),
        estimator("disturbances = { torque = [0.1, 1.0, 7.0] }"),
        changed(
            &text,
            "[controller]",
            "reference = [[0.0, [0, 0], 5.0]]\n[controller]",
        ),
        format!("{text}[world]\njump = [[0.5, [0, 0], 1]]\n"),
        changed(&text, "[controller]", "world = [{}]\n[controller]"),
    ] {
        fs::write(path.join("bad.toml"), &refused).unwrap();
        let message = fail(path, &["simulate", "bad.toml"]);
        assert!(message.contains("expected a table"), "{refused}\n{message}");
    }
    for taken in [
        estimator("gate = { deviations = 5.0 }, disturbances = { torque = { noise = 0.1 } }"),
        format!("{text}[world]\njump = [{{ time = 0.5, change = [0, 0] }}]\n"),
    ] {
        fs::write(path.join("good.toml"), taken).unwrap();
        succeed(path, &["simulate", "good.toml"]);
    }
    assert!(!path.join("bad").exists());
}

#[test]
fn a_run_has_a_sample_and_names_the_files_that_it_wrote() {
    let folder = pendulum();
    let path = folder.path();
    let said = succeed(path, &["simulate", "pendulum.toml"]);
    assert!(
        said.ends_with("with trajectory.csv, summary.json, figure.svg, figure.png\n"),
        "{said}"
    );
    let text = fs::read_to_string(path.join("pendulum.toml")).unwrap();
    for duration in ["1e-12", "0", "-1", "nan"] {
        let none = changed(&text, "duration = 2", &format!("duration = {duration}"));
        fs::write(path.join("none.toml"), none).unwrap();
        let message = fail(path, &["simulate", "none.toml"]);
        assert!(message.contains("at least one sample"), "{message}");
    }
}
