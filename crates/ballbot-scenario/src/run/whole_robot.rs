//! Both planes and the heading as one plant on three motors, and its world.

use crate::prepare::heading::Turning;
use crate::prepare::three_motors::ThreeMotors;
use crate::prepare::world::{PlaneWorld, Robot};
use ballbot::{HEADING, Heading, RobotState, Wheels, plane_of};
use lpvmpc_sim::{Actuator, Disturbance, Plant, Sensor, WorldSettings};
use nalgebra::{SVector, Vector1, Vector3, Vector4};

/// The state in the numbers of the simulation.
pub(crate) type State = RobotState<f64>;

/// The whole robot; the inputs are the motors' torques, N m. The loads are those of the planes.
#[derive(Clone, Debug)]
pub(crate) struct WholeRobot {
    planes: [Robot; 2],
    wheels: Wheels<f64>,
    turning: Turning,
}

impl Plant<10, 3, 4> for WholeRobot {
    fn derivative(&self, x: &State, motors: &Vector3<f64>, loads: &Vector4<f64>) -> State {
        let torques = self.wheels.virtual_torques(motors);
        let floor = Heading::new(x[HEADING]).to_floor(&torques.xy());
        let mut x_dot = State::zeros();
        for (index, robot) in self.planes.iter().enumerate() {
            let x = plane_of(x, index);
            let torque = Vector1::new(floor[index]);
            let load = loads.fixed_rows::<2>(2 * index).into_owned();
            let motion = robot.derivative(&x, &torque, &load);
            x_dot.fixed_rows_mut::<4>(4 * index).copy_from(&motion);
        }
        let rate = x[HEADING + 1];
        let gear = self.planes[0].mechanics.ballbot.gear();
        x_dot[HEADING] = rate;
        x_dot[HEADING + 1] = self.turning.acceleration(rate, torques[2], gear);
        x_dot
    }
}

/// The planes' worlds as one, with the whole robot in it.
pub(crate) fn whole_world(
    motors: &ThreeMotors,
    [x, y]: [&PlaneWorld; 2],
) -> (WholeRobot, WorldSettings<10, 3, 10, 4>) {
    let settings = &x.settings;
    let mut sensors = Sensor::ideal_states();
    for (index, world) in [x, y].into_iter().enumerate() {
        for (i, sensor) in world.settings.sensors.iter().enumerate() {
            let place = 4 * index + i;
            sensors[place] = Sensor {
                row: widen(&sensor.row, index),
                noise: sensor.noise,
                bias: sensor.bias,
                resolution: sensor.resolution,
                dropout: sensor.dropout,
                every: sensor.every,
                late: sensor.late,
                stale: sensor.stale,
            };
        }
    }
    let [angle, rate] = motors.turning.sensors(HEADING);
    (sensors[HEADING], sensors[HEADING + 1]) = (angle, rate);
    let [drive] = settings.actuators;
    let motor = Actuator {
        limit: drive.limit.min(motors.limits.motor),
        dead_zone: drive.dead_zone,
        lag: drive.lag,
    };
    let pushes = [x, y].into_iter().enumerate().flat_map(|(index, world)| {
        let pushes = world.settings.disturbances.iter();
        pushes.map(move |push| widen_push(push, index))
    });
    let robot = WholeRobot {
        planes: [x.robot, y.robot],
        // Of one robot, in both planes the same.
        wheels: x.robot.wheels,
        turning: motors.turning,
    };
    let settings = WorldSettings {
        period: settings.period,
        sensors,
        actuators: [motor; 3],
        delay: settings.delay,
        disturbances: pushes.collect(),
        seed: settings.seed,
        tolerances: settings.tolerances,
    };
    (robot, settings)
}

/// What belongs to the plane `index`, at its place among both planes'.
fn widen<const FROM: usize, const TO: usize>(
    of_plane: &SVector<f64, FROM>,
    index: usize,
) -> SVector<f64, TO> {
    let mut wide = SVector::<f64, TO>::zeros();
    wide.fixed_rows_mut::<FROM>(FROM * index)
        .copy_from(of_plane);
    wide
}

fn widen_push(push: &Disturbance<4, 2>, index: usize) -> Disturbance<10, 4> {
    match *push {
        Disturbance::Jump { time, change } => Disturbance::Jump {
            time,
            change: widen(&change, index),
        },
        Disturbance::Impulse { time, impulse } => Disturbance::Impulse {
            time,
            impulse: widen(&impulse, index),
        },
        Disturbance::Load { from, until, load } => Disturbance::Load {
            from,
            until,
            load: widen(&load, index),
        },
    }
}
