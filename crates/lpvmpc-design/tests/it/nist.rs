//! Two problems of the NIST Statistical Reference Datasets (StRD) for nonlinear regression, with
//! NIST's data, both of its starts and its certified parameters and residual sums of squares.
//! Misra1a is of lower, Thurber of higher difficulty.

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

fn assert_certified(fit: &Fit, parameters: &[f64], sum_of_squares: f64) {
    assert!(fit.termination.is_converged(), "{}", fit.termination);
    for (found, certified) in fit.parameters.iter().zip(parameters) {
        let error = (found / certified - 1.0).abs();
        assert!(error < 1e-7, "{found} for {certified}");
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
            &[2.3894212918E+02, 5.5015643181E-04],
            1.2455138894E-01,
        );
    }
}

#[test]
fn thurber_from_both_starts() {
    let certified = [
        1.2881396800E+03,
        1.4910792535E+03,
        5.8323836877E+02,
        7.5416644291E+01,
        9.6629502864E-01,
        3.9797285797E-01,
        4.9727297349E-02,
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
