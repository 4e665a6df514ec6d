//! The solver against its optimality conditions, other solvers and exact relations.

mod support;

mod campaign;
mod changes;
mod fuzz;
mod last_bounds;
mod many_bounds;
mod memory;
mod motion_limits;
mod optimality;
mod regressions;
mod relations;
mod scales;
mod single_precision;
mod verdicts;
mod warm_starts;
