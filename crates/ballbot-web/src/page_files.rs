//! What a page has in place of files.

use crate::from_js::from_js;
use ballbot_scenario::{
    CsvTable, Excitation, Files, KnownRobot, PointTable, ScenarioError, TerminalCertificate,
};
use std::io::{Error, ErrorKind};
use std::path::Path;
use wasm_bindgen::JsValue;

/// The built-in certificate, read by JavaScript, and no other file.
pub struct PageFiles {
    /// The certificate as an object with the keys of its file.
    pub certificate: JsValue,
}

fn none(path: impl AsRef<Path>) -> ScenarioError {
    ScenarioError::Read {
        path: path.as_ref().to_owned(),
        source: Error::new(ErrorKind::Unsupported, "a page in a browser has no files"),
    }
}

impl Files for PageFiles {
    fn reference(&self, file: &CsvTable, _duration: f64) -> Result<Vec<PointTable>, ScenarioError> {
        Err(none(&file.path))
    }

    fn certificate(&self, file: Option<&str>) -> Result<TerminalCertificate, ScenarioError> {
        match file {
            Some(path) => Err(none(path)),
            None => from_js(self.certificate.clone()).map_err(|error| ScenarioError::Value {
                key: "controller.terminal.certified.certificate".to_owned(),
                value: "(built-in)".to_owned(),
                expected: error.to_string(),
            }),
        }
    }

    fn robot(&self, file: &Path) -> Result<KnownRobot, ScenarioError> {
        Err(none(file))
    }

    fn excitation(&self, file: &Path) -> Result<Excitation, ScenarioError> {
        Err(none(file))
    }
}
