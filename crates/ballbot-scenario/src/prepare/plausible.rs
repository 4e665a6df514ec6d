//! What the numbers of a scenario are at most on any ballbot that could be built. Degrees,
//! millimetres and milliseconds in place of rad, m and s are asked about before anything runs; who
//! means them sets `accept_unusual_values = true`.

use crate::error::ScenarioError;
use crate::file::feedback_table::{EstimatorTable, MotorsTable, ShapingTable};
use crate::file::schema::{
    BoundsTable, ControllerTable, LissajousTable, ReferenceTable, Scenario, StateTable,
};
use crate::file::world_table::{PushTable, WorldTable};
use crate::number::text;
use crate::prepare::known_robot::KnownRobot;
use crate::prepare::reference::PhiReference;
use lpvmpc_design::significant_text;
use std::f64::consts::{FRAC_PI_2, PI};

/// Of a limit, and of what was meant, as messages tell them.
const DIGITS: usize = 4;

/// A range of absolute values. Zero and infinity, which stand for none, lie in every range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plausible {
    /// The smallest absolute value.
    pub least: f64,
    /// The largest absolute value.
    pub most: f64,
    /// Their unit.
    pub unit: &'static str,
    /// The unit that was meant, if the value times the factor is plausible.
    pub mistaken: Option<(&'static str, f64)>,
}

const DEGREES: Option<(&str, f64)> = Some(("degrees", PI / 180.0));
const DEGREES_PER_SECOND: Option<(&str, f64)> = Some(("degrees/s", PI / 180.0));
const MILLIMETRES: Option<(&str, f64)> = Some(("mm", 1e-3));
const MILLISECONDS: Option<(&str, f64)> = Some(("ms", 1e-3));

const fn range(
    least: f64,
    most: f64,
    unit: &'static str,
    mistaken: Option<(&'static str, f64)>,
) -> Plausible {
    Plausible {
        least,
        most,
        unit,
        mistaken,
    }
}

/// A tilt as a bound: beyond it the body has gone through the floor.
pub const TILT: Plausible = range(0.0, PI, "rad", DEGREES);
/// A tilt at which a robot starts: beyond it it lies on the floor.
pub const START_TILT: Plausible = range(0.0, FRAC_PI_2, "rad", DEGREES);
/// A tilt rate.
pub const TILT_RATE: Plausible = range(0.0, 100.0, "rad/s", DEGREES_PER_SECOND);
/// A speed of the ball.
pub const BALL_RATE: Plausible = range(0.0, 300.0, "rad/s", DEGREES_PER_SECOND);
/// An angle of the ball as a place to be at: some 50 m on a ball of 0.11 m.
pub const BALL_ANGLE: Plausible = range(0.0, 450.0, "rad", DEGREES);
/// A place on the floor.
pub const PLACE: Plausible = range(0.0, 50.0, "m", MILLIMETRES);
/// A torque.
pub const TORQUE: Plausible = range(0.0, 100.0, "N m", Some(("mN m", 1e-3)));
/// A sampling time, of the control or of the sensors.
pub const SAMPLING: Plausible = range(1e-5, 1.0, "s", MILLISECONDS);
/// A delay or a time constant of the drive.
pub const DELAY: Plausible = range(0.0, 1.0, "s", MILLISECONDS);
/// A radius of ball or wheel.
pub const RADIUS: Plausible = range(0.002, 1.0, "m", MILLIMETRES);
/// A height above the ball's centre.
pub const HEIGHT: Plausible = range(0.002, 5.0, "m", MILLIMETRES);
/// An inertia per body mass.
pub const INERTIA: Plausible = range(0.0, 100.0, "m^2", Some(("mm^2", 1e-6)));
/// Inertias of the rolling are at most so many times the ball's radius squared: a solid ball of ten times the body's mass
/// has 15, and wheels and motors, as the ball sees them, the rest; the paper's b2 is 4.
const MOST_ROLLING: f64 = 100.0;
/// At a ball's rate of 1 rad/s friction brakes at most as much as the floor could hold the whole body, with a
/// coefficient of friction of 1: |b4| <= g r_b.
const BRAKING_RATE: f64 = 1.0;
/// A viscous friction per body mass, as far as no robot is known.
const FRICTION: Plausible = range(0.0, f64::INFINITY, "m^2/s", Some(("mm^2/s", 1e-6)));
/// The acceleration of gravity, on the moon as well.
pub const GRAVITY: Plausible = range(1.0, 30.0, "m/s^2", Some(("mm/s^2", 1e-3)));
/// The zenith angle of the wheels.
pub const ZENITH: Plausible = range(5.0, 90.0, "degrees", Some(("rad", 180.0 / PI)));
/// Noise, bias or resolution of an angle.
pub const ANGLE_ERROR: Plausible = range(0.0, 0.5, "rad", DEGREES);

impl Plausible {
    /// The same with another largest value.
    fn up_to(self, most: f64) -> Self {
        Self { most, ..self }
    }

    /// Whether the value can be meant.
    pub fn holds(&self, value: f64) -> bool {
        let size = value.abs();
        size == 0.0 || !size.is_finite() || (self.least..=self.most).contains(&size)
    }

    /// The same of what is never negative: a value below zero is for other checks, as a NaN is.
    ///
    /// # Errors
    /// As [`check`](Self::check).
    pub fn check_size(&self, key: &str, value: f64) -> Result<(), ScenarioError> {
        match value < 0.0 {
            true => Ok(()),
            false => self.check(key, value),
        }
    }

    /// Asks about a value that cannot be meant; a NaN is for other checks.
    ///
    /// # Errors
    /// [`ScenarioError::Value`] with the key, the range and the unit that may have been meant.
    pub fn check(&self, key: &str, value: f64) -> Result<(), ScenarioError> {
        if self.holds(value) {
            return Ok(());
        }
        let Self { unit, .. } = self;
        let (limit, end) = match value.abs() > self.most {
            true => (self.most, "more"),
            false => (self.least, "less"),
        };
        let meant = self.mistaken.map(|(name, factor)| (name, value * factor));
        let question = match meant {
            Some((name, right)) if self.holds(right) => format!(
                "; were {name} meant? {} {name} are {} {unit}",
                text(value),
                significant_text(right, DIGITS)
            ),
            _ => String::new(),
        };
        let expected = format!(
            "{end} than {} {unit} is no ballbot's{question}. If {} {unit} is right, set \
             accept_unusual_values = true at the top of the file",
            significant_text(limit, DIGITS),
            text(value)
        );
        Err(ScenarioError::value(key, value, expected))
    }
}

impl Scenario {
    /// Asks about values that no ballbot has, before anything is computed from them.
    ///
    /// # Errors
    /// The first of them.
    pub(crate) fn check_plausible(&self) -> Result<(), ScenarioError> {
        if self.accept_unusual_values {
            return Ok(());
        }
        self.controller.check_plausible()?;
        self.bounds.check_plausible()?;
        self.initial_state.check_plausible("initial_state")?;
        self.reference.check_plausible("reference")?;
        if let Some(state) = &self.initial_state_y {
            state.check_plausible("initial_state_y")?;
        }
        self.world
            .as_ref()
            .map_or(Ok(()), WorldTable::check_plausible)
    }

    /// The same for a robot, which may stand in a file; `key` is where the scenario names it.
    pub(crate) fn check_robot(&self, key: &str, robot: &KnownRobot) -> Result<(), ScenarioError> {
        match self.accept_unusual_values {
            true => Ok(()),
            false => check_robot(key, robot),
        }
    }

    /// The same for a reference that stands in a file.
    pub(crate) fn check_reference(
        &self,
        key: &str,
        reference: &PhiReference,
    ) -> Result<(), ScenarioError> {
        match reference {
            PhiReference::Interpolated(points) if !self.accept_unusual_values => {
                let mut points = points.iter();
                points.try_for_each(|point| BALL_ANGLE.check(key, point.phi_rad))
            }
            _ => Ok(()),
        }
    }
}

/// Asks about a robot that could not be built.
///
/// # Errors
/// The first of its numbers that is not plausible, below `key`.
pub fn check_robot(key: &str, robot: &KnownRobot) -> Result<(), ScenarioError> {
    let geometry = &robot.ballbot.geometry;
    let zenith = robot.wheels.zenith_angle().to_degrees();
    let (radius, gravity) = (geometry.ball_radius, geometry.gravity);
    let rolling = INERTIA.up_to(MOST_ROLLING * radius * radius);
    let braking = FRICTION.up_to(gravity * radius / BRAKING_RATE);
    for (name, value, plausible) in [
        ("centre_of_mass_m", geometry.centre_of_mass, HEIGHT),
        ("ball_radius_m", radius, RADIUS),
        ("wheel_radius_m", geometry.wheel_radius, RADIUS),
        ("gravity_m_s2", gravity, GRAVITY),
        // These by the lengths of this robot, which are plausible by now.
        ("b1_m2", robot.ballbot.b1, rolling),
        ("b2_m2", robot.ballbot.b2, rolling),
        ("b3_m2", robot.ballbot.b3, INERTIA),
        ("b4_m2_s", robot.ballbot.b4, braking),
        ("zenith_angle_deg", zenith, ZENITH),
    ] {
        plausible.check(&format!("{key}.{name}"), value)?;
    }
    Ok(())
}

impl ReferenceTable {
    fn check_plausible(&self, key: &str) -> Result<(), ScenarioError> {
        let (kind, points) = match self {
            Self::SetPoints { points } => ("set_points", points),
            Self::MinimumJerk { points } => ("minimum_jerk", points),
            Self::Lines { points } => ("lines", points),
            Self::Sine(sine) => {
                BALL_ANGLE.check(&format!("{key}.sine.amplitude_rad"), sine.amplitude_rad)?;
                return BALL_ANGLE.check(&format!("{key}.sine.offset_rad"), sine.offset_rad);
            }
            Self::Lissajous(LissajousTable {
                amplitude_x_m,
                amplitude_y_m,
                ..
            }) => {
                PLACE.check(&format!("{key}.lissajous.amplitude_x_m"), *amplitude_x_m)?;
                return PLACE.check(&format!("{key}.lissajous.amplitude_y_m"), *amplitude_y_m);
            }
            Self::Planes { x, y } => {
                x.check_plausible(&format!("{key}.planes.x"))?;
                return y.check_plausible(&format!("{key}.planes.y"));
            }
            // When it has been read.
            Self::Csv(_) => return Ok(()),
        };
        for (i, point) in points.iter().enumerate() {
            BALL_ANGLE.check(&format!("{key}.{kind}.points[{i}].phi_rad"), point.phi_rad)?;
        }
        Ok(())
    }
}

impl ControllerTable {
    fn check_plausible(&self) -> Result<(), ScenarioError> {
        SAMPLING.check_size("controller.t_s", self.t_s)?;
        DELAY.check_size("controller.delay_s", self.delay_s)?;
        if let Some(EstimatorTable {
            phi_noise_rad,
            theta_noise_rad,
            theta_dot_noise_rad_s,
            ..
        }) = self.estimator
        {
            ANGLE_ERROR.check_size("controller.estimator.phi_noise_rad", phi_noise_rad)?;
            ANGLE_ERROR.check_size("controller.estimator.theta_noise_rad", theta_noise_rad)?;
            let key = "controller.estimator.theta_dot_noise_rad_s";
            TILT_RATE.check_size(key, theta_dot_noise_rad_s)?;
        }
        if let Some(ShapingTable { phi_dot_rad_s, .. }) = self.shaping {
            BALL_RATE.check_size("controller.shaping.phi_dot_rad_s", phi_dot_rad_s)?;
        }
        if let Some(MotorsTable {
            limit_nm,
            yaw_reserve_nm,
        }) = self.motors
        {
            TORQUE.check_size("controller.motors.limit_nm", limit_nm)?;
            TORQUE.check_size("controller.motors.yaw_reserve_nm", yaw_reserve_nm)?;
        }
        Ok(())
    }
}

impl BoundsTable {
    fn check_plausible(&self) -> Result<(), ScenarioError> {
        for (name, bounds, plausible) in [
            ("theta_rad", self.theta_rad, TILT),
            ("phi_dot_rad_s", self.phi_dot_rad_s, BALL_RATE),
            ("theta_dot_rad_s", self.theta_dot_rad_s, TILT_RATE),
            ("torque_nm", self.torque_nm, TORQUE),
        ] {
            for (i, bound) in bounds.into_iter().enumerate() {
                plausible.check(&format!("bounds.{name}[{i}]"), bound)?;
            }
        }
        Ok(())
    }
}

impl StateTable {
    fn check_plausible(&self, key: &str) -> Result<(), ScenarioError> {
        BALL_ANGLE.check(&format!("{key}.phi_rad"), self.phi_rad)?;
        START_TILT.check(&format!("{key}.theta_rad"), self.theta_rad)?;
        BALL_RATE.check(&format!("{key}.phi_dot_rad_s"), self.phi_dot_rad_s)?;
        TILT_RATE.check(&format!("{key}.theta_dot_rad_s"), self.theta_dot_rad_s)
    }
}

impl WorldTable {
    fn check_plausible(&self) -> Result<(), ScenarioError> {
        let Self {
            sensors,
            actuator,
            delay,
            ..
        } = self;
        if let Some(period) = self.sensor_period_s {
            SAMPLING.check_size("world.sensor_period_s", period)?;
        }
        for (name, angle) in [("phi", &sensors.phi), ("theta", &sensors.theta)] {
            let key = |quantity: &str| format!("world.sensors.{name}.{quantity}");
            ANGLE_ERROR.check_size(&key("noise_rad"), angle.noise_rad)?;
            ANGLE_ERROR.check(&key("bias_rad"), angle.bias_rad)?;
            ANGLE_ERROR.check_size(&key("resolution_rad"), angle.resolution_rad)?;
            DELAY.check_size(&key("delay_s"), angle.delay_s)?;
        }
        for (name, rate) in [
            ("phi_dot", &sensors.phi_dot),
            ("theta_dot", &sensors.theta_dot),
        ] {
            let key = |quantity: &str| format!("world.sensors.{name}.{quantity}");
            TILT_RATE.check_size(&key("noise_rad_s"), rate.noise_rad_s)?;
            TILT_RATE.check(&key("bias_rad_s"), rate.bias_rad_s)?;
            TILT_RATE.check_size(&key("resolution_rad_s"), rate.resolution_rad_s)?;
            DELAY.check_size(&key("delay_s"), rate.delay_s)?;
        }
        for (name, torque) in [
            ("limit_nm", actuator.limit_nm),
            ("dead_zone_nm", actuator.dead_zone_nm),
            ("coulomb_friction_nm", actuator.coulomb_friction_nm),
        ] {
            TORQUE.check_size(&format!("world.actuator.{name}"), torque)?;
        }
        TORQUE.check("world.actuator.bias_nm", actuator.bias_nm)?;
        DELAY.check_size("world.actuator.lag_s", actuator.lag_s)?;
        DELAY.check_size("world.delay.computation_s", delay.computation_s)?;
        DELAY.check_size("world.delay.transport_s", delay.transport_s)?;
        for (i, push) in self.pushes.iter().enumerate() {
            push.check_plausible(&|name| format!("world.pushes[{i}].{name}"))?;
        }
        Ok(())
    }
}

impl PushTable {
    fn check_plausible(&self, key: &dyn Fn(&str) -> String) -> Result<(), ScenarioError> {
        match *self {
            Self::Rates {
                phi_dot_rad_s,
                theta_dot_rad_s,
                ..
            } => {
                BALL_RATE.check(&key("rates.phi_dot_rad_s"), phi_dot_rad_s)?;
                TILT_RATE.check(&key("rates.theta_dot_rad_s"), theta_dot_rad_s)
            }
            Self::Impulse { height_m, .. } => HEIGHT.check(&key("impulse.height_m"), height_m),
            Self::Force { height_m, .. } => HEIGHT.check(&key("force.height_m"), height_m),
        }
    }
}
