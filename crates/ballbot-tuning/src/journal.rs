//! The journal: what was evaluated, line by line, so that none of it is run again.

use crate::error::TuningError;
use crate::judge::{Judged, infinite};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// A candidate in the journal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// Its number, from 0.
    pub candidate: usize,
    /// Its values, in the order of the parameters.
    pub values: Vec<serde_json::Value>,
    /// What became of it.
    pub state: State,
    /// Why they make no scenario, where they do not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refused: Option<String>,
    /// The runs that were made.
    pub runs: u64,
    /// Goals.
    #[serde(with = "infinite")]
    pub goals: Vec<f64>,
    /// Limits.
    #[serde(with = "infinite")]
    pub limits: Vec<f64>,
    /// The mean share of a run's time that it did not last.
    pub lost: f64,
}

/// What became of a candidate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// All its runs were made.
    Whole,
    /// It was left when it was certain that it is worse than others.
    GivenUp,
    /// Its values make no scenario.
    Refused,
}

impl Entry {
    /// Goals and limits; lower bounds where it was given up.
    pub fn judged(&self) -> Judged {
        Judged {
            goals: self.goals.clone(),
            limits: self.limits.clone(),
            lost: self.lost,
            exact: self.state == State::Whole,
        }
    }
}

/// A journal that was read.
#[derive(Clone, Debug, Default)]
pub struct Journal {
    /// What is in it, in its order.
    pub entries: Vec<Entry>,
    /// Its length, bytes, without a last line that was cut off.
    pub length: usize,
    /// The digest of all its lines.
    chain: String,
}

/// The first line's key.
const OF: &str = "tuning";

impl Journal {
    /// An empty journal of a tuning with this fingerprint, and its first line.
    pub fn new(fingerprint: &str) -> (Self, String) {
        let mut journal = Self::default();
        let line = journal.chained(&format!("{{\"{OF}\":\"{fingerprint}\"}}"));
        (journal, line)
    }

    /// A journal from its text. A last line without an end was being written when its process ended; it
    /// counts as absent.
    ///
    /// # Errors
    /// It is of another tuning, or was changed.
    pub fn read(text: &str, fingerprint: &str) -> Result<Self, TuningError> {
        let (mut journal, first) = Self::new(fingerprint);
        let refused = |line: usize, problem: &str| {
            Err(TuningError::Journal {
                line,
                problem: problem.to_owned(),
            })
        };
        let length = text.rfind('\n').map_or(0, |end| end + 1);
        let mut lines = text[..length].split_inclusive('\n');
        match lines.next() {
            // Empty, or its first line was being written.
            None if first.starts_with(text) => return Ok(Self::default()),
            None => return refused(1, "it is no journal of a tuning"),
            Some(line) if line == first => journal.length = line.len(),
            Some(line) if line.contains(OF) => {
                let problem = "it is of another tuning, of another program, or one of the files was \
                               changed since";
                return refused(1, problem);
            }
            Some(_) => return refused(1, "it is no journal of a tuning"),
        }
        for (i, line) in lines.enumerate() {
            let number = i + 2;
            let content = line
                .trim_end_matches('\n')
                .split_once(' ')
                .map(|(_, content)| content);
            let expected = content.map(|content| journal.chained(content));
            let Some(content) = content.filter(|_| expected.as_deref() == Some(line)) else {
                return refused(number, "it was changed, or lines before it are missing");
            };
            match serde_json::from_str::<Entry>(content) {
                Ok(entry) if entry.candidate == i => journal.entries.push(entry),
                Ok(_) => return refused(number, "its candidate is not the next one"),
                Err(error) => return refused(number, &error.to_string()),
            }
            journal.length += line.len();
        }
        Ok(journal)
    }

    /// The line of the next entry.
    pub fn line(&mut self, entry: &Entry) -> String {
        // A struct of numbers and words is always JSON.
        let content = serde_json::to_string(entry).unwrap_or_default();
        self.chained(&content)
    }

    /// A line with its digest, which follows from all lines before.
    fn chained(&mut self, content: &str) -> String {
        let digest = Sha256::new()
            .chain_update(&self.chain)
            .chain_update(content)
            .finalize();
        self.chain = digest
            .iter()
            .take(8)
            .map(|byte| format!("{byte:02x}"))
            .collect();
        format!("{} {content}\n", self.chain)
    }
}
