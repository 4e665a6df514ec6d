//! What a file means: every check that a person may need, and what is left to be worked out.

mod disk;
pub(crate) mod excitation;
mod feedback;
pub(crate) mod files;
pub(crate) mod guarantee;
pub(crate) mod heading;
pub(crate) mod known_robot;
mod late;
pub(crate) mod parameters;
pub mod plausible;
pub(crate) mod prepared;
mod problem;
pub mod proofs;
pub(crate) mod reference;
pub mod rollout;
pub(crate) mod standing;
pub(crate) mod three_motors;
mod time_series;
pub(crate) mod uncertainty;
pub(crate) mod weights;
pub(crate) mod world;
