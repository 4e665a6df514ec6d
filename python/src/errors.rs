//! Errors of the libraries as Python's exceptions.

use lpvmpc_any::MpcError;
use lpvmpc_certify::CertifyError;
use lpvmpc_plant::PlantError;
use pyo3::PyErr;

mod python {
    use pyo3::import_exception;

    import_exception!(lpvmpc.errors, CertificateError);
    import_exception!(lpvmpc.errors, FalseClaimError);
    import_exception!(lpvmpc.errors, PlantError);
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
