//! One contender on one sequence of problems: first the check of its answers, then the time.

use crate::BenchmarkError;
use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Criterion, Throughput};
use nalgebra::SVector;
use std::hint::black_box;
use std::time::Duration;

/// A first input may differ from ours by this much, relative to the largest first input of the
/// sequence.
pub const TOLERANCE: f64 = 1e-4;

/// Something that solves the problems of a sequence, one after the other.
pub trait Contender<const NU: usize> {
    /// The first input, u_0, of the problem with this number; 0 begins the sequence anew.
    ///
    /// # Errors
    /// [`BenchmarkError::NotSolved`] or `Refused`.
    fn solve(&mut self, problem: usize) -> Result<SVector<f64, NU>, BenchmarkError>;
}

/// A sequence of problems, by the first inputs that solve them.
pub struct Comparison<'a, const NU: usize> {
    group: BenchmarkGroup<'a, WallTime>,
    sequence: String,
    expected: Vec<SVector<f64, NU>>,
}

impl<'a, const NU: usize> Comparison<'a, NU> {
    /// A group of benchmarks, `family/sequence`; one repetition solves the whole sequence. The
    /// sequences of a family share a table in the summary.
    pub fn new(
        criterion: &'a mut Criterion,
        family: &str,
        sequence: &str,
        expected: Vec<SVector<f64, NU>>,
    ) -> Self {
        let mut group = criterion.benchmark_group(format!("{family}/{sequence}"));
        group.throughput(Throughput::Elements(expected.len() as u64));
        group.sample_size(20);
        group.warm_up_time(Duration::from_secs(1));
        group.measurement_time(Duration::from_secs(4));
        Self {
            group,
            sequence: sequence.to_owned(),
            expected,
        }
    }

    /// Checks all answers of `contender` and then times it.
    ///
    /// # Errors
    /// [`BenchmarkError::Disagrees`], or the contender's own.
    pub fn time(
        &mut self,
        name: &str,
        contender: &mut impl Contender<NU>,
    ) -> Result<(), BenchmarkError> {
        let deviation = self.verify(name, contender)?;
        println!(
            "{}/{name}: largest deviation of u_0 {deviation:.1e}",
            self.sequence
        );
        self.time_unchecked(name, |problem| black_box(contender.solve(problem)).is_ok());
        Ok(())
    }

    /// Times `work`, which has no answer of its own to check, on every problem.
    pub fn time_unchecked<R>(&mut self, name: &str, mut work: impl FnMut(usize) -> R) {
        let problems = self.expected.len();
        self.group.bench_function(name, |bencher| {
            bencher.iter(|| {
                for problem in 0..problems {
                    black_box(work(problem));
                }
            });
        });
    }

    /// The largest deviation, relative to the largest first input of the sequence.
    fn verify(
        &self,
        name: &str,
        contender: &mut impl Contender<NU>,
    ) -> Result<f64, BenchmarkError> {
        let largest = self.expected.iter().map(SVector::amax).fold(0.0, f64::max);
        let mut worst = 0.0_f64;
        for (problem, expected) in self.expected.iter().enumerate() {
            let deviation = (contender.solve(problem)? - expected).amax() / largest;
            if deviation <= TOLERANCE {
                worst = worst.max(deviation);
            } else {
                return Err(BenchmarkError::Disagrees {
                    contender: name.to_owned(),
                    sequence: self.sequence.clone(),
                    problem,
                    deviation,
                    tolerance: TOLERANCE,
                });
            }
        }
        Ok(worst)
    }
}
