//! What a step answers, as Python's `lpvmpc.Plan` takes it.

use crate::arrays::to_numpy;
use lpvmpc::Status;
use lpvmpc_any::Plan;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;

/// The word for a status in programs.
fn word(status: &Status<f64>) -> &'static str {
    match status {
        Status::Solved => "solved",
        Status::Converged => "converged",
        Status::Improved => "improved",
        Status::NoImprovement => "no improvement",
        Status::Infeasible(_) => "infeasible",
        Status::Exceeded(_) => "exceeded",
        Status::Inaccurate(_) => "inaccurate",
        Status::MaxChanges => "max changes",
        Status::WorkingSetFull | Status::HorizonTooLong => "no memory",
        Status::NumericalFailure { .. } => "numerical failure",
        Status::NotFinite => "not finite",
        Status::Refused(_) => "refused",
    }
}

/// Stage, bound in words, multiplier, whether it is exceeded.
type Active = (usize, String, f64, bool);

/// u, x, status, message, whether it is solved, cost, programs, active bounds and they in words, what it is backed by, and
/// state and input of the steady state that it heads for.
pub type PlanTuple<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    &'static str,
    String,
    bool,
    f64,
    usize,
    Vec<Active>,
    String,
    Option<String>,
    Option<Bound<'py, PyArray1<f64>>>,
    Option<Bound<'py, PyArray1<f64>>>,
);

/// The fields of a plan.
pub fn fields<'py>(py: Python<'py>, plan: Plan) -> PlanTuple<'py> {
    let in_words = plan.active_bounds();
    let is_solved = plan.is_solved();
    let active = plan.active.into_iter();
    let (x_target, u_target) = plan.target.map(|target| (target.x, target.u)).unzip();
    (
        to_numpy(py, &plan.u),
        to_numpy(py, &plan.x),
        word(&plan.kind),
        plan.status,
        is_solved,
        plan.cost,
        plan.problems,
        active
            .map(|one| (one.stage, one.bound, one.multiplier, one.exceeded))
            .collect(),
        in_words,
        plan.decision.map(|decision| decision.to_string()),
        x_target.map(|x| PyArray1::from_vec(py, x)),
        u_target.map(|u| PyArray1::from_vec(py, u)),
    )
}
