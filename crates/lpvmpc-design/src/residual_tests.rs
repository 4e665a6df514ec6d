//! What residuals must look like when a model is right: noise, and nothing of the input.
//!
//! Ljung, System Identification, 2nd ed., section 16.6.

/// Half the width of a 95 % interval of a normal variable, in standard deviations.
pub const NORMAL_95: f64 = 1.959_963_984_540_054;

/// A sample correlation over lags.
#[derive(Debug, Clone, PartialEq)]
pub struct Correlation {
    /// First lag, in samples; the others follow one by one.
    pub first_lag: isize,
    /// Correlation coefficient at each lag.
    pub values: Vec<f64>,
    /// What 95 % of the coefficients are within if there is no correlation.
    pub bound: f64,
}

impl Correlation {
    /// Which part of the lags is beyond the bound: 0.05 is expected of no correlation.
    pub fn exceeding(&self) -> f64 {
        let beyond = self.values.iter().filter(|value| value.abs() > self.bound);
        beyond.count() as f64 / self.values.len().max(1) as f64
    }

    /// The lag with the largest coefficient, and the coefficient.
    pub fn largest(&self) -> (isize, f64) {
        let values = self.values.iter().enumerate();
        let largest = values.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        largest.map_or((0, 0.0), |(place, value)| {
            (self.first_lag + place as isize, *value)
        })
    }
}

/// Correlation of a residual with itself at the lags 1 to `lags`, over pieces that are each sampled
/// without gap. NaN is left out. Few degrees of freedom lost to a fit hardly matter to the bound.
pub fn autocorrelation(pieces: &[Vec<f64>], lags: usize) -> Correlation {
    let pairs: Vec<(&[f64], &[f64])> = pieces
        .iter()
        .map(|piece| (piece.as_slice(), piece.as_slice()))
        .collect();
    correlation(&pairs, 1, lags as isize)
}

/// Correlation of a residual with an input `lag` samples before, at the lags -`lags` to `lags`.
///
/// The bound takes both as white; an input that is not widens the true one, so what exceeds it
/// slightly means little.
pub fn cross_correlation(residual: &[Vec<f64>], input: &[Vec<f64>], lags: usize) -> Correlation {
    let pieces = residual.iter().zip(input);
    let pairs: Vec<(&[f64], &[f64])> = pieces
        .map(|(residual, input)| (residual.as_slice(), input.as_slice()))
        .collect();
    correlation(&pairs, -(lags as isize), lags as isize)
}

fn correlation(pairs: &[(&[f64], &[f64])], first: isize, last: isize) -> Correlation {
    let one = Moments::of(pairs.iter().map(|pair| pair.0));
    let other = Moments::of(pairs.iter().map(|pair| pair.1));
    let scale = (one.variance * other.variance).sqrt();
    let mut count_at_smallest_lag = 0;
    let values = (first..=last).map(|lag| {
        let (mut sum, mut count) = (0.0, 0);
        for (residual, input) in pairs {
            let length = residual.len().min(input.len()) as isize;
            for now in lag.max(0)..length.min(length + lag) {
                let product = (residual[now as usize] - one.mean)
                    * (input[(now - lag) as usize] - other.mean);
                if !product.is_nan() {
                    sum += product;
                    count += 1;
                }
            }
        }
        count_at_smallest_lag = count_at_smallest_lag.max(count);
        if count == 0 || scale == 0.0 {
            0.0
        } else {
            sum / (count as f64 * scale)
        }
    });
    let values: Vec<f64> = values.collect();
    Correlation {
        first_lag: first,
        values,
        bound: NORMAL_95 / f64::from(count_at_smallest_lag.max(1)).sqrt(),
    }
}

struct Moments {
    mean: f64,
    variance: f64,
}

impl Moments {
    fn of<'a>(pieces: impl Iterator<Item = &'a [f64]> + Clone) -> Self {
        let values = || pieces.clone().flatten().filter(|value| !value.is_nan());
        let count = values().count().max(1) as f64;
        let mean = values().sum::<f64>() / count;
        let variance = values().map(|value| (value - mean).powi(2)).sum::<f64>() / count;
        Self { mean, variance }
    }
}
