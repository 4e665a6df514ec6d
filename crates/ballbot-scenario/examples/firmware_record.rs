//! Writes what the firmware embeds: a scenario's settings, its first samples in closed loop, and
//! its references, rounded to `f32`, as Rust source.
//!
//! ```sh
//! cargo run --release -p ballbot-scenario --example firmware_record -- lissajous 40 \
//!     > firmware/src/recorded/lissajous.rs
//! cargo run --release -p ballbot-scenario --example firmware_record -- tight-bounds 80 \
//!     > firmware/src/recorded/tight_bounds.rs
//! cargo run --release -p ballbot-scenario --example firmware_record -- \
//!     docs/examples/whole-robot.toml 40 > firmware/src/recorded/whole_robot.rs
//! ```
//!
//! Of a robot whose planes share their motors it writes what the sensors deliver, and what stands
//! around the controllers, which plan by descent. Without shared motors it is a controller alone, with the paper's program:
//! one for each sample, hard bounds, the scheduling held within a sample. What else a scenario asks for is refused.

use ballbot::{Ballbot, Geometry, Wheel, Wheels};
use ballbot_scenario::{Plane, Prepared, Problem, RunHooks, Scenario, ThreeMotors};
use lpvmpc::{Iterations, Predictor, Reading, Scheduling, TerminalIngredient};
use lpvmpc_sim::{LogRow, Trajectory};
use std::error::Error;
use std::fmt::Write;
use std::{env, path::Path};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [name, samples] = arguments.as_slice() else {
        return Err("usage: firmware_record SCENARIO SAMPLES".into());
    };
    let scenario = Scenario::load(name)?;
    let folder = Path::new(name).parent().unwrap_or(Path::new("."));
    let mut prepared = scenario.prepare(folder)?;
    prepared.samples = samples.parse()?;
    check_plan(&prepared)?;
    if let Some(motors) = prepared.motors {
        check_descent(&prepared)?;
        print!("{}", whole_robot(name, &prepared, &motors)?);
        return Ok(());
    }
    check_alone(&prepared)?;
    let trajectories = prepared.run(&RunHooks::NONE)?;
    let mut text = format!(
        "//! The scenario `{name}` and its first {samples} samples in closed loop.\n\
         //! Written by `firmware_record {name} {samples}`, an example of `ballbot-scenario`.\n\n\
         use crate::recording::{{Plane, Recording}};\n\
         use ballbot::{{Ballbot, DriveFriction, Geometry, Wheel}};\n\n\
         /// The recording.\n\
         pub const RECORDING: Recording = Recording {{\n    name: {name:?},\n"
    );
    write_robot(&mut text, &prepared.ballbot)?;
    write_wheels(&mut text, &prepared.wheels)?;
    write_settings(&mut text, &prepared)?;
    writeln!(text, "    planes: &[")?;
    for (plane, trajectory) in prepared.planes.iter().zip(&trajectories) {
        write_plane(&mut text, &prepared, plane, trajectory)?;
    }
    writeln!(text, "    ],\n}};")?;
    print!("{text}");
    Ok(())
}

/// What none of the firmware's controllers has.
fn check_plan(prepared: &Prepared) -> Result<(), Box<dyn Error>> {
    let settings = &prepared.settings;
    refuse(&[
        (
            !matches!(prepared.problem, Problem::Plain),
            "controller.torque_rate and a certified terminal set: leave them out",
        ),
        (
            !matches!(settings.scheduling, Scheduling::Predicted),
            "controller.model = \"linear\": take \"lpv\"",
        ),
        (
            !prepared.feedback.preview,
            "controller.preview = false: leave it out",
        ),
    ])
}

/// Torques on their way and instants that the firmware remembers of a plane: `COMMANDS` and `INSTANTS` in
/// `firmware/src/robot.rs`, which is built for another target.
const ROOM: (f64, f64) = (4.0, 16.0);

/// What the firmware's memory of a robot has no room for.
fn check_room(
    prepared: &Prepared,
    period: f64,
    rows: &[LogRow<10, 3>],
) -> Result<(), Box<dyn Error>> {
    let (commands, instants) = ROOM;
    let delay = (prepared.feedback.delay / prepared.settings.t_s - 1e-9).ceil();
    let oldest = prepared.feedback.estimator.map_or(0.0, |it| it.gate.oldest);
    let readings = rows.iter().flat_map(|row| row.readings).flatten();
    let ages = readings
        .map(|reading| reading.age)
        .filter(|age| *age <= oldest);
    // A change of the torque in between is an instant, too.
    let passed = 2.0 * ages.fold(0.0, f64::max) / period;
    refuse(&[
        (
            delay + 2.0 > commands,
            "memory for the torques on their way during controller.delay_s: take two samples at most",
        ),
        (
            passed > instants,
            "memory for readings that late: lower controller.estimator.oldest_s or world.sensors...delay_s",
        ),
    ])
}

/// What a robot whose planes share their motors does not have.
fn check_descent(prepared: &Prepared) -> Result<(), Box<dyn Error>> {
    let settings = &prepared.settings;
    let first = match settings.iterations {
        Iterations::Descent { first, most, .. } => first != most,
        Iterations::Fixed(_) => false,
    };
    let quadratic = |price: &lpvmpc::Penalty<f64>| price.quadratic != 0.0;
    refuse(&[
        (
            !matches!(settings.predictor, Predictor::StageConsistent(_)),
            "controller.predictor but stage_consistent",
        ),
        (
            settings.soft_x.iter().flatten().any(quadratic),
            "quadratic prices of state bounds: leave them at 0",
        ),
        (first, "controller.iterations.descent.first: leave it out"),
    ])
}

/// What a controller alone does not have.
fn check_alone(prepared: &Prepared) -> Result<(), Box<dyn Error>> {
    let settings = &prepared.settings;
    let one = matches!(settings.iterations, Iterations::Fixed(1));
    refuse(&[
        (
            !one,
            "controller.iterations: a descent needs [controller.motors]; take { fixed = 1 }",
        ),
        (
            !matches!(settings.predictor, Predictor::FrozenRk4(_)),
            "controller.predictor: take { rk4 = { substeps = 1 } }",
        ),
        (
            settings.soft_x.iter().any(Option::is_some),
            "soft state bounds: take controller.state_bounds = \"hard\"",
        ),
        (
            prepared.feedback.estimator.is_some() || prepared.feedback.delay > 0.0,
            "controller.estimator and controller.delay_s: they need [controller.motors]",
        ),
    ])
}

/// The first of these that is so.
fn refuse(faults: &[(bool, &str)]) -> Result<(), Box<dyn Error>> {
    match faults.iter().find(|(is_so, _)| *is_so) {
        Some((_, fault)) => Err(format!("the firmware does not have {fault}").into()),
        None => Ok(()),
    }
}

fn write_wheels(text: &mut String, wheels: &Wheels<f64>) -> std::fmt::Result {
    writeln!(
        text,
        "    zenith_angle: {},",
        literal(wheels.zenith_angle())
    )?;
    writeln!(text, "    wheels: [")?;
    for Wheel { azimuth, reversed } in wheels.arrangement() {
        let azimuth = literal(azimuth);
        writeln!(
            text,
            "        Wheel {{ azimuth: {azimuth}, reversed: {reversed} }},"
        )?;
    }
    writeln!(text, "    ],")
}

fn write_robot(text: &mut String, robot: &Ballbot<f64>) -> std::fmt::Result {
    let Geometry {
        centre_of_mass,
        ball_radius,
        wheel_radius,
        gravity,
    } = robot.geometry;
    let fields = |text: &mut String, indent: &str, fields: &[(&str, f64)]| {
        fields
            .iter()
            .try_for_each(|(name, value)| writeln!(text, "{indent}{name}: {},", literal(*value)))
    };
    writeln!(text, "    ballbot: Ballbot {{")?;
    let b = [
        ("b1", robot.b1),
        ("b2", robot.b2),
        ("b3", robot.b3),
        ("b4", robot.b4),
    ];
    fields(text, "        ", &b)?;
    writeln!(text, "        drive: DriveFriction {{")?;
    let friction = [
        ("viscous", robot.drive.viscous),
        ("coulomb", robot.drive.coulomb),
    ];
    fields(text, "            ", &friction)?;
    writeln!(text, "        }},")?;
    writeln!(text, "        geometry: Geometry {{")?;
    let lengths = [
        ("centre_of_mass", centre_of_mass),
        ("ball_radius", ball_radius),
        ("wheel_radius", wheel_radius),
        ("gravity", gravity),
    ];
    fields(text, "            ", &lengths)?;
    writeln!(text, "        }},\n    }},")
}

fn write_settings(text: &mut String, prepared: &Prepared) -> Result<(), Box<dyn Error>> {
    let settings = &prepared.settings;
    let TerminalIngredient::Cost(p) = settings.terminal else {
        return Err("the firmware takes a terminal cost, not an equality".into());
    };
    writeln!(text, "    t_s: {},", literal(settings.t_s))?;
    writeln!(text, "    horizon: {},", settings.horizon)?;
    writeln!(text, "    substeps: {},", settings.predictor.rk4().substeps)?;
    writeln!(
        text,
        "    q: {},",
        list(settings.weights.q.diagonal().iter())
    )?;
    writeln!(text, "    r: {},", literal(settings.weights.r[0]))?;
    writeln!(text, "    p: [")?;
    for column in p.column_iter() {
        writeln!(text, "        {},", list(column.iter()))?;
    }
    writeln!(text, "    ],")?;
    writeln!(text, "    state_lower: {},", list(&settings.x.lower))?;
    writeln!(text, "    state_upper: {},", list(&settings.x.upper))?;
    let torque = [settings.u.lower[0], settings.u.upper[0]];
    writeln!(text, "    torque: {},", list(&torque))?;
    Ok(())
}

fn write_plane(
    text: &mut String,
    prepared: &Prepared,
    plane: &Plane,
    trajectory: &Trajectory<4, 1>,
) -> Result<(), Box<dyn Error>> {
    if trajectory.samples.len() < prepared.samples {
        return Err(format!("the run ended early: {:?}", trajectory.termination).into());
    }
    writeln!(text, "        Plane {{\n            states: &[")?;
    for sample in &trajectory.samples {
        writeln!(text, "                {},", list(&sample.x))?;
    }
    writeln!(text, "            ],\n            phi_ref: &[")?;
    for k in 0..prepared.samples + prepared.settings.horizon {
        let phi_ref = plane.reference.at(k as f64 * prepared.settings.t_s);
        writeln!(text, "                {},", literal(phi_ref))?;
    }
    writeln!(text, "            ],\n        }},")?;
    Ok(())
}

/// A robot whose planes share their motors, and what its sensors deliver.
fn whole_robot(
    name: &str,
    prepared: &Prepared,
    ThreeMotors { limits, turning }: &ThreeMotors,
) -> Result<String, Box<dyn Error>> {
    let record = prepared.record(&RunHooks::NONE)?;
    let samples = prepared.samples;
    let estimator = prepared.feedback.estimator.ok_or(
        "it has no estimator, which a robot whose planes share their motors needs; write a table \
         [controller.estimator], or leave out [controller.motors]",
    )?;
    let plane = prepared.planes.first().ok_or("it has no plane")?;
    let period = plane.world.settings.period;
    let per_sample = (prepared.settings.t_s / period).round() as usize;
    if record.robot_log.len() < samples * per_sample {
        return Err("the run ended early".into());
    }
    check_room(prepared, period, &record.robot_log)?;
    let mut text = format!(
        "//! The robot of `{name}` and what its sensors deliver in the first {samples} samples.\n\
         //! Written by `firmware_record {name} {samples}`, an example of `ballbot-scenario`.\n\n\
         use crate::recording::{{Descent, Recording}};\n\
         use crate::robot_recording::{{RobotRecording, RobotSettings}};\n\
         use ballbot::{{Ballbot, DriveFriction, Geometry, MotorLimits, Wheel, YawLaw}};\n\
         use lpvmpc::Gate;\n\n\
         /// The recording.\n\
         pub const RECORDING: RobotRecording = RobotRecording {{\n\
         robot: RobotSettings {{\n\
         plane: Recording {{\n    name: \"whole-robot\",\n"
    );
    write_robot(&mut text, &prepared.ballbot)?;
    write_wheels(&mut text, &prepared.wheels)?;
    write_settings(&mut text, prepared)?;
    writeln!(text, "    planes: &[],\n}},")?;
    let Iterations::Descent {
        tolerance, most, ..
    } = prepared.settings.iterations
    else {
        return Err("the firmware's whole robot takes a descent".into());
    };
    let prices = prepared.settings.soft_x.map(|price| match price {
        Some(price) => format!("Some({})", literal(price.linear)),
        None => "None".to_owned(),
    });
    writeln!(
        text,
        "descent: Descent {{ tolerance: {}, most: {most}, prices: [{}] }},",
        literal(tolerance),
        prices.join(", ")
    )?;
    let feedback = &prepared.feedback;
    for (name, number) in [
        ("delay", feedback.delay),
        ("period", period),
        ("longest_step", estimator.longest_step),
    ] {
        writeln!(text, "{name}: {},", literal(number))?;
    }
    for (name, variances) in [
        ("state_noise", &estimator.state_noise),
        ("measurement_noise", &estimator.measurement_noise),
        ("initial_state", &estimator.initial_state),
    ] {
        writeln!(text, "{name}: {},", list(variances))?;
    }
    for (name, variances) in [
        ("disturbance_noise", &estimator.disturbance_noise),
        ("initial_disturbance", &estimator.initial_disturbance),
    ] {
        writeln!(text, "{name}: {},", list(variances))?;
    }
    let gate = &estimator.gate;
    writeln!(
        text,
        "gate: Gate {{ deviations: {}, patience: {}, oldest: {}, longest_gap: {} }},",
        literal(gate.deviations),
        gate.patience,
        literal(gate.oldest),
        literal(gate.longest_gap)
    )?;
    writeln!(
        text,
        "limits: MotorLimits {{ motor: {}, yaw: {} }},",
        literal(limits.motor),
        literal(limits.yaw)
    )?;
    writeln!(
        text,
        "yaw: YawLaw {{ stiffness: {}, damping: {} }},",
        literal(turning.law.stiffness),
        literal(turning.law.damping)
    )?;
    writeln!(text, "heading: {},", literal(turning.initial))?;
    writeln!(
        text,
        "target: ({}, {}),",
        literal(turning.target.0),
        literal(turning.target.1)
    )?;
    writeln!(text, "}},\nphi_ref: [")?;
    let end = (samples + prepared.settings.horizon) as f64 * prepared.settings.t_s + feedback.delay;
    for plane in &prepared.planes {
        let count = (end / period).round() as usize + 1;
        let references = (0..count).map(|k| plane.reference.at(k as f64 * period));
        writeln!(text, "    &{},", list(&references.collect::<Vec<_>>()))?;
    }
    writeln!(text, "],\nrows: &[")?;
    for row in &record.robot_log {
        let readings = row.readings.map(|reading| match reading {
            Some(Reading { value, age }) => format!("Some([{}, {}])", literal(value), literal(age)),
            None => "None".to_owned(),
        });
        writeln!(text, "    [{}],", readings.join(", "))?;
    }
    writeln!(text, "],\n}};")?;
    Ok(text)
}

fn list<'a>(numbers: impl IntoIterator<Item = &'a f64>) -> String {
    let literals: Vec<String> = numbers.into_iter().copied().map(literal).collect();
    format!("[{}]", literals.join(", "))
}

fn literal(number: f64) -> String {
    let rounded = number as f32;
    if rounded.is_finite() {
        format!("{rounded:?}")
    } else if rounded > 0.0 {
        "f32::INFINITY".to_owned()
    } else {
        "f32::NEG_INFINITY".to_owned()
    }
}
