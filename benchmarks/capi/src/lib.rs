//! The solver of `lpvmpc` behind a C interface (`include/lpvmpc.h`), for the sizes that are compared with
//! other solvers. What each function does is said in the header.
//!
//! A problem and a solver are apart: one solver, with its memory and its last answer, serves any number of
//! problems of its size.
//!
//! Unsafe code is confined to this crate, and in it to [`boundary`] and the exported functions: these get
//! pointers from C. Nothing is unsafe in between. A panic does not cross the boundary.

mod any;
mod boundary;
mod problem;
mod solver;

pub use problem::{EndPointers, StagePointers};
