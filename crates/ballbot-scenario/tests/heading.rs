//! Both planes and yaw as one robot with three motors, each with its limit.
#![allow(
    clippy::expect_used,
    reason = "a test fails by panicking, in its helper functions too"
)]

use ballbot::{Ballbot, Heading, Wheels};
use ballbot_scenario::{MotorsTable, Prepared, Scenario};
use lpvmpc_sim::{
    Actuator, ClosedLoop, Course, Decision, Ending, Measurement, Plant, Recording, Regulator,
    Sensor, Tolerances, World, WorldSettings, record,
};
use nalgebra::{SVector, Vector2, Vector3, Vector4};
use std::path::Path;
use std::time::Duration;

/// x plane, y plane (of the floor), heading (rad) and its rate (rad/s).
type State = SVector<f64, 10>;

/// Two planes and a body that turns on the ball; the inputs are the motors' torques, N m.
struct Robot {
    ballbot: Ballbot<f64>,
    wheels: Wheels<f64>,
}

/// Moment of inertia about the vertical per body mass, m^2, and friction, m^2/s.
const YAW_INERTIA: f64 = 0.02;
const YAW_FRICTION: f64 = 0.01;

fn plane(x: &State, first: usize) -> Vector4<f64> {
    x.fixed_rows::<4>(first).into_owned()
}

impl Plant<10, 3, 0> for Robot {
    fn derivative(&self, x: &State, motors: &Vector3<f64>, _: &SVector<f64, 0>) -> State {
        let torques = self.wheels.virtual_torques(motors);
        let floor = Heading::new(x[8]).to_floor(&torques.xy());
        let mut x_dot = State::zeros();
        for (first, torque) in [(0, floor[0]), (4, floor[1])] {
            let motion = self.ballbot.f(&plane(x, first), torque);
            x_dot.fixed_rows_mut::<4>(first).copy_from(&motion);
        }
        // A positive yaw torque on the ball turns the body the other way.
        x_dot[8] = x[9];
        x_dot[9] = (-2.4 * torques[2] - YAW_FRICTION * x[9]) / YAW_INERTIA;
        x_dot
    }
}

/// One plane's regulator for x and for y, and a proportional-derivative law for the heading.
struct Planes {
    planes: [Box<dyn Regulator<4, 1, 4>>; 2],
    wheels: Wheels<f64>,
    /// Largest yaw torque, N m.
    yaw_limit: f64,
    /// Whether the torques are turned from the floor to the robot.
    turns: bool,
    heading: (f64, f64),
    largest_motor: f64,
}

impl Regulator<10, 3, 10> for Planes {
    fn t_s(&self) -> f64 {
        self.planes[0].t_s()
    }

    fn observe(&mut self, measurement: &Measurement<10>) {
        let values = &measurement.values;
        for (plane, values) in self.planes.iter_mut().zip(values.chunks(4)) {
            let values = values.try_into().expect("four of them");
            let t = measurement.t;
            plane.observe(&Measurement { t, values });
        }
        let (angle, rate) = (values[8].expect("ideal"), values[9].expect("ideal"));
        self.heading = (angle, rate);
    }

    fn decide(
        &mut self,
        k: usize,
        reference: &dyn Fn(f64) -> State,
        clock: &dyn Fn() -> Duration,
    ) -> Decision<10, 3> {
        let along = |first: usize| move |t: f64| plane(&reference(t), first);
        let [x, y] = &mut self.planes;
        let (x, y) = (x.decide(k, &along(0), clock), y.decide(k, &along(4), clock));
        let now = reference(k as f64 * self.t_s());
        let (angle, rate) = self.heading;
        let wanted = 0.1 * (angle - now[8]) + 0.03 * (rate - now[9]);
        let yaw = wanted.clamp(-self.yaw_limit, self.yaw_limit);
        let frame = Heading::new(if self.turns { angle } else { 0.0 });
        let planes = frame.to_robot(&Vector2::new(x.u[0], y.u[0]));
        let u = self.wheels.motors(&planes.push(yaw));
        self.largest_motor = self.largest_motor.max(u.amax());
        Decision {
            u,
            estimate: State::zeros(),
            x_ref: now,
            cost: x.cost + y.cost,
            status: if x.status.is_solved() {
                y.status
            } else {
                x.status
            },
            active_bounds: x.active_bounds + y.active_bounds,
            step_time: x.step_time + y.step_time,
            gap: State::zeros(),
            guard: None,
        }
    }

    fn prediction(&self) -> Vec<State> {
        Vec::new()
    }
}

const MOTOR_LIMIT: f64 = 0.5;
const YAW_LIMIT: f64 = 0.05;
const DURATION: f64 = 25.0;

/// A Lissajous curve, started beside it, while the robot turns by 0.3 rad/s.
fn run(turns: bool) -> (Prepared, f64, Recording<10, 3, 10>) {
    let file =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples/pushed-lissajous.toml");
    let mut scenario = Scenario::load(file.to_str().expect("text")).expect("valid");
    scenario.world = None;
    scenario.controller.delay_s = 0.0;
    scenario.controller.estimator = None;
    scenario.controller.motors = Some(MotorsTable {
        limit_nm: MOTOR_LIMIT,
        yaw_reserve_nm: YAW_LIMIT,
    });
    let prepared = scenario.prepare(Path::new(".")).expect("valid");
    let planes = [0, 1].map(|i| {
        let closed_loop = prepared.closed_loop(&prepared.planes[i]).expect("valid");
        closed_loop.regulator
    });
    let t_s = prepared.settings.t_s;
    let (ballbot, wheels) = (prepared.ballbot, prepared.wheels);
    let regulator = Planes {
        planes,
        wheels,
        yaw_limit: YAW_LIMIT,
        turns,
        heading: (0.0, 0.0),
        largest_motor: 0.0,
    };
    let limited = Actuator {
        limit: MOTOR_LIMIT,
        ..Actuator::default()
    };
    let settings = WorldSettings {
        period: t_s,
        sensors: Sensor::ideal_states(),
        actuators: [limited; 3],
        delay: 0.0,
        disturbances: Vec::new(),
        seed: 0,
        tolerances: Tolerances {
            relative: 1e-9,
            absolute: 1e-9,
        },
    };
    let mut start = State::zeros();
    // Beside the curve by 1 m and 0.6 m: the torques reach their bounds.
    (start[0], start[4]) = (8.0, -5.0);
    let world = World::new(Robot { ballbot, wheels }, start, settings).expect("valid");
    let mut closed_loop = ClosedLoop::new(regulator, world).expect("one rate");
    closed_loop.range.lower[1] = -1.5;
    closed_loop.range.upper[1] = 1.5;
    let reference = |t: f64| {
        let mut x = State::zeros();
        for (plane, first) in prepared.planes.iter().zip([0, 4]) {
            x.fixed_rows_mut::<4>(first)
                .copy_from(&plane.state_reference(t));
        }
        (x[8], x[9]) = (0.3 * t, 0.3);
        x
    };
    let course = Course {
        samples: (DURATION / t_s) as usize,
        reference: &reference,
        clock: &|| Duration::ZERO,
        progress: &|_| (),
    };
    let recording = record(&mut closed_loop, &course);
    (prepared, closed_loop.regulator.largest_motor, recording)
}

#[test]
fn a_turning_robot_follows_the_curve_and_no_motor_is_asked_for_more_than_it_has() {
    let (prepared, largest_motor, recording) = run(true);
    assert_eq!(recording.trajectory.ending, Ending::Complete);
    let late = recording
        .trajectory
        .samples
        .iter()
        .filter(|sample| sample.t > 10.0);
    for sample in late {
        let error = sample.x - sample.x_ref;
        let way = prepared.ballbot.geometry.position(error[0].hypot(error[4]));
        assert!(way < 0.02, "{way} m beside the curve at {} s", sample.t);
        assert!(
            error[8].abs() < 0.2,
            "heading off by {} at {} s",
            error[8],
            sample.t
        );
    }
    assert!(
        largest_motor <= MOTOR_LIMIT * (1.0 + 1e-9),
        "{largest_motor} N m"
    );
    assert!(
        largest_motor > 0.8 * MOTOR_LIMIT,
        "the limit was needed: {largest_motor} N m"
    );
}

#[test]
fn without_the_heading_it_falls() {
    let (_, _, recording) = run(false);
    assert_ne!(recording.trajectory.ending, Ending::Complete);
}
