//! What a whole robot's samples are to its planes and motors.

use crate::run::excited_robot::ExcitedRobot;
use ballbot::{AnyPlanner, Heading, RobotRegulator, Wheels, plane_of};
use lpvmpc::{Observation, Restart};
use lpvmpc_sim::{LogRow, Sample};
use nalgebra::{Vector1, Vector3};

/// The regulator of both planes and the heading.
pub(crate) type WholeRegulator = RobotRegulator<f64, AnyPlanner<f64>>;

/// The heading and the motors at a control sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorSample {
    /// Time, s.
    pub t: f64,
    /// Heading, rad.
    pub heading: f64,
    /// Where the robot has to look, rad.
    pub target: f64,
    /// The motors' torques (tau_1, tau_2, tau_3) from here on, N m.
    pub torques: Vector3<f64>,
}

/// One plane's sample of the whole robot's; half of the time of the decision counts for each.
pub(crate) fn sample_of_plane(
    excited: &ExcitedRobot,
    index: usize,
    sample: &Sample<10, 3>,
) -> Option<Sample<4, 1>> {
    let regulator = excited.regulator();
    let command = regulator.command_of(index)?;
    Some(Sample {
        t: sample.t,
        x: plane_of(&sample.x, index),
        estimate: command.estimate,
        u: command.u.add_scalar(excited.on_top()[index]),
        x_ref: plane_of(&sample.x_ref, index),
        cost: regulator.cost_of(index)?,
        status: command.status,
        active_bounds: command.active_bounds,
        step_time: sample.step_time / 2,
        gap: command.gap,
        guarantee: command.guarantee,
    })
}

/// One plane's row of the whole robot's log: the motors' torques as the plane feels them on the robot's true
/// `wheels` and `heading`, rad, and the plane's own `restart`.
pub(crate) fn log_of_plane(
    wheels: &Wheels<f64>,
    index: usize,
    row: &LogRow<10, 3>,
    restart: Option<Restart>,
    heading: f64,
) -> LogRow<4, 1> {
    let felt = |motors: &Vector3<f64>| {
        let torques = wheels.virtual_torques(motors).xy();
        Vector1::new(Heading::new(heading).to_floor(&torques)[index])
    };
    LogRow {
        t: row.t,
        readings: std::array::from_fn(|i| row.readings[4 * index + i]),
        observation: Observation {
            verdicts: std::array::from_fn(|i| row.observation.verdicts[4 * index + i]),
            restart,
        },
        commanded: felt(&row.commanded),
        applied: felt(&row.applied),
    }
}
