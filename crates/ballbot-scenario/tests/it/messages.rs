//! Bad scenarios: each mistake gets a message with the place, the value and what is right.

use ballbot_scenario::{Scenario, ScenarioError, builtin};
use std::path::{Path, PathBuf};

fn text() -> String {
    builtin::find("two-setpoints")
        .expect("built-in")
        .text
        .to_owned()
}

/// The message for the built-in file with `from` replaced by `to`.
fn message(from: &str, to: &str) -> String {
    let text = text();
    assert!(text.contains(from), "the file has no `{from}`");
    let scenario = match Scenario::parse(&text.replacen(from, to, 1), "my.toml") {
        Ok(scenario) => scenario,
        Err(error) => return error.to_string(),
    };
    match scenario.prepare(Path::new(".")) {
        Ok(_) => panic!("`{to}` was accepted"),
        Err(error) => error.to_string(),
    }
}

#[track_caller]
fn assert_says(message: &str, words: &[&str]) {
    for word in words {
        assert!(message.contains(word), "no `{word}` in: {message}");
    }
}

#[test]
fn unknown_key() {
    let said = message("horizon = 20", "horizon = 20\nhorizn = 20");
    assert_says(
        &said,
        &["my.toml", "horizn", "unknown field", "line 24", "horizon"],
    );
}

#[test]
fn wrong_type() {
    assert_says(
        &message("t_s = 0.05", "t_s = \"0.05\""),
        &["my.toml", "line 22", "t_s", "expected a number"],
    );
    assert_says(
        &message("q = [200.0, 1.0, 0.1, 0.1]", "q = [200.0, 1.0]"),
        &["line", "4"],
    );
}

#[test]
fn types_are_named_as_people_name_them() {
    for (from, to, words) in [
        (
            "horizon = 20",
            "horizon = 20.5",
            "a whole number, 0 or more",
        ),
        ("horizon = 20", "horizon = -3", "a whole number, 0 or more"),
        (
            "model = \"lpv\"",
            "model = 3",
            "the name of a kind in quotes",
        ),
        (
            "[reference.set_points]",
            "[reference.sine]\namplitude_rad = 1.0\nangular_frequency_rad_s = 1.0\n\n\
             [reference.set_points]",
            "one kind must be chosen",
        ),
    ] {
        let said = message(from, to);
        assert_says(&said, &["line", words]);
        for jargon in ["usize", "f64", "variant", "element"] {
            assert!(!said.contains(jargon), "`{jargon}` in: {said}");
        }
    }
}

#[test]
fn another_robots_certificate_is_told_by_the_first_difference() {
    let text = builtin::find("far-setpoints").expect("built-in").text;
    let text = text.replace("ball_radius_m = 0.12", "ball_radius_m = 0.13");
    let scenario = Scenario::parse(&text, "my.toml").expect("valid TOML");
    let said = scenario.prepare(Path::new(".")).expect_err("another robot");
    let words = [
        "parameters.ball_radius_m = 0.13",
        "another robot",
        "is 0.12",
    ];
    assert_says(&said.to_string(), &words);
}

#[test]
fn values_are_set_by_their_keys() {
    let with = |changes: &[(&str, &str)]| {
        let changes: Vec<_> = changes
            .iter()
            .map(|(key, value)| ((*key).to_owned(), (*value).to_owned()))
            .collect();
        Scenario::load_with("two-setpoints", &changes)
    };
    let scenario = with(&[
        ("controller.t_s", "0.04"),
        ("bounds.torque_nm.1", "0.5"),
        ("controller.terminal", "none"),
        ("world.seed", "7"),
        ("title", "Mine"),
        ("controller.predictor", "{ stage_consistent = {} }"),
    ])
    .expect("valid");
    assert_eq!(scenario.controller.t_s, 0.04);
    assert_eq!(scenario.bounds.torque_nm, [-1.5, 0.5]);
    assert_eq!(scenario.world.expect("made").seed, 7);
    assert_eq!(scenario.title, "Mine");
    assert_eq!(with(&[]).expect("valid").controller.t_s, 0.05);
    for (key, value, words) in [
        ("controller.horizn", "3", ["horizn", "horizon"]),
        ("controller.horizon", "many", ["horizon", "a whole number"]),
        (
            "controller.t_s.x",
            "3",
            ["controller.t_s.x", "below a value"],
        ),
        (
            "bounds.torque_nm.2",
            "3",
            ["bounds.torque_nm.2", "a list of 2"],
        ),
        ("controller..t_s", "3", ["controller..t_s", "name of a key"]),
    ] {
        let said = with(&[(key, value)]).expect_err("refused").to_string();
        assert_says(&said, &words);
    }
}

#[test]
fn missing_key() {
    assert_says(&message("horizon = 20", "#"), &["missing field `horizon`"]);
}

#[test]
fn unknown_choice() {
    assert_says(
        &message("\"lpv\"", "\"nonlinear\""),
        &["nonlinear", "lpv", "linear", "line"],
    );
    assert_says(
        &message("reference.set_points", "reference.circle"),
        &["circle", "lissajous"],
    );
}

#[test]
fn negative_weight() {
    let said = message("q = [200.0, 1.0", "q = [200.0, -1.0");
    assert_says(&said, &["controller.q[1]", "-1", "zero or positive"]);
}

#[test]
fn a_list_that_is_too_long() {
    let said = message("q = [200.0, 1.0", "q = [7.0, 200.0, 1.0");
    assert_says(&said, &["controller.q", "invalid length 5", "too many"]);
}

#[test]
fn input_weight_not_positive() {
    assert_says(
        &message("r = 1000.0", "r = 0.0"),
        &["controller.r", "0", "positive"],
    );
    assert_says(
        &message("r = 1000.0", "r = -3.0"),
        &["controller.r", "-3", "positive"],
    );
}

#[test]
fn horizon_out_of_range() {
    assert_says(
        &message("horizon = 20", "horizon = 0"),
        &["controller.horizon", "0", "from 1"],
    );
    assert_says(
        &message("horizon = 20", "horizon = 1001"),
        &["controller.horizon", "1001", "1000"],
    );
}

#[test]
fn crossed_bounds() {
    let said = message("torque_nm = [-1.5, 1.5]", "torque_nm = [1.5, -1.5]");
    assert_says(&said, &["bounds.torque_nm", "[1.5, -1.5]", "lower"]);
    assert_says(
        &message("torque_nm = [-1.5", "torque_nm = [nan"),
        &["bounds.torque_nm", "NaN"],
    );
}

#[test]
fn number_that_is_not_finite() {
    assert_says(
        &message("b1_m2 = 0.002483", "b1_m2 = nan"),
        &["parameters.b1_m2", "finite"],
    );
    assert_says(
        &message("theta_rad = 0.0", "theta_rad = inf"),
        &["initial_state.theta_rad"],
    );
    assert_says(
        &message("duration_s = 4.0", "duration_s = -4.0"),
        &["duration_s", "-4"],
    );
}

#[test]
fn lengths_and_angles() {
    let said = message("ball_radius_m = 0.12", "ball_radius_m = 0.0");
    assert_says(&said, &["parameters.ball_radius_m", "positive"]);
    let said = message("zenith_angle_deg = 45.0", "zenith_angle_deg = 95.0");
    assert_says(&said, &["zenith_angle_deg", "95", "pi/2"]);
}

#[test]
fn sampling_time_too_long_for_the_predictor() {
    // h lambda = -51.8 * 0.06 = -3.1, beyond the stability limit -2.785 of one RK4 step.
    let said = message("t_s = 0.05", "t_s = 0.06");
    assert_says(&said, &["t_s", "-51.8", "0.06"]);
    // Left to choose, the predictor takes shorter steps.
    let mut scenario = Scenario::load("two-setpoints").expect("built-in");
    scenario.controller.t_s = 0.06;
    scenario.controller.predictor = None;
    let prepared = scenario.prepare(Path::new(".")).expect("valid");
    assert!(prepared.settings.predictor.rk4().substeps > 1);
}

#[test]
fn equations_without_solution() {
    // A larger b1 brings det M = b1 b3 - k^2 through zero within the bounds.
    let said = message("b1_m2 = 0.002483", "b1_m2 = 0.009");
    assert_says(&said, &["parameters", "crosses zero"]);
}

#[test]
fn indefinite_terminal_cost() {
    let text = text();
    let start = text
        .find("\n[controller.terminal")
        .expect("a terminal table")
        + 1;
    let end = start + text[start..].find("\n\n").expect("its end");
    let with = |p: &str| {
        format!(
            "{}[controller.terminal.cost]\np = {p}\n{}",
            &text[..start],
            &text[end..]
        )
    };
    let prepare = |rows: &str| {
        let rest = "[0.0,0.0,1.0,0.0],[0.0,0.0,0.0,1.0]";
        let text = with(&format!("[{rows},{rest}]"));
        let scenario = Scenario::parse(&text, "my.toml").expect("valid TOML");
        scenario.prepare(Path::new("."))
    };
    let refuse = |rows| prepare(rows).expect_err("refused").to_string();
    prepare("[1.0,0.5,0.0,0.0],[0.5,1.0,0.0,0.0]").expect("positive definite");
    assert_says(
        &refuse("[1.0,0.0,0.0,0.0],[0.0,-1.0,0.0,0.0]"),
        &["controller.terminal.cost.p", "-1.000e0", "semidefinite"],
    );
    assert_says(
        &refuse("[1.0,2.0,0.0,0.0],[2.0,1.0,0.0,0.0]"),
        &["controller.terminal.cost.p", "semidefinite"],
    );
    // One triangle of it is definite.
    assert_says(
        &refuse("[1.0,5.0,0.0,0.0],[0.0,1.0,0.0,0.0]"),
        &[
            "controller.terminal.cost.p[1][0]",
            "symmetric",
            "p[0][1] is 5",
        ],
    );
    assert_says(
        &refuse("[nan,0.0,0.0,0.0],[0.0,1.0,0.0,0.0]"),
        &["controller.terminal.cost.p[0][0]", "finite"],
    );
}

#[test]
fn set_points_out_of_order() {
    let said = message("time_s = 3.0", "time_s = 0.5");
    assert_says(
        &said,
        &["reference.set_points.points[2].time_s", "0.5", "increase"],
    );
}

#[test]
fn unknown_scenario_suggests_the_nearest() {
    let error = Scenario::load("lisajous").expect_err("unknown");
    assert!(matches!(
        error,
        ScenarioError::Unknown {
            nearest: Some("lissajous"),
            ..
        }
    ));
    assert_says(
        &error.to_string(),
        &["lisajous", "did you mean `lissajous`", "two-setpoints"],
    );
}

#[test]
fn unreadable_file() {
    let error = Scenario::load("no/such/file.toml").expect_err("unreadable");
    assert_says(&error.to_string(), &["no/such/file.toml", "cannot read"]);
}

/// A folder of this test's own with `reference.csv` in it.
fn with_reference(name: &str, csv: &str) -> Result<(), String> {
    let directory: PathBuf = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&directory).expect("a folder for the test");
    std::fs::write(directory.join("reference.csv"), csv).expect("a file for the test");
    let text = text();
    let start = text.find("[reference.set_points]").expect("a reference");
    let end = start + text[start..].find("\n\n").expect("its end");
    let text = format!(
        "{}[reference.csv]\npath = \"reference.csv\"\n{}",
        &text[..start],
        &text[end..]
    );
    let scenario = Scenario::parse(&text, "my.toml").expect("valid TOML");
    let prepared = scenario
        .prepare(directory.as_path())
        .map_err(|error| error.to_string())?;
    assert!(
        (prepared.planes[0].reference.at(0.25) - 0.5).abs() < 1e-12,
        "phi = 2 t"
    );
    Ok(())
}

fn rows(times: impl Iterator<Item = f64>) -> String {
    let rows = times.map(|t| format!("{t},{}\n", 2.0 * t));
    format!("t_s,phi_ref_rad\n{}", rows.collect::<String>())
}

#[test]
fn reference_files() {
    let grid = |n: usize| (0..=n).map(|i| 0.1 * i as f64);
    with_reference("good", &rows(grid(40))).expect("accepted");
    with_reference("crlf", &rows(grid(40)).replace('\n', "\r\n")).expect("accepted");
    let refused = |name: &str, csv: &str, words: &[&str]| {
        let said = with_reference(name, csv).expect_err("refused");
        assert_says(&said, &["reference.csv"]);
        assert_says(&said, words);
    };
    let gap = grid(40).filter(|t| !(0.95..1.45).contains(t));
    refused("gap", &rows(gap), &["line 12", "gap of 0.6", "after 0.9"]);
    refused("short", &rows(grid(30)), &["ends at 3", "duration_s = 4"]);
    refused("late", &rows(grid(40).skip(3)), &["begins at 0.3"]);
    refused(
        "missing",
        &rows(grid(40)).replace(",0.4\n", ",\n"),
        &["line 4", "phi_ref_rad", "missing"],
    );
    refused(
        "text",
        &rows(grid(40)).replace(",0.4\n", ",up\n"),
        &["line 4", "`up`"],
    );
    refused(
        "nan",
        &rows(grid(40)).replace(",0.4\n", ",NaN\n"),
        &["line 4", "NaN"],
    );
    refused(
        "ragged",
        &rows(grid(40)).replace(",0.4\n", "\n"),
        &["line 4"],
    );
    refused(
        "twice",
        "t_s,phi_ref_rad,phi_ref_rad\n0,0,1\n4,1,1\n",
        &[
            "line 1",
            "names `phi_ref_rad` twice, as fields 2 and 3: rename one",
        ],
    );
    refused(
        "column",
        &rows(grid(40)).replace("phi_ref_rad", "phi"),
        &["phi_ref_rad", "t_s, phi"],
    );
    refused(
        "backwards",
        "t_s,phi_ref_rad\n0,0\n1,2\n0.5,1\n4,8\n",
        &["line 4", "increase"],
    );
    // Lines are counted as an editor counts them, whatever ends them and whatever is between them.
    let bad = rows(grid(40)).replace(",0.4\n", ",up\n");
    refused("text crlf", &bad.replace('\n', "\r\n"), &["line 4", "`up`"]);
    let remarks = format!("# one\n# two\n{}", bad.replace("0.1,", "# three\n\n0.1,"));
    refused("remarks", &remarks, &["line 8", "`up`"]);
    refused(
        "remarks crlf",
        &remarks.replace('\n', "\r\n"),
        &["line 8", "`up`"],
    );
    let column = format!(
        "# one\n# two\n{}",
        rows(grid(40)).replace("phi_ref_rad", "phi")
    );
    refused("column below", &column, &["line 3", "no column"]);
    let ragged = rows(grid(40)).replace(",0.4\n", "\n").replace('\n', "\r\n");
    refused("ragged crlf", &ragged, &["line 4"]);
    with_reference("semicolons", &rows(grid(40)).replace(',', ";")).expect("accepted");
    refused(
        "decimal commas",
        &rows(grid(40)).replace(',', ";").replace('.', ","),
        &["line 3", "`0,1`", "0.1"],
    );
    refused("empty", "", &["no column"]);
    refused("header", "t_s,phi_ref_rad\n", &["no rows"]);
}

/// A robot whose wheels stand elsewhere has other torques of the motors for the same planes.
#[test]
fn wheels_stand_where_they_are_said_to() {
    let lissajous = builtin::find("lissajous").unwrap();
    let with = |keys: &str| {
        let zenith = "zenith_angle_deg = 45.0";
        let text = lissajous.text.replace(zenith, &format!("{zenith}\n{keys}"));
        assert!(text.contains(keys));
        let scenario = Scenario::parse(&text, "my.toml").map_err(|error| error.to_string())?;
        let prepared = scenario.prepare(Path::new("."));
        prepared
            .map(|prepared| prepared.wheels)
            .map_err(|error| error.to_string())
    };
    let paper = with("# nothing").unwrap();
    assert_eq!(paper, with("wheel_azimuths_deg = [-90, 30, 150]").unwrap());
    // Turned by a quarter: what drove along x drives along y.
    let turned = with("wheel_azimuths_deg = [0, 120, 240]").unwrap();
    let (along_x, along_y) = (nalgebra::Vector3::x(), nalgebra::Vector3::y());
    assert!((turned.motors(&along_y) - paper.motors(&along_x)).amax() < 1e-15);
    let reversed = with("wheels_reversed = [true, false, false]").unwrap();
    let [a, b] = [&reversed, &paper].map(|wheels| wheels.motors(&along_x));
    assert!((a[0] + b[0]).abs() < 1e-15 && (a[1] - b[1]).abs() < 1e-15);
    let said = with("wheel_azimuths_deg = [0, 0, 120]").unwrap_err();
    assert_says(
        &said,
        &["parameters.wheel_azimuths_deg", "apart from each other"],
    );
}
