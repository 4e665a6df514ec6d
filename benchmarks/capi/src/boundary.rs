//! Between C's pointers and references: null pointers and panics become codes.

use lpvmpc_problems::ProblemError;
use std::ffi::c_int;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Why a call has done nothing. The numbers are those of the header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum Refusal {
    /// A pointer that must not be null is.
    Null = -1,
    /// A size, stage or choice that there is not, or things of different sizes.
    Size = -2,
    /// A file that cannot be read.
    File = -3,
    /// A defect of the library.
    Panic = -4,
}

impl From<ProblemError> for Refusal {
    fn from(error: ProblemError) -> Self {
        match error {
            ProblemError::Size { .. } | ProblemError::Length { .. } => Self::Size,
            ProblemError::Io(_) | ProblemError::Header(_) | ProblemError::NotInFormat(_) => {
                Self::File
            }
        }
    }
}

/// Runs `body`; 0 where it succeeds.
pub fn guarded(body: impl FnOnce() -> Result<(), Refusal>) -> c_int {
    // After a panic the caller can only free what it has, so a broken invariant is never met.
    match catch_unwind(AssertUnwindSafe(body)) {
        Ok(Ok(())) => 0,
        Ok(Err(refusal)) => refusal as c_int,
        Err(_) => Refusal::Panic as c_int,
    }
}

/// What a pointer points at.
///
/// # Safety
/// Null, or valid for reads for as long as the result is used.
pub unsafe fn shared<'a, T>(pointer: *const T) -> Result<&'a T, Refusal> {
    // SAFETY: as this function demands.
    unsafe { pointer.as_ref() }.ok_or(Refusal::Null)
}

/// What a pointer points at, to be changed.
///
/// # Safety
/// Null, or valid for reads and writes, by nobody else, for as long as the result is used.
pub unsafe fn exclusive<'a, T>(pointer: *mut T) -> Result<&'a mut T, Refusal> {
    // SAFETY: as this function demands.
    unsafe { pointer.as_mut() }.ok_or(Refusal::Null)
}

/// `length` numbers; `None` for null.
///
/// # Safety
/// Null, or valid for reads of `length` numbers for as long as the result is used.
pub unsafe fn numbers<'a>(pointer: *const f64, length: usize) -> Option<&'a [f64]> {
    // SAFETY: not null, and as this function demands.
    (!pointer.is_null()).then(|| unsafe { std::slice::from_raw_parts(pointer, length) })
}

/// Copies `source` to where `pointer` points, which must have exactly as many places.
///
/// # Safety
/// Null, or valid for writes of `places` numbers.
pub unsafe fn copy_out(
    source: impl ExactSizeIterator<Item = f64>,
    pointer: *mut f64,
    places: usize,
) -> Result<(), Refusal> {
    if pointer.is_null() {
        return Err(Refusal::Null);
    }
    if source.len() != places {
        return Err(Refusal::Size);
    }
    for (place, number) in source.enumerate() {
        // SAFETY: not null, below `places`, and as this function demands.
        unsafe { pointer.add(place).write(number) };
    }
    Ok(())
}

/// Moves `value` to the heap, and its address to where `out` points.
///
/// # Safety
/// Null, or valid for a write.
pub unsafe fn hand_out<T>(value: T, out: *mut *mut T) -> Result<(), Refusal> {
    if out.is_null() {
        return Err(Refusal::Null);
    }
    // SAFETY: not null, and as this function demands.
    unsafe { out.write(Box::into_raw(Box::new(value))) };
    Ok(())
}

/// Frees what [`hand_out`] has given; null is nothing.
///
/// # Safety
/// Null, or an address from `hand_out` that is not used any more.
pub unsafe fn take_back<T>(pointer: *mut T) {
    if !pointer.is_null() {
        // SAFETY: not null, and as this function demands.
        drop(unsafe { Box::from_raw(pointer) });
    }
}
