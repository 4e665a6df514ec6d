//! Steps bare controllers on recorded states, and a whole robot's regulator on recorded readings, and
//! prints torques and what they cost: instructions, stack, RAM. `firmware_check`, an example of `ballbot-scenario`, reads the output.
#![no_std]
#![no_main]

mod failure;
mod instructions;
mod stack;

use cortex_m::singleton;
use cortex_m_rt::entry;
use cortex_m_semihosting::{debug, hprintln};
use firmware::{
    Controller, ControllerMemory, Descent, Recording, RobotMemory, RobotRecording, RobotRegulator,
    Workspace, WorkspaceMemory, recorded,
};
use instructions::InstructionCounter;
use lpvmpc::{ControllerSettings, Regulator};
use nalgebra::{Vector3, Vector4};

type Memory = &'static mut ControllerMemory;

#[entry]
fn main() -> ! {
    let (Some(peripherals), Some(robot), Some(memory), Some([x, y, tight, descent])) = (
        cortex_m::Peripherals::take(),
        singleton!(ROBOT: RobotMemory = RobotMemory::default()),
        singleton!(WORKSPACE: WorkspaceMemory = WorkspaceMemory::default()),
        singleton!(PLANES: [ControllerMemory; 4] = [ControllerMemory::default(); 4]),
    ) else {
        failure::stop()
    };
    let workspace = &mut Workspace::new(memory.lend());
    let mut counter = InstructionCounter::new(peripherals.SYST);
    if !counter.is_exact() {
        hprintln!("the instruction counter is not exact: is this QEMU with -icount shift=6?");
        failure::stop();
    }
    let controller = size_of::<Controller>() + size_of::<ControllerMemory>();
    hprintln!("bytes controller {controller}");
    let bytes = size_of::<Workspace>() + size_of::<WorkspaceMemory>();
    hprintln!("bytes workspace {bytes}");
    let recording = &recorded::LISSAJOUS;
    let mut planes = [x, y].map(|memory| set_up(recording, &recording.settings(), memory));
    let mut deepest = replay(recording, &mut planes, workspace, &mut counter);
    let recording = &recorded::TIGHT_BOUNDS;
    let mut plane = [set_up(recording, &recording.settings(), tight)];
    deepest = deepest.max(replay(recording, &mut plane, workspace, &mut counter));
    let recording = &recorded::LISSAJOUS;
    let iterations = Descent {
        tolerance: 1e-3,
        most: 8,
        prices: [None, Some(1e5), Some(1e5), Some(1e5)],
    };
    let settings = recording.with_descent(&iterations, 4);
    let mut plane = set_up(recording, &settings, descent);
    deepest = deepest.max(descend(recording, &mut plane, workspace, &mut counter));
    hprintln!("bytes stack {deepest}");
    let bytes = size_of::<RobotRegulator>() + size_of::<RobotMemory>();
    hprintln!("bytes robot {bytes}");
    let deepest = regulate(&recorded::WHOLE_ROBOT, robot, &mut counter);
    hprintln!("bytes robot_stack {deepest}");
    debug::exit(debug::EXIT_SUCCESS);
    failure::stop()
}

/// The first plane as a descent, on the recorded states. Returns the deepest stack of a step, bytes.
#[inline(never)]
fn descend(
    recording: &Recording,
    controller: &mut Controller,
    workspace: &mut Workspace,
    counter: &mut InstructionCounter,
) -> u32 {
    let Some(plane) = recording.planes.first() else {
        failure::stop()
    };
    let mut deepest = 0;
    for (k, state) in plane.states.iter().enumerate() {
        let (x, window) = (Vector4::from(*state), plane.window(k));
        let mut instructions = None;
        let stack = stack::depth(&mut || {
            (instructions, _) = counter.count(|| {
                controller.step(&x, &window.reference(), workspace);
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

/// The whole robot's regulator on what its sensors deliver. Returns the deepest stack, bytes.
#[inline(never)]
fn regulate(
    recording: &RobotRecording,
    memory: &'static mut RobotMemory,
    counter: &mut InstructionCounter,
) -> u32 {
    let Ok(wheels) = recording.robot.plane.wheels() else {
        failure::stop()
    };
    let mut regulator = match recording.robot.regulator(wheels, memory) {
        Ok(regulator) => regulator,
        Err(error) => {
            hprintln!("{}: {error}", recording.robot.plane.name);
            failure::stop()
        }
    };
    let mut deepest = 0;
    for k in 0..recording.rows.len() {
        let Some(measurement) = recording.measurement(k) else {
            failure::stop()
        };
        let decides = k % recording.robot.per_sample() == 0;
        let (mut instructions, mut command, mut solved) = (None, None, true);
        let stack = stack::depth(&mut || {
            (instructions, command) = counter.count(|| {
                regulator.observe(&measurement);
                if decides {
                    let command = regulator.decide(&|t| recording.reference(t));
                    solved = command.status.is_solved();
                    Some(command.u)
                } else {
                    regulator.between()
                }
            });
        });
        deepest = deepest.max(stack);
        let (Some(instructions), Some(motors)) = (instructions, command) else {
            hprintln!("the instruction counter wrapped, or there is no command");
            failure::stop()
        };
        let (kind, solved) = (u8::from(decides), u8::from(solved));
        let [first, second, third] = motors.into();
        hprintln!("robot {k} {kind} {first} {second} {third} {instructions} {solved}");
    }
    deepest
}

/// A new controller with these settings.
#[inline(never)]
fn set_up(
    recording: &Recording,
    settings: &ControllerSettings<f32, 4, 1, 3>,
    memory: Memory,
) -> Controller {
    match Controller::new(recording.ballbot, *settings, memory.lend()) {
        Ok(controller) => controller,
        Err(error) => {
            hprintln!("{}: {error}", recording.name);
            failure::stop()
        }
    }
}

/// All planes, sample by sample; the torque of a plane that was not recorded is zero. Returns
/// the deepest stack of a step, bytes.
#[inline(never)]
fn replay(
    recording: &Recording,
    planes: &mut [Controller],
    workspace: &mut Workspace,
    counter: &mut InstructionCounter,
) -> u32 {
    let Ok(wheels) = recording.wheels() else {
        failure::stop()
    };
    let mut deepest = 0;
    for k in 0..recording.samples() {
        let mut torques = Vector3::zeros();
        let places = torques
            .iter_mut()
            .zip(recording.planes)
            .zip(planes.iter_mut());
        for (index, ((torque, plane), controller)) in places.enumerate() {
            let Some(state) = plane.states.get(k) else {
                failure::stop()
            };
            let x = Vector4::from(*state);
            let window = plane.window(k);
            let mut instructions = None;
            let stack = stack::depth(&mut || {
                (instructions, _) = counter.count(|| {
                    controller.step(&x, &window.reference(), workspace);
                });
            });
            deepest = deepest.max(stack);
            let Some(instructions) = instructions else {
                hprintln!("the instruction counter wrapped");
                failure::stop()
            };
            let plan = controller.solution();
            *torque = plan.first_input()[0];
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
