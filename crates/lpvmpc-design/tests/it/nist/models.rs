//! The models, as NIST states them.

use super::dual::Dual;
use std::f64::consts::{PI, TAU};

/// What the response (its logarithm, for Nelson) should be with parameters b at the predictors x.
pub type Model = fn(b: &[Dual], x: &[f64]) -> Dual;

/// A set's name, its data and its model.
macro_rules! set {
    ($name:literal, $model:expr) => {
        (
            $name,
            include_str!(concat!("../../../../../testdata/nist-strd/", $name, ".txt")),
            $model,
        )
    };
}

/// The sets in alphabetical order, each with the file of its data.
pub const SETS: [(&str, &str, Model); 27] = [
    set!("Bennett5", |b, x| b[0] * (-(b[1] + x[0]).ln() / b[2]).exp()),
    set!("BoxBOD", saturation),
    set!("Chwirut1", chwirut),
    set!("Chwirut2", chwirut),
    set!("DanWood", |b, x| b[0] * (b[1] * x[0].ln()).exp()),
    set!("ENSO", enso),
    set!("Eckerle4", |b, x| {
        let distance = (-b[2] + x[0]) / b[1];
        b[0] / b[1] * (distance * distance * -0.5).exp()
    }),
    set!("Gauss1", gauss),
    set!("Gauss2", gauss),
    set!("Gauss3", gauss),
    set!("Hahn1", cubic_over_cubic),
    set!("Kirby2", |b, x| {
        let top = b[0] + (b[1] + b[2] * x[0]) * x[0];
        top / ((b[3] + b[4] * x[0]) * x[0] + 1.0)
    }),
    set!("Lanczos1", three_exponentials),
    set!("Lanczos2", three_exponentials),
    set!("Lanczos3", three_exponentials),
    set!("MGH09", |b, x| {
        b[0] * (b[1] + x[0]) * x[0] / ((b[2] + x[0]) * x[0] + b[3])
    }),
    set!("MGH10", |b, x| b[0] * (b[1] / (b[2] + x[0])).exp()),
    set!("MGH17", |b, x| {
        b[0] + b[1] * (-b[3] * x[0]).exp() + b[2] * (-b[4] * x[0]).exp()
    }),
    set!("Misra1a", saturation),
    set!("Misra1b", |b, x| {
        let u = b[1] * x[0] / 2.0 + 1.0;
        b[0] * (-(Dual::from(1.0) / (u * u)) + 1.0)
    }),
    set!("Misra1c", |b, x| {
        let u = b[1] * 2.0 * x[0] + 1.0;
        b[0] * (-(Dual::from(1.0) / u.sqrt()) + 1.0)
    }),
    set!("Misra1d", |b, x| b[0] * b[1] * x[0] / (b[1] * x[0] + 1.0)),
    set!("Nelson", |b, x| b[0] - b[1] * x[0] * (-b[2] * x[1]).exp()),
    set!("Rat42", |b, x| b[0] / ((b[1] - b[2] * x[0]).exp() + 1.0)),
    set!("Rat43", |b, x| {
        b[0] / (((b[1] - b[2] * x[0]).exp() + 1.0).ln() / b[3]).exp()
    }),
    set!("Roszman1", |b, x| {
        b[0] - b[1] * x[0] - (b[2] / (-b[3] + x[0])).atan() / PI
    }),
    set!("Thurber", cubic_over_cubic),
];

fn saturation(b: &[Dual], x: &[f64]) -> Dual {
    b[0] * (-(-b[1] * x[0]).exp() + 1.0)
}

fn chwirut(b: &[Dual], x: &[f64]) -> Dual {
    (-b[0] * x[0]).exp() / (b[1] + b[2] * x[0])
}

fn enso(b: &[Dual], x: &[f64]) -> Dual {
    let wave = |period: Dual, cosine: Dual, sine: Dual| {
        let angle = Dual::from(TAU * x[0]) / period;
        cosine * angle.cos() + sine * angle.sin()
    };
    b[0] + wave(Dual::from(12.0), b[1], b[2]) + wave(b[3], b[4], b[5]) + wave(b[6], b[7], b[8])
}

fn gauss(b: &[Dual], x: &[f64]) -> Dual {
    let bell = |height: Dual, centre: Dual, width: Dual| {
        let distance = (-centre + x[0]) / width;
        height * (-distance * distance).exp()
    };
    b[0] * (-b[1] * x[0]).exp() + bell(b[2], b[3], b[4]) + bell(b[5], b[6], b[7])
}

fn three_exponentials(b: &[Dual], x: &[f64]) -> Dual {
    let decay = |i: usize| b[i] * (-b[i + 1] * x[0]).exp();
    decay(0) + decay(2) + decay(4)
}

fn cubic_over_cubic(b: &[Dual], x: &[f64]) -> Dual {
    let x = x[0];
    let top = b[0] + (b[1] + (b[2] + b[3] * x) * x) * x;
    top / ((b[4] + (b[5] + b[6] * x) * x) * x + 1.0)
}
