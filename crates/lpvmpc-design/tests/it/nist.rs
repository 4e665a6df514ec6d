//! Problems of the NIST Statistical Reference Datasets (StRD) for nonlinear regression, with NIST's
//! data, both of its starts and its certified parameters, standard deviations and residual sums of
//! squares. Misra1a is of lower, Rat42, MGH09, BoxBOD and Thurber are of higher difficulty.
//!
//! Source: National Institute of Standards and Technology, Information Technology Laboratory,
//! Statistical Reference Datasets, nonlinear regression, www.itl.nist.gov/div898/strd (Misra1a,
//! Rat42, MGH09, BoxBOD, Thurber).

#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot go on must fail, in its support functions too"
)]

use lpvmpc_design::{Fit, LeastSquaresSettings, ResidualModel, levenberg_marquardt};
use nalgebra::{DMatrix, DVector};

/// Dental research, monomolecular adsorption: y = b1 (1 - exp(-b2 x)).
struct Misra1a;

const MISRA1A: [(f64, f64); 14] = [
    (77.6, 10.07),
    (114.9, 14.73),
    (141.1, 17.94),
    (190.8, 23.93),
    (239.9, 29.61),
    (289.0, 35.18),
    (332.8, 40.02),
    (378.4, 44.82),
    (434.8, 50.76),
    (477.3, 55.05),
    (536.8, 61.01),
    (593.1, 66.40),
    (689.1, 75.47),
    (760.0, 81.78),
];

impl ResidualModel for Misra1a {
    fn residual(&self, b: &DVector<f64>) -> DVector<f64> {
        DVector::from_iterator(
            MISRA1A.len(),
            MISRA1A
                .iter()
                .map(|(x, y)| y - b[0] * (1.0 - (-b[1] * x).exp())),
        )
    }

    fn jacobian(&self, b: &DVector<f64>) -> DMatrix<f64> {
        DMatrix::from_fn(MISRA1A.len(), 2, |row, column| {
            let x = MISRA1A[row].0;
            let decay = (-b[1] * x).exp();
            if column == 0 {
                decay - 1.0
            } else {
                -b[0] * x * decay
            }
        })
    }
}

/// Semiconductor electron mobility against the logarithm of density:
/// y = (b1 + b2 x + b3 x^2 + b4 x^3) / (1 + b5 x + b6 x^2 + b7 x^3).
struct Thurber;

const THURBER: [(f64, f64); 37] = [
    (-3.067, 80.574),
    (-2.981, 84.248),
    (-2.921, 87.264),
    (-2.912, 87.195),
    (-2.840, 89.076),
    (-2.797, 89.608),
    (-2.702, 89.868),
    (-2.699, 90.101),
    (-2.633, 92.405),
    (-2.481, 95.854),
    (-2.363, 100.696),
    (-2.322, 101.060),
    (-1.501, 401.672),
    (-1.460, 390.724),
    (-1.274, 567.534),
    (-1.212, 635.316),
    (-1.100, 733.054),
    (-1.046, 759.087),
    (-0.915, 894.206),
    (-0.714, 990.785),
    (-0.566, 1090.109),
    (-0.545, 1080.914),
    (-0.400, 1122.643),
    (-0.309, 1178.351),
    (-0.109, 1260.531),
    (-0.103, 1273.514),
    (0.010, 1288.339),
    (0.119, 1327.543),
    (0.377, 1353.863),
    (0.790, 1414.509),
    (0.963, 1425.208),
    (1.006, 1421.384),
    (1.115, 1442.962),
    (1.572, 1464.350),
    (1.841, 1468.705),
    (2.047, 1447.894),
    (2.200, 1457.628),
];

impl Thurber {
    fn fraction(b: &DVector<f64>, x: f64) -> (f64, f64) {
        let top = b[0] + x * (b[1] + x * (b[2] + x * b[3]));
        let bottom = 1.0 + x * (b[4] + x * (b[5] + x * b[6]));
        (top, bottom)
    }
}

impl ResidualModel for Thurber {
    fn residual(&self, b: &DVector<f64>) -> DVector<f64> {
        DVector::from_iterator(
            THURBER.len(),
            THURBER.iter().map(|(x, y)| {
                let (top, bottom) = Self::fraction(b, *x);
                y - top / bottom
            }),
        )
    }

    fn jacobian(&self, b: &DVector<f64>) -> DMatrix<f64> {
        DMatrix::from_fn(THURBER.len(), 7, |row, column| {
            let x = THURBER[row].0;
            let (top, bottom) = Self::fraction(b, x);
            if column < 4 {
                -x.powi(column as i32) / bottom
            } else {
                x.powi(column as i32 - 3) * top / (bottom * bottom)
            }
        })
    }
}

/// Parameters and standard deviations to six digits, the sum of squares to ten.
fn assert_certified(fit: &Fit, certified: &[(f64, f64)], sum_of_squares: f64) {
    assert!(fit.termination.is_converged(), "{}", fit.termination);
    let covariance = fit.covariance.as_ref().unwrap();
    for (i, (parameter, deviation)) in certified.iter().enumerate() {
        let found = fit.parameters[i];
        assert!(
            (found / parameter - 1.0).abs() < 1e-6,
            "{found} for {parameter}"
        );
        let found = covariance[(i, i)].sqrt();
        assert!(
            (found / deviation - 1.0).abs() < 1e-6,
            "{found} for {deviation}"
        );
    }
    let found = fit.residual_norm.powi(2);
    let error = (found / sum_of_squares - 1.0).abs();
    assert!(error < 1e-10, "{found} for {sum_of_squares}");
}

#[test]
fn misra1a_from_both_starts() {
    for start in [[500.0, 0.0001], [250.0, 0.0005]] {
        let start = DVector::from_row_slice(&start);
        let fit = levenberg_marquardt(&Misra1a, &start, &LeastSquaresSettings::default()).unwrap();
        assert_certified(
            &fit,
            &[
                (2.3894212918E+02, 2.7070075241E+00),
                (5.5015643181E-04, 7.2668688436E-06),
            ],
            1.2455138894E-01,
        );
    }
}

#[test]
fn thurber_from_both_starts() {
    let certified = [
        (1.2881396800E+03, 4.6647963344E+00),
        (1.4910792535E+03, 3.9571156086E+01),
        (5.8323836877E+02, 2.8698696102E+01),
        (7.5416644291E+01, 5.5675370270E+00),
        (9.6629502864E-01, 3.1333340687E-02),
        (3.9797285797E-01, 1.4984928198E-02),
        (4.9727297349E-02, 6.5842344623E-03),
    ];
    for start in [
        [1000.0, 1000.0, 400.0, 40.0, 0.7, 0.3, 0.03],
        [1300.0, 1500.0, 500.0, 75.0, 1.0, 0.4, 0.05],
    ] {
        let start = DVector::from_row_slice(&start);
        let fit = levenberg_marquardt(&Thurber, &start, &LeastSquaresSettings::default()).unwrap();
        assert_certified(&fit, &certified, 5.6427082397E+03);
    }
}

/// A model y = f(b, x) with its data; derivatives by central differences.
struct Curve {
    data: &'static [(f64, f64)],
    f: fn(&DVector<f64>, f64) -> f64,
    parameters: usize,
}

impl ResidualModel for Curve {
    fn residual(&self, b: &DVector<f64>) -> DVector<f64> {
        let residuals = self.data.iter().map(|(x, y)| y - (self.f)(b, *x));
        DVector::from_iterator(self.data.len(), residuals)
    }

    fn jacobian(&self, b: &DVector<f64>) -> DMatrix<f64> {
        DMatrix::from_fn(self.data.len(), self.parameters, |row, column| {
            let x = self.data[row].0;
            let at = |step: f64| {
                let mut moved = b.clone();
                moved[column] += step * b[column];
                (self.f)(&moved, x)
            };
            // Five points: the truncation is of order step^4, here 1e-12.
            let slope = |h: f64| (at(h) - at(-h)) / (2.0 * h * b[column]);
            -(4.0 * slope(1e-3) - slope(2e-3)) / 3.0
        })
    }
}

fn assert_curve(curve: &Curve, starts: [&[f64]; 2], certified: &[(f64, f64)], squares: f64) {
    for start in starts {
        let start = DVector::from_row_slice(start);
        let fit = levenberg_marquardt(curve, &start, &LeastSquaresSettings::default()).unwrap();
        assert_certified(&fit, certified, squares);
    }
}

#[test]
fn rat42_from_both_starts() {
    let curve = Curve {
        data: &[
            (9.0, 8.930),
            (14.0, 10.800),
            (21.0, 18.590),
            (28.0, 22.330),
            (42.0, 39.350),
            (57.0, 56.110),
            (63.0, 61.730),
            (70.0, 64.620),
            (79.0, 67.080),
        ],
        f: |b, x| b[0] / (1.0 + (b[1] - b[2] * x).exp()),
        parameters: 3,
    };
    assert_curve(
        &curve,
        [&[100.0, 1.0, 0.1], &[75.0, 2.5, 0.07]],
        &[
            (7.2462237576E+01, 1.7340283401E+00),
            (2.6180768402E+00, 8.8295217536E-02),
            (6.7359200066E-02, 3.4465663377E-03),
        ],
        8.0565229338E+00,
    );
}

#[test]
fn mgh09_from_both_starts() {
    let curve = Curve {
        data: &[
            (4.0, 1.957E-01),
            (2.0, 1.947E-01),
            (1.0, 1.735E-01),
            (5.0E-01, 1.600E-01),
            (2.5E-01, 8.44E-02),
            (1.67E-01, 6.27E-02),
            (1.25E-01, 4.56E-02),
            (1.0E-01, 3.42E-02),
            (8.33E-02, 3.23E-02),
            (7.14E-02, 2.35E-02),
            (6.25E-02, 2.46E-02),
        ],
        f: |b, x| b[0] * (x * x + x * b[1]) / (x * x + x * b[2] + b[3]),
        parameters: 4,
    };
    assert_curve(
        &curve,
        [&[25.0, 39.0, 41.5, 39.0], &[0.25, 0.39, 0.415, 0.39]],
        &[
            (1.9280693458E-01, 1.1435312227E-02),
            (1.9128232873E-01, 1.9633220911E-01),
            (1.2305650693E-01, 8.0842031232E-02),
            (1.3606233068E-01, 9.0025542308E-02),
        ],
        3.0750560385E-04,
    );
}

#[test]
fn boxbod_from_both_starts() {
    let curve = Curve {
        data: &[
            (1.0, 109.0),
            (2.0, 149.0),
            (3.0, 149.0),
            (5.0, 191.0),
            (7.0, 213.0),
            (10.0, 224.0),
        ],
        f: |b, x| b[0] * (1.0 - (-b[1] * x).exp()),
        parameters: 2,
    };
    assert_curve(
        &curve,
        [&[1.0, 1.0], &[100.0, 0.75]],
        &[
            (2.1380940889E+02, 1.2354515176E+01),
            (5.4723748542E-01, 1.0455993237E-01),
        ],
        1.1680088766E+03,
    );
}
