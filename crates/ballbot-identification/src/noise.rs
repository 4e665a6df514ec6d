//! The noise of the sensors, from the log alone.

use crate::log::{Run, quantile};
use nalgebra::Vector3;

/// Standard deviation of the noise of each output: what is left of white noise after three
/// differences, in which the robot's motion, smooth from row to row, all but vanishes.
///
/// It is a lower bound of what a fit can leave. Quantisation counts as far as it changes from row
/// to row. An output that is not measured has 1.
pub fn floor(runs: &[Run]) -> Vector3<f64> {
    Vector3::from_fn(|output, _| {
        let mut differences: Vec<f64> = Vec::new();
        for run in runs {
            for stretch in &run.stretches {
                let values: Vec<f64> = run.outputs[stretch.clone()]
                    .iter()
                    .map(|row| row[output])
                    .collect();
                let thirds = values
                    .windows(4)
                    .map(|v| v[3] - 3.0 * v[2] + 3.0 * v[1] - v[0]);
                differences.extend(thirds.map(f64::abs).filter(|value| !value.is_nan()));
            }
        }
        if differences.is_empty() {
            return 1.0;
        }
        // Of a normal variable 68 % are within one standard deviation; outliers do not matter.
        let within = quantile(&mut differences, 0.682_689_5);
        let spread = if within > 0.0 {
            within
        } else {
            let squares = differences.iter().map(|value| value * value);
            (squares.sum::<f64>() / differences.len() as f64).sqrt()
        };
        // 20 = 1 + 9 + 9 + 1; a log without any noise has rounding.
        (spread / 20_f64.sqrt()).max(SMALLEST)
    })
}

/// The noise of a log without noise, rad and rad/s.
const SMALLEST: f64 = 1e-9;
