//! Measures how deep a call goes into the stack: paint the free stack, call, find the lowest
//! painted word that was overwritten.

use core::hint::black_box;
use core::ptr::{read_volatile, write_volatile};

const PAINT: u32 = 0xdead_beef;

unsafe extern "C" {
    // The ends of the stack region, from memory.x: lowest address and one past the highest.
    static mut _stack_end: u32;
    static mut _stack_start: u32;
}

/// Bytes of stack that a call of `work` uses. A frame that stays below its own stack pointer
/// untouched (a large array never written) is not seen.
#[inline(never)]
pub fn depth(work: &mut dyn FnMut()) -> u32 {
    let top = cortex_m::register::msp::read();
    paint(top);
    // Opaque, so that the work is called and not inlined into this frame.
    black_box(work)();
    top - lowest_used()
}

/// Inlined: a frame of its own would lie in what it paints.
#[inline(always)]
fn paint(top: u32) {
    let mut word = &raw mut _stack_end;
    while (word as u32) < top {
        // SAFETY: `word` lies in the stack region, below every live frame.
        unsafe {
            write_volatile(word, PAINT);
            word = word.add(1);
        }
    }
}

#[inline(always)]
fn lowest_used() -> u32 {
    let mut word = &raw const _stack_end;
    let end = &raw const _stack_start;
    // SAFETY: `word` lies in the stack region, which is readable memory.
    while word < end && unsafe { read_volatile(word) } == PAINT {
        word = word.wrapping_add(1);
    }
    word as u32
}
