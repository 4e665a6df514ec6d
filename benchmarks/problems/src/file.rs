//! Reading and writing whole files.

use crate::ProblemError;
use crate::header::Header;
use crate::layout::{self, Sizes};
use lpvmpc::Ocp;
use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::Path;

/// Writes a sequence of problems of the same sizes.
///
/// # Errors
/// [`ProblemError`]: a problem of other sizes than the header's, or a file that cannot be written.
pub fn write<const NX: usize, const NU: usize>(
    path: &Path,
    header: &Header,
    problems: &[Ocp<f64, NX, NU>],
) -> Result<(), ProblemError> {
    let mut file = BufWriter::new(File::create(path)?);
    writeln!(file, "{header}")?;
    for ocp in problems {
        let mut numbers = Vec::with_capacity(header.sizes.of_problem());
        layout::write(ocp, &mut numbers)?;
        let (found, wanted) = (numbers.len(), header.sizes.of_problem());
        if Sizes::of(ocp) != header.sizes || found != wanted {
            return Err(ProblemError::Length { found, wanted });
        }
        for number in numbers {
            file.write_all(&number.to_le_bytes())?;
        }
    }
    Ok(file.flush()?)
}

/// The header of a file.
///
/// # Errors
/// [`ProblemError`].
pub fn header(path: &Path) -> Result<Header, ProblemError> {
    open(path).map(|(header, _)| header)
}

/// The numbers of problem `number`, from 0.
///
/// # Errors
/// [`ProblemError`].
pub fn numbers(path: &Path, number: usize) -> Result<(Header, Vec<f64>), ProblemError> {
    let (header, mut file) = open(path)?;
    if number >= header.problems {
        return Err(ProblemError::Size {
            what: "number of the problem",
            found: number,
            wanted: header.problems,
        });
    }
    let bytes = header.sizes.of_problem() * size_of::<f64>();
    let skipped = i64::try_from(number * bytes).map_err(|_| ProblemError::Header("problems"))?;
    file.seek(SeekFrom::Current(skipped))?;
    let mut data = vec![0; bytes];
    file.read_exact(&mut data)?;
    let (chunks, _) = data.as_chunks();
    let numbers = chunks.iter().copied().map(f64::from_le_bytes).collect();
    Ok((header, numbers))
}

fn open(path: &Path) -> Result<(Header, BufReader<File>), ProblemError> {
    let mut file = BufReader::new(File::open(path)?);
    let mut line = String::new();
    file.read_line(&mut line)?;
    Ok((Header::parse(&line)?, file))
}
