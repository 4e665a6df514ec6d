//! What `ballbot identify` shows of an identification: tables, figures, report, words.

pub mod figures;
pub mod published;
pub mod report;
pub mod summary;
pub mod tables;
