//! Terminal ingredients for predictive control of nonlinear plants, with a certificate: a gain, a cost
//! and a set in which, for the sampled nonlinear plant, the cost decreases and all bounds hold.
//!
//! | for | use |
//! |---|---|
//! | a gain and a cost for a set of schedulings | [`synthesize_terminal`] (linear matrix inequalities) |
//! | a set, and the proof that it is one | [`certify_terminal`], [`Certificate::prove`] |
//! | how far a rollout by Runge-Kutta steps is from its plant | [`RolloutClaim`] |
//! | numbers that contain what they stand for | [`Interval`], [`TaylorModel`], [`TaylorMap`] |
//! | where a sampled loop may be after a sample | [`SampleEnclosure`] |
//!
//! A plant is an [`lpvmpc::Embedding`]: its equations over any number, so that the same code that a
//! controller runs on numbers is proved on intervals and Taylor models.
//!
//! # Example
//!
//! ```
//! use lpvmpc::Number;
//! use lpvmpc_certificate::Interval;
//!
//! // sin over the angles from 0 to 0.1 rad lies between 0 and 0.1.
//! let angles = Interval::new(0.0, 0.1);
//! let sine = angles.sin();
//! assert!(sine.lower <= 0.0 && sine.upper >= 0.1_f64.sin() && sine.upper < 0.101);
//! println!("sin is from {} to {}", sine.lower, sine.upper);
//! ```

mod cover;
mod enclosure;
mod rollout;
mod terminal;

pub use enclosure::{
    Arithmetic, Ball, FlowError, Frame, Interval, SampleEnclosure, SampledLaw, TaylorMap,
    TaylorModel,
};
pub use rollout::{EnclosedSample, RolloutClaim, RolloutError, RolloutProof};
pub use terminal::{
    Certificate, CertificateProblem, CertifyError, ClaimError, DocumentError, Effort, MOST_BOXES,
    MOST_BYTES, PROOF_REVISION, Proof, QuadraticClaim, Record, SampledClaim, SynthesisError,
    TerminalClaim, TerminalIngredients, TerminalProblem, certify_terminal, check_document_digest,
    document_content, document_text, is_at_most, raise_level, read_certificate,
    synthesize_terminal, synthesize_terminal_at,
};
