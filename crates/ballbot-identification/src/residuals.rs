//! What the residuals say about the model.

use crate::estimate::{Estimate, Status, Task, problem};
use crate::joint::{Joint, SegmentedPlanes};
use crate::line::Line;
use crate::log::Run;
use crate::parameter::{Parameter, Values};
use lpvmpc_design::{Correlation, ShootingModel, autocorrelation, cross_correlation};
use nalgebra::{DMatrix, DVector, Vector3, Vector4};

/// The outputs in words, in the order of all vectors of three.
pub const OUTPUTS: [&str; 3] = ["ball angle", "tilt", "tilt rate"];

/// Lags that are looked at, rows.
const LAGS: usize = 25;

/// The residuals of one output.
#[derive(Clone, Debug)]
pub struct OutputResidual {
    /// Standard deviation, rad or rad/s.
    pub spread: f64,
    /// The least it can be: the noise of the sensor.
    pub floor: f64,
    /// Standard deviation of the measured values from a straight line in each segment: the motion.
    pub motion: f64,
    /// Correlation with itself.
    pub autocorrelation: Correlation,
    /// Correlation with the torque.
    pub with_torque: Correlation,
}

impl OutputResidual {
    /// Residual over noise: 1 is right, from about 1.3 on the model misses something.
    pub fn normalised(&self) -> f64 {
        self.spread / self.floor
    }

    /// Which part of the motion the robot does not explain.
    pub fn unexplained(&self) -> f64 {
        self.spread / self.motion
    }

    /// Whether it is noise.
    pub fn is_white(&self) -> bool {
        is_white(&self.autocorrelation)
    }
}

/// Segments that the colour of residuals is taken from; more tell little more.
const COLOUR_SEGMENTS: usize = 60;

/// How many rows of each output count as one, since the residuals repeat themselves (the integrated
/// autocorrelation): 1 for white noise.
pub fn repetition(residuals: &[Vec<Vector3<f64>>]) -> Vector3<f64> {
    let every = residuals.len().div_ceil(COLOUR_SEGMENTS).max(1);
    Vector3::from_fn(|output, _| {
        let pieces = residuals.iter().step_by(every);
        let pieces: Vec<Vec<f64>> = pieces
            .map(|rows| rows.iter().map(|row| row[output]).collect())
            .collect();
        // Beyond half of a segment its fitted initial state makes up for what is left.
        let longest = pieces.iter().map(Vec::len).max().unwrap_or(0) / 2;
        let correlation = autocorrelation(&pieces, longest);
        // Only as far as it is positive: what follows is chance.
        let positive = correlation
            .values
            .iter()
            .take_while(|value| **value > COLOURED / 2.0);
        if is_white(&correlation) {
            1.0
        } else {
            1.0 + 2.0 * positive.sum::<f64>()
        }
    })
}

/// A fit leaves correlations of a few percent; with many rows they are significant, and mean
/// nothing.
const COLOURED: f64 = 0.1;

fn is_white(autocorrelation: &Correlation) -> bool {
    let (_, largest) = autocorrelation.largest();
    autocorrelation.exceeding() <= 0.2 || largest.abs() < COLOURED
}

/// Measured minus simulated outputs with their times, segment by segment.
#[derive(Clone, Debug)]
pub struct SegmentResidual {
    /// Which run.
    pub run: usize,
    /// Times of the rows, s.
    pub time: Vec<f64>,
    /// Measured outputs.
    pub measured: Vec<Vector3<f64>>,
    /// Simulated outputs.
    pub simulated: Vec<Vector3<f64>>,
    /// Torque, N m.
    pub torque: Vec<f64>,
}

/// What the fitted robot does, beside what was measured.
pub fn simulated(task: &Task<'_>, estimate: &Estimate) -> Vec<SegmentResidual> {
    let model = task.model(estimate.segments.clone(), estimate.noise);
    let pairs = estimate.segments.iter().zip(&estimate.initial);
    pairs
        .enumerate()
        .map(|(index, (segment, initial))| {
            let mut simulated = Vec::new();
            model.simulate(index, &estimate.coordinates, initial, &mut simulated);
            let rows = segment.first..segment.end;
            let run: &Run = &task.runs[segment.run];
            SegmentResidual {
                run: segment.run,
                time: run.time[rows.clone()].to_vec(),
                measured: run.outputs[rows.clone()].to_vec(),
                simulated,
                torque: run.torque[rows].to_vec(),
            }
        })
        .collect()
}

/// The residuals output by output.
pub fn tests(
    segments: &[SegmentResidual],
    spread: Vector3<f64>,
    floor: Vector3<f64>,
) -> Vec<OutputResidual> {
    let torque: Vec<Vec<f64>> = segments.iter().map(|s| s.torque.clone()).collect();
    (0..OUTPUTS.len())
        .filter(|output| {
            let mut rows = segments.iter().flat_map(|segment| &segment.measured);
            rows.any(|row| !row[*output].is_nan())
        })
        .map(|output| {
            let residual = |segment: &SegmentResidual| {
                let pairs = segment.measured.iter().zip(&segment.simulated);
                pairs.map(|(m, s)| m[output] - s[output]).collect()
            };
            let pieces: Vec<Vec<f64>> = segments.iter().map(residual).collect();
            OutputResidual {
                spread: spread[output],
                floor: floor[output],
                motion: motion(segments, output),
                autocorrelation: autocorrelation(&pieces, LAGS),
                with_torque: cross_correlation(&pieces, &torque, LAGS),
            }
        })
        .collect()
}

/// Standard deviation of an output from a straight line in each segment.
fn motion(segments: &[SegmentResidual], output: usize) -> f64 {
    let (mut squares, mut count) = (0.0, 0.0);
    for segment in segments {
        let values = segment.measured.iter().map(|row| row[output]);
        let points: Vec<(f64, f64)> = segment.time.iter().copied().zip(values).collect();
        let line = Line::through(points.iter().copied().filter(|(_, value)| !value.is_nan()));
        for (time, value) in points.into_iter().filter(|(_, value)| !value.is_nan()) {
            squares += (value - line.at(time)).powi(2);
            count += 1.0;
        }
    }
    (squares / f64::max(count, 1.0)).sqrt()
}

/// What a fit of a parameter that was held would change, to first order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScoreTest {
    /// The parameter.
    pub parameter: Parameter,
    /// The value that it was held at.
    pub held: f64,
    /// By how much the residuals want to change it.
    pub change: f64,
    /// Standard deviation of the change.
    pub standard_deviation: f64,
}

/// From so many standard deviations on a score is no chance: of seven held parameters none reaches
/// it in 99.9 % of the fits.
const ALARM: f64 = 4.0;

impl ScoreTest {
    /// Whether the residuals ask for it.
    pub fn is_alarm(&self) -> bool {
        self.change.abs() > ALARM * self.standard_deviation
    }
}

/// What the residuals say against the fit.
#[derive(Clone, Debug)]
pub struct Scores {
    /// Of the parameters that were held, plane by plane.
    pub held: Vec<Vec<ScoreTest>>,
    /// Of the parameters that the planes share.
    pub differences: Vec<Difference>,
}

/// By how much a parameter of the second plane, which the planes share, would differ from that of the
/// first if each had its own, to first order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// The parameter.
    pub parameter: Parameter,
    /// Its value, which is the one of both planes.
    pub value: f64,
    /// The second plane's minus the first's.
    pub change: f64,
    /// Standard deviation of the change.
    pub standard_deviation: f64,
}

impl Difference {
    /// The change over its standard deviation.
    pub fn significance(&self) -> f64 {
        self.change.abs() / self.standard_deviation
    }

    /// Whether it is no chance.
    pub fn is_alarm(&self) -> bool {
        self.significance() > ALARM
    }
}

/// Score tests (Rao 1948) of every parameter that was held, and of every one that planes share. The
/// noise is that of the residuals, their colour included, so a model that misses much asks for little
/// by itself.
pub fn score_tests(joint: &Joint<'_>, estimates: &[Estimate]) -> Scores {
    let segments = estimates.iter().map(|plane| plane.segments.clone());
    let noises: Vec<Vector3<f64>> = estimates.iter().map(|plane| plane.noise).collect();
    let values: Vec<Values> = estimates.iter().map(|plane| plane.values).collect();
    // Of planes that share nothing: what they share are directions in which both move alike.
    let (variables, apart) = (joint.variables, joint.variables.apart());
    let model = SegmentedPlanes {
        variables: apart,
        ..joint.model(segments.collect(), &noises)
    };
    let unknowns = joint.unknowns(&values, &model);
    let priors = joint.priors(&model, apart);
    let problem = problem(&model, &unknowns, &priors);
    let coordinates = estimates.iter().flat_map(|plane| plane.coordinates.clone());
    let coordinates: Vec<f64> = coordinates.collect();
    let initial = estimates.iter().flat_map(|plane| plane.initial.clone());
    let initial: Vec<Vector4<f64>> = initial.collect();
    let all: Vec<usize> = (0..apart.count()).collect();
    let reduced = problem.reduced(&coordinates, &initial, &all);

    let direction = |plane: usize, parameter: Parameter| {
        let mut direction = DVector::zeros(apart.count());
        for other in 0..variables.planes() {
            if other == plane || !variables.is_own(parameter) {
                direction[apart.place(other, parameter)] = 1.0;
            }
        }
        direction
    };
    let found = variables.all().filter(|(plane, parameter)| {
        let places = estimates.first().map(|plane| &plane.fit.reduced.indices);
        places.is_some_and(|places| places.contains(&variables.place(*plane, *parameter)))
    });
    let found: Vec<DVector<f64>> = found.map(|(plane, one)| direction(plane, one)).collect();
    // The step of a direction that a fit of it beside all that was found would make.
    let step = |direction: DVector<f64>| {
        let mut columns = found.clone();
        columns.push(direction);
        let columns = DMatrix::from_columns(&columns);
        let information = columns.tr_mul(&reduced.information) * &columns;
        let gradient = columns.tr_mul(&reduced.gradient);
        let covariance = crate::covariance::inverse(&information);
        let last = columns.ncols() - 1;
        let change = -(covariance.row(last) * gradient)[0];
        let standard_deviation = covariance[(last, last)].sqrt();
        let finite = change.is_finite() && standard_deviation.is_finite();
        finite.then_some((change, standard_deviation))
    };
    let held = |plane: usize| {
        let (task, estimate) = (&joint.tasks[plane], &estimates[plane]);
        let bounds = model.planes[plane]
            .coordinates
            .bounds(&estimate.values, task.physical);
        let held = Parameter::ALL
            .into_iter()
            .filter(|parameter| !task.choices[*parameter].is_free());
        held.filter_map(|parameter| {
            let (change, standard_deviation) = step(direction(plane, parameter))?;
            let (lower, upper) = bounds[parameter];
            let value = estimate.coordinates[parameter.index()];
            let possible = (change > 0.0 && value < upper) || (change < 0.0 && value > lower);
            possible.then_some(ScoreTest {
                parameter,
                held: value,
                change,
                standard_deviation,
            })
        })
        .collect()
    };
    let differences = || {
        let [first, second] = estimates else {
            return Vec::new();
        };
        let shared = Parameter::ALL.into_iter().filter(|parameter| {
            !variables.is_own(*parameter) && first.status[*parameter] == Status::Found
        });
        shared
            .filter_map(|parameter| {
                // What changes the second plane's parameter and no other.
                let mut moved = second.values;
                moved[parameter] += 1.0;
                let moved = model.planes[1].coordinates.of(&moved);
                let mut direction = DVector::zeros(apart.count());
                for (i, to) in moved.into_iter().enumerate() {
                    let place = apart.place(1, Parameter::ALL[i]);
                    direction[place] = to - second.coordinates[i];
                }
                let (change, standard_deviation) = step(direction)?;
                Some(Difference {
                    parameter,
                    value: first.values[parameter],
                    change,
                    standard_deviation,
                })
            })
            .collect()
    };
    Scores {
        held: (0..estimates.len()).map(held).collect(),
        differences: differences(),
    }
}
