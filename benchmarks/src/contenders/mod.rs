//! The solvers that are compared. What each of them is given is made beforehand, in its own form.

mod clarabel;
mod osqp;
mod own;
mod quadprogpp;

pub use clarabel::{ClarabelSolve, ClarabelUpdate};
pub use osqp::Osqp;
pub use own::Own;
pub use quadprogpp::QuadProgPp;
