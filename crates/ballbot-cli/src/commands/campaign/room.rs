//! Whether the results fit on the disk.

use crate::commands::CommandError;
use crate::output::FileError;
use ballbot_campaign::{Column, Kind};
use std::path::Path;

/// More bytes than this are asked about.
const LARGE: u64 = 1_000_000_000;

/// Bytes of a cell: in Parquet, which is not compressed, and in CSV, as measured.
fn bytes(kind: Kind) -> [u64; 2] {
    match kind {
        Kind::Real => [9, 20],
        Kind::Whole => [9, 8],
        Kind::Text => [14, 10],
        Kind::Flag => [1, 6],
    }
}

/// Refuses so many rows where there is no room for them, and asks about many. What is written is a
/// Parquet file and, with `csv`, a CSV file.
///
/// # Errors
/// They do not fit, or take more than a gigabyte without `yes`.
pub(super) fn check(
    rows: u64,
    columns: &[Column],
    csv: bool,
    (out, yes): (&Path, bool),
) -> Result<(), CommandError> {
    let row: u64 = columns
        .iter()
        .map(|column| bytes(column.kind))
        .map(|[parquet, text]| parquet + if csv { text } else { 0 })
        .sum();
    let needed = rows.saturating_mul(row);
    let there = out
        .ancestors()
        .find(|folder| folder.exists())
        .unwrap_or(Path::new("."));
    let there = if there.as_os_str().is_empty() {
        Path::new(".")
    } else {
        there
    };
    let free = fs4::available_space(there).map_err(FileError::at(out))?;
    let gigabytes = |bytes: u64| format!("{:.1} GB", bytes as f64 / 1e9);
    let said = format!(
        "{rows} rows need about {} in {}, where {} are free",
        gigabytes(needed),
        out.display(),
        gigabytes(free)
    );
    if needed > free / 10 * 9 {
        return Err(CommandError::Impossible(format!(
            "{said}; fewer runs, fewer measures (`measure`), or another folder (--out)"
        )));
    }
    if needed > LARGE && !yes {
        return Err(CommandError::Usage(format!(
            "{said}; if that is meant, say --yes"
        )));
    }
    Ok(())
}
