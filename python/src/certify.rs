//! Certificates: their text goes to and fro, and the libraries say what it is worth.

use crate::arrays::{Matrix, matrix};
use crate::errors::of_certificate;
use crate::plant::Plant;
use crate::work::{Report, work};
use lpvmpc_certify::{Certificate, CertifySettings, verify_text};
use pyo3::prelude::*;

/// Lower and upper bounds.
type Pair = Option<(Vec<f64>, Vec<f64>)>;

/// What a certificate is asked for, as Python hands it over: all keys are there.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Asked<'py> {
    t_s: f64,
    q: Matrix<'py>,
    r: Matrix<'py>,
    equilibrium: Pair,
    x_bounds: Pair,
    u_bounds: Pair,
    enlargement: f64,
    most_boxes: Option<usize>,
    trials: usize,
}

/// The text of a certificate that was proved.
#[pyfunction]
pub fn certify(
    py: Python<'_>,
    plant: &Plant,
    asked: Asked<'_>,
    report: Report<'_>,
) -> PyResult<String> {
    let settings = CertifySettings {
        q: matrix(&asked.q),
        r: matrix(&asked.r),
        equilibrium: asked.equilibrium,
        x_bounds: asked.x_bounds,
        u_bounds: asked.u_bounds,
        enlargement: asked.enlargement,
        most_boxes: asked.most_boxes,
        trials: asked.trials,
        ..CertifySettings::new(asked.t_s, &[], &[])
    };
    let found = work(py, &report, |watch| {
        let progress = |done| watch.set_part("proving a set", done);
        lpvmpc_certify::certify(&plant.inner, &settings, &progress)?.to_json()
    });
    found?.map_err(of_certificate)
}

/// Boxes of a proof from the text alone, and where the states are at most.
#[pyfunction]
pub fn verify(
    py: Python<'_>,
    text: &str,
    plant: &Plant,
    report: Report<'_>,
) -> PyResult<(usize, Vec<f64>)> {
    let verified = work(py, &report, |watch| {
        let progress = |done| watch.set_part("proving the certificate", done);
        verify_text(text, &plant.inner, &progress)
    });
    let (_, verified) = verified?.map_err(of_certificate)?;
    Ok((verified.boxes, verified.reach))
}

/// An error if the text is no certificate, or is not as it was written.
#[pyfunction]
pub fn check_certificate(text: &str) -> PyResult<()> {
    Certificate::from_json(text)
        .map(drop)
        .map_err(of_certificate)
}
