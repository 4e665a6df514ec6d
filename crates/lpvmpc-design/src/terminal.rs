//! Terminal law, cost and set of a predictive controller.

mod certificate;
mod document;
mod lmi;
mod synthesis;

pub use certificate::{Certificate, DocumentError, QuadraticClaim, Record, TerminalClaim};
pub use synthesis::{SynthesisError, TerminalIngredients, TerminalProblem, synthesize_terminal};
