//! Which input explains what happens: from the runs as they are, whatever their layout.

use crate::cell::Cell;
use serde::Serialize;

/// What an input says of an output.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sensitivity {
    /// The input.
    pub input: String,
    /// First-order Sobol index: the part of the output's variance that is explained by this input
    /// alone, less what chance would explain.
    pub first_order: f64,
    /// An input that explains nothing stays below this with about 99.9 %.
    pub noise: f64,
    /// Spearman's rank correlation, -1 to 1: positive where a larger value goes with a larger
    /// output. None where the input's values have no order.
    pub rank_correlation: Option<f64>,
}

/// Classes of an input with more values, of as many runs each. What an output does within a class is
/// not seen, so the index of a wavy one comes out a little low.
const CLASSES: usize = 20;
/// Fewer runs of a class say little of it.
const LEAST_RUNS: usize = 10;

/// What an input's `values` say of the `output` of the same runs; `None` where one of them is always
/// the same.
pub fn sensitivity(input: &str, values: &[Cell], output: &[f64]) -> Option<Sensitivity> {
    let classes = classes(values);
    let count = classes.iter().max()? + 1;
    let n = output.len() as f64;
    let mean = output.iter().sum::<f64>() / n;
    let total: f64 = output.iter().map(|y| (y - mean).powi(2)).sum();
    if count < 2 || !(total > 0.0) || n <= count as f64 {
        return None;
    }
    let mut sums = vec![(0.0, 0.0); count];
    for (class, y) in classes.iter().zip(output) {
        sums[*class].0 += 1.0;
        sums[*class].1 += y;
    }
    let between = |(size, sum): &(f64, f64)| match *size > 0.0 {
        true => size * (sum / size - mean).powi(2),
        false => 0.0,
    };
    let explained = sums.iter().map(between).sum::<f64>() / total;
    // With k classes, chance explains (k - 1)/(n - 1) on average (epsilon squared, Kelley 1935).
    let free = (count - 1) as f64;
    let chance = free / (n - 1.0);
    Some(Sensitivity {
        input: input.to_owned(),
        first_order: ((explained - chance) / (1.0 - chance)).max(0.0),
        noise: 3.1 * (2.0 * free).sqrt() / n,
        rank_correlation: numbers(values).and_then(|values| spearman(&values, output)),
    })
}

fn numbers(values: &[Cell]) -> Option<Vec<f64>> {
    values.iter().map(Cell::number).collect()
}

/// The class of each value: of its own where there are few values, of its rank otherwise.
fn classes(values: &[Cell]) -> Vec<usize> {
    let most = (values.len() / LEAST_RUNS).clamp(2, CLASSES);
    let mut texts: Vec<String> = Vec::new();
    let own = values.iter().map(|value| {
        let text = value.text();
        match texts.iter().position(|known| *known == text) {
            Some(class) => Some(class),
            None if texts.len() < most => {
                texts.push(text);
                Some(texts.len() - 1)
            }
            None => None,
        }
    });
    if let Some(own) = own.collect::<Option<Vec<_>>>() {
        return own;
    }
    let Some(numbers) = numbers(values) else {
        return vec![0; values.len()];
    };
    let n = numbers.len();
    let ranks = ranks(&numbers);
    let class = |rank: f64| ((rank / n as f64 * most as f64) as usize).min(most - 1);
    ranks.into_iter().map(class).collect()
}

/// Ranks from 0; equal values share the mean of theirs.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<u32> = (0..values.len() as u32).collect();
    let at = |index: &u32| values[*index as usize];
    order.sort_by(|a, b| at(a).total_cmp(&at(b)));
    let mut ranks = vec![0.0; values.len()];
    let mut first = 0;
    for equal in order.chunk_by(|a, b| at(a) == at(b)) {
        let rank = first as f64 + (equal.len() - 1) as f64 / 2.0;
        equal.iter().for_each(|index| ranks[*index as usize] = rank);
        first += equal.len();
    }
    ranks
}

fn spearman(x: &[f64], y: &[f64]) -> Option<f64> {
    let (x, y) = (ranks(x), ranks(y));
    let mean = (x.len() as f64 - 1.0) / 2.0;
    let product = |a: &[f64], b: &[f64]| -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - mean) * (b - mean)).sum()
    };
    let scale = (product(&x, &x) * product(&y, &y)).sqrt();
    (scale > 0.0).then(|| product(&x, &y) / scale)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lpvmpc_sim::Random;
    use std::f64::consts::PI;

    /// The function of Ishigami and Homma (1990), whose indices are known: sin x1 + 7 sin^2 x2 +
    /// 0.1 x3^4 sin x1 on [-pi, pi]^3.
    #[test]
    fn indices_of_the_ishigami_function_are_found() {
        let mut random = Random::new(11, 0);
        let n = 200_000;
        let points: Vec<[f64; 4]> = (0..n)
            .map(|_| std::array::from_fn(|_| PI * random.symmetric()))
            .collect();
        let f =
            |x: &[f64; 4]| x[0].sin() + 7.0 * x[1].sin().powi(2) + 0.1 * x[2].powi(4) * x[0].sin();
        let output: Vec<f64> = points.iter().map(f).collect();
        let of = |i: usize| {
            let values: Vec<Cell> = points.iter().map(|x| Cell::Real(x[i])).collect();
            sensitivity("x", &values, &output).unwrap()
        };
        for (i, expected) in [0.3139, 0.4424, 0.0, 0.0].into_iter().enumerate() {
            let found = of(i);
            assert!(
                (found.first_order - expected).abs() < 0.02,
                "x{i}: {found:?}"
            );
            assert!(
                expected > 0.0 || found.first_order < found.noise,
                "x{i}: {found:?}"
            );
        }
        // It rises with x1 in between, and is even in x2.
        assert!(of(0).rank_correlation.unwrap() > 0.3);
        assert!(of(1).rank_correlation.unwrap().abs() < 0.02);
    }

    #[test]
    fn words_have_classes_and_no_order() {
        let values: Vec<Cell> = (0..400)
            .map(|i| Cell::Text(["a", "b"][i % 2].to_owned()))
            .collect();
        let output: Vec<f64> = (0..400).map(|i| (i % 2) as f64).collect();
        let found = sensitivity("word", &values, &output).unwrap();
        assert!((found.first_order - 1.0).abs() < 1e-12 && found.rank_correlation.is_none());
        assert_eq!(sensitivity("word", &values, &vec![1.0; 400]), None);
    }

    #[test]
    fn equal_values_share_their_rank() {
        assert_eq!(ranks(&[2.0, 1.0, 2.0, 3.0]), [1.5, 0.0, 1.5, 3.0]);
        assert_eq!(spearman(&[1.0, 2.0, 3.0], &[1.0, 8.0, 27.0]), Some(1.0));
    }
}
