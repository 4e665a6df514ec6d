//! Parts of a batch that other processes run: a file each, whose text says what it is of and which
//! program and machine made it.

use crate::batch::{Batch, Tried, Worlds};
use crate::error::TuningError;
use crate::tuning::Tuning;
use ballbot_campaign::Shard;
use ballbot_scenario::Files;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// A batch on its way to other processes.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct BatchFile {
    /// The tuning's fingerprint: of its files and the program.
    tuning: String,
    batch: Batch,
}

/// What became of a part of a batch.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PartFile {
    /// The digest of the batch's text.
    batch: String,
    /// What this machine makes of the start in its first world. Mathematical functions may differ in
    /// the last bit between machines.
    machine: String,
    loops: Vec<Tried>,
}

/// The digest of a text: 16 hexadecimal digits.
pub fn digest(text: &str) -> String {
    let digest = Sha256::digest(text);
    digest
        .iter()
        .take(8)
        .map(|byte| format!("{byte:02x}"))
        .collect()
}

impl<F: Files + Copy + Sync> Tuning<'_, F> {
    /// The text of a batch for other processes.
    pub fn batch_text(&self, batch: &Batch) -> String {
        let file = BatchFile {
            tuning: self.fingerprint().to_owned(),
            batch: batch.clone(),
        };
        // Numbers and words are always JSON.
        serde_json::to_string(&file).unwrap_or_default()
    }

    /// Runs a part of the batch with this text; the text of the result.
    ///
    /// # Errors
    /// It is of another tuning or program, or a closed loop fails.
    pub fn run_part(&self, batch: &str, part: Shard) -> Result<String, TuningError> {
        let refused = |problem: String| TuningError::Batch(problem);
        let file: BatchFile = serde_json::from_str(batch)
            .map_err(|error| refused(format!("it is no batch of a tuning: {error}")))?;
        if file.tuning != self.fingerprint() {
            let problem = "it was written by another program, or for another tuning, or one of the \
                           files was changed since";
            return Err(refused(problem.to_owned()));
        }
        let (from, until) = part.runs(file.batch.loops.len() as u64);
        let result = PartFile {
            batch: digest(batch),
            machine: self.machine()?,
            loops: self.run_some(&file.batch, from as usize..until as usize)?,
        };
        Ok(serde_json::to_string(&result).unwrap_or_default())
    }

    /// What became of the loops of a part whose result has this text; `machine` is [`Self::machine`] of
    /// the process that searches.
    ///
    /// # Errors
    /// It was cut off, is of another batch, or of a machine that makes other numbers.
    pub fn read_part(
        &self,
        batch: &str,
        part: Shard,
        text: &str,
        machine: &str,
    ) -> Result<Vec<Tried>, TuningError> {
        let refused = |problem: &str| Err(TuningError::Batch(problem.to_owned()));
        let Ok(file) = serde_json::from_str::<PartFile>(text) else {
            return refused("it was cut off, or is no part of a batch; remove it and run again");
        };
        let loops = serde_json::from_str(batch).map_or(0, |file: BatchFile| file.batch.loops.len());
        let (from, until) = part.runs(loops as u64);
        if file.batch != digest(batch) || file.loops.len() as u64 != until - from {
            return refused("it is of another batch; remove it and run again");
        }
        if file.machine != machine {
            return refused(
                "it was run on a machine that makes other numbers of the start than this one; use \
                 machines with the same processor features and mathematical library",
            );
        }
        Ok(file.loops)
    }

    /// The digest of what this machine makes of the start in its first world.
    ///
    /// # Errors
    /// That cannot be run.
    pub fn machine(&self) -> Result<String, TuningError> {
        let first = self.run(&Batch::of(Worlds::Search, &[self.start()], 0..1))?;
        Ok(digest(&serde_json::to_string(&first).unwrap_or_default()))
    }
}
