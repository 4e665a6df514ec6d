//! `ballbot rehearse`: the whole chain, and what its controller must withstand.

use crate::{assert_says, ballbot_in, fail, succeed};
use ballbot_scenario::{DeviationsTable, Parameters, Prepared, RunHooks, Scenario, WorldTable};
use lpvmpc_sim::{Termination, Trajectory};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// A scenario of the rehearsal, in a world that may be changed.
fn run(
    folder: &Path,
    name: &str,
    change: impl Fn(&mut Scenario),
) -> (Prepared, Vec<Trajectory<4, 1>>) {
    let mut scenario = Scenario::load(folder.join(name).to_str().unwrap()).unwrap();
    change(&mut scenario);
    let prepared = scenario.prepare(folder).unwrap();
    let trajectories = prepared.run(&RunHooks::NONE).unwrap();
    (prepared, trajectories)
}

fn world(scenario: &mut Scenario) -> &mut WorldTable {
    scenario.world.as_mut().unwrap()
}

/// Root mean square of the distance on the floor from where the robot should be, all planes
/// together, mm.
fn rms_mm((prepared, planes): &(Prepared, Vec<Trajectory<4, 1>>), from: f64, until: f64) -> f64 {
    let squares = planes.iter().map(|plane| {
        assert_eq!(plane.termination, Termination::Complete);
        let samples = plane.samples.iter();
        let errors: Vec<f64> = samples
            .filter(|sample| (from..=until).contains(&sample.t))
            .map(|sample| sample.x[0] - sample.x_ref[0])
            .collect();
        errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64
    });
    let distance = squares.sum::<f64>().sqrt();
    1000.0 * prepared.ballbot.geometry.position(distance)
}

fn largest_tilt((_, planes): &(Prepared, Vec<Trajectory<4, 1>>)) -> f64 {
    let states = planes.iter().flat_map(Trajectory::states);
    states.fold(0.0, |most, x| most.max(x[1].abs()))
}

/// The folder of the chain, which is run once for all of these tests.
static REHEARSED: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("rehearsal");
    // What an earlier run has left.
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir(&folder).unwrap();
    let said = succeed(&folder, &["rehearse"]);
    let stages = [
        "ballbot excite --config",
        "ballbot simulate out/rehearsal/record.toml",
        "ballbot identify out/rehearsal/log.csv",
        "Lissajous",
        "off by",
        "good: the robot explains the log",
    ];
    assert_says(&said, &stages);
    folder.join("out").join("rehearsal")
});

#[test]
fn identified_within_the_stated_errors() {
    let folder = &*REHEARSED;
    let read = |name: &str| -> toml::Table {
        let text = std::fs::read_to_string(folder.join(name)).unwrap();
        text.parse().unwrap()
    };
    let found = read("identification/parameters.toml");
    let truth = read("true-robot.toml");
    let number = |key: &str| truth["parameters"][key].as_float().unwrap();
    let world = Scenario::load(folder.join("record.toml").to_str().unwrap()).unwrap();
    let delay = world.world.unwrap().delay;
    for (key, expected) in [
        ("b1_m2", number("b1_m2")),
        ("b2_m2", number("b2_m2")),
        ("b3_m2", number("b3_m2")),
        ("b4_m2_s", number("b4_m2_s")),
        ("drive_friction_m2_s", number("drive_friction_m2_s")),
        ("drive_coulomb_m2_s2", number("drive_coulomb_m2_s2")),
        // r_w times the mass is 0.5 m kg, and r_w 0.05 m.
        ("torque_gain_1_kg", 0.05 / number("wheel_radius_m")),
        ("delay_s", delay.computation_s + delay.transport_s),
        ("tilt_offset_rad", 0.01),
    ] {
        let entry = &found["identification"][key];
        let value = entry["value"].as_float().unwrap();
        let deviation = entry["standard_deviation"].as_float().unwrap();
        assert!(
            (value - expected).abs() < 4.0 * deviation,
            "{key}: {value} +- {deviation} for {expected}"
        );
        assert!(deviation < 0.05 * expected, "{key}: +- {deviation}");
    }
}

#[test]
fn follows() {
    let folder = &*REHEARSED;
    for seed in 1..=5 {
        let seeded = |scenario: &mut Scenario| world(scenario).seed = seed;
        let error = rms_mm(&run(folder, "move.toml", seeded), 6.0, 10.0);
        assert!(error < 20.0, "seed {seed}: {error} mm");
        // The push included.
        let error = rms_mm(&run(folder, "lissajous.toml", seeded), 0.0, 70.0);
        assert!(error < 25.0, "seed {seed}: {error} mm");
        // And on robots that the log allows as well as the one that was found.
        let drawn = |scenario: &mut Scenario| {
            let file = scenario.parameters.clone();
            world(scenario).parameters = Some(file);
            world(scenario).draw = Some(seed);
        };
        let error = rms_mm(&run(folder, "move.toml", drawn), 6.0, 10.0);
        assert!(error < 20.0, "draw {seed}: {error} mm");
        let error = rms_mm(&run(folder, "lissajous.toml", drawn), 0.0, 70.0);
        assert!(error < 25.0, "draw {seed}: {error} mm");
    }
}

/// Every corner of b1 to b4 wrong by 20 %: it does not only keep from falling, it follows.
fn withstands_wrong_parameters(name: &str, (from, until): (f64, f64)) {
    for corner in 0..16 {
        let factor = |bit: u32| if corner & (1 << bit) == 0 { 0.8 } else { 1.2 };
        let wrong = |scenario: &mut Scenario| {
            world(scenario).robot = DeviationsTable {
                b1_factor: factor(0),
                b2_factor: factor(1),
                b3_factor: factor(2),
                b4_factor: factor(3),
                ..DeviationsTable::default()
            };
        };
        let run = run(&REHEARSED, name, wrong);
        let tilt = largest_tilt(&run);
        assert!(tilt < 0.7, "{name}, corner {corner:04b}: {tilt} rad");
        let error = rms_mm(&run, from, until);
        assert!(error < 40.0, "{name}, corner {corner:04b}: {error} mm");
    }
}

#[test]
fn moves_with_wrong_parameters() {
    withstands_wrong_parameters("move.toml", (6.0, 12.0));
}

/// With the push.
#[test]
fn follows_a_curve_with_wrong_parameters() {
    withstands_wrong_parameters("lissajous.toml", (0.0, 70.0));
}

/// The checks above can fail: with the robot of the drawing the curve is missed.
#[test]
fn the_drawing_alone_would_not_do() {
    let folder = &*REHEARSED;
    let record = Scenario::load(folder.join("record.toml").to_str().unwrap()).unwrap();
    assert!(matches!(record.parameters, Parameters::Table(_)));
    let drawing = |scenario: &mut Scenario| scenario.parameters = record.parameters.clone();
    let error = rms_mm(&run(folder, "lissajous.toml", drawing), 0.0, 70.0);
    assert!(error > 25.0, "{error} mm");
}

#[test]
fn files_that_are_there_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let record = folder.path().join("record.toml");
    std::fs::write(&record, "duration_s = 1.0").unwrap();
    let said = fail(folder.path(), &["rehearse", "--out", "."], 1);
    assert_says(&said, &["record.toml", "missing field"]);
    assert_eq!(std::fs::read_to_string(record).unwrap(), "duration_s = 1.0");
}

/// What lies in the folder under the name of a result, and is none, stays; a rehearsal's own is made anew.
#[test]
fn a_log_of_the_users_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["log.csv", "excitation.csv"] {
        let file = folder.path().join(name);
        std::fs::write(&file, "mine").unwrap();
        let message = fail(folder.path(), &["rehearse", "--out", "."], 1);
        assert_says(&message, &[name, "--out"]);
        assert_eq!(std::fs::read_to_string(&file).unwrap(), "mine");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        std::fs::remove_file(&file).unwrap();
    }
    let list = REHEARSED.join(".ballbot-files");
    let listed = std::fs::read_to_string(list).unwrap();
    assert_eq!(
        listed.lines().collect::<Vec<_>>(),
        ["excitation.csv", "log.csv"]
    );
}

/// Of a move that the run ends in, or before.
#[test]
fn distances_are_over_the_time_of_the_run() {
    let folder = tempfile::tempdir().unwrap();
    for name in [
        "true-robot.toml",
        "my-robot.toml",
        "record.toml",
        "move.toml",
        "lissajous.toml",
    ] {
        std::fs::copy(REHEARSED.join(name), folder.path().join(name)).unwrap();
    }
    let path = folder.path().join("move.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let duration = text
        .lines()
        .find(|line| line.starts_with("duration_s"))
        .unwrap();
    for (duration_s, over, none) in [("8.0", "6 to 8", false), ("5.0", "6 to 10", true)] {
        std::fs::write(
            &path,
            text.replace(duration, &format!("duration_s = {duration_s}")),
        )
        .unwrap();
        let ended = ballbot_in(folder.path(), &["rehearse", "--out", "."]);
        let said = String::from_utf8(ended.stdout).unwrap();
        let row = said.lines().find(|line| line.contains(over));
        let row = row.unwrap_or_else(|| panic!("{said}"));
        assert_eq!(row.contains("the run ends before"), none, "{row}");
    }

    // A log of an earlier rehearsal is not taken for that of two planes.
    let path = folder.path().join("record.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let two = crate::closed_loops::edited(
        &text,
        "[reference.set_points]\npoints = [{ time_s = 0.0, phi_rad = 0.0 }]",
        "[reference.lissajous]\namplitude_x_m = 0.1\namplitude_y_m = 0.1\n\
         angular_frequency_x_rad_s = 0.3\nangular_frequency_y_rad_s = 0.4",
    );
    std::fs::write(&path, two).unwrap();
    let message = fail(folder.path(), &["rehearse", "--out", "."], 1);
    assert_says(&message, &["record.toml", "two planes"]);
}
