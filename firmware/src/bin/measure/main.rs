//! Steps the controllers on recorded states and prints torques and what they cost: instructions,
//! stack, RAM. `firmware_check`, an example of `ballbot-scenario`, reads the output.
#![no_std]
#![no_main]

mod failure;
mod instructions;
mod stack;

use ballbot::Wheels;
use cortex_m::singleton;
use cortex_m_rt::entry;
use cortex_m_semihosting::{debug, hprintln};
use firmware::{Controller, Recording, Workspace, recorded};
use instructions::InstructionCounter;
use lpvmpc::ControllerSettings;
use nalgebra::{Vector3, Vector4};

type Planes = [Option<Controller>; 2];

#[entry]
fn main() -> ! {
    let (Some(peripherals), Some(workspace), Some(planes)) = (
        cortex_m::Peripherals::take(),
        singleton!(WORKSPACE: Workspace = Workspace::new()),
        singleton!(PLANES: Planes = [None, None]),
    ) else {
        failure::stop()
    };
    let mut counter = InstructionCounter::new(peripherals.SYST);
    if !counter.is_exact() {
        hprintln!("the instruction counter is not exact: is this QEMU with -icount shift=6?");
        failure::stop();
    }
    hprintln!("bytes controller {}", size_of::<Controller>());
    hprintln!("bytes workspace {}", size_of::<Workspace>());
    let mut deepest = 0;
    for recording in [&recorded::LISSAJOUS, &recorded::TIGHT_BOUNDS] {
        set_up(recording, planes);
        deepest = deepest.max(replay(recording, planes, workspace, &mut counter));
    }
    deepest = deepest.max(descend(
        &recorded::LISSAJOUS,
        planes,
        workspace,
        &mut counter,
    ));
    hprintln!("bytes stack {deepest}");
    debug::exit(debug::EXIT_SUCCESS);
    failure::stop()
}

/// The first plane as a descent, on the recorded states. Returns the deepest stack of a step, bytes.
#[inline(never)]
fn descend(
    recording: &Recording,
    planes: &mut Planes,
    workspace: &mut Workspace,
    counter: &mut InstructionCounter,
) -> u32 {
    set_up_with(recording, &recording.descent(8), planes);
    let ([Some(controller), _], Some(plane)) = (planes, recording.planes.first()) else {
        failure::stop()
    };
    let mut deepest = 0;
    for (k, state) in plane.states.iter().enumerate() {
        let (x, reference) = (Vector4::from(*state), plane.reference(k));
        let mut instructions = None;
        let stack = stack::depth(&mut || {
            (instructions, _) = counter.count(|| {
                controller.step(&x, &reference, workspace);
            });
        });
        deepest = deepest.max(stack);
        let Some(instructions) = instructions else {
            hprintln!("the instruction counter wrapped");
            failure::stop()
        };
        let (problems, plan) = (controller.problems(), controller.solution());
        let solved = u8::from(plan.status.is_solved());
        hprintln!("descent {k} {problems} {instructions} {solved}");
    }
    deepest
}

/// New controllers with the recording's settings.
#[inline(never)]
fn set_up(recording: &Recording, planes: &mut Planes) {
    set_up_with(recording, &recording.settings(), planes);
}

#[inline(never)]
fn set_up_with(
    recording: &Recording,
    settings: &ControllerSettings<f32, 4, 1, 3>,
    planes: &mut Planes,
) {
    for place in planes {
        match Controller::new(recording.ballbot, *settings) {
            Ok(controller) => *place = Some(controller),
            Err(error) => {
                hprintln!("{}: {error}", recording.name);
                failure::stop()
            }
        }
    }
}

/// All planes, sample by sample; the torque of a plane that was not recorded is zero. Returns
/// the deepest stack of a step, bytes.
#[inline(never)]
fn replay(
    recording: &Recording,
    planes: &mut Planes,
    workspace: &mut Workspace,
    counter: &mut InstructionCounter,
) -> u32 {
    let Ok(wheels) = Wheels::of_paper(recording.zenith_angle) else {
        failure::stop()
    };
    let mut deepest = 0;
    for k in 0..recording.samples() {
        let mut torques = Vector3::zeros();
        let places = torques.iter_mut().zip(recording.planes).zip(&mut *planes);
        for (index, ((torque, plane), controller)) in places.enumerate() {
            let (Some(state), Some(controller)) = (plane.states.get(k), controller) else {
                failure::stop()
            };
            let x = Vector4::from(*state);
            let reference = plane.reference(k);
            let mut instructions = None;
            let stack = stack::depth(&mut || {
                (instructions, _) = counter.count(|| {
                    controller.step(&x, &reference, workspace);
                });
            });
            deepest = deepest.max(stack);
            let Some(instructions) = instructions else {
                hprintln!("the instruction counter wrapped");
                failure::stop()
            };
            let plan = controller.solution();
            *torque = plan.u[0][0];
            hprintln!(
                "step {} {index} {k} {} {} {} {} {torque} {} {instructions} {}",
                recording.name,
                x[0],
                x[1],
                x[2],
                x[3],
                plan.active.len(),
                plan.status
            );
        }
        let motors = wheels.motors(&torques);
        hprintln!(
            "motors {} {k} {} {} {}",
            recording.name,
            motors[0],
            motors[1],
            motors[2]
        );
    }
    deepest
}
