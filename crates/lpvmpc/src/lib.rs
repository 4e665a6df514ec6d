//! Model predictive control for linear parameter-varying (LPV) models.
#![no_std]

mod model;

pub use model::{LpvModel, Scalar};
