//! What is asked of an excitation that makes no sense, or would tell nothing.

use super::{ExcitationError, ExcitationTask, FADE};
use crate::parameter::{Parameter, Values};
use crate::poles::linear_model;
use lpvmpc_design::poles;
use nalgebra::{DMatrix, Vector4};

/// A loop with a pole right of this lets the robot drift or fall, 1/s.
const SLOWEST: f64 = 1e-6;

/// An expected standard deviation relative to the value from which on a log is not worth recording.
const LEAST_PRECISE: f64 = 0.5;

/// An hour at 1 kHz has 3.6 million rows.
const MOST_ROWS: f64 = 4e6;

/// Cosines of all rows: some seconds' work.
const MOST_TERMS: f64 = 1e9;

impl ExcitationTask {
    /// The gains hold the robot that is expected, its delay aside.
    pub(super) fn check_loop(&self, gain: &Vector4<f64>) -> Result<(), ExcitationError> {
        let linear = linear_model(&self.robot, self.geometry);
        let (a, b) = linear.ok_or(ExcitationError::NoLinearModel)?;
        let closed = a - b * gain.transpose();
        let found = poles(&DMatrix::from_column_slice(4, 4, closed.as_slice()));
        let worst = found.map_or(f64::INFINITY, |poles| {
            poles
                .iter()
                .fold(f64::NEG_INFINITY, |most, pole| most.max(pole.re))
        });
        if worst < SLOWEST {
            return Ok(());
        }
        Err(ExcitationError::UnstableLoop {
            gain: (*gain).into(),
            pole: worst,
        })
    }

    /// The body's inertias and mass are told, if they are to be found.
    pub(super) fn check_precision(&self, deviations: &Values) -> Result<(), ExcitationError> {
        let choices = self.choices();
        for parameter in [Parameter::B1, Parameter::B3, Parameter::TorqueGain] {
            let relative = (deviations[parameter] / self.robot[parameter]).abs();
            let told = relative <= LEAST_PRECISE;
            if choices[parameter].is_free() && !told {
                return Err(ExcitationError::TellsNothing {
                    parameter,
                    relative,
                });
            }
        }
        Ok(())
    }

    pub(super) fn check(&self) -> Result<(), ExcitationError> {
        let nyquist = 0.5 * self.rate;
        let shortest = (2.0 * FADE + self.segment).max(2.0 / self.band.0);
        let within = |what, value: f64, least: f64, most: f64, expected: String| {
            let right = (least..=most).contains(&value);
            let error = ExcitationError::Value {
                what,
                value,
                expected,
            };
            if right { Ok(()) } else { Err(error) }
        };
        within(
            "the rate",
            self.rate,
            5.0,
            1e5,
            "from 5 to 100000 Hz".to_owned(),
        )?;
        within(
            "the lowest frequency",
            self.band.0,
            1e-3,
            1e4,
            "from 0.001 to 10000 Hz".to_owned(),
        )?;
        within(
            "the highest frequency",
            self.band.1,
            self.band.0,
            nyquist,
            format!("from the lowest one to half of the rate, {nyquist} Hz"),
        )?;
        within(
            "the number of harmonics",
            self.harmonics as f64,
            2.0,
            1e4,
            "from 2 to 10000".to_owned(),
        )?;
        within(
            "the torque",
            self.amplitude,
            1e-6,
            1e6,
            "from 1e-6 to 1e6 N m".to_owned(),
        )?;
        within(
            "the tilt limit in degrees",
            self.tilt_limit.to_degrees(),
            0.06,
            57.0,
            "from 0.06 to 57".to_owned(),
        )?;
        within(
            "the length",
            self.duration,
            shortest,
            3600.0,
            format!("from {shortest:.1} s (two periods of the lowest frequency) to an hour"),
        )?;
        within(
            "the number of rows, length times rate,",
            self.rows() as f64,
            1.0,
            MOST_ROWS,
            format!("at most {MOST_ROWS}: a shorter length or a lower rate"),
        )?;
        within(
            "the number of rows times that of the harmonics",
            self.rows() as f64 * self.harmonics as f64,
            1.0,
            MOST_TERMS,
            format!("at most {MOST_TERMS}: fewer harmonics, a shorter length or a lower rate"),
        )
    }
}
