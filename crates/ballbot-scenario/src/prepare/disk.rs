//! A folder on the disk as the place of what a scenario names.

use crate::error::ScenarioError;
use crate::file::certificate::TerminalCertificate;
use crate::file::schema::{CsvTable, PointTable};
use crate::prepare::excitation::Excitation;
use crate::prepare::files::Files;
use crate::prepare::known_robot::KnownRobot;
use crate::prepare::time_series::TimeSeries;
use crate::prepare::{guarantee, parameters};
use std::path::Path;

/// The folder that paths are relative to.
impl Files for &Path {
    fn reference(&self, file: &CsvTable, duration: f64) -> Result<Vec<PointTable>, ScenarioError> {
        let columns = [file.time_column.as_str(), file.phi_column.as_str()];
        let series = TimeSeries::read(self.join(&file.path), columns)?;
        series.check_covers(duration)?;
        let points = series
            .rows()
            .map(|(time_s, phi_rad)| PointTable { time_s, phi_rad });
        Ok(points.collect())
    }

    fn certificate(&self, file: Option<&str>) -> Result<TerminalCertificate, ScenarioError> {
        guarantee::read(file, self)
    }

    fn robot(&self, file: &Path) -> Result<KnownRobot, ScenarioError> {
        parameters::read(file, self)
    }

    fn excitation(&self, file: &Path) -> Result<Excitation, ScenarioError> {
        Excitation::read(self.join(file))
    }
}
