//! Terminal law, cost and set of a predictive controller.

mod certificate;
mod claim;
mod counterexample;
mod decrease;
mod design;
mod document;
mod ellipsoid;
mod lmi;
mod normalised;
mod numbers;
mod proof;
mod quadratic;
mod sampled;
mod synthesis;

pub use certificate::{
    Certificate, DocumentError, MOST_BYTES, QuadraticClaim, Record, TerminalClaim,
    check_document_digest, document_content, document_text, read_certificate,
};
pub use claim::ClaimError;
pub use design::{CertificateProblem, CertifyError, Effort, certify_terminal, raise_level};
pub use numbers::is_at_most;
pub use proof::{MOST_BOXES, PROOF_REVISION, Proof};
pub use sampled::SampledClaim;
pub use synthesis::{
    SynthesisError, TerminalIngredients, TerminalProblem, synthesize_terminal,
    synthesize_terminal_at,
};
