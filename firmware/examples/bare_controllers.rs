//! Bare controllers on a timer, both planes every 50 ms, for a robot that knows its state and does
//! everything else itself. What the robot has to offer is the trait `Board`; the one here is a
//! stand-in. The whole regulator is in `timer.rs`.
//!
//! `.ci/firmware.sh` takes the flash of the controllers from this image.
#![no_std]
#![no_main]

use ballbot::Wheels;
use core::hint::black_box;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicU32, Ordering};
use cortex_m::{Peripherals, peripheral::syst::SystClkSource, singleton};
use cortex_m_rt::{entry, exception};
use firmware::{
    Controller, ControllerMemory, N, Window, Workspace, WorkspaceMemory,
    recorded::LISSAJOUS as ROBOT,
};
use nalgebra::{Vector3, Vector4};

/// Core clock, Hz.
const CLOCK: u32 = 100_000_000;
/// Sampling time in core clocks: 50 ms, as in the controller's settings.
const SAMPLE: u32 = CLOCK / 20;
/// After more samples than this without a plan, one after the other, the robot stops.
const MOST_WITHOUT_PLAN: u32 = 2;

/// Samples that the timer has begun.
static BEGUN: AtomicU32 = AtomicU32::new(0);

/// What the program needs of the robot.
trait Board {
    /// State (phi, theta, phi_dot, theta_dot) of the x and the y plane, rad and rad/s.
    fn states(&mut self) -> [Vector4<f32>; 2];
    /// References of the two planes over the horizon that begins now.
    fn references(&mut self) -> [Window; 2];
    /// Sets the torques of the three motors, N m, and feeds the watchdog.
    fn drive(&mut self, motors: &Vector3<f32>);
    /// Takes the power from the motors until a person starts again.
    fn stop(&mut self) -> !;
}

#[exception]
fn SysTick() {
    BEGUN.fetch_add(1, Ordering::Release);
}

fn run(
    board: &mut impl Board,
    planes: &mut [Controller; 2],
    workspace: &mut Workspace,
    wheels: &Wheels<f32>,
) -> ! {
    let mut sample = BEGUN.load(Ordering::Acquire);
    let mut without_plan = 0;
    loop {
        // Not `wfi`: a period that begins between the two would be slept through, `wfe` wakes up from the past, too.
        while BEGUN.load(Ordering::Acquire) == sample {
            cortex_m::asm::wfe();
        }
        sample = sample.wrapping_add(1);
        let mut torques = Vector3::zeros();
        let mut solved = true;
        let inputs = board.states().into_iter().zip(board.references());
        for ((torque, (x, window)), plane) in torques.iter_mut().zip(inputs).zip(&mut *planes) {
            let plan = plane.step(&x, &window.reference(), workspace);
            *torque = plan.first_input()[0];
            solved &= plan.status.is_solved();
        }
        without_plan = if solved { 0 } else { without_plan + 1 };
        let late = BEGUN.load(Ordering::Acquire) != sample;
        if late || without_plan > MOST_WITHOUT_PLAN {
            board.stop();
        }
        board.drive(&wheels.motors(&torques));
    }
}

#[entry]
fn main() -> ! {
    let mut board = StandIn;
    let (Some(mut peripherals), Some(memory), Some([x, y])) = (
        Peripherals::take(),
        singleton!(WORKSPACE: WorkspaceMemory = WorkspaceMemory::default()),
        singleton!(PLANES: [ControllerMemory; 2] = [ControllerMemory::default(); 2]),
    ) else {
        board.stop()
    };
    let (Some(x), Some(y), Ok(wheels)) = (controller(x), controller(y), ROBOT.wheels()) else {
        board.stop() // the settings make no sense
    };
    let workspace = &mut Workspace::new(memory.lend());
    peripherals.SYST.set_clock_source(SystClkSource::Core);
    peripherals.SYST.set_reload(SAMPLE - 1);
    peripherals.SYST.clear_current();
    peripherals.SYST.enable_interrupt();
    peripherals.SYST.enable_counter();
    run(&mut board, &mut [x, y], workspace, &wheels)
}

fn controller(memory: &'static mut ControllerMemory) -> Option<Controller> {
    Controller::new(ROBOT.ballbot, ROBOT.settings(), memory.lend()).ok()
}

/// No robot at all; opaque to the compiler, so that nothing is left out.
struct StandIn;

impl Board for StandIn {
    fn states(&mut self) -> [Vector4<f32>; 2] {
        black_box([Vector4::zeros(); 2])
    }

    fn references(&mut self) -> [Window; 2] {
        let rest = Window {
            stages: [Vector4::zeros(); N],
            terminal: Vector4::zeros(),
        };
        black_box([rest; 2])
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
