//! Errors of the libraries as Python's exceptions.

use ballbot_scenario::ScenarioError;
use lpvmpc_any::MpcError;
use lpvmpc_certificate::ClaimError;
use lpvmpc_certify::CertifyError;
use lpvmpc_plant::PlantError;
use pyo3::PyErr;

mod python {
    use pyo3::import_exception;

    import_exception!(lpvmpc.errors, CertificateError);
    import_exception!(lpvmpc.errors, IdentificationError);
    import_exception!(lpvmpc.errors, FalseClaimError);
    import_exception!(lpvmpc.errors, PlantError);
    import_exception!(lpvmpc.errors, ScenarioError);
    import_exception!(lpvmpc.errors, SettingError);
    import_exception!(lpvmpc.errors, SimulationError);
}

/// `lpvmpc.PlantError`.
pub fn of_plant(error: PlantError) -> PyErr {
    python::PlantError::new_err(error.to_string())
}

/// `lpvmpc.SettingError`.
pub fn of_setting(error: MpcError) -> PyErr {
    python::SettingError::new_err(error.to_string())
}

/// `lpvmpc.CertificateError`, or what it is of a setting or of a claim that is false.
pub fn of_certificate(error: CertifyError) -> PyErr {
    let text = error.to_string();
    match error {
        _ if error.is_false() => python::FalseClaimError::new_err(text),
        CertifyError::Setting { .. } => python::SettingError::new_err(text),
        CertifyError::Plant(_) => python::PlantError::new_err(text),
        _ => python::CertificateError::new_err(text),
    }
}

/// `lpvmpc.SettingError` about `place`.
pub fn setting(place: &str, fault: &str) -> PyErr {
    python::SettingError::new_err(format!("{place}: {fault}"))
}

/// `lpvmpc.SimulationError`.
pub fn of_simulation(error: impl ToString) -> PyErr {
    python::SimulationError::new_err(error.to_string())
}

/// `lpvmpc.ScenarioError`.
pub fn of_scenario(error: ScenarioError) -> PyErr {
    python::ScenarioError::new_err(error.to_string())
}

/// `lpvmpc.ScenarioError` about a value that no scenario can have.
pub fn scenario_value(key: &str, value: &str, expected: &str) -> PyErr {
    of_scenario(ScenarioError::Value {
        key: key.to_owned(),
        value: value.to_owned(),
        expected: expected.to_owned(),
    })
}

/// `lpvmpc.ScenarioError`: a study cannot be made of a scenario.
pub fn study(error: impl ToString) -> PyErr {
    python::ScenarioError::new_err(error.to_string())
}

/// `lpvmpc.IdentificationError`.
pub fn identification(message: &str) -> PyErr {
    python::IdentificationError::new_err(message.to_owned())
}

/// `lpvmpc.CertificateError`.
pub fn certificate(error: impl ToString) -> PyErr {
    python::CertificateError::new_err(error.to_string())
}

/// `lpvmpc.FalseClaimError`, or `lpvmpc.CertificateError` where a claim could not be shown.
pub fn claim(error: &ClaimError) -> PyErr {
    let text = format!("the certificate {}: {error}", error.verdict());
    match error.is_false() {
        true => python::FalseClaimError::new_err(text),
        false => python::CertificateError::new_err(text),
    }
}
