//! Campaigns of closed loops, from their file to their rows.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test that cannot go on must fail, in its support functions too"
)]

mod designs;
mod messages;
mod rare;
mod rows;
mod shards;

use ballbot_campaign::{Campaign, Cell, Clock, Row, RowFile, Source};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::time::Duration;
use tempfile::TempDir;

/// What names the program in these tests.
const PROGRAM: &str = "ballbot test";
/// No step takes any time.
const NO_CLOCK: Clock<'_> = &|| Duration::ZERO;

/// A short closed loop with noise, delay and four inputs.
const NOISY: &str = r#"
title = "Noise and delay"
scenario = "single-setpoint"
runs = 24
seed = 3

[set]
duration_s = 1.0
"world.sensors.theta.noise_rad" = 0.001

[[vary]]
key = "world.delay.transport_s"
uniform = [0.0, 0.1]

[[vary]]
key = "initial_state.theta_rad"
normal = { mean = 0.0, deviation = 0.1, lower = -0.3, upper = 0.3 }

[[vary]]
key = "controller.horizon"
integers = [10, 30]

[[vary]]
key = "controller.model"
list = ["lpv", "linear"]

[success]
largest_tilt_rad.at_most = 0.5
"#;

/// A campaign's file in a folder of its own.
fn written(text: &str) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("campaign.toml");
    fs::write(&path, text).unwrap();
    (folder, path)
}

/// Does something with a campaign of this text.
fn with<T>(text: &str, does: impl FnOnce(&Campaign<'_, &Path>) -> T) -> T {
    let (folder, path) = written(text);
    let source = Source::load(&path).unwrap();
    let result = does(&Campaign::new(&source, source.folder(), PROGRAM).unwrap());
    drop(folder);
    result
}

/// All rows of a campaign.
fn rows(campaign: &Campaign<'_, &Path>) -> Vec<Row> {
    let run = |run| campaign.run(run, NO_CLOCK).unwrap();
    (0..campaign.runs()).map(run).collect()
}

/// The cells of a column.
fn column(campaign: &Campaign<'_, &Path>, rows: &[Row], name: &str) -> Vec<Cell> {
    let index = campaign
        .columns()
        .iter()
        .position(|column| column.name == name);
    let index = index.unwrap_or_else(|| panic!("no column {name}"));
    rows.iter().map(|row| row[index].clone()).collect()
}

/// Its numbers.
fn numbers(campaign: &Campaign<'_, &Path>, rows: &[Row], name: &str) -> Vec<f64> {
    let cells = column(campaign, rows, name);
    cells.iter().map(|cell| cell.number().unwrap()).collect()
}

/// Writes the file of all rows, in one piece.
fn write_whole(campaign: &Campaign<'_, &Path>, path: &Path) {
    let file = File::create(path).unwrap();
    let mut writer = campaign.writer(&file, path).unwrap();
    let each = |row| -> Result<(), ballbot_campaign::CampaignError> {
        writer.push(row).unwrap();
        Ok(())
    };
    campaign.run_all(NO_CLOCK, &|| (), each).unwrap();
    writer.finish().unwrap();
}

/// The rows of a file.
fn read(path: &Path) -> Vec<Row> {
    let mut rows = Vec::new();
    let each = |row| -> Result<(), ballbot_campaign::CampaignError> {
        rows.push(row);
        Ok(())
    };
    RowFile::open(path).unwrap().for_each(each).unwrap();
    rows
}
