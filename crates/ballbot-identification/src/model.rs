//! The robot as its log shows it: plant, drive and sensors, simulated at the log's own times.

use crate::coordinates::Coordinates;
use crate::line::Line;
use crate::log::{BallAngle, Run, TorqueReader};
use crate::parameter::{Parameter, Values};
use crate::varied::Varied;
use ballbot::{Ballbot, DriveFriction, Geometry};
use lpvmpc::Rk4;
use lpvmpc_design::{LinearizedOutputs, ShootingModel};
use nalgebra::{DMatrix, Vector1, Vector3, Vector4};

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
        Rk4::step(&self.plant, x, &self.driving(torque), duration)
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
        let states = self.states(segment, &robot, *initial);
        let rows = states.iter().map(|x| robot.outputs(x, self.ball_angle));
        outputs.extend(rows);
    }

    fn linearized(
        &self,
        segment: usize,
        parameters: &[f64],
        initial: &Vector4<f64>,
        indices: &[usize],
    ) -> Option<LinearizedOutputs<3>> {
        let indices: Vec<Option<Parameter>> = indices
            .iter()
            .map(|index| Parameter::ALL.get(*index).copied())
            .collect();
        Some(self.derivatives(segment, parameters, initial, &indices))
    }
}

impl SegmentedRuns<'_> {
    fn robot(&self, parameters: &[f64]) -> Robot {
        let values = self.coordinates.values(parameters);
        Robot::new(values, self.coordinates.geometry)
    }

    /// The states at a segment's rows, as far as they are a robot's.
    fn states(&self, segment: usize, robot: &Robot, initial: Vector4<f64>) -> Vec<Vector4<f64>> {
        let mut torque = self.torque(segment, robot.values[Parameter::Delay]);
        let mut x = initial;
        let mut states = Vec::with_capacity(self.measured(segment).len());
        states.push(initial);
        for (steps, duration) in self.intervals(segment) {
            for _ in 0..steps {
                x = robot.step(&x, torque.mean_over(duration), duration);
            }
            if !is_robots(&x) {
                break;
            }
            states.push(x);
        }
        states
    }

    /// From each row of a segment to the next: how many steps of the integration, and how long, s.
    fn intervals(&self, segment: usize) -> impl Iterator<Item = (usize, f64)> {
        let Segment { run, first, end } = self.segments[segment];
        let time = &self.runs[run].time[first..end];
        time.windows(2).map(|pair| {
            let interval = pair[1] - pair[0];
            let steps = steps(interval);
            (steps as usize, interval / steps)
        })
    }

    /// The torque that acts from the first row of a segment on, after a delay in s.
    fn torque(&self, segment: usize, delay: f64) -> TorqueReader<'_> {
        let Segment { run, first, .. } = self.segments[segment];
        self.runs[run].torque_before(first, delay)
    }

    /// The outputs of a segment with their derivatives by the initial state and by the coordinates
    /// of the parameters `by`; `None` for what has no effect on them.
    pub(crate) fn derivatives(
        &self,
        segment: usize,
        parameters: &[f64],
        initial: &Vector4<f64>,
        by: &[Option<Parameter>],
    ) -> LinearizedOutputs<3> {
        let robot = self.robot(parameters);
        let rows = self.measured(segment).len();
        let jacobian = self.coordinates.jacobian();
        // The parameters that a coordinate moves, and by how much.
        let moved: Vec<Vec<(Parameter, f64)>> = by
            .iter()
            .map(|coordinate| match coordinate {
                None => Vec::new(),
                Some(coordinate) => Parameter::ALL
                    .into_iter()
                    .map(|one| (one, jacobian[(one.index(), coordinate.index())]))
                    .filter(|(_, share)| *share != 0.0)
                    .collect(),
            })
            .collect();
        let mut outputs = Vec::with_capacity(rows);
        let mut slopes = DMatrix::zeros(3 * rows, 4 + by.len());
        let mut record = |varied: &Varied| {
            let first = 3 * outputs.len();
            outputs.push(robot.outputs(&varied.x, self.ball_angle));
            for (output, shown) in varied.outputs(&robot, self.ball_angle).iter().enumerate() {
                for state in 0..4 {
                    slopes[(first + output, state)] = shown.by_state[state];
                }
                for (column, moved) in moved.iter().enumerate() {
                    let terms = moved.iter();
                    slopes[(first + output, 4 + column)] = terms
                        .map(|(parameter, share)| shown.by_parameter[*parameter] * share)
                        .sum();
                }
            }
        };
        let delay = robot.values[Parameter::Delay];
        let mut torque = self.torque(segment, delay);
        let mut delayed = self.torque(segment, delay + DELAY_DIFFERENCE);
        let mut varied = Varied::start(*initial);
        record(&varied);
        for (steps, duration) in self.intervals(segment) {
            for _ in 0..steps {
                let torque = torque.mean_over(duration);
                // The mean over a step is continuous in the delay.
                let by_delay = (delayed.mean_over(duration) - torque) / DELAY_DIFFERENCE;
                varied.step(&robot, torque, by_delay, duration);
            }
            if !is_robots(&varied.x) || !varied.is_bounded() {
                break;
            }
            record(&varied);
        }
        LinearizedOutputs { outputs, slopes }
    }
}

/// Over which the torque is differentiated by the delay, s: far above the rounding of times, and far
/// below the time between two rows.
const DELAY_DIFFERENCE: f64 = 1e-8;

/// Whether a robot can have these rates: beyond them the simulation of a wrong model is at its end.
fn is_robots(x: &Vector4<f64>) -> bool {
    x[2].abs() < 1e6 && x[3].abs() < 1e6
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Torque;

    /// A swaying torque over 0.6 s, with a row that came late.
    fn run() -> Run {
        let time: Vec<f64> = (0..120)
            .map(|row| 5e-3 * f64::from(row) + if row == 70 { 2e-3 } else { 0.0 })
            .collect();
        Run {
            name: "swaying".to_owned(),
            outputs: vec![Vector3::zeros(); time.len()],
            torque: time.iter().map(|t| (25.0 * t).sin() + 0.3).collect(),
            stretches: std::iter::once(0..time.len()).collect(),
            torque_kind: Torque::Applied,
            time,
        }
    }

    #[test]
    fn derivatives_are_those_of_differences() {
        for (ball_angle, coulomb) in [
            (BallAngle::Inertial, 0.0),
            (BallAngle::RelativeToBody, 0.05),
        ] {
            let runs = [run()];
            let segments = vec![Segment {
                run: 0,
                first: 20,
                end: 120,
            }];
            let coordinates = Coordinates::new(&Values::usual(), Geometry::paper(), true);
            let model = SegmentedRuns {
                runs: &runs,
                segments,
                coordinates,
                ball_angle,
                noise: Vector3::repeat(1.0),
            };
            let mut values = Values([0.01; Parameter::ALL.len()]);
            values[Parameter::B1] = 0.04;
            values[Parameter::B3] = 0.15;
            values[Parameter::DriveCoulomb] = coulomb;
            values[Parameter::TorqueGain] = 0.1;
            // Between the rows: where a step begins at one of them, the torque's mean has a kink.
            values[Parameter::Delay] = 0.0123;
            let parameters = coordinates.of(&values);
            let initial = Vector4::new(0.3, 0.05, -0.4, 0.2);
            let indices: Vec<usize> = (0..Parameter::ALL.len()).collect();
            let found = model
                .linearized(0, &parameters, &initial, &indices)
                .unwrap();
            let outputs = |parameters: &[f64], initial: &Vector4<f64>| {
                let mut outputs = Vec::new();
                model.simulate(0, parameters, initial, &mut outputs);
                outputs
            };
            assert_eq!(found.outputs.len(), 100);
            let scales = coordinates.scales();
            for column in 0..4 + indices.len() {
                let by = 1e-5
                    * if column < 4 {
                        1.0
                    } else {
                        scales.0[column - 4]
                    };
                let at = |by: f64| {
                    let (mut parameters, mut initial) = (parameters.clone(), initial);
                    match column {
                        0..4 => initial[column] += by,
                        _ => parameters[column - 4] += by,
                    }
                    outputs(&parameters, &initial)
                };
                let (above, below) = (at(by), at(-by));
                let differences = above.iter().zip(&below);
                let differences: Vec<Vector3<f64>> = differences
                    .map(|(above, below)| (above - below) / (2.0 * by))
                    .collect();
                let largest = differences.iter().map(Vector3::amax).fold(0.0, f64::max);
                assert!(largest > 0.0, "column {column} moves nothing");
                for (row, difference) in differences.iter().enumerate() {
                    for output in 0..3 {
                        let slope = found.slopes[(3 * row + output, column)];
                        assert!(
                            (slope - difference[output]).abs() <= 1e-5 * largest,
                            "column {column}, row {row}, output {output}: {slope} for {}",
                            difference[output]
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn a_simulation_that_is_left_has_no_derivatives_afterwards() {
        let runs = [run()];
        let coordinates = Coordinates::new(&Values::usual(), Geometry::paper(), true);
        let model = SegmentedRuns {
            runs: &runs,
            segments: vec![Segment {
                run: 0,
                first: 20,
                end: 120,
            }],
            coordinates,
            ball_angle: BallAngle::Inertial,
            noise: Vector3::repeat(1.0),
        };
        let mut values = Values([0.01; Parameter::ALL.len()]);
        // Friction that gives energy, much of it.
        values[Parameter::RollingFriction] = -30.0;
        values[Parameter::TorqueGain] = 0.1;
        let parameters = coordinates.of(&values);
        let initial = Vector4::new(0.3, 0.05, -0.4, 0.2);
        let found = model
            .linearized(0, &parameters, &initial, &[0, 1, 3])
            .unwrap();
        assert!(found.outputs.len() < 100);
        assert!(found.slopes.iter().all(|slope| slope.is_finite()));
        let rest = found.slopes.rows_range(3 * found.outputs.len()..);
        assert!(rest.iter().all(|slope| *slope == 0.0));
    }
}
