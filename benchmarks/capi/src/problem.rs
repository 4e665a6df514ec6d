//! The functions of a problem.

use crate::any::AnyProblem;
use crate::boundary::{Refusal, exclusive, guarded, hand_out, numbers, shared, take_back};
use lpvmpc_problems::file;
use lpvmpc_problems::layout::{END_PARTS, STAGE_PARTS, Sizes};
use std::ffi::{CStr, c_char, c_int};
use std::path::Path;

/// `lpvmpc_stage` of the header: what there is of a stage.
#[repr(C)]
#[derive(Debug)]
pub struct StagePointers {
    /// The parts in the order of [`lpvmpc_problems::layout`]; null leaves what there is.
    pub parts: [*const f64; STAGE_PARTS],
}

/// `lpvmpc_end` of the header: what there is of the end of the horizon.
#[repr(C)]
#[derive(Debug)]
pub struct EndPointers {
    /// The parts in the order of [`lpvmpc_problems::layout`]; null leaves what there is.
    pub parts: [*const f64; END_PARTS],
}

/// # Safety
/// `out` is null or valid for a write.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lpvmpc_problem_new(
    nx: c_int,
    nu: c_int,
    horizon: c_int,
    rows: c_int,
    common: c_int,
    out: *mut *mut AnyProblem,
) -> c_int {
    guarded(|| {
        let size = |number: c_int| usize::try_from(number).map_err(|_| Refusal::Size);
        let sizes = Sizes {
            nx: size(nx)?,
            nu: size(nu)?,
            horizon: size(horizon)?,
            rows: size(rows)?,
        };
        // A component of a row's name has one byte.
        if sizes.rows > usize::from(u8::MAX) {
            return Err(Refusal::Size);
        }
        let problem = AnyProblem::new(&sizes, common != 0)?;
        // SAFETY: as this function demands.
        unsafe { hand_out(problem, out) }
    })
}

/// # Safety
/// `path` is null or a string that ends with a zero; `out` is null or valid for a write.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lpvmpc_problem_read(
    path: *const c_char,
    number: c_int,
    out: *mut *mut AnyProblem,
) -> c_int {
    guarded(|| {
        // SAFETY: as this function demands.
        let first = unsafe { shared(path) }?;
        // SAFETY: not null, and as this function demands.
        let path = unsafe { CStr::from_ptr(first) };
        let path = Path::new(path.to_str().map_err(|_| Refusal::File)?);
        let number = usize::try_from(number).map_err(|_| Refusal::Size)?;
        let (header, numbers) = file::numbers(path, number)?;
        let mut problem = AnyProblem::new(&header.sizes, header.common)?;
        problem.set_all(&numbers)?;
        // SAFETY: as this function demands.
        unsafe { hand_out(problem, out) }
    })
}

/// # Safety
/// `problem` is null or was handed out by a function above, and is not used any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lpvmpc_problem_free(problem: *mut AnyProblem) {
    // SAFETY: as this function demands.
    unsafe { take_back(problem) }
}

/// # Safety
/// `problem` is null or handed out and not freed; `x0` is null or has NX numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lpvmpc_problem_set_x0(problem: *mut AnyProblem, x0: *const f64) -> c_int {
    guarded(|| {
        // SAFETY: as this function demands.
        let problem = unsafe { exclusive(problem) }?;
        // SAFETY: as this function demands.
        let x0 = unsafe { numbers(x0, problem.sizes().nx) };
        problem.set_x0(x0.ok_or(Refusal::Null)?);
        Ok(())
    })
}

/// # Safety
/// `problem` is null or handed out and not freed; each pointer of `stage` is null or has the numbers of
/// its part.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lpvmpc_problem_set_stage(
    problem: *mut AnyProblem,
    number: c_int,
    stage: *const StagePointers,
) -> c_int {
    guarded(|| {
        // SAFETY: as this function demands.
        let (problem, stage) = unsafe { (exclusive(problem)?, shared(stage)?) };
        let lengths = problem.sizes().of_stage();
        let number = usize::try_from(number).map_err(|_| Refusal::Size)?;
        let parts = std::array::from_fn(|part| {
            // SAFETY: as this function demands.
            unsafe { numbers(stage.parts[part], lengths[part]) }
        });
        Ok(problem.set_stage(number, &parts)?)
    })
}

/// # Safety
/// `problem` is null or handed out and not freed; each pointer of `end` is null or has the numbers of its
/// part.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lpvmpc_problem_set_end(
    problem: *mut AnyProblem,
    end: *const EndPointers,
) -> c_int {
    guarded(|| {
        // SAFETY: as this function demands.
        let (problem, end) = unsafe { (exclusive(problem)?, shared(end)?) };
        let lengths = problem.sizes().of_end();
        let parts = std::array::from_fn(|part| {
            // SAFETY: as this function demands.
            unsafe { numbers(end.parts[part], lengths[part]) }
        });
        Ok(problem.set_end(&parts)?)
    })
}

/// # Safety
/// `problem` is null or handed out and not freed; `all` is null or has `count` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn lpvmpc_problem_set_all(
    problem: *mut AnyProblem,
    all: *const f64,
    count: usize,
) -> c_int {
    guarded(|| {
        // SAFETY: as this function demands.
        let (problem, all) = unsafe { (exclusive(problem)?, numbers(all, count)) };
        Ok(problem.set_all(all.ok_or(Refusal::Null)?)?)
    })
}
