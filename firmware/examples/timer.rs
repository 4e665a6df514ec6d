//! A robot's main loop on a timer: the sensors every 12.5 ms, a decision every 50 ms. What the robot
//! has to offer is the trait `Board`; the one here is a stand-in.
//!
//! `.ci/firmware.sh` takes the flash of a whole robot's regulator from this image.
#![no_std]
#![no_main]

use ballbot::RobotState;
use core::hint::black_box;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicU32, Ordering};
use cortex_m::{Peripherals, peripheral::syst::SystClkSource, singleton};
use cortex_m_rt::{entry, exception};
use firmware::{RobotMemory, RobotRegulator, RobotSettings, recorded::WHOLE_ROBOT};
use lpvmpc::{Measurement, Regulator};
use nalgebra::Vector3;

/// The robot.
const ROBOT: RobotSettings = WHOLE_ROBOT.robot;
/// Core clock, Hz.
const CLOCK: u32 = 100_000_000;
/// Period of the sensors in core clocks: 12.5 ms, as in the robot's settings.
const PERIOD: u32 = CLOCK / 80;
/// After more decisions than this without a plan, one after the other, the robot stops.
const MOST_WITHOUT_PLAN: u32 = 2;

/// Periods that the timer has begun.
static BEGUN: AtomicU32 = AtomicU32::new(0);

/// What the program needs of the robot.
trait Board {
    /// Readings of both planes, along the floor's axes, and of the heading.
    fn measurement(&mut self) -> Measurement<f32, 10>;
    /// Where the robot has to be at a time on the clock of the measurements, s.
    fn reference(&self, t: f64) -> RobotState<f32>;
    /// Sets the torques of the three motors, N m, and feeds the watchdog.
    fn drive(&mut self, motors: &Vector3<f32>);
    /// Takes the power from the motors until a person starts again.
    fn stop(&mut self) -> !;
}

#[exception]
fn SysTick() {
    BEGUN.fetch_add(1, Ordering::Release);
}

fn run(board: &mut impl Board, regulator: &mut RobotRegulator, per_decision: u32) -> ! {
    let mut period = BEGUN.load(Ordering::Acquire);
    let (mut to_decision, mut without_plan) = (0, 0);
    loop {
        // Not `wfi`: a period that begins between the two would be slept through, `wfe` wakes up from the past, too.
        while BEGUN.load(Ordering::Acquire) == period {
            cortex_m::asm::wfe();
        }
        period = period.wrapping_add(1);
        regulator.observe(&board.measurement());
        let motors = if to_decision == 0 {
            to_decision = per_decision;
            let command = regulator.decide(&|t| board.reference(t));
            without_plan = match command.status.is_solved() {
                true => 0,
                false => without_plan + 1,
            };
            Some(command.u)
        } else {
            regulator.between()
        };
        to_decision -= 1;
        let late = BEGUN.load(Ordering::Acquire) != period;
        if late || without_plan > MOST_WITHOUT_PLAN {
            board.stop();
        }
        if let Some(motors) = motors {
            board.drive(&motors);
        }
    }
}

#[entry]
fn main() -> ! {
    let mut board = StandIn;
    let (Some(mut peripherals), Some(memory)) = (
        Peripherals::take(),
        singleton!(ROBOT_MEMORY: RobotMemory = RobotMemory::default()),
    ) else {
        board.stop()
    };
    let Ok(wheels) = ROBOT.plane.wheels() else {
        board.stop() // the wheels make no sense
    };
    let Ok(mut regulator) = ROBOT.regulator(wheels, memory) else {
        board.stop() // the settings make no sense
    };
    peripherals.SYST.set_clock_source(SystClkSource::Core);
    peripherals.SYST.set_reload(PERIOD - 1);
    peripherals.SYST.clear_current();
    peripherals.SYST.enable_interrupt();
    peripherals.SYST.enable_counter();
    run(&mut board, &mut regulator, ROBOT.per_sample() as u32)
}

/// No robot at all; opaque to the compiler, so that nothing is left out.
struct StandIn;

impl Board for StandIn {
    fn measurement(&mut self) -> Measurement<f32, 10> {
        black_box(Measurement {
            t: 0.0,
            readings: [None; 10],
        })
    }

    fn reference(&self, _t: f64) -> RobotState<f32> {
        black_box(RobotState::zeros())
    }

    fn drive(&mut self, motors: &Vector3<f32>) {
        black_box(motors);
    }

    fn stop(&mut self) -> ! {
        loop {
            cortex_m::asm::wfi();
        }
    }
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    StandIn.stop()
}
