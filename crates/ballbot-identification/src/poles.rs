//! Poles of the fitted robot at its upright position, with intervals.

use crate::estimate::Estimate;
use crate::model::Robot;
use crate::parameter::{Parameter, Values};
use ballbot::Geometry;
use lpvmpc_design::{linearize, poles};
use nalgebra::{Complex, DMatrix, DVector, Matrix4, SVector, Vector4};

/// A pole with the standard deviations of its parts, 1/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pole {
    /// The pole.
    pub value: Complex<f64>,
    /// Of its real and of its imaginary part.
    pub standard_deviation: (f64, f64),
}

/// A and B of the robot at the upright position, without Coulomb friction, whose slope at rest says
/// nothing about motion. `None` if the robot has no linear model.
pub fn linear_model(
    values: &Values,
    geometry: Geometry<f64>,
) -> Option<(Matrix4<f64>, Vector4<f64>)> {
    let mut values = *values;
    values[Parameter::DriveCoulomb] = 0.0;
    values[Parameter::TorqueBias] = 0.0;
    let robot = Robot::new(values, geometry);
    let f = |x: &Vector4<f64>, u: &SVector<f64, 1>| robot.plant.f(x, robot.driving(u[0])[0]);
    let linear = linearize(f, &Vector4::zeros(), &SVector::zeros()).ok()?;
    Some((linear.a, linear.b))
}

/// The poles, sorted by real part. The covariance is carried over to first order.
pub fn uncertain_poles(
    estimate: &Estimate,
    covariance: &DMatrix<f64>,
    geometry: Geometry<f64>,
) -> Vec<Pole> {
    let of = |values: &Values| {
        let (a, _) = linear_model(values, geometry)?;
        poles(&DMatrix::from_column_slice(4, 4, a.as_slice())).ok()
    };
    let Some(nominal) = of(&estimate.values) else {
        return Vec::new();
    };
    let mut slopes = vec![
        (
            DVector::zeros(Parameter::ALL.len()),
            DVector::zeros(Parameter::ALL.len())
        );
        nominal.len()
    ];
    for parameter in Parameter::ALL {
        let index = parameter.index();
        let step = 1e-3 * covariance[(index, index)].sqrt();
        if !(step > 0.0 && step.is_finite()) {
            continue;
        }
        let moved = |sign: f64| {
            let mut values = estimate.values;
            values[parameter] += sign * step;
            of(&values)
        };
        let (Some(up), Some(down)) = (moved(1.0), moved(-1.0)) else {
            continue;
        };
        for (slope, (up, down)) in slopes.iter_mut().zip(up.iter().zip(&down)) {
            let change = (up - down) / (2.0 * step);
            slope.0[index] = change.re;
            slope.1[index] = change.im;
        }
    }
    let deviation = |slope: &DVector<f64>| slope.dot(&(covariance * slope)).max(0.0).sqrt();
    nominal
        .iter()
        .zip(&slopes)
        .map(|(value, (re, im))| Pole {
            value: *value,
            standard_deviation: (deviation(re), deviation(im)),
        })
        .collect()
}
