//! `ballbot wheels check`: pushes by hand, as contact in three dimensions says that they show.

use crate::{assert_says, failure, text};
use nalgebra::{Rotation3, Vector3};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// What a wheel at this azimuth shows when the ball turns: the ball's speed at the contact point along
/// the wheel's rim, and a wheel that turns in its sense.
fn shows(azimuth_deg: f64, reversed: bool, ball: &Vector3<f64>) -> f64 {
    let about = Rotation3::from_axis_angle(&Vector3::z_axis(), azimuth_deg.to_radians());
    let point = about * Vector3::new(0.5_f64.sqrt(), 0.0, 0.5_f64.sqrt());
    let rim = about * Vector3::y();
    let sense = if reversed { -1.0 } else { 1.0 };
    sense * ball.cross(&point).dot(&rim)
}

/// Rolling along x and y, and a turn counter-clockwise: angular velocities of a ball on the floor.
const PUSHES: [(&str, [f64; 3]); 3] = [
    ("along-x", [0.0, 1.0, 0.0]),
    ("along-y", [-1.0, 0.0, 0.0]),
    ("turn", [0.0, 0.0, 1.0]),
];

/// Logs of the three pushes of a robot whose wheels stand there, with columns in this order. A hand
/// is a few degrees off.
fn logs(folder: &Path, wheels: [(f64, bool); 3], columns: [usize; 3]) -> [PathBuf; 3] {
    PUSHES.map(|(name, axis)| {
        let astray = Vector3::new(0.03, -0.03, 0.05);
        let ball = Vector3::from(axis) + astray;
        let mut log = "t_s,m1,m2,m3\n".to_owned();
        for row in 0..200 {
            let turned = 3.0 * (f64::from(row) / 199.0).powi(2);
            let m = columns.map(|wheel| {
                let (azimuth, reversed) = wheels[wheel];
                // Counts start anywhere.
                17.0 + (turned * shows(azimuth, reversed, &ball) * 2.4).to_degrees()
            });
            writeln!(log, "{},{},{},{}", f64::from(row) * 0.01, m[0], m[1], m[2]).unwrap();
        }
        let path = folder.join(format!("{name}.csv"));
        std::fs::write(&path, log).unwrap();
        path
    })
}

fn config(folder: &Path, azimuths: [f64; 3], reversed: [bool; 3]) -> PathBuf {
    let encoder = |i: usize| format!("{{ column = \"m{i}\", unit = \"deg\", factor = 0.4167 }}");
    let path = folder.join("robot.toml");
    let text = format!(
        "[log.wheels]\nplane = \"x\"\nzenith_angle_deg = 45.0\nazimuths_deg = {azimuths:?}\n\
         reversed = {reversed:?}\nencoders = [{}, {}, {}]\n",
        encoder(1),
        encoder(2),
        encoder(3)
    );
    std::fs::write(&path, text).unwrap();
    path
}

/// The command with one push or all three.
fn command(config: &Path, [x, y, turn]: &[PathBuf; 3], all: bool) -> Vec<String> {
    let mut arguments = vec!["wheels", "check"];
    let paths = [config, x, y, turn].map(|path| path.to_str().unwrap());
    arguments.extend(["--config", paths[0], paths[1]]);
    if all {
        arguments.extend(["--along-y", paths[2], "--turn", paths[3]]);
    }
    arguments.into_iter().map(str::to_owned).collect()
}

fn succeeds(arguments: &[String]) -> String {
    text(&arguments.iter().map(String::as_str).collect::<Vec<_>>())
}

fn fails(arguments: &[String]) -> String {
    failure(&arguments.iter().map(String::as_str).collect::<Vec<_>>(), 1)
}

const STANDING: [(f64, bool); 3] = [(0.0, false), (120.0, true), (240.0, false)];

#[test]
fn wheels_as_they_are_said_agree() {
    let folder = tempfile::tempdir().unwrap();
    let logs = logs(folder.path(), STANDING, [0, 1, 2]);
    let config = config(folder.path(), [0.0, 120.0, -120.0], [false, true, false]);
    for all in [false, true] {
        let said = succeeds(&command(&config, &logs, all));
        assert_says(&said, &["agree with [log.wheels]", "m1", "along x, seen"]);
        assert!(said.ends_with('\n'), "{said}");
    }
}

/// A robot whose first wheel stands on the x axis, under the azimuths of the paper's torque map.
#[test]
fn azimuths_that_are_a_quarter_turn_off_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let logs = logs(
        folder.path(),
        STANDING.map(|(at, _)| (at, false)),
        [0, 1, 2],
    );
    let config = config(folder.path(), [-90.0, 30.0, 150.0], [false; 3]);
    for all in [false, true] {
        let said = fails(&command(&config, &logs, all));
        assert_says(
            &said,
            &[
                "not as [log.wheels] says",
                "all azimuths are 90 degrees larger",
            ],
        );
    }
    let said = fails(&command(&config, &logs, true));
    assert_says(&said, &["azimuths of"]);
}

#[test]
fn mixed_up_encoders_and_senses_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let mixed = logs(folder.path(), STANDING, [2, 0, 1]);
    let right = config(folder.path(), [0.0, 120.0, -120.0], [false, true, false]);
    let said = fails(&command(&right, &mixed, true));
    assert_says(&said, &["the wheels 1, 2, 3 have the encoders 2, 3, 1"]);
    let logs = logs(folder.path(), STANDING, [0, 1, 2]);
    let forward = config(folder.path(), [0.0, 120.0, -120.0], [false; 3]);
    let said = fails(&command(&forward, &logs, true));
    assert_says(&said, &["wheel 2 turns the other way"]);
    assert!(!said.contains(" or "), "{said}");
}

/// The others were said not to have turned.
#[test]
fn a_column_without_values_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let [x, y, turn] = logs(folder.path(), STANDING, [0, 1, 2]);
    let text = std::fs::read_to_string(&x).unwrap();
    let rows = text.lines().enumerate().map(|(row, line)| {
        let mut cells: Vec<&str> = line.split(',').collect();
        if row > 0 {
            cells[2] = "";
        }
        cells.join(",") + "\n"
    });
    std::fs::write(&x, rows.collect::<String>()).unwrap();
    let config = config(folder.path(), [0.0, 120.0, -120.0], [false, true, false]);
    let said = fails(&command(&config, &[x, y, turn], false));
    assert_says(
        &said,
        &["along-x.csv", "`m2` has no value in 200 of 200 rows"],
    );
}

/// It was taken for a wheel that stands elsewhere.
#[test]
fn an_encoder_that_hardly_moves_is_told_first() {
    let folder = tempfile::tempdir().unwrap();
    let [x, y, turn] = logs(folder.path(), STANDING, [0, 1, 2]);
    for path in [&x, &y, &turn] {
        let text = std::fs::read_to_string(path).unwrap();
        let rows = text.lines().enumerate().map(|(row, line)| {
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            if row > 0 {
                cells[2] = (17.0 + 0.05 * (row as f64).sin()).to_string();
            }
            cells.join(",") + "\n"
        });
        std::fs::write(path, rows.collect::<String>()).unwrap();
    }
    let config = config(folder.path(), [0.0, 120.0, -120.0], [false, true, false]);
    for all in [false, true] {
        let said = fails(&command(
            &config,
            &[x.clone(), y.clone(), turn.clone()],
            all,
        ));
        let told = said
            .find("the angle of wheel 2 (`m2`) hardly moves")
            .unwrap();
        assert_says(&said[told..], &["is the encoder connected?", "agree"]);
        assert!(
            !said[..told].contains("azimuths agrees") && !said[..told].contains("it would agree")
        );
        assert!(
            !said.contains("wheel 1 (`m1`)") && !said.contains("wheel 3 (`m3`)"),
            "{said}"
        );
    }
}

#[test]
fn a_log_without_a_push_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let [x, y, turn] = logs(folder.path(), STANDING, [0, 1, 2]);
    let config = config(folder.path(), [0.0, 120.0, -120.0], [false; 3]);
    std::fs::write(&x, "t_s,m1,m2,m3\n0,1,2,3\n1,50,60,70\n2,1,2,3\n").unwrap();
    let said = fails(&command(&config, &[x, y, turn], false));
    assert_says(&said, &["along-x.csv", "in one direction"]);
    std::fs::write(&config, "").unwrap();
    let logs = logs(folder.path(), STANDING, [0, 1, 2]);
    let said = fails(&command(&config, &logs, false));
    assert_says(&said, &["robot.toml", "[log.wheels]"]);
}
