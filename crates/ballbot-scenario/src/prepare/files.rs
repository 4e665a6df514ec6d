//! What a scenario names besides itself, and where it is found.

use crate::error::ScenarioError;
use crate::file::certificate::TerminalCertificate;
use crate::file::schema::{CsvTable, PointTable};
use crate::prepare::excitation::Excitation;
use crate::prepare::known_robot::KnownRobot;
use crate::prepare::standing::Standing;
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
    /// The file cannot be read, is not as it was written, or has numbers that cannot be.
    fn certificate(&self, file: Option<&str>) -> Result<TerminalCertificate, ScenarioError>;

    /// What is known of the certificate that was read from `file`, after a proof if there is to be
    /// one. A proof takes minutes on all cores ([`TerminalCertificate::prove`]), so this one makes
    /// none, and the answer is that the certificate is taken at its word.
    ///
    /// # Errors
    /// A claim is false or could not be shown.
    fn prove(
        &self,
        file: &str,
        certificate: &TerminalCertificate,
    ) -> Result<Standing, ScenarioError> {
        let _ = (file, certificate);
        Ok(Standing::NotProved)
    }

    /// The robot in the table `[parameters]` of a TOML file.
    ///
    /// # Errors
    /// The file cannot be read or has no such table, or a number makes no sense.
    fn robot(&self, file: &Path) -> Result<KnownRobot, ScenarioError>;

    /// A torque on top of the loop's, from a file of `ballbot excite`.
    ///
    /// # Errors
    /// The file cannot be read, or a row makes no sense.
    fn excitation(&self, file: &Path) -> Result<Excitation, ScenarioError>;
}
