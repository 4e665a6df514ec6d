//! Why there is no excitation.

use crate::parameter::Parameter;
use crate::words::{number, percent};
use lpvmpc_design::{RiccatiError, number_text};

/// Why there is no excitation.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ExcitationError {
    /// A number out of range.
    #[error("{what} is {value}: it must be {expected}", value = number_text(*value))]
    Value {
        /// What it is.
        what: &'static str,
        /// Its value.
        value: f64,
        /// What would be right.
        expected: String,
    },
    /// No loop holds the robot.
    #[error(
        "no linear-quadratic regulator holds a robot with these parameters: {0}. Give masses or \
         parameters in a configuration, or the gains of your loop"
    )]
    Regulator(#[from] RiccatiError),
    /// The robot has no linear model.
    #[error(
        "a robot with these parameters has no linear model: its mass matrix cannot be inverted"
    )]
    NoLinearModel,
    /// The loop is unstable without any excitation.
    #[error(
        "the loop u = -K x, K = ({}, {}, {}, {}) does not hold the robot that is expected: it has a \
         pole at +{} 1/s. The gains belong to another robot, have the other sign or another unit (N m \
         per rad and per rad/s), or the robot is not what is expected (--config, --parameters)",
        number(gain[0]), number(gain[1]), number(gain[2]), number(gain[3]), number(*pole)
    )]
    UnstableLoop {
        /// The gains.
        gain: [f64; 4],
        /// The real part of the pole, 1/s.
        pole: f64,
    },
    /// What the tilt leaves of the torque tells nothing.
    #[error(
        "only {} N m of the {} N m are left before the robot leans {} degrees: that excitation tells \
         nothing. The loop hardly holds the robot that is expected: check its gains, or allow more \
         tilt (--tilt-limit)",
        number(*left), number(*wanted), number(limit.to_degrees())
    )]
    Useless {
        /// What is left of the torque, N m.
        left: f64,
        /// What was asked for, N m.
        wanted: f64,
        /// The tilt limit, rad.
        limit: f64,
    },
    /// The log would not tell what it is recorded for.
    #[error(
        "a log with that excitation would determine {} only to within {}: a larger torque (--amplitude) or a longer \
         log (--length) is needed",
        parameter.words(), percent(*relative)
    )]
    TellsNothing {
        /// What it would not tell.
        parameter: Parameter,
        /// Expected standard deviation over the value.
        relative: f64,
    },
    /// The loop does not hold the robot.
    #[error(
        "the loop does not hold the robot within {limit:.3} rad, however small the torque: the gains \
         or the parameters are wrong"
    )]
    Unstable {
        /// The tilt limit, rad.
        limit: f64,
    },
}
