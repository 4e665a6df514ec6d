//! The library as C sees it: answers are those of the Rust interface, mistakes are codes.
#![allow(
    clippy::undocumented_unsafe_blocks,
    reason = "every pointer here is null or of a variable beside the call"
)]

use lpvmpc::{Ocp, Solution, Solver, SolverSettings};
// Its functions are found by the linker.
use lpvmpc_c as _;
use lpvmpc_problems::layout;
use lpvmpc_sequences::{Kind, Recipe, working_memory};
use std::error::Error;
use std::ffi::{c_int, c_void};
use std::ptr::{null, null_mut};

type Handle = *mut c_void;

unsafe extern "C" {
    fn lpvmpc_problem_new(
        nx: c_int,
        nu: c_int,
        n: c_int,
        rows: c_int,
        common: c_int,
        out: *mut Handle,
    ) -> c_int;
    fn lpvmpc_problem_set_all(problem: Handle, all: *const f64, count: usize) -> c_int;
    fn lpvmpc_problem_set_x0(problem: Handle, x0: *const f64) -> c_int;
    fn lpvmpc_problem_set_stage(
        problem: Handle,
        number: c_int,
        stage: *const [*const f64; 20],
    ) -> c_int;
    fn lpvmpc_problem_free(problem: Handle);
    fn lpvmpc_solver_new(like: Handle, out: *mut Handle) -> c_int;
    fn lpvmpc_solver_free(solver: Handle);
    fn lpvmpc_solve(solver: Handle, problem: Handle, start: c_int) -> c_int;
    fn lpvmpc_status(solver: Handle, out: *mut c_int) -> c_int;
    fn lpvmpc_inputs(solver: Handle, u: *mut f64, count: usize) -> c_int;
    fn lpvmpc_kkt_residual(solver: Handle, problem: Handle, out: *mut f64) -> c_int;
}

const OK: c_int = 0;
const NULL: c_int = -1;
const SIZE: c_int = -2;

fn new(nx: c_int, nu: c_int, horizon: c_int) -> (c_int, Handle) {
    let mut problem = null_mut();
    let code = unsafe { lpvmpc_problem_new(nx, nu, horizon, 0, 1, &mut problem) };
    (code, problem)
}

/// What C gets for a sequence, next to what Rust gets.
fn same_answers<const NX: usize, const NU: usize>(kind: Kind) -> Result<(), Box<dyn Error>> {
    let recipe = Recipe {
        kind,
        horizon: 8,
        samples: 4,
        share: 0.4,
        seed: 3,
    };
    let problems: Vec<Ocp<f64, NX, NU>> = recipe.make()?.problems;
    let room = working_memory(&problems);
    let (mut solver, mut solution) = (Solver::allocate(room), Solution::allocate(room));
    let mut of_c: Handle = null_mut();
    for ocp in &problems {
        solver.solve(ocp, &SolverSettings::default(), &mut solution);
        let mut numbers = Vec::new();
        layout::write(ocp, &mut numbers)?;
        let size = |number: usize| number as c_int;
        let (mut problem, mut status, mut residual) = (null_mut(), -1, f64::NAN);
        let mut u = vec![f64::NAN; 8 * NU];
        unsafe {
            let rows = size(ocp.rows_per_stage);
            assert_eq!(
                lpvmpc_problem_new(size(NX), size(NU), 8, rows, 1, &mut problem),
                OK
            );
            assert_eq!(
                lpvmpc_problem_set_all(problem, numbers.as_ptr(), numbers.len()),
                OK
            );
            if of_c.is_null() {
                assert_eq!(lpvmpc_solver_new(problem, &mut of_c), OK);
            }
            assert_eq!(lpvmpc_solve(of_c, problem, 2), OK);
            assert_eq!(lpvmpc_status(of_c, &mut status), OK);
            assert_eq!(lpvmpc_inputs(of_c, u.as_mut_ptr(), u.len()), OK);
            assert_eq!(lpvmpc_kkt_residual(of_c, problem, &mut residual), OK);
            lpvmpc_problem_free(problem);
        }
        let expected: Vec<f64> = solution.u.iter().flatten().copied().collect();
        assert_eq!(status, 0);
        // The same code twice; which of its operations the compiler fuses is the same, too.
        assert_eq!(u, expected);
        assert!(residual < 1e-10, "{residual}");
    }
    unsafe { lpvmpc_solver_free(of_c) };
    Ok(())
}

#[test]
fn answers_are_those_of_the_rust_interface() -> Result<(), Box<dyn Error>> {
    for kind in Kind::ALL {
        same_answers::<4, 1>(kind)?;
        same_answers::<8, 2>(kind)?;
        same_answers::<12, 4>(kind)?;
        same_answers::<16, 6>(kind)?;
    }
    Ok(())
}

#[test]
fn null_pointers_are_refused() {
    let (code, problem) = new(4, 1, 5);
    assert_eq!(code, OK);
    unsafe {
        assert_eq!(lpvmpc_problem_new(4, 1, 5, 0, 1, null_mut()), NULL);
        assert_eq!(lpvmpc_problem_set_x0(problem, null()), NULL);
        assert_eq!(lpvmpc_problem_set_x0(null_mut(), [0.0; 4].as_ptr()), NULL);
        assert_eq!(lpvmpc_solve(null_mut(), problem, 0), NULL);
        assert_eq!(lpvmpc_solver_new(null_mut(), &mut null_mut()), NULL);
        // Nothing to free is not a mistake.
        lpvmpc_problem_free(null_mut());
        lpvmpc_solver_free(null_mut());
        lpvmpc_problem_free(problem);
    }
}

#[test]
fn sizes_that_there_are_not_are_refused() {
    for (nx, nu, horizon) in [(5, 1, 5), (4, 2, 5), (-4, 1, 5), (4, 1, 0), (4, 1, 65_536)] {
        assert_eq!(new(nx, nu, horizon).0, SIZE, "{nx} x {nu}, N = {horizon}");
    }
    let ((_, small), (_, large)) = (new(4, 1, 5), new(8, 2, 5));
    let mut solver = null_mut();
    let numbers = [0.0; 8];
    unsafe {
        assert_eq!(lpvmpc_solver_new(small, &mut solver), OK);
        assert_eq!(lpvmpc_solve(solver, large, 0), SIZE);
        assert_eq!(lpvmpc_solve(solver, small, 3), SIZE);
        assert_eq!(lpvmpc_problem_set_all(small, numbers.as_ptr(), 8), SIZE);
        assert_eq!(lpvmpc_problem_set_stage(small, 5, &[null(); 20]), SIZE);
        assert_eq!(lpvmpc_solve(solver, small, 0), OK);
        assert_eq!(lpvmpc_inputs(solver, [0.0; 4].as_mut_ptr(), 4), SIZE);
        lpvmpc_solver_free(solver);
        lpvmpc_problem_free(small);
        lpvmpc_problem_free(large);
    }
}

/// A problem that is longer than its solver's memory is an answer, not a crash.
#[test]
fn a_horizon_that_is_too_long_is_a_status() {
    let ((_, short), (_, long)) = (new(4, 1, 5), new(4, 1, 6));
    let (mut solver, mut status) = (null_mut(), -1);
    unsafe {
        assert_eq!(lpvmpc_solver_new(short, &mut solver), OK);
        assert_eq!(lpvmpc_solve(solver, long, 0), OK);
        assert_eq!(lpvmpc_status(solver, &mut status), OK);
        assert_eq!(status, 5);
        lpvmpc_solver_free(solver);
        lpvmpc_problem_free(short);
        lpvmpc_problem_free(long);
    }
}
