//! Multiple shooting against a second route, its optimality, its bounds and its statistics.

use fastrand::Rng;
use lpvmpc_design::{
    LeastSquaresSettings, LinearizedOutputs, Prior, ResidualModel, ShootingError, ShootingFit,
    ShootingModel, ShootingProblem, ShootingSettings, ShootingTermination, Unknown,
    autocorrelation, cross_correlation, levenberg_marquardt,
};
use nalgebra::{DMatrix, DVector, SVector, Vector1, Vector2};

/// x+ = a x + b sin(k), both measured twice, in segments of 20 rows.
struct Recursion {
    measured: Vec<Vec<Vector2<f64>>>,
}

const TRUTH: [f64; 2] = [1.1, 0.3];

/// Every other segment is measured twice as badly.
fn noise(segment: usize) -> Vector2<f64> {
    Vector2::new(0.05, 0.2) * if segment % 2 == 1 { 2.0 } else { 1.0 }
}

impl ShootingModel<1, 2> for Recursion {
    fn segments(&self) -> usize {
        self.measured.len()
    }

    fn measured(&self, segment: usize) -> &[Vector2<f64>] {
        &self.measured[segment]
    }

    fn noise(&self, segment: usize) -> Vector2<f64> {
        noise(segment)
    }

    fn simulate(
        &self,
        segment: usize,
        parameters: &[f64],
        initial: &SVector<f64, 1>,
        outputs: &mut Vec<Vector2<f64>>,
    ) {
        let mut x = initial[0];
        for row in 0..self.measured[segment].len() {
            outputs.push(Vector2::new(x, 2.0 * x));
            x = parameters[0] * x + parameters[1] * (row as f64).sin();
        }
    }
}

fn normal(rng: &mut Rng) -> f64 {
    let (u, v) = (1.0 - rng.f64(), rng.f64());
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

fn recursion(segments: usize, seed: u64) -> Recursion {
    let mut rng = Rng::with_seed(seed);
    let mut model = Recursion {
        measured: vec![vec![Vector2::zeros(); 20]; segments],
    };
    for segment in 0..segments {
        let initial = Vector1::new(normal(&mut rng));
        let mut outputs = Vec::new();
        model.simulate(segment, &TRUTH, &initial, &mut outputs);
        for output in &mut outputs {
            let deviation = noise(segment);
            *output += deviation.map(|deviation| deviation * normal(&mut rng));
        }
        model.measured[segment] = outputs;
    }
    // A missing value is no value.
    model.measured[0][3][1] = f64::NAN;
    model
}

fn unknowns() -> [Unknown; 2] {
    [1.0, 0.0].map(|start| Unknown {
        start,
        lower: f64::NEG_INFINITY,
        upper: f64::INFINITY,
        scale: 1.0,
        free: true,
        kinked: false,
    })
}

fn problem<'a>(
    model: &'a Recursion,
    unknowns: &'a [Unknown],
    priors: &'a [Prior],
) -> ShootingProblem<'a, Recursion, 1, 2> {
    ShootingProblem {
        model,
        unknowns,
        priors,
        state_scale: Vector1::new(1.0),
    }
}

/// The same fit as one dense problem in parameters and initial states.
struct Dense<'a>(&'a Recursion);

impl ResidualModel for Dense<'_> {
    fn residual(&self, b: &DVector<f64>) -> DVector<f64> {
        let mut residuals = Vec::new();
        for segment in 0..self.0.segments() {
            let mut outputs = Vec::new();
            let initial = Vector1::new(b[2 + segment]);
            self.0
                .simulate(segment, &b.as_slice()[..2], &initial, &mut outputs);
            for (measured, simulated) in self.0.measured[segment].iter().zip(&outputs) {
                for output in 0..2 {
                    let residual = (measured[output] - simulated[output]) / noise(segment)[output];
                    residuals.push(if residual.is_nan() { 0.0 } else { residual });
                }
            }
        }
        DVector::from_vec(residuals)
    }

    fn jacobian(&self, b: &DVector<f64>) -> DMatrix<f64> {
        let columns: Vec<DVector<f64>> = (0..b.len())
            .map(|column| {
                let mut step = DVector::zeros(b.len());
                step[column] = 1e-5;
                (self.residual(&(b + &step)) - self.residual(&(b - &step))) / 2e-5
            })
            .collect();
        DMatrix::from_columns(&columns)
    }
}

#[test]
fn parameters_and_covariance_are_those_of_the_dense_problem() {
    let (model, unknowns) = (recursion(6, 1), unknowns());
    let settings = ShootingSettings {
        reduction_tolerance: 1e-12,
        ..ShootingSettings::default()
    };
    let initial = model.measured.iter().map(|rows| Vector1::new(rows[0][0]));
    let initial: Vec<_> = initial.collect();
    let shooting = problem(&model, &unknowns, &[])
        .fit(initial.clone(), &settings, &|_| {})
        .unwrap();
    let start = [1.0, 0.0].into_iter().chain(initial.iter().map(|x| x[0]));
    let start = DVector::from_iterator(8, start);
    let dense = levenberg_marquardt(&Dense(&model), &start, &LeastSquaresSettings::default());
    let dense = dense.unwrap().require_converged().unwrap();
    for i in 0..2 {
        assert!((shooting.parameters[i] - dense.parameters[i]).abs() < 1e-7);
    }
    for (found, expected) in shooting.initial.iter().zip(dense.parameters.iter().skip(2)) {
        assert!((found[0] - expected).abs() < 1e-6);
    }
    assert!((shooting.chi_square - dense.residual_norm.powi(2)).abs() < 1e-6);
    assert_eq!(shooting.values, 6 * 40 - 1);
    assert_eq!(shooting.degrees_of_freedom(), 231.0);
    // Of the dense covariance the noise that it estimates is taken out again.
    let covariance = shooting.reduced.information.try_inverse().unwrap();
    let factor = 232.0 / dense.residual_norm.powi(2);
    let expected = dense.covariance.unwrap().view((0, 0), (2, 2)) * factor;
    assert!(
        (&covariance - &expected).norm() < 1e-4 * expected.norm(),
        "{covariance}{expected}"
    );
    // At the optimum the gradient vanishes, whatever its parts.
    let parts = shooting
        .reduced
        .scores
        .iter()
        .map(DVector::norm)
        .sum::<f64>();
    assert!(shooting.reduced.gradient.norm() < 1e-4 * parts);
}

#[test]
fn a_bound_holds_and_a_tight_prior_decides() {
    let model = recursion(6, 2);
    let mut unknowns = unknowns();
    unknowns[1].upper = 0.2;
    let initial: Vec<_> = model
        .measured
        .iter()
        .map(|rows| Vector1::new(rows[0][0]))
        .collect();
    let settings = ShootingSettings::default();
    let bounded = problem(&model, &unknowns, &[])
        .fit(initial.clone(), &settings, &|_| {})
        .unwrap();
    assert_eq!(bounded.parameters[1], 0.2);
    assert_eq!(bounded.reduced.indices, [0]);
    // b = 0.25 + 1e-9: the data cannot say no.
    unknowns[1].upper = f64::INFINITY;
    let priors = [Prior {
        coefficients: vec![1.0, 2.0],
        mean: 1.7,
        standard_deviation: 1e-6,
    }];
    let decided = problem(&model, &unknowns, &priors)
        .fit(initial, &settings, &|_| {})
        .unwrap();
    let combination = decided.parameters[0] + 2.0 * decided.parameters[1];
    assert!((combination - 1.7).abs() < 1e-6, "{combination}");
}

#[test]
fn a_score_says_what_a_fit_would_change() {
    let (model, mut unknowns) = (recursion(20, 3), unknowns());
    let initial: Vec<_> = model
        .measured
        .iter()
        .map(|rows| Vector1::new(rows[0][0]))
        .collect();
    let settings = ShootingSettings {
        reduction_tolerance: 1e-12,
        ..ShootingSettings::default()
    };
    // The model is linear in b, so one step from a wrong value is the whole way.
    unknowns[0].free = false;
    unknowns[0].start = TRUTH[0];
    unknowns[1].free = false;
    unknowns[1].start = 0.25;
    let held = problem(&model, &unknowns, &[])
        .fit(initial.clone(), &settings, &|_| {})
        .unwrap();
    let reduced = problem(&model, &unknowns, &[]).reduced(&held.parameters, &held.initial, &[1]);
    let change = -reduced.gradient[0] / reduced.information[(0, 0)];
    unknowns[1].free = true;
    let fitted = problem(&model, &unknowns, &[])
        .fit(initial, &settings, &|_| {})
        .unwrap();
    assert!((0.25 + change - fitted.parameters[1]).abs() < 1e-6);
}

#[test]
fn mistakes_are_named() {
    let (model, mut unknowns) = (recursion(2, 4), unknowns());
    let settings = ShootingSettings::default();
    let two = vec![Vector1::zeros(); 2];
    let error = problem(&model, &unknowns, &[]).fit(vec![], &settings, &|_| {});
    assert_eq!(
        error.unwrap_err(),
        ShootingError::InitialStates {
            expected: 2,
            found: 0
        }
    );
    unknowns[0].start = 1e300;
    let error = problem(&model, &unknowns, &[]).fit(vec![Vector1::new(1.0); 2], &settings, &|_| {});
    assert_eq!(
        error.unwrap_err(),
        ShootingError::NonFiniteStart { segment: 0 }
    );
    unknowns[0].scale = 0.0;
    let error = problem(&model, &unknowns, &[])
        .fit(two, &settings, &|_| {})
        .unwrap_err();
    assert!(
        error.to_string().contains("the scale of parameter 0 is 0"),
        "{error}"
    );
}

/// y(k) = x0 + p s(k) + q (k / 40)^2, where s is another on the other side of p = 0.
struct Bent {
    measured: Vec<Vector1<f64>>,
    /// Its derivatives are said to be those of -q.
    mistaken: bool,
}

impl Bent {
    fn slopes(row: usize) -> (f64, f64) {
        let k = row as f64;
        ((0.7 * k).sin(), (1.9 * k).cos())
    }

    /// Measured are `below` times s below zero and `above` times s above it, with an error.
    fn new(below: f64, above: f64) -> Self {
        let rows = 0..40;
        let measured = rows.map(|row| {
            let (s_below, s_above) = Self::slopes(row);
            let (k, error) = (row as f64, 0.1 * (row as f64).powi(2).cos());
            let square = 0.3 * (k / 40.0).powi(2);
            Vector1::new(1.0 + below * s_below + above * s_above + square + error)
        });
        Self {
            measured: measured.collect(),
            mistaken: false,
        }
    }

    fn unknowns(kinked: bool) -> [Unknown; 2] {
        [(0.9, kinked), (0.0, false)].map(|(start, kinked)| Unknown {
            start,
            lower: f64::NEG_INFINITY,
            upper: f64::INFINITY,
            scale: 1.0,
            free: true,
            kinked,
        })
    }

    fn fit(&self, unknowns: &[Unknown]) -> Result<ShootingFit<1>, ShootingError> {
        let problem = ShootingProblem {
            model: self,
            unknowns,
            priors: &[],
            state_scale: Vector1::new(1.0),
        };
        let settings = ShootingSettings::default();
        problem.fit(vec![Vector1::new(0.0)], &settings, &|_| {})
    }
}

impl ShootingModel<1, 1> for Bent {
    fn segments(&self) -> usize {
        1
    }

    fn measured(&self, _: usize) -> &[Vector1<f64>] {
        &self.measured
    }

    fn noise(&self, _: usize) -> Vector1<f64> {
        Vector1::new(0.1)
    }

    fn simulate(
        &self,
        _: usize,
        parameters: &[f64],
        initial: &SVector<f64, 1>,
        outputs: &mut Vec<Vector1<f64>>,
    ) {
        let linear = self.linearized(0, parameters, initial, &[]);
        outputs.extend(linear.into_iter().flat_map(|linear| linear.outputs));
    }

    fn linearized(
        &self,
        _: usize,
        parameters: &[f64],
        initial: &SVector<f64, 1>,
        indices: &[usize],
    ) -> Option<LinearizedOutputs<1>> {
        let [p, q] = parameters else { return None };
        let rows = 0..self.measured.len();
        let (mut outputs, mut slopes) = (Vec::new(), DMatrix::zeros(rows.len(), 1 + indices.len()));
        for row in rows {
            let (below, above) = Self::slopes(row);
            let slope = if *p < 0.0 { below } else { above };
            let square = (row as f64 / 40.0).powi(2);
            outputs.push(Vector1::new(initial[0] + p * slope + q * square));
            slopes[(row, 0)] = 1.0;
            let by_q = if self.mistaken { -square } else { square };
            for (column, index) in indices.iter().enumerate() {
                slopes[(row, 1 + column)] = [slope, by_q][*index];
            }
        }
        Some(LinearizedOutputs { outputs, slopes })
    }
}

#[test]
fn a_minimum_at_a_kink_is_one() {
    // Each side wants to go to the other.
    let at_kink = Bent::new(0.1, -0.1);
    let fit = at_kink.fit(&Bent::unknowns(true)).unwrap();
    assert_eq!(fit.termination, ShootingTermination::Converged);
    let deviation = |place: usize| {
        let covariance = fit.reduced.information.clone().try_inverse();
        covariance.unwrap()[(place, place)].sqrt()
    };
    assert!(fit.parameters[0].abs() < 0.01 * deviation(0), "{fit:?}");
    // The gradient does not vanish there, and whoever waits for that waits in vain.
    assert!(fit.reduced.gradient[0].abs() * deviation(0) > 1.0);
    assert_ne!(
        at_kink.fit(&Bent::unknowns(false)).unwrap().termination,
        ShootingTermination::Converged
    );
    // To neither side is it lower, all else fitted again.
    for p in [-1.0, 1.0].map(|side| side * deviation(0)) {
        let held = Unknown {
            start: p,
            free: false,
            ..Bent::unknowns(true)[0]
        };
        let beside = at_kink.fit(&[held, Bent::unknowns(true)[1]]).unwrap();
        assert!(beside.chi_square > fit.chi_square + 0.1, "{p}: {beside:?}");
    }
}

#[test]
fn a_kink_beside_the_minimum_does_not_end_a_fit() {
    // From the other side of the kink, on which chi^2 falls towards it.
    let model = Bent::new(-0.4, -0.1);
    let fit = model.fit(&Bent::unknowns(true)).unwrap();
    assert_eq!(fit.termination, ShootingTermination::Converged);
    let mut same_side = Bent::unknowns(false);
    same_side[0].start = -0.5;
    let expected = model.fit(&same_side).unwrap();
    assert_eq!(expected.termination, ShootingTermination::Converged);
    assert!((expected.parameters[0] + 0.4).abs() < 0.1, "{expected:?}");
    for (found, expected) in fit.parameters.iter().zip(&expected.parameters) {
        assert!((found - expected).abs() < 1e-3, "{found} for {expected}");
    }
}

#[test]
fn a_fit_that_stagnates_elsewhere_has_not_converged_at_a_kink() {
    let mut wrong = Bent::new(0.1, -0.1);
    wrong.mistaken = true;
    assert_eq!(
        wrong.fit(&Bent::unknowns(true)).unwrap().termination,
        ShootingTermination::Stagnation
    );
}

#[test]
fn white_noise_is_white_and_a_filtered_one_is_not() {
    let mut rng = Rng::with_seed(5);
    let white: Vec<Vec<f64>> = (0..10)
        .map(|_| (0..1000).map(|_| normal(&mut rng)).collect())
        .collect();
    let correlation = autocorrelation(&white, 25);
    assert!(correlation.exceeding() <= 0.2, "{correlation:?}");
    // x+ = 0.8 x + e has the autocorrelation 0.8^lag.
    let filter = |piece: &Vec<f64>| -> Vec<f64> {
        let mut x = 0.0;
        piece
            .iter()
            .map(|e| {
                x = 0.8 * x + e;
                x
            })
            .collect()
    };
    let filtered: Vec<Vec<f64>> = white.iter().map(filter).collect();
    let correlation = autocorrelation(&filtered, 5);
    for (lag, value) in correlation.values.iter().enumerate() {
        assert!(
            (value - 0.8_f64.powi(lag as i32 + 1)).abs() < 0.06,
            "{correlation:?}"
        );
    }
    // An input three samples before is found there.
    let late: Vec<Vec<f64>> = white
        .iter()
        .map(|piece| {
            (0..piece.len())
                .map(|i| if i < 3 { 0.0 } else { piece[i - 3] })
                .collect()
        })
        .collect();
    let (lag, value) = cross_correlation(&late, &white, 10).largest();
    assert_eq!(lag, 3);
    assert!(value > 0.95);
}
