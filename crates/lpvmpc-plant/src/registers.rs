//! Registers that are kept from one evaluation of a code to the next.

use lpvmpc::Number;
use std::cell::RefCell;
use std::sync::atomic::{AtomicU64, Ordering};

/// So many registers are kept: any `u8` is one of them, and need not be checked.
pub(crate) const FEW: usize = 256;

/// The name of numbers that are fixed for a code: no two have the same one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Name(u64);

impl Name {
    /// Of nothing.
    const NONE: Self = Self(0);

    /// One that nothing has yet.
    pub fn new() -> Self {
        static LAST: AtomicU64 = AtomicU64::new(0);
        Self(LAST.fetch_add(1, Ordering::Relaxed) + 1)
    }
}

/// Registers that are kept from one evaluation to the next: to clear them would take longer than many a code.
pub(crate) struct Registers<N> {
    pub numbers: [N; FEW],
    /// Whose fixed numbers are in the first ones.
    pub holds: Name,
}

impl<N: Number> Registers<N> {
    /// Registers that hold this number.
    pub const fn of(number: N) -> Self {
        Self {
            numbers: [number; FEW],
            holds: Name::NONE,
        }
    }
}

/// A kind of number with registers that are kept.
pub(crate) trait Kept: Number {
    /// Calls `run` with registers that hold anything.
    fn with(run: impl FnOnce(&mut Registers<Self>));
}

thread_local! {
    static FLOATS: RefCell<Registers<f64>> = const { RefCell::new(Registers::of(0.0)) };
}

impl Kept for f64 {
    #[inline(always)]
    fn with(run: impl FnOnce(&mut Registers<Self>)) {
        FLOATS.with_borrow_mut(run);
    }
}
