//! The functions of a solver.

use crate::any::{AnyProblem, AnySolver, BySize, Memory, each_size, same_size, status_number};
use crate::boundary::{Refusal, copy_out, exclusive, guarded, hand_out, shared, take_back};
use lpvmpc::WarmStart;
use std::ffi::c_int;

/// # Safety
/// `like` is null or a problem that was handed out and not freed; `out` is null or valid for a write.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lpvmpc_solver_new(
    like: *const AnyProblem,
    out: *mut *mut AnySolver,
) -> c_int {
    guarded(|| {
        // SAFETY: as this function demands.
        let solver = match unsafe { shared(like) }? {
            BySize::S4x1(ocp) => BySize::S4x1(Memory::for_problem(ocp)),
            BySize::S8x2(ocp) => BySize::S8x2(Memory::for_problem(ocp)),
            BySize::S12x4(ocp) => BySize::S12x4(Memory::for_problem(ocp)),
            BySize::S16x6(ocp) => BySize::S16x6(Memory::for_problem(ocp)),
        };
        // SAFETY: as this function demands.
        unsafe { hand_out(solver, out) }
    })
}

/// # Safety
/// `solver` is null or was handed out by the function above, and is not used any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lpvmpc_solver_free(solver: *mut AnySolver) {
    // SAFETY: as this function demands.
    unsafe { take_back(solver) }
}

/// # Safety
/// `solver` and `problem` are null or handed out and not freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lpvmpc_solve(
    solver: *mut AnySolver,
    problem: *const AnyProblem,
    start: c_int,
) -> c_int {
    guarded(|| {
        let start = match start {
            0 => WarmStart::Cold,
            1 => WarmStart::Same,
            2 => WarmStart::Shifted,
            _ => return Err(Refusal::Size),
        };
        // SAFETY: as this function demands.
        let (solver, problem) = unsafe { (exclusive(solver)?, shared(problem)?) };
        same_size!(solver, problem, (memory, ocp) => memory.solve(ocp, start))
    })
}

/// # Safety
/// `solver` is null or handed out and not freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lpvmpc_forget(solver: *mut AnySolver) -> c_int {
    guarded(|| {
        // SAFETY: as this function demands.
        let solver = unsafe { exclusive(solver) }?;
        each_size!(solver, memory => memory.solution.active.clear());
        Ok(())
    })
}

/// # Safety
/// `solver` is null or handed out and not freed; `out` is null or valid for a write.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lpvmpc_status(solver: *const AnySolver, out: *mut c_int) -> c_int {
    guarded(|| {
        // SAFETY: as this function demands.
        let (solver, out) = unsafe { (shared(solver)?, exclusive(out)?) };
        *out = each_size!(solver, memory => status_number(&memory.solution.status));
        Ok(())
    })
}

/// # Safety
/// `solver` is null or handed out and not freed; `u` is null or has `count` places.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lpvmpc_inputs(
    solver: *const AnySolver,
    u: *mut f64,
    count: usize,
) -> c_int {
    guarded(|| {
        // SAFETY: as this function demands.
        let solver = unsafe { shared(solver) }?;
        each_size!(solver, memory => {
            let list = memory.solution.u.get(..memory.stages).unwrap_or_default();
            let numbers: Vec<f64> = list.iter().flatten().copied().collect();
            // SAFETY: as this function demands.
            unsafe { copy_out(numbers.into_iter(), u, count) }
        })
    })
}

/// # Safety
/// `solver` is null or handed out and not freed; `x` is null or has `count` places.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lpvmpc_states(
    solver: *const AnySolver,
    x: *mut f64,
    count: usize,
) -> c_int {
    guarded(|| {
        // SAFETY: as this function demands.
        let solver = unsafe { shared(solver) }?;
        each_size!(solver, memory => {
            let list = memory.solution.x.get(..memory.stages).unwrap_or_default();
            let numbers: Vec<f64> = list.iter().flatten().copied().collect();
            // SAFETY: as this function demands.
            unsafe { copy_out(numbers.into_iter(), x, count) }
        })
    })
}

/// # Safety
/// `solver` is null or handed out and not freed; `out` is null or valid for a write.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lpvmpc_cost(solver: *const AnySolver, out: *mut f64) -> c_int {
    guarded(|| {
        // SAFETY: as this function demands.
        let (solver, out) = unsafe { (shared(solver)?, exclusive(out)?) };
        *out = each_size!(solver, memory => memory.solution.cost);
        Ok(())
    })
}

/// # Safety
/// `solver` is null or handed out and not freed; `active` and `changes` are null or valid for a write.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lpvmpc_active(
    solver: *const AnySolver,
    active: *mut c_int,
    changes: *mut c_int,
) -> c_int {
    guarded(|| {
        // SAFETY: as this function demands.
        let solver = unsafe { shared(solver) }?;
        let number = |count: usize| c_int::try_from(count).map_err(|_| Refusal::Size);
        let (rows, spent) = each_size!(solver, memory => {
            (number(memory.solution.active.len())?, number(memory.solution.changes)?)
        });
        // SAFETY: as this function demands.
        unsafe {
            *exclusive(active)? = rows;
            *exclusive(changes)? = spent;
        }
        Ok(())
    })
}

/// # Safety
/// `solver` and `problem` are null or handed out and not freed; `out` is null or valid for a write.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lpvmpc_kkt_residual(
    solver: *const AnySolver,
    problem: *const AnyProblem,
    out: *mut f64,
) -> c_int {
    guarded(|| {
        // SAFETY: as this function demands.
        let (solver, problem, out) =
            unsafe { (shared(solver)?, shared(problem)?, exclusive(out)?) };
        *out = same_size!(solver, problem, (memory, ocp) => memory.residual(ocp))?;
        Ok(())
    })
}

/// Does nothing, so that the time of a call can be taken.
#[unsafe(no_mangle)]
pub extern "C" fn lpvmpc_nothing() -> c_int {
    guarded(|| Ok(()))
}
