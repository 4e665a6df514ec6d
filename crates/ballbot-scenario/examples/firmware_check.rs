//! Checks what the firmware printed: its torques against the same controllers in `f64` on the
//! same recorded states, and its cost against the last measurement and the goals.
//!
//! ```sh
//! firmware_check firmware/limits.toml COMPILER FLASH_BYTES OUTPUT
//! ```
//!
//! COMPILER is the line that `rustc --version` prints; OUTPUT is what the image printed.

use ballbot::Ballbot;
use ballbot_scenario::{Prepared, Scenario, Surroundings};
use lpvmpc::{Controller, Reference, Workspace};
use nalgebra::{Vector3, Vector4};
use serde::Deserialize;
use std::error::Error;
use std::{env, fs, path::Path, time::Duration};

/// Largest difference of a torque, N m. Torques are up to 0.5 N m, f32 rounds to 6e-8 of a number,
/// and a plan sums a few dozen products of the torque's size or ten times that: some 1e-6 is to be
/// expected, and is found. A setting that is wrong in its fourth digit shows as 1e-4 or more.
const TORQUE_NM: f64 = 2e-5;
/// Largest distance of a recorded state from the scenario's closed loop as it is today, rad and
/// rad/s; recordings are rounded to f32.
const STATE: f64 = 1e-5;
/// A cost may grow by this much before it must be looked at.
const GROWTH: f64 = 0.05;

type Failure = Box<dyn Error>;

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [limits, compiler, flash, output] = arguments.as_slice() else {
        return Err("usage: firmware_check LIMITS COMPILER FLASH_BYTES OUTPUT".into());
    };
    let limits: Limits = toml::from_str(&fs::read_to_string(limits)?)?;
    let output = Output::parse(&fs::read_to_string(output)?)?;
    for name in ["lissajous", "tight-bounds"] {
        check_scenario(name, &output)?;
    }
    let measured = output.costs(flash.parse()?)?;
    check_costs(&limits, compiler, &measured)
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

struct Output {
    steps: Vec<Step>,
    motors: Vec<Motors>,
    controller: u64,
    workspace: u64,
    stack: u64,
}

impl Output {
    fn parse(text: &str) -> Result<Self, Failure> {
        let (mut steps, mut motors, mut sizes) = (Vec::new(), Vec::new(), Vec::new());
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
            steps,
            motors,
        })
    }

    fn costs(&self, flash: u64) -> Result<Costs, Failure> {
        let steps = self.steps.iter();
        let free = steps.clone().filter(|step| step.active == 0);
        let most = |instructions: Option<u64>| instructions.ok_or("the firmware made no step");
        Ok(Costs {
            instructions_without_active_bounds: most(free.map(|step| step.instructions).max())?,
            instructions_median: median(steps.clone().map(|step| step.instructions)),
            instructions_worst: most(steps.map(|step| step.instructions).max())?,
            flash_bytes: flash,
            ram_bytes: 2 * self.controller + self.workspace,
            stack_bytes: self.stack,
        })
    }
}

fn median(numbers: impl Iterator<Item = u64>) -> u64 {
    let mut sorted: Vec<u64> = numbers.collect();
    sorted.sort_unstable();
    sorted.get(sorted.len() / 2).copied().unwrap_or(0)
}

/// Every step of the scenario against the `f64` controller on the printed states.
fn check_scenario(name: &str, output: &Output) -> Result<(), Failure> {
    let mut prepared = Scenario::load(name)?.prepare(Path::new("."))?;
    let steps = output.steps.iter().filter(|step| step.scenario == name);
    prepared.samples = steps.clone().map(|step| step.sample + 1).max().unwrap_or(0);
    check_recording(&prepared, steps.clone())?;
    let mut worst = 0.0_f64;
    let mut torques = vec![Vector3::zeros(); prepared.samples];
    for plane in 0..prepared.planes.len() {
        let mut replay = Replay::new(&prepared, plane)?;
        for step in steps.clone().filter(|step| step.plane == plane) {
            if step.status != "solved" {
                return Err(format!("{name}, sample {}: {}", step.sample, step.status).into());
            }
            let torque = replay.step(step)?;
            torques[step.sample][plane] = torque;
            worst = worst.max((step.torque - torque).abs());
        }
    }
    let mut worst_motor = 0.0_f64;
    for motors in output
        .motors
        .iter()
        .filter(|motors| motors.scenario == name)
    {
        let exact = prepared.wheels.motors(&torques[motors.sample]);
        worst_motor = worst_motor.max((motors.torques - exact).amax());
    }
    println!(
        "{name}: {} steps, f32 - f64: torque {worst:.1e} N m, motors {worst_motor:.1e} N m \
         (tolerance {TORQUE_NM:e})",
        steps.count()
    );
    // Negated, so that a difference that is not a number fails.
    if !(worst <= TORQUE_NM && worst_motor <= TORQUE_NM) {
        return Err(format!("{name}: the torques in f32 and f64 differ too much").into());
    }
    Ok(())
}

/// The states in the firmware are those of the scenario.
fn check_recording<'a>(
    prepared: &Prepared,
    steps: impl Iterator<Item = &'a Step>,
) -> Result<(), Failure> {
    let trajectories = prepared.run(&Surroundings {
        clock: &|| Duration::ZERO,
        progress: &|_| (),
    })?;
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
    prepared: &'a Prepared,
    plane: usize,
    controller: Box<Controller<Ballbot<f64>, f64, 4, 1, 2, 20, 20>>,
    workspace: Box<Workspace<f64, 4, 1, 20, 20>>,
}

impl<'a> Replay<'a> {
    fn new(prepared: &'a Prepared, plane: usize) -> Result<Self, Failure> {
        Ok(Self {
            prepared,
            plane,
            controller: Box::new(Controller::new(prepared.ballbot, prepared.settings)?),
            workspace: Box::default(),
        })
    }

    fn step(&mut self, step: &Step) -> Result<f64, Failure> {
        let plane = &self.prepared.planes[self.plane];
        let t_s = self.prepared.settings.t_s;
        let at = |i: usize| plane.state_reference((step.sample + i) as f64 * t_s);
        let reference = Reference {
            stages: std::array::from_fn(at),
            terminal: at(20),
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
    measured: Costs,
    goal: Goals,
}

/// What a step and the controllers cost.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Costs {
    instructions_without_active_bounds: u64,
    instructions_median: u64,
    instructions_worst: u64,
    flash_bytes: u64,
    ram_bytes: u64,
    stack_bytes: u64,
}

/// What they may cost at most.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Goals {
    instructions_without_active_bounds: u64,
    instructions_worst: u64,
    flash_bytes: u64,
    ram_bytes: u64,
}

fn check_costs(limits: &Limits, compiler: &str, now: &Costs) -> Result<(), Failure> {
    let (last, goal) = (&limits.measured, &limits.goal);
    let rows = [
        (
            "instructions, no active bound",
            now.instructions_without_active_bounds,
            last.instructions_without_active_bounds,
            Some(goal.instructions_without_active_bounds),
        ),
        (
            "instructions, median",
            now.instructions_median,
            last.instructions_median,
            None,
        ),
        (
            "instructions, worst",
            now.instructions_worst,
            last.instructions_worst,
            Some(goal.instructions_worst),
        ),
        (
            "flash, bytes",
            now.flash_bytes,
            last.flash_bytes,
            Some(goal.flash_bytes),
        ),
        (
            "RAM, bytes",
            now.ram_bytes,
            last.ram_bytes,
            Some(goal.ram_bytes),
        ),
        (
            "stack of a step, bytes",
            now.stack_bytes,
            last.stack_bytes,
            None,
        ),
    ];
    let comparable = compiler == limits.compiler;
    if !comparable {
        println!(
            "NOT COMPARED with the last measurement: it was made with {}, this is {compiler}",
            limits.compiler
        );
    }
    println!(
        "{:30} {:>9} {:>9} {:>9}",
        "", "measured", "last time", "goal"
    );
    let mut wrong = Vec::new();
    for (name, now, last, goal) in rows {
        let shown = goal.map_or("-".to_owned(), |goal| goal.to_string());
        println!("{name:30} {now:9} {last:9} {shown:>9}");
        let change = now as f64 / last as f64 - 1.0;
        if goal.is_some_and(|goal| now > goal) {
            wrong.push(format!("{name}: beyond the goal"));
        }
        if comparable && change > GROWTH {
            wrong.push(format!(
                "{name}: {:.1} % more than last time",
                100.0 * change
            ));
        } else if comparable && change < -GROWTH {
            println!("{name}: less than last time; lower the number in firmware/limits.toml");
        }
    }
    if wrong.is_empty() {
        Ok(())
    } else {
        Err(wrong.join("; ").into())
    }
}
