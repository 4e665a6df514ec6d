//! A fitted robot on data that it has not seen.

use crate::estimate::{EstimateError, Task, problem};
use crate::model::Segment;
use crate::parameter::{Choice, Parameter, Values};
use crate::segments::{Stretch, segments, spread};
use lpvmpc_design::{ShootingFit, ShootingModel, ShootingSettings};
use nalgebra::Vector3;

/// How far ahead a prediction is judged, s.
pub const HORIZONS: [f64; 4] = [0.1, 0.25, 0.5, 1.0];

/// The state at the begin of a prediction is found from so much before it, s.
const OBSERVED: f64 = 0.5;

/// At most so many windows; more tell little more.
const WINDOWS: usize = 200;

/// Errors on held-back data.
#[derive(Clone, Debug, PartialEq)]
pub struct Validation {
    /// chi^2 per value of held-back segments, their initial states fitted and nothing else: 1 is
    /// right. It judges a model without the growth of the unstable mode.
    pub chi_square: f64,
    /// Values that it is over.
    pub values: usize,
    /// Root of the mean square error of ball angle (rad), tilt (rad) and rate (rad/s) of
    /// predictions over each of [`HORIZONS`]; NaN where the held-back data are too short.
    pub errors: [Vector3<f64>; HORIZONS.len()],
}

/// Judges a robot on stretches that were held back.
///
/// # Errors
/// The stretches are too short, or the robot cannot be simulated there.
pub fn validate(
    task: &Task<'_>,
    values: &Values,
    noise: Vector3<f64>,
    stretches: &[Stretch],
) -> Result<Validation, EstimateError> {
    // Everything is held, so only the initial states are fitted.
    let held = Task {
        choices: Values(Parameter::ALL.map(|parameter| Choice::Fixed(values[parameter]))),
        ..task.clone()
    };
    let whole = segments(held.runs, stretches, held.segment, held.lead());
    let whole = states_of(&held, spread(&whole, WINDOWS), values, noise)?;
    let ahead = HORIZONS[HORIZONS.len() - 1];
    let windows = segments(held.runs, stretches, OBSERVED + ahead, held.lead());
    let windows = spread(&windows, WINDOWS);
    let errors = if windows.is_empty() {
        [Vector3::repeat(f64::NAN); HORIZONS.len()]
    } else {
        prediction_errors(&held, windows, values, noise)?
    };
    Ok(Validation {
        chi_square: whole.chi_square / whole.degrees_of_freedom(),
        values: whole.values,
        errors,
    })
}

/// The initial states of segments under a known robot.
fn states_of(
    held: &Task<'_>,
    segments: Vec<Segment>,
    values: &Values,
    noise: Vector3<f64>,
) -> Result<ShootingFit<4>, EstimateError> {
    if segments.is_empty() {
        return Err(EstimateError::NoSegments {
            segment: held.segment,
            lead: held.lead(),
        });
    }
    let model = held.model(segments, noise);
    let unknowns = held.unknowns(values, &model.coordinates);
    let problem = problem(&model, &unknowns, &[]);
    let initial = model.initial_states(values);
    Ok(problem.fit(initial, &ShootingSettings::default(), &|_| {})?)
}

fn prediction_errors(
    held: &Task<'_>,
    windows: Vec<Segment>,
    values: &Values,
    noise: Vector3<f64>,
) -> Result<[Vector3<f64>; HORIZONS.len()], EstimateError> {
    let observed = windows.iter().map(|window| {
        let time = &held.runs[window.run].time;
        let until = time[window.first] + OBSERVED;
        let rows = time[window.first..window.end].partition_point(|stamp| *stamp <= until);
        Segment {
            end: window.first + rows,
            ..*window
        }
    });
    let observed: Vec<Segment> = observed.collect();
    let states = states_of(held, observed.clone(), values, noise)?;
    let model = held.model(windows.clone(), noise);
    let mut sums = [(Vector3::zeros(), Vector3::<f64>::zeros()); HORIZONS.len()];
    for (index, window) in windows.iter().enumerate() {
        let mut outputs = Vec::new();
        model.simulate(
            index,
            &states.parameters,
            &states.initial[index],
            &mut outputs,
        );
        let run = &held.runs[window.run];
        let begin = run.time[observed[index].end - 1];
        for row in observed[index].end..window.end {
            let Some(predicted) = outputs.get(row - window.first) else {
                break;
            };
            let error = run.outputs[row] - predicted;
            for (sum, horizon) in sums.iter_mut().zip(HORIZONS) {
                if run.time[row] - begin <= horizon {
                    let there = error.map(|value| if value.is_nan() { 0.0 } else { 1.0 });
                    sum.0 += error.map(|value| if value.is_nan() { 0.0 } else { value * value });
                    sum.1 += there;
                }
            }
        }
    }
    Ok(sums.map(|(squares, counts)| squares.component_div(&counts).map(f64::sqrt)))
}
