//! Counts executed instructions under QEMU's `-icount shift=6`.
//!
//! Every instruction then takes 64 ns of virtual time and SysTick counts virtual time at 25 MHz
//! (40 ns per tick), so instructions = ticks * 40 / 64, to the instruction. Instructions are not
//! cycles: a real core takes more of them for a division, a flash wait state or a missed branch.

use core::hint::black_box;
use cortex_m::peripheral::{SYST, syst::SystClkSource};

const NANOSECONDS_PER_TICK: u32 = 40;
const NANOSECONDS_PER_INSTRUCTION: u32 = 64;
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
        let (empty_ticks, ()) = counter.ticks(|| ());
        counter.empty_ticks = empty_ticks;
        counter
    }

    /// Instructions that `work` executes, and its result; `None` when the timer wrapped, that is
    /// beyond 10.4 million instructions.
    pub fn count<R>(&mut self, work: impl FnOnce() -> R) -> (Option<u32>, R) {
        let (ticks, result) = self.ticks(work);
        let wrapped = self.timer.has_wrapped();
        let spent = ticks.saturating_sub(self.empty_ticks) * (NANOSECONDS_PER_TICK / 8);
        let per_instruction = NANOSECONDS_PER_INSTRUCTION / 8;
        // Rounded, because a tick boundary may fall inside the first or the last instruction.
        let instructions = (spent + per_instruction / 2) / per_instruction;
        ((!wrapped).then_some(instructions), result)
    }

    /// Counts loops of known length, and one that is too long to be counted.
    ///
    /// Compared with a loop of one round at the same place in the code: the few instructions that
    /// bring the argument in belong to the place.
    pub fn is_exact(&mut self) -> bool {
        let Some(one_round) = self.count_loop(1) else {
            return false;
        };
        [2, 3, 10, 11, 12, 13, 1_000, 5_000_000]
            .iter()
            .all(|rounds| self.count_loop(*rounds) == Some(one_round + 2 * (rounds - 1)))
            && self.count_loop(6_000_000).is_none()
    }

    #[inline(never)]
    fn count_loop(&mut self, rounds: u32) -> Option<u32> {
        self.count(|| loop_of(black_box(rounds))).0
    }

    #[inline(never)]
    fn ticks<R>(&mut self, work: impl FnOnce() -> R) -> (u32, R) {
        self.timer.clear_current();
        // The first tick after clearing reloads the counter; without it `start` may read 0.
        while SYST::get_current() == 0 {}
        // Reading the flag clears it.
        self.timer.has_wrapped();
        let start = SYST::get_current();
        // Opaque, so that work whose result is not used is done all the same.
        let result = black_box(work());
        let end = SYST::get_current();
        (start.wrapping_sub(end) & RELOAD, result)
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
