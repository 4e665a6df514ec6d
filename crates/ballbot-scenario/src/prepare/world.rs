//! The world that the robot is simulated in. Without `[world]` in the scenario it is ideal.

use crate::error::ScenarioError;
use crate::file::world_table::{
    ActuatorTable, AngleSensorTable, PlaneName, PushTable, RateSensorTable, SensorsTable,
    WithoutPlan, WorldTable,
};
use crate::number::{check, finite, not_negative, positive};
use crate::prepare::excitation::Excitation;
use crate::prepare::files::Files;
use crate::prepare::known_robot::KnownRobot;
use ballbot::{Ballbot, Disturbed, Wheels};
use lpvmpc::Bounds;
use lpvmpc_sim::{Actuator, Disturbance, OnInfeasible, Plant, Sensor, Tolerances, WorldSettings};
use nalgebra::{Vector1, Vector2, Vector4};
use std::f64::consts::FRAC_PI_2;

/// More samples of the sensors per sample of the control than this would be a slip of the pen.
const MOST_SENSOR_SAMPLES: f64 = 1e4;

/// What is right in place of something that is said of the y plane.
pub(crate) const ONE_PLANE: &str = "the reference has one plane only; leave it out";

/// The robot as the simulated world sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Robot {
    /// Its mechanics.
    pub mechanics: Disturbed<f64>,
    /// A torque on top of what the drive delivers, N m.
    pub torque_bias: f64,
    /// Its torque map to the motors.
    pub wheels: Wheels<f64>,
}

impl Plant<4, 1, 2> for Robot {
    /// The load is that of [`Disturbed::f`].
    fn derivative(&self, x: &Vector4<f64>, u: &Vector1<f64>, load: &Vector2<f64>) -> Vector4<f64> {
        self.mechanics.f(x, u[0] + self.torque_bias, load)
    }
}

/// One plane's world, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaneWorld {
    /// The robot.
    pub robot: Robot,
    /// Sensors, of (phi, theta, phi_dot, theta_dot) in this order, drive, delay and pushes.
    pub settings: WorldSettings<4, 1, 4, 2>,
    /// What happens without a plan.
    pub without_plan: OnInfeasible,
    /// Outside of it the robot has fallen: beyond a right angle it lies on the floor.
    pub range: Bounds<f64, 4>,
    /// What is added to the controller's torque.
    pub excitation: Option<Excitation>,
}

impl PlaneWorld {
    /// A world without faults.
    pub(crate) fn ideal(
        (ballbot, wheels): (Ballbot<f64>, Wheels<f64>),
        t_s: f64,
        tolerances: Tolerances,
    ) -> Self {
        Self {
            robot: Robot {
                mechanics: Disturbed::level(ballbot),
                torque_bias: 0.0,
                wheels,
            },
            settings: WorldSettings::ideal(t_s, tolerances),
            without_plan: OnInfeasible::End,
            range: upright(),
            excitation: None,
        }
    }
}

/// The states of a robot that has not fallen.
fn upright() -> Bounds<f64, 4> {
    let mut range = Bounds::none();
    (range.lower[1], range.upper[1]) = (-FRAC_PI_2, FRAC_PI_2);
    range
}

impl WorldTable {
    /// The robot that is there, before `robot` changes it, and its wheels; `model` is the controller's.
    ///
    /// # Errors
    /// The parameters cannot be used, or have no covariance to draw from.
    pub(crate) fn real_robot(
        &self,
        model: &KnownRobot,
        check: impl Fn(&KnownRobot) -> Result<(), ScenarioError>,
        files: &dyn Files,
    ) -> Result<(Ballbot<f64>, Wheels<f64>), ScenarioError> {
        let read = match &self.parameters {
            Some(parameters) => {
                let robot = parameters.read("world.parameters", files)?;
                check(&robot)?;
                Some(robot)
            }
            None => None,
        };
        let robot = read.as_ref().unwrap_or(model);
        let ballbot = match (self.draw, &robot.uncertainty) {
            (None, _) => robot.ballbot,
            (Some(seed), Some(uncertainty)) => uncertainty.draw(&robot.ballbot, seed)?,
            (Some(seed), None) => {
                let (whose, key) = match read {
                    Some(_) => ("of world.parameters", "world.parameters, or leave that out"),
                    None => ("the robot's parameters", "parameters"),
                };
                let expected = format!(
                    "{whose} have no covariance to draw from; name a parameters.toml of `ballbot \
                     identify` as {key}"
                );
                return Err(ScenarioError::value("world.draw", seed, expected));
            }
        };
        Ok((ballbot, robot.wheels))
    }

    /// The world of one plane; `ballbot` is the robot that is there, on its `wheels`.
    ///
    /// # Errors
    /// [`ScenarioError`] with the key, or an excitation that cannot be read.
    pub(crate) fn prepare(
        &self,
        plane: PlaneName,
        (ballbot, wheels): &(Ballbot<f64>, Wheels<f64>),
        t_s: f64,
        tolerances: Tolerances,
        files: &dyn Files,
    ) -> Result<PlaneWorld, ScenarioError> {
        let period = match self.sensor_period_s {
            Some(period) => self.sensor_period(period, t_s)?,
            None => t_s,
        };
        let mechanics = self.mechanics(plane, ballbot)?;
        finite("world.actuator.bias_nm", self.actuator.bias_nm)?;
        // Every plane and every run has noise of its own.
        let seed = self.seed.wrapping_mul(2).wrapping_add(plane as u64);
        Ok(PlaneWorld {
            robot: Robot {
                mechanics,
                torque_bias: self.actuator.bias_nm,
                wheels: *wheels,
            },
            settings: WorldSettings {
                period,
                sensors: self.sensors.check(period)?,
                actuators: [self.actuator.check()?],
                delay: not_negative("world.delay.computation_s", self.delay.computation_s)?
                    + not_negative("world.delay.transport_s", self.delay.transport_s)?,
                disturbances: self.pushes(plane)?,
                seed,
                tolerances,
            },
            without_plan: match self.without_plan {
                WithoutPlan::Apply => OnInfeasible::Apply,
                WithoutPlan::End => OnInfeasible::End,
            },
            range: upright(),
            excitation: self.excitation(plane, files)?,
        })
    }

    /// Nothing is said of a plane that the reference has not.
    ///
    /// # Errors
    /// The first key of the y plane that is not zero, or the first push in it.
    pub(crate) fn check_one_plane(&self) -> Result<(), ScenarioError> {
        for (key, value) in [
            ("world.floor.slope_y_deg", self.floor.slope_y_deg),
            (
                "world.robot.tilt_offset_y_rad",
                self.robot.tilt_offset_y_rad,
            ),
        ] {
            check(key, value, value == 0.0, ONE_PLANE)?;
        }
        let in_y = |push: &PushTable| push.plane() == PlaneName::Y;
        match self.pushes.iter().position(in_y) {
            Some(i) => {
                let key = format!("world.pushes[{i}].{}.plane", self.pushes[i].kind());
                Err(ScenarioError::value(key, "y", ONE_PLANE))
            }
            None => Ok(()),
        }
    }

    fn sensor_period(&self, period: f64, t_s: f64) -> Result<f64, ScenarioError> {
        let key = "world.sensor_period_s";
        let ratio = (t_s / positive(key, period)?).round();
        if ratio > MOST_SENSOR_SAMPLES {
            let expected = format!(
                "at most {MOST_SENSOR_SAMPLES} samples of the sensors per controller.t_s ({t_s} s) \
                 can be simulated"
            );
            Err(ScenarioError::value(key, period, expected))
        } else if ratio >= 1.0 && (ratio * period - t_s).abs() <= 1e-6 * t_s {
            Ok(t_s / ratio)
        } else {
            Err(ScenarioError::value(
                key,
                period,
                format!("controller.t_s ({t_s} s) must be a whole number of sensor periods"),
            ))
        }
    }

    fn mechanics(
        &self,
        plane: PlaneName,
        ballbot: &Ballbot<f64>,
    ) -> Result<Disturbed<f64>, ScenarioError> {
        let (robot, floor) = (&self.robot, &self.floor);
        let factor = |name: &str, factor: f64| positive(&format!("world.robot.{name}"), factor);
        let (axis, slope, offset) = match plane {
            PlaneName::X => ("x", floor.slope_x_deg, robot.tilt_offset_x_rad),
            PlaneName::Y => ("y", floor.slope_y_deg, robot.tilt_offset_y_rad),
        };
        for (key, angle, limit) in [
            (format!("world.floor.slope_{axis}_deg"), slope, 45.0),
            (format!("world.robot.tilt_offset_{axis}_rad"), offset, 0.5),
        ] {
            if !(angle.abs() <= limit) {
                let expected = format!("it must be from -{limit} to {limit}");
                return Err(ScenarioError::value(key, angle, expected));
            }
        }
        let ratio = floor.total_mass_ratio;
        if !(ratio >= 1.0 && ratio.is_finite()) {
            return Err(ScenarioError::value(
                "world.floor.total_mass_ratio",
                ratio,
                "body and ball together weigh at least as much as the body: 1 or more",
            ));
        }
        let mut real = *ballbot;
        real.b1 *= factor("b1_factor", robot.b1_factor)?;
        real.b2 *= factor("b2_factor", robot.b2_factor)?;
        real.b3 *= factor("b3_factor", robot.b3_factor)?;
        real.b4 *= factor("b4_factor", robot.b4_factor)?;
        real.drive.viscous *= factor("drive_friction_factor", robot.drive_friction_factor)?;
        real.drive.coulomb *= factor("drive_coulomb_factor", robot.drive_coulomb_factor)?;
        let key = "world.actuator.coulomb_friction_nm";
        let dry = not_negative(key, self.actuator.coulomb_friction_nm)?;
        real.drive.coulomb += dry * real.geometry.ball_radius / real.geometry.wheel_radius;
        real.geometry.centre_of_mass *=
            factor("centre_of_mass_factor", robot.centre_of_mass_factor)?;
        Ok(Disturbed {
            ballbot: real,
            slope: slope.to_radians(),
            total_mass: ratio,
            tilt_offset: offset,
        })
    }

    fn excitation(
        &self,
        plane: PlaneName,
        files: &dyn Files,
    ) -> Result<Option<Excitation>, ScenarioError> {
        match (&self.excitation, plane) {
            (Some(file), PlaneName::X) => files.excitation(file).map(Some),
            _ => Ok(None),
        }
    }

    fn pushes(&self, plane: PlaneName) -> Result<Vec<Disturbance<4, 2>>, ScenarioError> {
        let mut pushes = Vec::new();
        for (i, push) in self.pushes.iter().enumerate() {
            let key = |name: &str| format!("world.pushes[{i}].{name}");
            push.check(&key)?;
            if push.plane() == plane {
                pushes.push(push.disturbance());
            }
        }
        Ok(pushes)
    }
}

impl PushTable {
    /// The plane that it acts in.
    pub fn plane(&self) -> PlaneName {
        match *self {
            Self::Rates { plane, .. } | Self::Impulse { plane, .. } | Self::Force { plane, .. } => {
                plane
            }
        }
    }

    /// What it is called in a file.
    fn kind(&self) -> &'static str {
        match self {
            Self::Rates { .. } => "rates",
            Self::Impulse { .. } => "impulse",
            Self::Force { .. } => "force",
        }
    }

    /// When it begins: its key, and the time in s.
    pub(crate) fn beginning(&self) -> (String, f64) {
        let (name, time) = match *self {
            Self::Rates { time_s, .. } | Self::Impulse { time_s, .. } => ("time_s", time_s),
            Self::Force { from_s, .. } => ("from_s", from_s),
        };
        (format!("{}.{name}", self.kind()), time)
    }

    fn check(&self, key: &dyn Fn(&str) -> String) -> Result<(), ScenarioError> {
        match *self {
            Self::Rates {
                time_s,
                phi_dot_rad_s,
                theta_dot_rad_s,
                ..
            } => {
                not_negative(&key("rates.time_s"), time_s)?;
                finite(&key("rates.phi_dot_rad_s"), phi_dot_rad_s)?;
                finite(&key("rates.theta_dot_rad_s"), theta_dot_rad_s)?;
                Ok(())
            }
            Self::Impulse {
                time_s,
                momentum_m_s,
                height_m,
                ..
            } => {
                not_negative(&key("impulse.time_s"), time_s)?;
                finite(&key("impulse.momentum_m_s"), momentum_m_s)?;
                finite(&key("impulse.height_m"), height_m)?;
                Ok(())
            }
            Self::Force {
                from_s,
                until_s,
                force_m_s2,
                height_m,
                ..
            } => {
                not_negative(&key("force.from_s"), from_s)?;
                finite(&key("force.force_m_s2"), force_m_s2)?;
                finite(&key("force.height_m"), height_m)?;
                if until_s >= from_s {
                    Ok(())
                } else {
                    Err(ScenarioError::value(
                        key("force.until_s"),
                        until_s,
                        format!("it must not be before from_s ({from_s} s); inf for ever"),
                    ))
                }
            }
        }
    }

    /// What it does to the plant of its plane.
    pub fn disturbance(&self) -> Disturbance<4, 2> {
        match *self {
            Self::Rates {
                time_s,
                phi_dot_rad_s,
                theta_dot_rad_s,
                ..
            } => Disturbance::Jump {
                time: time_s,
                change: Vector4::new(0.0, 0.0, phi_dot_rad_s, theta_dot_rad_s),
            },
            Self::Impulse {
                time_s,
                momentum_m_s,
                height_m,
                ..
            } => Disturbance::Impulse {
                time: time_s,
                impulse: at_height(momentum_m_s, height_m),
            },
            Self::Force {
                from_s,
                until_s,
                force_m_s2,
                height_m,
                ..
            } => Disturbance::Load {
                from: from_s,
                until: until_s,
                load: at_height(force_m_s2, height_m),
            },
        }
    }
}

/// The load of a horizontal push at a height above the ball's centre, on the upright body.
fn at_height(push: f64, height: f64) -> Vector2<f64> {
    Vector2::new(push, push * height)
}

impl SensorsTable {
    /// `period` is that of the world's samples, s.
    fn check(&self, period: f64) -> Result<[Sensor<4>; 4], ScenarioError> {
        let mut sensors = Sensor::ideal_states();
        let rows = [
            ("phi", self.phi.into(), "rad"),
            ("theta", self.theta.into(), "rad"),
            ("phi_dot", self.phi_dot, "rad_s"),
            ("theta_dot", self.theta_dot, "rad_s"),
        ];
        for (sensor, (name, table, unit)) in sensors.iter_mut().zip(rows) {
            let key = |quantity: &str| format!("world.sensors.{name}.{quantity}");
            sensor.noise = not_negative(&key(&format!("noise_{unit}")), table.noise_rad_s)?;
            finite(&key(&format!("bias_{unit}")), table.bias_rad_s)?;
            sensor.bias = table.bias_rad_s;
            sensor.resolution =
                not_negative(&key(&format!("resolution_{unit}")), table.resolution_rad_s)?;
            let room = 1.0 - table.dropout;
            for (quantity, chance, most) in [
                ("dropout", table.dropout, 1.0),
                ("stale", table.stale, room),
            ] {
                if !(0.0..=most).contains(&chance) {
                    let expected = format!("it must be a probability, from 0 to {most}");
                    return Err(ScenarioError::value(key(quantity), chance, expected));
                }
            }
            sensor.stale = table.stale;
            let samples = |quantity: &str, time: f64| whole(&key(quantity), time, period);
            sensor.late = samples("delay_s", table.delay_s)?;
            if let Some(time) = table.period_s {
                sensor.every = samples("period_s", positive(&key("period_s"), time)?)?.max(1);
            }
            sensor.dropout = table.dropout;
        }
        Ok(sensors)
    }
}

/// How many samples of `period` s a time in s is.
fn whole(key: &str, time: f64, period: f64) -> Result<usize, ScenarioError> {
    let ratio = (time / period).round();
    if (0.0..=1e6).contains(&ratio) && (ratio * period - time).abs() <= 1e-6 * period {
        Ok(ratio as usize)
    } else {
        Err(ScenarioError::value(
            key,
            time,
            format!("it must be a whole number of periods of the sensors ({period} s)"),
        ))
    }
}

impl From<AngleSensorTable> for RateSensorTable {
    /// The same numbers, in rad.
    fn from(table: AngleSensorTable) -> Self {
        Self {
            noise_rad_s: table.noise_rad,
            bias_rad_s: table.bias_rad,
            resolution_rad_s: table.resolution_rad,
            dropout: table.dropout,
            period_s: table.period_s,
            delay_s: table.delay_s,
            stale: table.stale,
        }
    }
}

impl ActuatorTable {
    fn check(&self) -> Result<Actuator, ScenarioError> {
        let limit = self.limit_nm;
        if !(limit > 0.0) {
            let expected = "it must be positive; inf for no limit";
            return Err(ScenarioError::value(
                "world.actuator.limit_nm",
                limit,
                expected,
            ));
        }
        Ok(Actuator {
            limit,
            dead_zone: not_negative("world.actuator.dead_zone_nm", self.dead_zone_nm)?,
            lag: not_negative("world.actuator.lag_s", self.lag_s)?,
        })
    }
}
