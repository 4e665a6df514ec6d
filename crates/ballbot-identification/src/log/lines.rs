//! Lines of a text file, none of them longer than a log's line can be.

use super::error::Problem;
use std::io::{BufRead, Read};

/// The longest line that is taken for one, bytes.
const LONGEST: usize = 64 * 1024;

/// The byte order mark, as text.
const MARK: &str = "\u{feff}";

/// Lines with their number, counted from 1.
pub(super) struct Lines<R> {
    reader: R,
    buffer: Vec<u8>,
    /// Number of the last line that was read.
    pub(super) number: usize,
    /// Bytes that were read.
    pub(super) bytes: u64,
    /// Whether the last line ended with a line feed.
    pub(super) ended: bool,
}

impl<R: BufRead> Lines<R> {
    pub(super) fn new(reader: R) -> Self {
        Self {
            reader,
            buffer: Vec::new(),
            number: 0,
            bytes: 0,
            ended: true,
        }
    }

    /// Goes to the next line; `false` at the end of the file.
    pub(super) fn advance(&mut self) -> Result<bool, Problem> {
        self.buffer.clear();
        let read = Read::by_ref(&mut self.reader)
            .take(LONGEST as u64 + 1)
            .read_until(b'\n', &mut self.buffer)
            .map_err(Problem::Read)?;
        self.number += 1;
        self.bytes += read as u64;
        if self.buffer.len() > LONGEST {
            return Err(Problem::LongLine {
                line: self.number,
                limit: LONGEST,
            });
        }
        self.ended = self.buffer.last() == Some(&b'\n');
        Ok(read > 0)
    }

    /// Whether the line is the first one and begins with a byte order mark.
    pub(super) fn is_marked(&self) -> bool {
        self.number == 1 && self.buffer.starts_with(MARK.as_bytes())
    }

    /// The line without its end, and without a byte order mark.
    pub(super) fn text(&self) -> Result<&str, Problem> {
        let Self { buffer, number, .. } = self;
        if *number == 1 && (buffer.starts_with(&[0xff, 0xfe]) || buffer.starts_with(&[0xfe, 0xff]))
        {
            return Err(Problem::Utf16);
        }
        if let Some(place) = buffer.iter().position(|byte| *byte == 0) {
            return Err(Problem::Binary {
                line: *number,
                column: place + 1,
            });
        }
        let line = std::str::from_utf8(buffer).map_err(|error| Problem::NotUtf8 {
            line: *number,
            column: error.valid_up_to() + 1,
        })?;
        let line = match number {
            1 => line.strip_prefix(MARK).unwrap_or(line),
            _ => line,
        };
        Ok(line.trim_end_matches(['\n', '\r']))
    }
}
