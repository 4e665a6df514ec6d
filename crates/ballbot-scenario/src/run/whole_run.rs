//! The run of a robot whose planes share three motors.

use crate::error::ScenarioError;
use crate::prepare::prepared::{Plane, Prepared};
use crate::prepare::three_motors::ThreeMotors;
use crate::run::excited_robot::ExcitedRobot;
use crate::run::motor_sample::{MotorSample, log_of_plane, sample_of_plane};
use crate::run::record::{Record, RunHooks};
use crate::run::whole_robot::{State, WholeRobot, whole_world};
use ballbot::{HEADING, RobotRegulator, plane_feedback, plane_of};
use lpvmpc_sim::{ClosedLoop, Recording, Termination, Trajectory, World};

type WholeLoop = ClosedLoop<ExcitedRobot, WholeRobot, 10, 3, 10, 4>;

impl Prepared {
    /// Runs both planes together.
    pub(crate) fn record_whole(
        &self,
        motors: &ThreeMotors,
        planes: [&Plane; 2],
        hooks: &RunHooks<'_>,
    ) -> Result<Record, ScenarioError> {
        let reference = |t: f64| self.whole_reference(motors, planes, t);
        let mut closed_loop = self.whole_loop(motors, planes)?;
        let mut samples = [Vec::new(), Vec::new()];
        let mut logs = [Vec::new(), Vec::new()];
        let mut robot_log = Vec::new();
        let mut turns = Vec::with_capacity(self.samples);
        let mut termination = Termination::Complete;
        for k in 0..self.samples {
            let mut rows = Vec::new();
            let sample = closed_loop.sample(&reference, hooks.clock, &mut |row| {
                rows.push(row);
            });
            let sample = match sample {
                Ok(sample) => sample,
                Err(early) => {
                    termination = early;
                    break;
                }
            };
            let restarts = closed_loop.regulator.take_restarts();
            let regulator = &closed_loop.regulator;
            for (index, (samples, log)) in samples.iter_mut().zip(&mut logs).enumerate() {
                let wheels = &planes[index].world.robot.wheels;
                samples.extend(sample_of_plane(regulator, index, &sample));
                log.extend(rows.iter().zip(&restarts).map(|(row, restarts)| {
                    let heading = sample.x[HEADING] + sample.x[HEADING + 1] * (row.t - sample.t);
                    log_of_plane(wheels, index, row, restarts[index], heading)
                }));
            }
            robot_log.extend(rows);
            turns.push(MotorSample {
                t: sample.t,
                heading: sample.x[HEADING],
                target: sample.x_ref[HEADING],
                torques: sample.u,
            });
            (hooks.progress)(planes.len() * (k + 1));
        }
        if let (Termination::Complete, Err(late)) = (&termination, closed_loop.in_range()) {
            termination = late;
        }
        let final_time = closed_loop.world.time();
        let (x, x_ref) = (closed_loop.world.state(), reference(final_time));
        let of_plane = |(index, (samples, log))| Recording {
            trajectory: Trajectory {
                samples,
                final_time,
                final_state: plane_of(x, index),
                final_reference: plane_of(&x_ref, index),
                termination: of_plane(&termination),
            },
            log,
        };
        let planes = samples.into_iter().zip(logs).enumerate().map(of_plane);
        Ok(Record {
            planes: planes.collect(),
            motors: Some(turns),
            robot_log,
        })
    }

    /// The state reference of the whole robot at the time `t` s.
    fn whole_reference(&self, motors: &ThreeMotors, [x, y]: [&Plane; 2], t: f64) -> State {
        let mut reference = State::zeros();
        for (index, plane) in [x, y].into_iter().enumerate() {
            let part = plane.state_reference(t);
            reference.fixed_rows_mut::<4>(4 * index).copy_from(&part);
        }
        let target = motors.turning.target(t);
        reference.fixed_rows_mut::<2>(HEADING).copy_from(&target);
        reference
    }

    fn whole_loop(
        &self,
        motors: &ThreeMotors,
        [x, y]: [&Plane; 2],
    ) -> Result<WholeLoop, ScenarioError> {
        let period = x.world.settings.period;
        let plane = || {
            plane_feedback(
                &self.ballbot,
                &self.planner(),
                &self.feedback,
                &self.settings.u,
                period,
            )
        };
        let regulators = [plane()?, plane()?];
        let (robot, settings) = whole_world(motors, [&x.world, &y.world]);
        let mut start = State::zeros();
        for (index, plane) in [x, y].into_iter().enumerate() {
            start
                .fixed_rows_mut::<4>(4 * index)
                .copy_from(&plane.initial_state);
        }
        start[HEADING] = motors.turning.initial;
        let world = World::new(robot, start, settings)?;
        let ThreeMotors { limits, turning } = *motors;
        let regulator = RobotRegulator::new(
            regulators,
            (),
            self.wheels,
            limits,
            turning.law,
            turning.initial,
        );
        let regulator = ExcitedRobot::new(regulator, x.world.excitation.clone());
        let mut closed_loop = ClosedLoop::new(regulator, world)?;
        closed_loop.without_plan = x.world.without_plan;
        for (index, plane) in [x, y].into_iter().enumerate() {
            for i in 0..4 {
                let range = &plane.world.range;
                closed_loop.range.lower[4 * index + i] = range.lower[i];
                closed_loop.range.upper[4 * index + i] = range.upper[i];
            }
        }
        Ok(closed_loop)
    }
}

/// How the run of a plane ended, for both planes: they end together.
fn of_plane(termination: &Termination) -> Termination {
    match termination {
        Termination::OutOfRange { t, component } => Termination::OutOfRange {
            t: *t,
            component: component % 4,
        },
        termination => termination.clone(),
    }
}
