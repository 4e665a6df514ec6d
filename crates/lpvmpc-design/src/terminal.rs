//! Terminal law, cost and set of a predictive controller.

mod certificate;
mod cover;
mod decrease;
mod design;
mod document;
mod ellipsoid;
mod lmi;
mod normalised;
mod proof;
mod quadratic;
mod synthesis;

pub use certificate::{Certificate, DocumentError, QuadraticClaim, Record, TerminalClaim};
pub use design::{CertificateProblem, CertifyError, certify_terminal};
pub use proof::{ClaimError, MOST_BOXES, Proof};
pub use synthesis::{SynthesisError, TerminalIngredients, TerminalProblem, synthesize_terminal};
