//! Terminal sets, proved.

use super::scenario::Scenario;
use super::values::plain;
use crate::errors::{certificate as refused, claim, of_scenario};
use crate::work::{Report, work};
use ballbot_scenario::{TerminalCertificate, proofs};
use ballbot_studies::{CertificateSearch, ProvedSet, Searching};
use pyo3::prelude::*;
use std::io;
use std::path::PathBuf;

/// What is asked of a set, as Python hands it over: all keys are there, `None` for what is usual.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Asked {
    size: Option<f64>,
    level: Option<f64>,
    contraction: Option<f64>,
    boxes: Option<usize>,
    trials: Option<usize>,
}

/// The largest set that can be proved: its numbers, and the text of its certificate.
#[pyfunction]
pub fn certify_scenario<'py>(
    py: Python<'py>,
    scenario: &Scenario,
    asked: Asked,
    report: Report<'py>,
) -> PyResult<(Bound<'py, PyAny>, String)> {
    let (document, folder) = scenario.parts();
    let uncertified = document.scenario().clone().uncertified();
    let prepared = uncertified.prepare(folder).map_err(of_scenario)?;
    let search = CertificateSearch {
        prepared: &prepared,
        size: asked.size,
        contraction: asked.contraction.unwrap_or(CertificateSearch::CONTRACTION),
        level: asked.level.unwrap_or(CertificateSearch::LEVEL),
        boxes: asked.boxes.unwrap_or(CertificateSearch::BOXES),
        trials: asked.trials.unwrap_or(CertificateSearch::TRIALS),
        written_by: format!("lpvmpc for Python {}", env!("CARGO_PKG_VERSION")),
    };
    let certified = work(py, &report, |watch| {
        search.run(&|searching| match searching {
            Searching::Designing(done) => watch.set_part("designing sets", done),
            Searching::Proving { size, done } => {
                watch.set_part(&format!("proving a set of {size:.3} of the bounds"), done);
            }
            Searching::Raising(done) => watch.set_part("raising the level", done),
        })
    })?;
    let (certificate, proof) = certified.map_err(refused)?;
    proofs::remember(&certificate);
    let set = plain(py, &ProvedSet::new(&certificate, &proof))?;
    Ok((set, certificate.to_json().map_err(refused)?))
}

/// The text of a certificate's file.
#[pyfunction]
pub fn read_certificate(path: PathBuf) -> PyResult<String> {
    lpvmpc_certificate::read_certificate(&path).map_err(|error| {
        io::Error::new(error.kind(), format!("{}: {error}", path.display())).into()
    })
}

/// Proves the certificate in a text again: its numbers.
#[pyfunction]
pub fn verify_certificate<'py>(
    py: Python<'py>,
    text: &str,
    report: Report<'py>,
) -> PyResult<Bound<'py, PyAny>> {
    let certificate = TerminalCertificate::from_json(text).map_err(refused)?;
    let proof = work(py, &report, |watch| {
        proofs::prove(&certificate, &|done| watch.set_part("verifying", done))
    })?;
    let proof = proof.map_err(|error| claim(&error))?;
    // After the proof, so that a false claim is told by what it claims.
    TerminalCertificate::check_digest(text).map_err(refused)?;
    plain(py, &ProvedSet::new(&certificate, &proof))
}
