//! The first line: `lpvmpc-problems 1` and then pairs of a key and a value.

use crate::ProblemError;
use crate::layout::Sizes;
use std::fmt;

/// The beginning of the line: format and version.
const MAGIC: &str = "lpvmpc-problems 1";

/// What the first line says.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// Sizes of every problem.
    pub sizes: Sizes,
    /// Whether weights and bounds are the same at all stages of a problem. They are written out all the
    /// same; a reader may keep them once.
    pub common: bool,
    /// Problems in the file.
    pub problems: usize,
    /// What is bounded, one word.
    pub kind: String,
    /// The share of active bounds that was asked for: active bounds divided by the inputs of a horizon.
    pub wanted: f64,
    /// The share that was reached, on average over the sequence.
    pub share: f64,
}

impl fmt::Display for Header {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Sizes {
            nx,
            nu,
            horizon,
            rows,
        } = self.sizes;
        let common = u8::from(self.common);
        write!(
            f,
            "{MAGIC} nx {nx} nu {nu} horizon {horizon} rows {rows} common {common} problems {} kind {} \
             wanted {} share {:.4}",
            self.problems, self.kind, self.wanted, self.share
        )
    }
}

impl Header {
    /// Reads the line; keys that are not known are passed over.
    ///
    /// # Errors
    /// [`ProblemError::Header`].
    pub fn parse(line: &str) -> Result<Self, ProblemError> {
        let rest = line.trim_end().strip_prefix(MAGIC);
        let rest = rest.ok_or(ProblemError::Header(MAGIC))?;
        let words: Vec<&str> = rest.split_whitespace().collect();
        let text = |key: &'static str| {
            let pairs = words.chunks_exact(2);
            let mut found = pairs.filter_map(|pair| (pair[0] == key).then_some(pair[1]));
            found.next_back().ok_or(ProblemError::Header(key))
        };
        let count = |key| text(key)?.parse().map_err(|_| ProblemError::Header(key));
        let number = |key| text(key)?.parse().map_err(|_| ProblemError::Header(key));
        Ok(Self {
            sizes: Sizes {
                nx: count("nx")?,
                nu: count("nu")?,
                horizon: count("horizon")?,
                rows: count("rows")?,
            },
            common: count("common")? != 0,
            problems: count("problems")?,
            kind: text("kind")?.to_owned(),
            wanted: number("wanted")?,
            share: number("share")?,
        })
    }
}
