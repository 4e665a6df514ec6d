//! What the numbers of a configuration must be, and what goes together.

use super::{Config, ConfigError, FitTable, GeometryTable};
use crate::coordinates;
use crate::log::WheelPlane;
use crate::parameter::Parameter;
use lpvmpc_design::number_text;
use std::borrow::Cow;

impl Config {
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        let GeometryTable {
            centre_of_mass_m,
            ball_radius_m,
            wheel_radius_m,
            gravity_m_s2,
        } = self.geometry;
        within(
            "geometry.centre_of_mass_m",
            centre_of_mass_m,
            0.01,
            3.0,
            "from 0.01 to 3 m: lengths are in metres",
        )?;
        within(
            "geometry.ball_radius_m",
            ball_radius_m,
            0.01,
            1.0,
            "from 0.01 to 1 m: lengths are in metres",
        )?;
        within(
            "geometry.wheel_radius_m",
            wheel_radius_m,
            0.002,
            1.0,
            "from 0.002 to 1 m: lengths are in metres",
        )?;
        within(
            "geometry.gravity_m_s2",
            gravity_m_s2,
            1.0,
            30.0,
            "from 1 to 30 m/s^2 (9.81 on Earth)",
        )?;
        let noise = [
            ("noise.phi_rad", self.noise.phi_rad),
            ("noise.theta_rad", self.noise.theta_rad),
            ("noise.theta_dot_rad_s", self.noise.theta_dot_rad_s),
        ];
        for (key, value) in noise {
            value.map_or(Ok(()), |value| positive(key, value))?;
        }
        let FitTable {
            segment_s,
            held_back,
            ..
        } = self.fit;
        within("fit.segment_s", segment_s, 0.1, 10.0, "from 0.1 to 10 s")?;
        within("fit.held_back", held_back, 0.0, 0.8, "from 0 to 0.8")?;
        self.check_log()?;
        self.choices().map(|_| ())
    }

    fn check_log(&self) -> Result<(), ConfigError> {
        let times = [
            ("log.from_s", self.log.from_s),
            ("log.until_s", self.log.until_s),
        ];
        for (key, time) in times {
            time.map_or(Ok(()), |time| {
                within(key, time, 0.0, 1e9, "a time from 0 on")
            })?;
        }
        if let (Some(from), Some(until)) = (self.log.from_s, self.log.until_s) {
            within("log.until_s", until, from, 1e9, "a time after log.from_s")?;
        }
        let delimiter = self.log.delimiter;
        if delimiter.is_alphanumeric() || "+-.\"'\r\n".contains(delimiter) {
            return Err(ConfigError::Delimiter(delimiter));
        }
        for [from, to] in &self.log.leave_out {
            within("log.leave_out", *from, 0.0, 1e9, "a time from 0 on")?;
            within(
                "log.leave_out",
                *to,
                *from,
                1e9,
                "a time after the one before it",
            )?;
        }
        if self.body.is_some() && !self.log.torque_known() {
            return Err(ConfigError::NoTorque);
        }
        self.check_planes()
    }

    /// That both planes, or one, are said throughout.
    fn check_planes(&self) -> Result<(), ConfigError> {
        let log = &self.log;
        let wheels = log.wheels.as_ref();
        let both = wheels.is_some_and(|wheels| wheels.plane == WheelPlane::Both);
        let refused = |key, expected| Err(ConfigError::Planes { key, expected });
        let Some(y) = &log.y else {
            return match both {
                true => refused(
                    "log.wheels.plane = \"both\"",
                    "the tilt of the plane y is missing; name its columns in [log.y]",
                ),
                false => Ok(()),
            };
        };
        if wheels.is_some() && !both {
            return refused(
                "[log.y]",
                "it is of a second plane, and log.wheels.plane names one; set plane = \"both\", or \
                 leave [log.y] out",
            );
        }
        let torques = log.has_motors();
        for (key, given, by_wheels) in [
            ("log.y.phi", y.phi.is_some(), wheels.is_some()),
            ("log.y.torque", y.torque.is_some(), torques),
        ] {
            match (given, by_wheels) {
                (true, true) => {
                    return refused(
                        key,
                        "it is put together from the three wheels; leave it out",
                    );
                }
                (false, false) => return refused(key, "it is missing; name its column and unit"),
                _ => {}
            }
        }
        let planes = log.planes();
        let [x, y] = planes.as_slice() else {
            return Ok(());
        };
        if x.torque_known() != y.torque_known() {
            return refused(
                "log.y.torque",
                "the torque gain is that of both planes; give both torques in N m, or both in the \
                 same other unit",
            );
        }
        for (key, of_x, of_y) in [
            ("log.y.phi", &x.phi, &y.phi),
            ("log.y.theta", &x.theta, &y.theta),
            ("log.y.theta_dot", &x.theta_dot, &y.theta_dot),
            ("log.y.torque", &x.torque, &y.torque),
        ] {
            let of_wheels =
                (key == "log.y.phi" && wheels.is_some()) || (key == "log.y.torque" && torques);
            if of_x.column == of_y.column && !of_y.column.is_empty() && !of_wheels {
                return refused(key, "it is the same column as that of the plane x");
            }
        }
        Ok(())
    }

    /// That a robot of these lengths can have this `value`.
    pub(super) fn check_size(
        &self,
        parameter: Parameter,
        key: &str,
        value: f64,
    ) -> Result<(), ConfigError> {
        let (least, most) = coordinates::range(parameter, self.geometry(), self.fit.physical);
        let expected = match most.is_finite() {
            true => {
                let [least, most] = [least, most].map(number_text);
                format!("from {least} to {most} {}", parameter.unit())
            }
            false => "a positive number".to_owned(),
        };
        within(key, value, least, most, expected)
    }
}

pub(super) fn positive(key: &str, value: f64) -> Result<(), ConfigError> {
    within(key, value, f64::MIN_POSITIVE, 1e9, "a positive number")
}

pub(super) fn within(
    key: &str,
    value: f64,
    least: f64,
    most: f64,
    expected: impl Into<Cow<'static, str>>,
) -> Result<(), ConfigError> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    Err(ConfigError::Value {
        key: key.to_owned(),
        value,
        expected: expected.into(),
    })
}
