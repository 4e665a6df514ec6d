//! Certificates of plants that are data: a law u = u_eq - K (x - x_eq), a cost and a set about an equilibrium, proved
//! for the sampled nonlinear plant itself, or for a plant in discrete time.
//!
//! ```
//! use lpvmpc_certify::{CertifySettings, certify, verify};
//! use lpvmpc_plant::Plant;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let plant = Plant::from_json(r#"{
//!     "schema": 1,
//!     "name": "pendulum",
//!     "states": [{"name": "angle", "unit": "rad"}, {"name": "rate", "unit": "rad/s"}],
//!     "inputs": [{"name": "torque", "unit": "N m", "lower": -8, "upper": 8}],
//!     "operations": [
//!         ["state", 0], ["state", 1], ["input", 0], ["constant", 9.81],
//!         ["sin", 0], ["mul", 3, 4], ["add", 5, 2]
//!     ],
//!     "derivative": [1, 6]
//! }"#)?;
//! let certificate = certify(&plant, &CertifySettings::new(0.05, &[1.0, 1.0], &[0.1]), &|_| ())?;
//! assert!(certificate.contains(&[0.2, 0.0]));
//! let verified = verify(&certificate, &plant, &|_| ())?;
//! println!("proved on {} boxes: |angle| <= {:.3} rad", verified.boxes, verified.reach[0]);
//! # Ok(())
//! # }
//! ```
//!
//! What is claimed is at [`Certificate`]; how it is proved, at `lpvmpc-certificate` and in `docs/certificate.md`. The
//! plant enters by its own formulas, factorised exactly ([`lpvmpc_plant::AboutEquilibrium`]).
#![allow(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "a comparison with NaN must take the failing branch"
)]

mod certificate;
mod design;
mod equilibrium;
mod error;
mod settings;
mod sized;

pub use certificate::{Certificate, EquilibriumClaim, PlantName, Record};
pub use error::CertifyError;
pub use settings::CertifySettings;
pub use sized::Verified;

use lpvmpc_plant::Plant;

/// The most states that a plant may have.
pub const MOST_STATES: usize = 16;
/// The most inputs.
pub const MOST_INPUTS: usize = 6;

/// Calls a function of the smallest size in which a plant has room.
macro_rules! smallest {
    ($plant:expr, $function:ident $arguments:tt, $($nx:literal $nu:literal $ns:literal),+) => {{
        let data = $plant.data();
        let (n, m) = (data.states.len(), data.inputs.len());
        if m == 0 {
            return Err(CertifyError::setting("plant", "it has no input"));
        }
        $(if n <= $nx && m <= $nu {
            return on_threads(|| sized::$function::<$nx, $nu, $ns> $arguments);
        })+
        let fault = format!(
            "there are {n} states and {m} inputs; a certificate has at most {MOST_STATES} and {MOST_INPUTS}"
        );
        Err(CertifyError::setting("plant", fault))
    }};
}

/// Bytes of the stack of each thread of a proof: maps of many states are large. Those that are not used take no memory.
const STACK: usize = 256 << 20;

/// On as many threads as there are cores.
fn on_threads<R: Send>(
    run: impl FnOnce() -> Result<R, CertifyError> + Send,
) -> Result<R, CertifyError> {
    let pool = rayon::ThreadPoolBuilder::new().stack_size(STACK).build();
    pool.map_err(|error| CertifyError::setting("threads", error))?
        .install(run)
}

/// Finds a law, a cost and a set about an equilibrium of `plant`, and proves them: sets as large as the bounds allow
/// first, then halves, until one is proved, whose level is then raised. `progress` hears which share of a
/// proof is done; there may be several.
///
/// # Errors
/// A setting that makes no sense, no equilibrium, no law, or no proof.
pub fn certify(
    plant: &Plant,
    settings: &CertifySettings,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Certificate, CertifyError> {
    if !(settings.t_s > 0.0 && settings.t_s.is_finite()) {
        let fault = format!(
            "it is {} s; it must be a positive number of seconds",
            settings.t_s
        );
        return Err(CertifyError::setting("t_s", fault));
    }
    check_period(plant, settings.t_s)?;
    if !(settings.enlargement >= 1.0 && settings.enlargement <= 1e6) {
        let fault = format!("it is {}; it must be from 1 to 1e6", settings.enlargement);
        return Err(CertifyError::setting("enlargement", fault));
    }
    smallest!(plant, certify(plant, settings, progress), 2 1 3, 4 2 6, 6 2 8, 8 4 12, 16 6 22)
}

/// Proves every claim of a certificate again, from its numbers and the plant's formulas alone.
///
/// # Errors
/// It is of another plant; a claim is false ([`CertifyError::is_false`]), malformed, or could not be shown.
pub fn verify(
    certificate: &Certificate,
    plant: &Plant,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Verified, CertifyError> {
    certificate.check_plant(plant)?;
    check_period(plant, certificate.t_s)?;
    smallest!(plant, verify(certificate, plant, progress), 2 1 3, 4 2 6, 6 2 8, 8 4 12, 16 6 22)
}

fn check_period(plant: &Plant, t_s: f64) -> Result<(), CertifyError> {
    match plant.period() {
        Some(period) if period != t_s => {
            let fault =
                format!("it is {t_s} s; the plant is in discrete time with a period of {period} s");
            Err(CertifyError::setting("t_s", fault))
        }
        _ => Ok(()),
    }
}

/// As [`verify`], of the text of a file: that it is as it was written is looked at last, so that a false claim is told
/// by what it claims.
///
/// # Errors
/// As [`verify`]; or it is no certificate, or was changed after it was written.
pub fn verify_text(
    text: &str,
    plant: &Plant,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<(Certificate, Verified), CertifyError> {
    let certificate: Certificate = lpvmpc_certificate::document_content(text)?;
    let verified = verify(&certificate, plant, progress)?;
    lpvmpc_certificate::check_document_digest::<Certificate>(text)?;
    Ok((certificate, verified))
}
