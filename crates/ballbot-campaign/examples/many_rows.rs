//! Shards of a campaign whose closed loops are not run: draws as they would be, measures at random.
//! For measuring what merging them takes, which is the same for any rows:
//!
//! ```sh
//! cargo run --release -p ballbot-campaign --example many_rows -- CAMPAIGN BALLBOT SHARDS DIR
//! /usr/bin/time -v ballbot campaign merge DIR --yes
//! ```
#![allow(
    clippy::unwrap_used,
    reason = "a tool for measuring ends where it cannot go on"
)]

use ballbot_campaign::{Campaign, Cell, Kind, RowWriter, Shard, Source};
use lpvmpc_sim::Random;
use sha2::{Digest, Sha256};
use std::fs::{self, File};
use std::path::Path;

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, file, program, shards, out] = arguments.as_slice() else {
        eprintln!("CAMPAIGN BALLBOT SHARDS DIR");
        std::process::exit(2);
    };
    let digest = Sha256::digest(fs::read(program).unwrap());
    let half: String = digest
        .iter()
        .take(16)
        .map(|byte| format!("{byte:02x}"))
        .collect();
    let program = format!("ballbot {} {half}", env!("CARGO_PKG_VERSION"));
    let source = Source::load(Path::new(file)).unwrap();
    let campaign = Campaign::new(&source, source.folder(), &program).unwrap();
    let folder = Path::new(out).join("shards");
    fs::create_dir_all(&folder).unwrap();
    let shards: u32 = shards.parse().unwrap();
    let plan = format!(
        "{{\"campaign\": {:?}, \"shards\": {shards}, \"fingerprint\": {:?}, \"program\": {program:?}}}",
        fs::canonicalize(file).unwrap(),
        campaign.fingerprint()
    );
    fs::write(folder.join("plan.json"), plan).unwrap();
    let (columns, measures) = (campaign.columns(), campaign.measures().len());
    let mut random = Random::new(1, 0);
    for shard in Shard::all(shards) {
        let (from, until) = shard.runs(campaign.runs());
        let notes = [
            ("ballbot.title", source.file().title.clone()),
            ("ballbot.program", program.clone()),
            ("ballbot.fingerprint", campaign.fingerprint().to_owned()),
            ("ballbot.first_run_sha256", "(not run)".to_owned()),
            ("ballbot.from_run", from.to_string()),
            ("ballbot.until_run", until.to_string()),
        ];
        let file = File::create(folder.join(shard.file_name())).unwrap();
        let mut writer = RowWriter::new(&file, &columns, &notes).unwrap();
        for run in from..until {
            let drawn = campaign.drawn_cells(&campaign.draw(run));
            let mut row = vec![Cell::Whole(run as i64), drawn[0].clone()];
            row.push(Cell::Text("complete".to_owned()));
            row.push(Cell::Flag(random.uniform() < 0.9));
            row.extend_from_slice(&drawn[1..]);
            for column in &columns[columns.len() - measures..] {
                row.push(match column.kind {
                    Kind::Whole => Cell::Whole((10.0 * random.uniform()) as i64),
                    _ => Cell::Real(random.normal()),
                });
            }
            writer.push(row).unwrap();
        }
        writer.finish().unwrap();
    }
}
