//! Scenarios.

use super::run;
use super::values::{of_toml, to_toml, toml_text};
use crate::errors::of_scenario;
use crate::work::{Report, Watch, work};
use ballbot_scenario::proofs::ProvedFiles;
use ballbot_scenario::{Document, Prepared, ScenarioError, builtin};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::{Path, PathBuf};

/// A scenario, with the folder for the files that it names.
#[pyclass(module = "lpvmpc._lpvmpc")]
pub struct Scenario {
    document: Document,
    folder: PathBuf,
}

impl Scenario {
    fn of(document: Document, folder: PathBuf) -> Self {
        Self { document, folder }
    }

    /// The document, and where its files are.
    pub fn parts(&self) -> (&Document, &Path) {
        (&self.document, &self.folder)
    }
}

/// Checks a scenario and works out what it leaves to be computed; a certificate among its files is
/// proved, the first time.
pub fn prepare(
    scenario: &ballbot_scenario::Scenario,
    folder: &Path,
    watch: &Watch,
) -> Result<Prepared, ScenarioError> {
    let progress = |done| watch.set_part("proving the certificate", done);
    scenario.prepare(ProvedFiles {
        folder,
        progress: &progress,
    })
}

#[pymethods]
impl Scenario {
    /// The names of the built-in ones.
    #[staticmethod]
    fn builtins() -> Vec<&'static str> {
        builtin::ALL.iter().map(|builtin| builtin.name).collect()
    }

    #[staticmethod]
    fn builtin(name: &str) -> PyResult<Self> {
        let builtin = builtin::find(name).ok_or_else(|| ScenarioError::unknown(name));
        let text = builtin.map_err(of_scenario)?.text;
        let document = Document::parse(text.to_owned(), name);
        Ok(Self::of(document.map_err(of_scenario)?, PathBuf::from(".")))
    }

    /// A built-in one by its name, or a file by its path.
    #[staticmethod]
    fn load(name_or_path: &str) -> PyResult<Self> {
        let document = Document::load(name_or_path).map_err(of_scenario)?;
        let folder = Path::new(name_or_path).parent().unwrap_or(Path::new("."));
        Ok(Self::of(document, folder.to_owned()))
    }

    /// From the text of a file, or from a dictionary.
    #[staticmethod]
    fn parse(content: Bound<'_, PyAny>, origin: &str, folder: PathBuf) -> PyResult<Self> {
        let text = toml_text("scenario", &content)?;
        Ok(Self::of(
            Document::parse(text, origin).map_err(of_scenario)?,
            folder,
        ))
    }

    fn copy(&self) -> Self {
        Self::of(self.document.clone(), self.folder.clone())
    }

    #[getter]
    fn origin(&self) -> &str {
        self.document.origin()
    }

    #[getter]
    fn folder(&self) -> &Path {
        &self.folder
    }

    /// What stands at a key, or its default; `None` where there is neither.
    fn value<'py>(&self, py: Python<'py>, key: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        let value = self.document.value(key);
        value.map(|value| of_toml(py, &value)).transpose()
    }

    fn set(&mut self, changes: Vec<(String, Bound<'_, PyAny>)>) -> PyResult<()> {
        let changes = changes.iter().map(|(key, value)| {
            let value = to_toml(key, value)?;
            Ok((key.as_str(), value))
        });
        let changes: Vec<_> = changes.collect::<PyResult<_>>()?;
        self.document.set(&changes).map_err(of_scenario)
    }

    fn remove(&mut self, key: &str) -> PyResult<()> {
        self.document.remove(key).map_err(of_scenario)
    }

    /// The text of its file.
    #[getter]
    fn text(&self) -> &str {
        self.document.text()
    }

    fn check(&self, py: Python<'_>, report: Report<'_>) -> PyResult<()> {
        let (scenario, folder) = (self.document.scenario(), &self.folder);
        let prepared = work(py, &report, |watch| prepare(scenario, folder, watch))?;
        prepared.map_err(of_scenario).map(drop)
    }

    /// The recorded run.
    fn simulate<'py>(&self, py: Python<'py>, report: Report<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (scenario, folder) = (self.document.scenario(), &self.folder);
        let found = work(py, &report, |watch| {
            let prepared = prepare(scenario, folder, watch)?;
            let record = run::record(&prepared, watch)?;
            Ok((prepared, record))
        })?;
        let (prepared, record) = found.map_err(of_scenario)?;
        run::to_python(py, &prepared, record)
    }
}
