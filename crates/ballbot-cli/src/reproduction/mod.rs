//! The reproduction of the paper as tables, figures and a report.

pub mod claims;
pub mod figures;
pub mod guarantee;
pub mod optimum;
pub mod report;
pub mod tables;
