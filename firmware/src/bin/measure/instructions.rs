//! Counts executed instructions under QEMU's `-icount shift=6`.
//!
//! Every instruction then takes 64 ns of virtual time and SysTick counts virtual time at 25 MHz
//! (40 ns per tick), so instructions = ticks * 40 / 64, to the tick at which the counting ends: less than
//! one instruction. Instructions are not cycles: a real core takes more of them for a division, a flash wait state or a missed branch.

use core::hint::black_box;
use cortex_m::peripheral::{SYST, syst::SystClkSource};

/// Of virtual time, in units of 8 ns.
const TICK: u32 = 40 / 8;
const INSTRUCTION: u32 = 64 / 8;
const RELOAD: u32 = 0x00ff_ffff;

/// Instruction counter on the 24-bit SysTick timer.
pub struct InstructionCounter {
    timer: SYST,
    empty_ticks: u32,
}

impl InstructionCounter {
    /// Starts the timer and measures what a measurement itself costs.
    pub fn new(mut timer: SYST) -> Self {
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(RELOAD);
        timer.clear_current();
        timer.enable_counter();
        let mut counter = Self {
            timer,
            empty_ticks: 0,
        };
        counter.empty_ticks = counter.ticks(|| ()).0.unwrap_or(0);
        counter
    }

    /// Instructions that `work` executes, and its result; `None` when the timer wrapped, that is
    /// beyond 10.4 million instructions.
    pub fn count<R>(&mut self, work: impl FnOnce() -> R) -> (Option<u32>, R) {
        let (ticks, result) = self.ticks(work);
        let instructions = ticks.map(|ticks| {
            let spent = ticks.saturating_sub(self.empty_ticks) * TICK;
            (spent + INSTRUCTION / 2) / INSTRUCTION
        });
        (instructions, result)
    }

    /// Counts loops of known length to less than a tick, and one that is too long to be counted.
    ///
    /// Compared with a loop of one round at the same place in the code: the few instructions that
    /// bring the argument in belong to the place.
    pub fn is_exact(&mut self) -> bool {
        let Some(one_round) = self.ticks_of_loop(1) else {
            return false;
        };
        let mut lengths = [2, 3, 10, 11, 12, 13, 1_000, 5_000_000].into_iter();
        lengths.all(|rounds| {
            let expected = one_round * TICK + 2 * (rounds - 1) * INSTRUCTION;
            let counted = self.ticks_of_loop(rounds);
            counted.is_some_and(|ticks| expected.abs_diff(ticks * TICK) < TICK)
        }) && self.ticks_of_loop(6_000_000).is_none()
    }

    #[inline(never)]
    fn ticks_of_loop(&mut self, rounds: u32) -> Option<u32> {
        self.ticks(|| loop_of(black_box(rounds))).0
    }

    #[inline(never)]
    fn ticks<R>(&mut self, work: impl FnOnce() -> R) -> (Option<u32>, R) {
        self.timer.clear_current();
        // The first tick after clearing reloads the counter; without it `start` may read 0.
        while SYST::get_current() == 0 {}
        // Reading the flag clears it.
        self.timer.has_wrapped();
        let start = SYST::get_current();
        // Opaque, so that work whose result is not used is done all the same.
        let result = black_box(work());
        let end = SYST::get_current();
        let ticks = start.wrapping_sub(end) & RELOAD;
        ((!self.timer.has_wrapped()).then_some(ticks), result)
    }
}

/// Two instructions per round, and nothing else.
#[inline(always)]
fn loop_of(rounds: u32) {
    // SAFETY: touches no memory, only the named register and the flags.
    unsafe {
        core::arch::asm!("2:", "subs {n}, {n}, #1", "bne 2b", n = inout(reg) rounds => _,
                         options(nomem, nostack));
    }
}
