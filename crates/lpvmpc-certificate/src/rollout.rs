//! How far a rollout by Runge-Kutta steps is from the plant: claims, and their proof.

mod claim;
mod deviation;
mod rays;
mod sample;

pub use claim::{RolloutClaim, RolloutError, RolloutProof};
pub use sample::EnclosedSample;
