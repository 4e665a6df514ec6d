//! The motion of a plant over a short time: its power series, and what it does not leave.

use super::Columns;
use super::elementary::Arithmetic;
use super::flow::FlowError;
use super::interval::Interval;
use super::series::Series;
use lpvmpc::Embedding;
use nalgebra::{SMatrix, SVector};

/// The Taylor coefficients 0 to `order` of the columns' motion, the first of which is the state:
/// (k+1) Y_{k+1} = sum over j of A_j Y_{k-j} + B_k W. With a `scale` r, the state is r times the first
/// column, and the input r times the first of `inputs`.
pub(super) fn coefficients<T, M, const NX: usize, const NU: usize, const NS: usize>(
    model: &M,
    scale: Option<T>,
    start: &Columns<T, NX>,
    inputs: &Columns<T, NU>,
    order: usize,
) -> Vec<Columns<T, NX>>
where
    T: Arithmetic,
    M: Embedding<NX, NU, NS>,
{
    let scaled = |series: Series<T>| match scale {
        Some(scale) => Series::fixed(scale) * series,
        None => series,
    };
    let mut known = vec![start.clone()];
    for k in 0..order {
        let x = SVector::from_fn(|i, _| scaled(Series::new(known.iter().map(|y| y[0][i]))));
        let u = SVector::from_fn(|i, _| scaled(Series::fixed(inputs[0][i])));
        let (a, b) = model.matrices(&model.scheduling(&x, &u));
        let share = T::constant((k + 1) as f64).reciprocal();
        let next = (0..start.len()).map(|column| {
            std::array::from_fn(|i| {
                let mut sum = T::constant(0.0);
                for (j, y) in known.iter().rev().enumerate() {
                    for m in 0..NX {
                        sum = sum.plus_product(a[(i, m)].coefficient(j), &y[column][m]);
                    }
                }
                for m in 0..NU {
                    sum = sum.plus_product(b[(i, m)].coefficient(k), &inputs[column][m]);
                }
                sum * share
            })
        });
        let next = next.collect();
        known.push(next);
    }
    known
}

/// Columns that no motion leaves within `length` seconds: with Y = Y(0) + [0, h] f(Y') inside Y',
/// the Picard iteration maps Y' into itself. `scale` is that of [`coefficients`].
pub(super) fn a_priori<M, const NX: usize, const NU: usize, const NS: usize>(
    model: &M,
    scale: Option<Interval>,
    length: f64,
    start: &Columns<Interval, NX>,
    inputs: &Columns<Interval, NU>,
) -> Result<Columns<Interval, NX>, FlowError>
where
    M: Embedding<NX, NU, NS>,
{
    let time = Interval::new(0.0, length);
    let rates = |columns: &Columns<Interval, NX>| {
        coefficients(model, scale, columns, inputs, 1).swap_remove(1)
    };
    let ahead = time * Interval::point(FIRST_GUESS);
    let mut guess = zip(start, &rates(start), |start, rate| start + ahead * rate);
    for _ in 0..MOST_PICARD_STEPS {
        let image = zip(start, &rates(&guess), |start, rate| start + time * rate);
        let inside = |(guess, image): (&[Interval; NX], &[Interval; NX])| {
            guess
                .iter()
                .zip(image)
                .all(|(guess, image)| guess.contains(*image))
        };
        if guess.iter().zip(&image).all(inside) {
            return Ok(image);
        }
        let widened = |x: &Interval| Interval::around(x.middle(), (1.0 + INFLATION) * x.radius());
        guess = image
            .iter()
            .map(|column| column.each_ref().map(widened))
            .collect();
        let unbounded = |x: &Interval| !x.magnitude().is_finite();
        if guess.iter().flatten().any(unbounded) {
            break;
        }
    }
    Err(FlowError::NoEnclosure { step: length })
}

/// A and B wherever the first columns of `during` and `inputs` are.
pub(super) fn matrices_during<M, const NX: usize, const NU: usize, const NS: usize>(
    model: &M,
    during: &Columns<Interval, NX>,
    inputs: &Columns<Interval, NU>,
) -> (SMatrix<Interval, NX, NX>, SMatrix<Interval, NX, NU>)
where
    M: Embedding<NX, NU, NS>,
{
    let (x, u) = (SVector::from(during[0]), SVector::from(inputs[0]));
    model.matrices(&model.scheduling(&x, &u))
}

/// What stands in place of [`coefficients`] where A and B are only known to be somewhere in these `matrices`, in any
/// way over time: (k+1) Y_{k+1} = A Y_k + B_k W with all of A and B, as B_0 = B and B_k = 0 for k > 0. By the Peano-Baker
/// series, y(t) is the sum over k < n of integrals of A(t_1) ... A(t_k) y(0) and A(t_1) ... A(t_{k-1}) B(t_k) W over
/// t > t_1 > ... > t_k > 0, and of those of n matrices with y(t_n) in place of y(0). Each is t^k/k! times a mean of
/// such products, and the products are all in an interval, which is convex.
pub(super) fn iterated<T: Arithmetic, const NX: usize, const NU: usize>(
    (a, b): &(SMatrix<Interval, NX, NX>, SMatrix<Interval, NX, NU>),
    start: &Columns<T, NX>,
    inputs: &Columns<T, NU>,
    order: usize,
) -> Vec<Columns<T, NX>> {
    let (a, b) = (a.map(T::within), b.map(T::within));
    let mut known = vec![start.clone()];
    for k in 0..order {
        let share = T::constant((k + 1) as f64).reciprocal();
        let before = &known[k];
        let next = before.iter().zip(inputs).map(|(y, w)| {
            std::array::from_fn(|i| {
                let zero = T::constant(0.0);
                let of_y = (0..NX).fold(zero, |sum, m| sum.plus_product(&a[(i, m)], &y[m]));
                let sum = match k {
                    0 => (0..NU).fold(of_y, |sum, m| sum.plus_product(&b[(i, m)], &w[m])),
                    _ => of_y,
                };
                sum * share
            })
        });
        let next = next.collect();
        known.push(next);
    }
    known
}

const MOST_PICARD_STEPS: usize = 30;
/// The first guess goes by the initial rate, for this many steps.
const FIRST_GUESS: f64 = 1.5;
/// Share of its width by which a guess is widened on either side.
const INFLATION: f64 = 0.05;

fn zip<const N: usize>(
    a: &Columns<Interval, N>,
    b: &Columns<Interval, N>,
    f: impl Fn(Interval, Interval) -> Interval,
) -> Columns<Interval, N> {
    let columns = a.iter().zip(b);
    columns
        .map(|(a, b)| std::array::from_fn(|i| f(a[i], b[i])))
        .collect()
}
