//! Checks what the firmware printed: the torques of bare controllers against the same ones in `f64`
//! on the same recorded states, those of a whole robot's motors against the simulation that its
//! readings are from, and its cost against the last measurement and the goals.
//!
//! ```sh
//! firmware_check firmware/limits.toml COMPILER FLASH_BYTES ROBOT_FLASH_BYTES OUTPUT
//! ```
//!
//! COMPILER is the line that `rustc --version` prints; OUTPUT is what the image printed.
#![allow(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "a comparison with NaN must take the failing branch"
)]

use ballbot::{Controller, Workspace};
use ballbot_scenario::{Plane, Prepared, RunHooks, Scenario};
use lpvmpc::{ControllerSettings, Reference};
use nalgebra::{Vector3, Vector4};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::error::Error;
use std::{env, fs, path::Path};

/// Largest difference of a torque, N m. Torques are up to 0.5 N m, f32 rounds to 6e-8 of a number,
/// and a plan sums a few dozen products of the torque's size or ten times that: some 1e-6 is to be
/// expected, and is found. A setting that is wrong in its fourth digit shows as 1e-4 or more.
const TORQUE_NM: f64 = 2e-5;
/// Largest distance of a recorded state from the scenario's closed loop as it is today, rad and
/// rad/s; recordings are rounded to f32.
const STATE: f64 = 1e-5;
/// Largest difference of a motor's torque from the simulation's, N m: readings are rounded to f32,
/// too. The recorded readings do not answer to the torques, and the estimator's disturbances integrate:
/// what one decision rounds off stays and grows. (In f64, a first reading of phi that is 1e-4 rad off
/// moves the torques by 1.5e-4 N m after 12 measurements and by 5.9e-4 after 156.) So the change from
/// a measurement to the next is held to [`TORQUE_NM`] besides: a wrong setting shows there at once.
const ROBOT_TORQUE_NM: f64 = 4e-5;
/// A cost may grow by this much before it must be looked at.
const GROWTH: f64 = 0.05;

type Failure = Box<dyn Error>;

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [limits, compiler, flash, robot_flash, output] = arguments.as_slice() else {
        return Err("usage: firmware_check LIMITS COMPILER FLASH ROBOT_FLASH OUTPUT".into());
    };
    let limits: Limits = toml::from_str(&fs::read_to_string(limits)?)?;
    let output = Output::parse(&fs::read_to_string(output)?)?;
    for name in ["lissajous", "tight-bounds"] {
        check_scenario(name, &output)?;
    }
    check_robot(&output.robot)?;
    let programs = output.descents.iter().map(|step| step.programs);
    println!(
        "descent: {} steps, {} programs at most",
        output.descents.len(),
        programs.max().ok_or("no descent")?
    );
    check_costs(
        &limits,
        compiler,
        &output.costs(flash.parse()?, robot_flash.parse()?),
    )
}

/// One line `step SCENARIO PLANE SAMPLE PHI THETA PHI_DOT THETA_DOT TORQUE ACTIVE INSTRUCTIONS
/// STATUS`.
struct Step {
    scenario: String,
    plane: usize,
    sample: usize,
    x: Vector4<f64>,
    torque: f64,
    active: usize,
    instructions: u64,
    status: String,
}

/// One line `motors SCENARIO SAMPLE TAU_1 TAU_2 TAU_3`.
struct Motors {
    scenario: String,
    sample: usize,
    torques: Vector3<f64>,
}

/// One line `descent SAMPLE PROGRAMS INSTRUCTIONS SOLVED`.
struct Descent {
    programs: u64,
    instructions: u64,
}

/// One line `robot MEASUREMENT DECIDES TAU_1 TAU_2 TAU_3 INSTRUCTIONS SOLVED`.
struct RobotStep {
    decides: bool,
    torques: Vector3<f64>,
    instructions: u64,
}

struct Output {
    steps: Vec<Step>,
    robot: Vec<RobotStep>,
    descents: Vec<Descent>,
    motors: Vec<Motors>,
    controller: u64,
    workspace: u64,
    stack: u64,
    robot_bytes: u64,
    robot_stack: u64,
}

impl Output {
    fn parse(text: &str) -> Result<Self, Failure> {
        let (mut steps, mut motors, mut sizes) = (Vec::new(), Vec::new(), Vec::new());
        let (mut descents, mut robot) = (Vec::new(), Vec::new());
        for line in text.lines() {
            let words: Vec<&str> = line.split_whitespace().collect();
            match words.as_slice() {
                [
                    "step",
                    scenario,
                    plane,
                    sample,
                    x @ ..,
                    torque,
                    active,
                    instructions,
                    status,
                ] if x.len() == 4 => {
                    let x: Vec<f64> = x.iter().map(|x| x.parse()).collect::<Result<_, _>>()?;
                    steps.push(Step {
                        scenario: (*scenario).to_owned(),
                        plane: plane.parse()?,
                        sample: sample.parse()?,
                        x: Vector4::from_column_slice(&x),
                        torque: torque.parse()?,
                        active: active.parse()?,
                        instructions: instructions.parse()?,
                        status: (*status).to_owned(),
                    });
                }
                ["motors", scenario, sample, x, y, z] => motors.push(Motors {
                    scenario: (*scenario).to_owned(),
                    sample: sample.parse()?,
                    torques: Vector3::new(x.parse()?, y.parse()?, z.parse()?),
                }),
                ["descent", _, programs, instructions, "1"] => descents.push(Descent {
                    programs: programs.parse()?,
                    instructions: instructions.parse()?,
                }),
                ["robot", _, decides, x, y, z, instructions, "1"] => robot.push(RobotStep {
                    decides: *decides == "1",
                    torques: Vector3::new(x.parse()?, y.parse()?, z.parse()?),
                    instructions: instructions.parse()?,
                }),
                ["bytes", name, bytes] => sizes.push(((*name).to_owned(), bytes.parse()?)),
                _ => return Err(format!("the firmware printed: {line}").into()),
            }
        }
        let size = |name: &str| {
            let size = sizes.iter().find(|(printed, _)| printed == name);
            size.map(|(_, bytes)| *bytes)
                .ok_or(format!("the firmware did not print the size of the {name}"))
        };
        Ok(Self {
            controller: size("controller")?,
            workspace: size("workspace")?,
            stack: size("stack")?,
            robot_bytes: size("robot")?,
            robot_stack: size("robot_stack")?,
            steps,
            robot,
            descents,
            motors,
        })
    }

    /// What a step and the controllers cost, by the names of `firmware/limits.toml`.
    fn costs(&self, flash: u64, robot_flash: u64) -> [(&'static str, u64); 14] {
        let of = |active: fn(usize) -> bool| {
            let steps = self.steps.iter().filter(move |step| active(step.active));
            let mut sorted: Vec<u64> = steps.map(|step| step.instructions).collect();
            sorted.sort_unstable();
            sorted
        };
        let (free, all) = (of(|active| active == 0), of(|_| true));
        let at = |sorted: &[u64], place: usize| sorted.get(place).copied().unwrap_or(0);
        let mut descents: Vec<u64> = self.descents.iter().map(|step| step.instructions).collect();
        descents.sort_unstable();
        let robot = |decides: bool| {
            let steps = self
                .robot
                .iter()
                .filter(move |step| step.decides == decides);
            let mut sorted: Vec<u64> = steps.map(|step| step.instructions).collect();
            sorted.sort_unstable();
            sorted
        };
        let (decides, observes) = (robot(true), robot(false));
        [
            ("robot_instructions_median", at(&decides, decides.len() / 2)),
            (
                "robot_instructions_worst",
                at(&decides, decides.len().saturating_sub(1)),
            ),
            (
                "robot_instructions_between",
                at(&observes, observes.len().saturating_sub(1)),
            ),
            ("robot_flash_bytes", robot_flash),
            ("robot_ram_bytes", self.robot_bytes),
            ("robot_stack_bytes", self.robot_stack),
            (
                "instructions_descent_median",
                at(&descents, descents.len() / 2),
            ),
            (
                "instructions_descent_worst",
                at(&descents, descents.len().saturating_sub(1)),
            ),
            (
                "instructions_without_active_bounds",
                at(&free, free.len().saturating_sub(1)),
            ),
            ("instructions_median", at(&all, all.len() / 2)),
            ("instructions_worst", at(&all, all.len().saturating_sub(1))),
            ("flash_bytes", flash),
            ("ram_bytes", 2 * self.controller + self.workspace),
            ("stack_bytes", self.stack),
        ]
    }
}

/// Every step of the scenario against the `f64` controller on the printed states.
fn check_scenario(name: &str, output: &Output) -> Result<(), Failure> {
    let mut prepared = Scenario::load(name)?.prepare(Path::new("."))?;
    let steps = output.steps.iter().filter(|step| step.scenario == name);
    prepared.samples = steps.clone().map(|step| step.sample + 1).max().unwrap_or(0);
    check_recording(&prepared, steps.clone())?;
    let mut worst = 0.0_f64;
    let mut torques = vec![Vector3::zeros(); prepared.samples];
    for (index, plane) in prepared.planes.iter().enumerate() {
        let mut replay = Replay::new(&prepared, plane)?;
        for step in steps.clone().filter(|step| step.plane == index) {
            if step.status != "solved" {
                return Err(format!("{name}, sample {}: {}", step.sample, step.status).into());
            }
            let torque = replay.step(step)?;
            torques[step.sample][index] = torque;
            worst = worst.max(within_tolerance(
                (step.torque - torque).abs(),
                name,
                step.sample,
            )?);
        }
    }
    let mut worst_motor = 0.0_f64;
    for motors in output
        .motors
        .iter()
        .filter(|motors| motors.scenario == name)
    {
        let torques = torques.get(motors.sample).ok_or("motors without a step")?;
        let difference = (motors.torques - prepared.wheels.motors(torques)).map(f64::abs);
        for difference in difference.iter() {
            let difference = within_tolerance(*difference, name, motors.sample)?;
            worst_motor = worst_motor.max(difference);
        }
    }
    println!(
        "{name}: {} steps, f32 - f64: torque {worst:.1e} N m, motors {worst_motor:.1e} N m \
         (tolerance {TORQUE_NM:e})",
        steps.count()
    );
    Ok(())
}

/// The whole robot's motors against those of the simulation that its readings are from.
fn check_robot(steps: &[RobotStep]) -> Result<(), Failure> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples/whole-robot.toml");
    let scenario = Scenario::load(file.to_str().ok_or("the path of the project is no text")?)?;
    let mut prepared = scenario.prepare(Path::new("."))?;
    let plane = prepared.planes.first().ok_or("no plane")?;
    let per_sample = (prepared.settings.t_s / plane.world.settings.period).round() as usize;
    prepared.samples = steps.len() / per_sample;
    let record = prepared.record(&RunHooks::NONE)?;
    if steps.is_empty() || steps.len() != record.robot_log.len() {
        return Err(format!("whole-robot: {} of its measurements", steps.len()).into());
    }
    let (mut worst, mut worst_change, mut before) = (0.0_f64, 0.0_f64, Vector3::zeros());
    for (k, (step, row)) in steps.iter().zip(&record.robot_log).enumerate() {
        let difference = step.torques - row.commanded;
        let (size, change) = (difference.amax(), (difference - before).amax());
        if !(size <= ROBOT_TORQUE_NM && change <= TORQUE_NM) {
            return Err(format!(
                "whole-robot, measurement {k}: a motor's torque differs by {size:e} N m from the \
                 simulation, {change:e} of it since the measurement before; if the scenario has \
                 changed, record again with the example firmware_record"
            )
            .into());
        }
        worst = worst.max(size);
        worst_change = worst_change.max(change);
        before = difference;
    }
    println!(
        "whole-robot: {} measurements, firmware - simulation: motors {worst:.1e} N m (tolerance \
         {ROBOT_TORQUE_NM:e}), from one to the next {worst_change:.1e} N m ({TORQUE_NM:e})",
        steps.len()
    );
    Ok(())
}

fn within_tolerance(difference: f64, name: &str, sample: usize) -> Result<f64, Failure> {
    if difference <= TORQUE_NM {
        Ok(difference)
    } else {
        Err(format!("{name}, sample {sample}: f32 and f64 differ by {difference:e} N m").into())
    }
}

/// The states in the firmware are those of the scenario.
fn check_recording<'a>(
    prepared: &Prepared,
    steps: impl Iterator<Item = &'a Step>,
) -> Result<(), Failure> {
    let trajectories = prepared.run(&RunHooks::NONE)?;
    let mut count = 0;
    for step in steps {
        count += 1;
        let sample = trajectories
            .get(step.plane)
            .and_then(|trajectory| trajectory.samples.get(step.sample))
            .ok_or("the scenario's closed loop ended early")?;
        if !((step.x - sample.x).amax() <= STATE) {
            return Err(format!(
                "sample {} of the recording is not the scenario's any more; record again with \
                 the example firmware_record",
                step.sample
            )
            .into());
        }
    }
    if count == 0 || count != prepared.total_samples() {
        return Err(format!("{count} steps for {} samples", prepared.total_samples()).into());
    }
    Ok(())
}

/// The controller of one plane in `f64`, with its own past.
struct Replay<'a> {
    plane: &'a Plane,
    controller: Controller<f64>,
    workspace: Workspace<f64>,
}

impl<'a> Replay<'a> {
    fn new(prepared: &Prepared, plane: &'a Plane) -> Result<Self, Failure> {
        let controller = Controller::allocate(prepared.ballbot, prepared.settings)?;
        Ok(Self {
            plane,
            workspace: controller.workspace(),
            controller,
        })
    }

    fn step(&mut self, step: &Step) -> Result<f64, Failure> {
        let ControllerSettings { t_s, horizon, .. } = *self.controller.settings();
        let plane = self.plane;
        let at = |i: usize| plane.state_reference((step.sample + i) as f64 * t_s);
        let stages: Vec<_> = (0..horizon).map(at).collect();
        let reference = Reference {
            stages: &stages,
            terminal: at(horizon),
        };
        let plan = self
            .controller
            .step(&step.x, &reference, &mut self.workspace);
        if plan.status.is_solved() {
            Ok(plan.u[0][0])
        } else {
            Err(format!("in f64, sample {}: {}", step.sample, plan.status).into())
        }
    }
}

/// `firmware/limits.toml`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Limits {
    compiler: String,
    measured: BTreeMap<String, u64>,
    goal: BTreeMap<String, u64>,
}

fn check_costs(limits: &Limits, compiler: &str, costs: &[(&str, u64)]) -> Result<(), Failure> {
    let comparable = compiler == limits.compiler;
    if !comparable {
        println!("NOT COMPARED with the last measurement: another compiler");
        println!("  then: {}\n  now:  {compiler}", limits.compiler);
    }
    println!("{:36}{:>9}{:>9}{:>9}", "", "measured", "before", "goal");
    let mut wrong = Vec::new();
    for (name, now) in costs {
        let last = limits.measured.get(*name);
        let last = *last.ok_or(format!("limits.toml lacks measured.{name}"))?;
        let goal = limits.goal.get(*name);
        let shown = goal.map_or("-".to_owned(), u64::to_string);
        println!("{name:36}{now:9}{last:9}{shown:>9}");
        let growth = *now as f64 / last as f64 - 1.0;
        if goal.is_some_and(|goal| now > goal) {
            wrong.push(format!("{name} is beyond the goal"));
        }
        if comparable && growth > GROWTH {
            wrong.push(format!("{name} has grown by {:.1} %", 100.0 * growth));
        }
        if comparable && growth < -GROWTH {
            println!("  less than before: take it over into firmware/limits.toml");
        }
    }
    if wrong.is_empty() {
        Ok(())
    } else {
        Err(wrong.join("; ").into())
    }
}
