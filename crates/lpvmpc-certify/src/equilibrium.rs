//! Equilibria that are proved to exist.
//!
//! Numbers of a file are rounded, and f of them is not zero. A certificate speaks of the equilibrium nearby at
//! which it is: n components of (x, u) are unknown, those along which [A B] is farthest from singular, and the others are
//! as they are written. With C about the inverse of these n columns, the map z - C f(z) takes a box into itself
//! (Krawczyk's operator, with slopes in place of derivatives), so by Brouwer's theorem it has a fixed point there, and f a
//! zero. Of a plant in discrete time f(x, u) is F(x, u) - x here.

use crate::error::CertifyError;
use lpvmpc::{Embedding, LpvModel, Number};
use lpvmpc_certificate::Interval;
use lpvmpc_plant::{AboutEquilibrium, Plant};
use nalgebra::{DMatrix, DVector, SVector};

/// A first box is this many times the first correction, each further one this many times larger.
const WIDER: f64 = 4.0;
const MOST_BOXES: usize = 12;
/// Newton's steps of [`refined`].
const STEPS: usize = 8;
/// A correction of a state or input by more than this share of 1 + its size leads to another equilibrium.
const FARTHEST: f64 = 1e-3;

/// The unknowns and C.
struct Unknowns {
    columns: Vec<usize>,
    inverse: DMatrix<f64>,
}

impl Unknowns {
    /// Columns by elimination with full pivoting, each in units of 1 + its value's size.
    fn of(slopes: &DMatrix<f64>, at: &[f64]) -> Option<Self> {
        let (n, all) = slopes.shape();
        let mut rest = DMatrix::from_fn(n, all, |i, j| slopes[(i, j)] * (1.0 + at[j].abs()));
        for i in 0..n {
            let largest = rest.row(i).amax();
            rest.row_mut(i).unscale_mut(largest);
        }
        let mut columns = Vec::with_capacity(n);
        for step in 0..n {
            let (mut row, mut column) = (step, 0);
            for i in step..n {
                for j in 0..all {
                    if rest[(i, j)].abs() > rest[(row, column)].abs() {
                        (row, column) = (i, j);
                    }
                }
            }
            let pivot = rest[(row, column)];
            // Negated, so that NaN fails.
            if !(pivot.abs() > 1e-12) {
                return None;
            }
            rest.swap_rows(step, row);
            for i in step + 1..n {
                let factor = rest[(i, column)] / pivot;
                for j in 0..all {
                    let taken = factor * rest[(step, j)];
                    rest[(i, j)] -= taken;
                }
                rest[(i, column)] = 0.0;
            }
            columns.push(column);
        }
        let square = DMatrix::from_fn(n, n, |i, j| slopes[(i, columns[j])]);
        let inverse = square.try_inverse()?;
        inverse
            .iter()
            .all(|c| c.is_finite())
            .then_some(Self { columns, inverse })
    }
}

/// f(x, u), zero at an equilibrium.
fn rates<N: Number>(plant: &Plant, x: &[N], u: &[N]) -> Result<Vec<N>, CertifyError> {
    match plant.period() {
        None => Ok(plant.derivative(x, u)?),
        Some(_) => {
            let next = plant.next(x, u)?.into_iter().zip(x);
            Ok(next.map(|(next, x)| next - *x).collect())
        }
    }
}

/// What the slopes of f by x are less than A: 1 on the diagonal in discrete time, else 0.
fn unit(plant: &Plant, i: usize, j: usize) -> f64 {
    f64::from(u8::from(plant.period().is_some() && i == j))
}

/// The slopes of f by x and u in the plant's own sizes.
fn slopes<const NX: usize, const NU: usize, const NS: usize>(
    about: &AboutEquilibrium<NX, NU, NS>,
    (n, m): (usize, usize),
) -> DMatrix<f64> {
    let (a, b) = LpvModel::<f64, NX, NU, NS>::matrices(about, &SVector::zeros());
    let less = |i: usize, j: usize| unit(about.plant(), i, j);
    DMatrix::from_fn(n, n + m, |i, j| match j < n {
        true => a[(i, j)] - less(i, j),
        false => b[(i, j - n)],
    })
}

fn points(at: &[f64]) -> Vec<(f64, f64)> {
    at.iter().map(|value| (*value, *value)).collect()
}

/// The equilibrium next to `at`, the states, then the inputs, as exactly as Newton's method has it.
///
/// # Errors
/// There is none nearby.
pub(crate) fn refined<const NX: usize, const NU: usize, const NS: usize>(
    plant: &Plant,
    about: AboutEquilibrium<NX, NU, NS>,
    at: &[f64],
) -> Result<Vec<f64>, CertifyError> {
    let n = plant.data().states.len();
    let sizes = (n, at.len() - n);
    let mut best = (f64::INFINITY, at.to_vec());
    let mut found = at.to_vec();
    let mut about = about;
    for _ in 0..STEPS {
        about = about.about(&points(&found))?;
        let rates = rates(plant, &found[..n], &found[n..])?;
        let unknowns = Unknowns::of(&slopes(&about, sizes), &found).ok_or_else(singular)?;
        let step = &unknowns.inverse * DVector::from_vec(rates.clone());
        let size = rates
            .iter()
            .fold(0.0, |largest: f64, rate| largest.max(rate.abs()));
        if size < best.0 {
            best = (size, found.clone());
        }
        for (column, step) in unknowns.columns.iter().zip(step.iter()) {
            found[*column] -= step;
        }
    }
    let near = best
        .1
        .iter()
        .zip(at)
        .all(|(value, wanted)| (value - wanted).abs() <= FARTHEST * (1.0 + wanted.abs()));
    if !(near && best.0.is_finite()) {
        return Err(CertifyError::EquilibriumNotShown {
            within: "within a thousandth",
            hint: "give a state and input at which the plant stands",
        });
    }
    Ok(best.1)
}

fn singular() -> CertifyError {
    CertifyError::EquilibriumNotShown {
        within: "near",
        hint: "the derivatives of f (in discrete time of F(x, u) - x) by states and inputs together have not full rank \
               there, so the plant cannot be stabilised by its linearisation either",
    }
}

/// Ends of all components of an equilibrium that is next to `at`, proved.
///
/// # Errors
/// It could not be shown.
pub(crate) fn enclosed<const NX: usize, const NU: usize, const NS: usize>(
    plant: &Plant,
    about: AboutEquilibrium<NX, NU, NS>,
    at: &[f64],
) -> Result<Vec<(f64, f64)>, CertifyError> {
    let n = plant.data().states.len();
    let sizes = (n, at.len() - n);
    let about = about.about(&points(at))?;
    let rates = interval_rates(plant, &points(at))?;
    if rates.iter().all(|rate| *rate == Interval::point(0.0)) {
        return Ok(points(at));
    }
    let unknowns = Unknowns::of(&slopes(&about, sizes), at).ok_or_else(singular)?;
    let c = |i: usize, j: usize| Interval::point(unknowns.inverse[(i, j)]);
    let step: Vec<Interval> = (0..n)
        .map(|i| sum((0..n).map(|j| c(i, j) * rates[j])))
        .collect();
    // Beside a component of which nothing has to be corrected there may be one of which much has.
    let mut radii: Vec<f64> = (0..n)
        .map(|i| {
            let value = at[unknowns.columns[i]];
            WIDER * step[i].magnitude() + f64::EPSILON * f64::EPSILON * (1.0 + value.abs())
        })
        .collect();
    for _ in 0..MOST_BOXES {
        let mut way = SVector::<Interval, NS>::repeat(Interval::point(0.0));
        for (radius, column) in radii.iter().zip(&unknowns.columns) {
            let place = if *column < n {
                *column
            } else {
                NX + column - n
            };
            way[place] = Interval::new(-radius, *radius);
        }
        let (a, b) = Embedding::matrices(&about, &way);
        let slope = |i: usize, j: usize| {
            let column = unknowns.columns[j];
            if column < n {
                a[(i, column)] - Interval::point(unit(plant, i, column))
            } else {
                b[(i, column - n)]
            }
        };
        let image: Vec<Interval> = (0..n)
            .map(|i| {
                let rest = (0..n).map(|j| {
                    let product = sum((0..n).map(|k| c(i, k) * slope(k, j)));
                    let unit = Interval::point(if i == j { 1.0 } else { 0.0 });
                    (unit - product) * Interval::new(-radii[j], radii[j])
                });
                sum(rest) - step[i]
            })
            .collect();
        let inside = image
            .iter()
            .zip(&radii)
            .all(|(image, radius)| image.magnitude() < *radius);
        if inside {
            let mut ends = points(at);
            for (image, column) in image.iter().zip(&unknowns.columns) {
                let end = Interval::point(at[*column]) + *image;
                ends[*column] = (end.lower, end.upper);
            }
            return Ok(ends);
        }
        for (radius, image) in radii.iter_mut().zip(&image) {
            *radius = WIDER * radius.max(image.magnitude());
        }
    }
    Err(CertifyError::EquilibriumNotShown {
        within: "near",
        hint: "it is too far from one, or the formulas have no value or no derivative there",
    })
}

/// An error if f has no zero in the box, for certain.
pub(crate) fn refuted(plant: &Plant, ends: &[(f64, f64)]) -> Result<(), CertifyError> {
    let rates = interval_rates(plant, ends)?;
    let states = plant.data().states.iter().zip(rates);
    let mut nonzero = states.filter(|(_, rate)| rate.lower > 0.0 || rate.upper < 0.0);
    match nonzero.next() {
        Some((state, _)) => Err(CertifyError::NoEquilibrium {
            state: state.name.clone(),
        }),
        None => Ok(()),
    }
}

fn interval_rates(plant: &Plant, ends: &[(f64, f64)]) -> Result<Vec<Interval>, CertifyError> {
    let n = plant.data().states.len();
    let all: Vec<Interval> = ends.iter().map(|(a, b)| Interval::new(*a, *b)).collect();
    rates(plant, &all[..n], &all[n..])
}

fn sum(terms: impl Iterator<Item = Interval>) -> Interval {
    terms.fold(Interval::point(0.0), |sum, term| sum + term)
}
