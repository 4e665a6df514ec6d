//! The robot as its log shows it: plant, drive and sensors, simulated at the log's own times.

use crate::coordinates::Coordinates;
use crate::line::Line;
use crate::log::{BallAngle, Run};
use crate::parameter::{Parameter, Values};
use ballbot::{Ballbot, DriveFriction, Geometry};
use lpvmpc::Rk4;
use lpvmpc_design::ShootingModel;
use nalgebra::{Vector1, Vector3, Vector4};

/// The longest step of the integration, s. The fastest mode of a robot whose body weighs more than
/// its ball is slower than 1 kHz: one step is well within the stability limit, and for the 50 1/s
/// of the paper's robot its error is 1e-8 of the state.
pub const LONGEST_STEP: f64 = 2e-3;

/// As few equal steps of the integration over `interval` s as none is longer than [`LONGEST_STEP`].
pub(crate) fn steps(interval: f64) -> f64 {
    // A difference of times is rounded: rows every 10 ms take five steps, not five or six by chance.
    const ROUNDING: f64 = 1e-9;
    (interval / LONGEST_STEP - ROUNDING).ceil().max(1.0)
}

/// A robot with its drive and sensors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Robot {
    /// The plant, per unit of body mass: its torque is what the torque gain makes of the logged one.
    pub plant: Ballbot<f64>,
    /// All parameters, those of the plant included.
    pub values: Values,
}

impl Robot {
    /// The robot with these parameters.
    pub fn new(values: Values, geometry: Geometry<f64>) -> Self {
        Self {
            plant: Ballbot {
                b1: values[Parameter::B1],
                b2: values[Parameter::B2],
                b3: values[Parameter::B3],
                b4: values[Parameter::RollingFriction],
                drive: DriveFriction {
                    viscous: values[Parameter::DriveFriction],
                    coulomb: values[Parameter::DriveCoulomb],
                },
                geometry,
            },
            values,
        }
    }

    /// The torque that acts on the plant where `torque` (N m) is logged, N m.
    #[inline(always)]
    pub(crate) fn driving(&self, torque: f64) -> Vector1<f64> {
        Vector1::new(
            self.values[Parameter::TorqueGain] * (torque + self.values[Parameter::TorqueBias]),
        )
    }

    /// The state `duration` seconds later under a constant torque: one Runge-Kutta step of order 4.
    #[inline(always)]
    pub fn step(&self, x: &Vector4<f64>, torque: f64, duration: f64) -> Vector4<f64> {
        let [next] = Self::step_each([self], &[*x], [torque], duration);
        next
    }

    /// [`Robot::step`] of several robots.
    #[inline(always)]
    fn step_each<const LANES: usize>(
        robots: [&Self; LANES],
        x: &[Vector4<f64>; LANES],
        torque: [f64; LANES],
        duration: f64,
    ) -> [Vector4<f64>; LANES] {
        let mut next = *x;
        let mut driving = [Vector1::zeros(); LANES];
        // A loop: the closures of array::from_fn are not inlined.
        for i in 0..LANES {
            driving[i] = robots[i].driving(torque[i]);
        }
        let plants = robots.map(|robot| &robot.plant);
        Rk4::step_each(plants, &mut next, driving.each_ref(), duration);
        next
    }

    /// Whether the two differ at most in their sensors.
    fn moves_like(&self, other: &Self) -> bool {
        let acting = [
            Parameter::TorqueGain,
            Parameter::Delay,
            Parameter::TorqueBias,
        ];
        let alike = |parameter| self.values[parameter] == other.values[parameter];
        self.plant == other.plant && acting.into_iter().all(alike)
    }

    /// What the sensors show: ball angle, tilt, tilt rate.
    #[inline(always)]
    pub fn outputs(&self, x: &Vector4<f64>, ball_angle: BallAngle) -> Vector3<f64> {
        let phi = match ball_angle {
            BallAngle::Inertial => x[0],
            BallAngle::RelativeToBody => x[0] - x[1],
        };
        let creep =
            self.values[Parameter::CreepBall] * x[2] + self.values[Parameter::CreepTilt] * x[3];
        Vector3::new(
            phi + creep,
            x[1] + self.values[Parameter::TiltOffset],
            x[3] + self.values[Parameter::GyroBias],
        )
    }

    /// The state that the sensors show, with the ball's speed given.
    pub fn state(
        &self,
        outputs: &Vector3<f64>,
        phi_dot: f64,
        ball_angle: BallAngle,
    ) -> Vector4<f64> {
        let theta = outputs[1] - self.values[Parameter::TiltOffset];
        let theta_dot = outputs[2] - self.values[Parameter::GyroBias];
        let (phi, phi_dot) = match ball_angle {
            BallAngle::Inertial => (outputs[0], phi_dot),
            BallAngle::RelativeToBody => (outputs[0] + theta, phi_dot + theta_dot),
        };
        Vector4::new(phi, theta, phi_dot, theta_dot)
    }
}

/// Rows of one run, without gap between them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Segment {
    /// Which run.
    pub run: usize,
    /// First row.
    pub first: usize,
    /// One past the last row.
    pub end: usize,
}

/// Segments of runs, as data of a multiple-shooting fit with NX = 4 states and the NY = 3 outputs
/// ball angle, tilt, tilt rate.
#[derive(Clone, Debug)]
pub struct SegmentedRuns<'a> {
    /// The runs.
    pub runs: &'a [Run],
    /// The segments.
    pub segments: Vec<Segment>,
    /// What the fit's parameters are.
    pub coordinates: Coordinates,
    /// What phi is relative to.
    pub ball_angle: BallAngle,
    /// Standard deviations of the noise of the outputs.
    pub noise: Vector3<f64>,
}

impl SegmentedRuns<'_> {
    /// A start for each segment's initial state from the measured values around its first row.
    pub fn initial_states(&self, values: &Values) -> Vec<Vector4<f64>> {
        let robot = Robot::new(*values, self.coordinates.geometry);
        let segments = self.segments.iter();
        segments
            .map(|segment| {
                let run = &self.runs[segment.run];
                let (outputs, phi_dot) = first_outputs(run, *segment);
                robot.state(&outputs, phi_dot, self.ball_angle)
            })
            .collect()
    }
}

/// The first outputs of a segment, and the slope of its ball angle, from lines through its first
/// 30 ms. A missing value is taken from the next row that has one.
fn first_outputs(run: &Run, segment: Segment) -> (Vector3<f64>, f64) {
    let rows = segment.first..segment.end;
    let first = |output: usize| {
        let values = run.outputs[rows.clone()].iter().map(|row| row[output]);
        values
            .into_iter()
            .find(|value| !value.is_nan())
            .unwrap_or(0.0)
    };
    let start = run.time[segment.first];
    let window = rows
        .clone()
        .enumerate()
        .take_while(|(place, row)| *place < 4 || run.time[*row] - start <= 0.03)
        .map(|(_, row)| (run.time[row] - start, run.outputs[row][0]))
        .filter(|(_, phi)| !phi.is_nan());
    let line = Line::through(window);
    (Vector3::new(line.at(0.0), first(1), first(2)), line.slope)
}

impl ShootingModel<4, 3> for SegmentedRuns<'_> {
    fn segments(&self) -> usize {
        self.segments.len()
    }

    fn measured(&self, segment: usize) -> &[Vector3<f64>] {
        let Segment { run, first, end } = self.segments[segment];
        &self.runs[run].outputs[first..end]
    }

    fn noise(&self, _: usize) -> Vector3<f64> {
        self.noise
    }

    fn simulate(
        &self,
        segment: usize,
        parameters: &[f64],
        initial: &Vector4<f64>,
        outputs: &mut Vec<Vector3<f64>>,
    ) {
        let robot = self.robot(parameters);
        let [states] = self.states(segment, [&robot], [*initial]);
        let rows = states.iter().map(|x| robot.outputs(x, self.ball_angle));
        outputs.extend(rows);
    }

    fn simulate_each(
        &self,
        segment: usize,
        starts: &[(Vec<f64>, Vector4<f64>)],
    ) -> Vec<Vec<Vector3<f64>>> {
        let Some((parameters, first)) = starts.first() else {
            return Vec::new();
        };
        let leader = self.robot(parameters);
        // What only the sensors have moves as the first does; so does one that stands elsewhere:
        // nothing depends on phi.
        let follows = |robot: &Robot, initial: &Vector4<f64>| {
            robot.moves_like(&leader) && initial.fixed_rows::<3>(1) == first.fixed_rows::<3>(1)
        };
        let robots: Vec<Robot> = starts.iter().map(|(one, _)| self.robot(one)).collect();
        let pairs = || robots.iter().zip(starts.iter().map(|(_, initial)| initial));
        let others: Vec<(&Robot, Vector4<f64>)> = std::iter::once((&leader, *first))
            .chain(pairs().filter_map(|(robot, x)| (!follows(robot, x)).then_some((robot, *x))))
            .collect();
        let mut motions = Vec::with_capacity(others.len());
        // More of them side by side do not fit into the processor's window.
        for some in others.chunks(4) {
            if let [(robot, initial)] = some {
                motions.extend(self.states(segment, [robot], [*initial]));
                continue;
            }
            // The last once more in the place of each that is missing: side by side, none waits for the
            // operations of another.
            let [a, b, c, d] = [0, 1, 2, 3].map(|lane| some[lane.min(some.len() - 1)]);
            let each = self.states(segment, [a.0, b.0, c.0, d.0], [a.1, b.1, c.1, d.1]);
            motions.extend(each.into_iter().take(some.len()));
        }
        let mut next = 0;
        pairs()
            .map(|(robot, initial)| {
                let (motion, shift) = if follows(robot, initial) {
                    (0, Vector4::new(initial[0] - first[0], 0.0, 0.0, 0.0))
                } else {
                    next += 1;
                    (next, Vector4::zeros())
                };
                let states = motions[motion].iter();
                states
                    .map(|x| robot.outputs(&(x + shift), self.ball_angle))
                    .collect()
            })
            .collect()
    }
}

impl SegmentedRuns<'_> {
    fn robot(&self, parameters: &[f64]) -> Robot {
        let values = self.coordinates.values(parameters);
        Robot::new(values, self.coordinates.geometry)
    }

    /// The states at a segment's rows of several robots side by side, of each as far as it is a
    /// robot's.
    fn states<const LANES: usize>(
        &self,
        segment: usize,
        robots: [&Robot; LANES],
        initial: [Vector4<f64>; LANES],
    ) -> [Vec<Vector4<f64>>; LANES] {
        let Segment { run, first, end } = self.segments[segment];
        let run = &self.runs[run];
        let delays = robots.map(|robot| robot.values[Parameter::Delay]);
        let mut torques = delays.map(|delay| run.torque_from(run.time[first] - delay));
        let one_delay = delays.iter().all(|delay| *delay == delays[0]);
        let mut x = initial;
        let mut states = initial.map(|initial| {
            let mut states = Vec::with_capacity(end - first);
            states.push(initial);
            states
        });
        for row in first + 1..end {
            let interval = run.time[row] - run.time[row - 1];
            let steps = steps(interval);
            let duration = interval / steps;
            for _ in 0..steps as usize {
                // The mean over the step is continuous in the delay.
                let torque = if one_delay {
                    [torques[0].mean_over(duration); LANES]
                } else {
                    torques.each_mut().map(|torque| torque.mean_over(duration))
                };
                x = Robot::step_each(robots, &x, torque, duration);
            }
            let mut all_left = true;
            for (states, x) in states.iter_mut().zip(&x) {
                let stays = x[2].abs() < 1e6 && x[3].abs() < 1e6;
                if stays && states.len() == row - first {
                    states.push(*x);
                    all_left = false;
                }
            }
            if all_left {
                break;
            }
        }
        states
    }
}
