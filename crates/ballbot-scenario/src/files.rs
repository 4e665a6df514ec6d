//! What a scenario names besides itself, and where it is found.

use crate::certificate::TerminalCertificate;
use crate::error::ScenarioError;
use crate::guarantee;
use crate::reference_file;
use crate::schema::{CsvTable, PointTable};
use std::path::Path;

/// Where reference files and certificates come from: a folder, or, in a browser, the page.
pub trait Files {
    /// The points of a reference file, which cover `duration` seconds without a gap.
    ///
    /// # Errors
    /// The file cannot be read or makes no sense.
    fn reference(&self, file: &CsvTable, duration: f64) -> Result<Vec<PointTable>, ScenarioError>;

    /// The certificate of a terminal set: a file's, or the built-in one
    /// ([`crate::builtin::TERMINAL_CERTIFICATE`]), not proved again.
    ///
    /// # Errors
    /// The file cannot be read or is not as it was written.
    fn certificate(&self, file: Option<&str>) -> Result<TerminalCertificate, ScenarioError>;
}

/// The folder that paths are relative to.
impl Files for &Path {
    fn reference(&self, file: &CsvTable, duration: f64) -> Result<Vec<PointTable>, ScenarioError> {
        reference_file::read(file, duration, self)
    }

    fn certificate(&self, file: Option<&str>) -> Result<TerminalCertificate, ScenarioError> {
        guarantee::read(file, self)
    }
}
