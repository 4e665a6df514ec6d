//! Writes a log of ten minutes at 1 kHz, to see how long `ballbot identify` takes for it:
//! `cargo run --release -p ballbot-identification --example long_log -- log.csv`

#[path = "../tests/it/laboratory.rs"]
#[allow(
    dead_code,
    clippy::unwrap_used,
    reason = "the tests' laboratory, of which one record is needed"
)]
mod laboratory;

use laboratory::{Laboratory, csv, healthy};

fn main() -> std::io::Result<()> {
    let path = std::env::args().nth(1);
    let path =
        path.ok_or_else(|| std::io::Error::other("name the file to write: long_log log.csv"))?;
    let laboratory = Laboratory {
        rate: 1000.0,
        duration: 600.0,
        delay: 0.01,
        tilt_offset: 0.01,
        gyro_bias: 0.02,
        ..healthy()
    };
    std::fs::write(path, csv(&laboratory.record(1)))
}
