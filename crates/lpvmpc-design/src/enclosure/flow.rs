//! Enclosures of a plant's motion over one sample, for all initial states in a box.

use super::Columns;
use super::affine::Affine;
use super::affine_map::AffineMap;
use super::composition::Composition;
use super::elementary::Arithmetic;
use super::interval::Interval;
use super::series::{CAPACITY, Series};
use nalgebra::{SMatrix, SVector};
use thiserror::Error;

/// A plant x_dot = A(s) x + B(s) u, s = sigma(x), whose formulas can be evaluated on any
/// [`Arithmetic`]: the same plant as its `lpvmpc::LpvModel`, for proofs. All quantities are in SI
/// units.
pub trait AnalyticModel<const NX: usize, const NU: usize, const NS: usize> {
    /// sigma(x).
    fn scheduling<T: Arithmetic>(&self, x: &[T; NX]) -> [T; NS];

    /// The rows of A(s), per second, and of B(s).
    fn matrices<T: Arithmetic>(&self, scheduling: &[T; NS]) -> ([[T; NX]; NX], [[T; NU]; NX]);
}

/// A motion that could not be enclosed; a smaller box may help.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error("the motion from this box of initial states has no enclosure over a step of {step} s")]
pub struct FlowError {
    /// The time step, s.
    pub step: f64,
}

/// The law u = **-K** x(0), held over a sample of `t_s` seconds.
#[derive(Debug, Clone, Copy)]
pub struct SampledLaw<const NX: usize, const NU: usize> {
    /// K.
    pub k: SMatrix<f64, NU, NX>,
    /// Sampling time, s.
    pub t_s: f64,
    /// log2 of the number of time steps, so that they fill the sample exactly.
    pub halvings: u8,
}

/// Coordinates y of the state, x = T y, in which errors are measured: their norm is best that
/// of the function whose decrease is to be shown.
#[derive(Debug, Clone, Copy)]
pub struct Frame<const NX: usize> {
    /// T.
    pub t: [[Interval; NX]; NX],
    /// An enclosure of its inverse.
    pub inverse: [[Interval; NX]; NX],
}

/// What is known of every motion over a sample that starts in a box of y.
#[derive(Debug, Clone)]
pub struct SampleEnclosure<const NX: usize> {
    /// G in y(t_s) = G y(0), over the box.
    pub transition: AffineMap<NX, NX, NX>,
    /// Where the states x are during the sample.
    pub states: [Interval; NX],
}

/// Coefficients of the power series in time; the remainder is of this order.
const ORDER: usize = 6;
const _: () = assert!(ORDER < CAPACITY);

impl<const NX: usize, const NU: usize> SampledLaw<NX, NU> {
    /// Encloses the motions from x = T y with |y_i - `centre`_i| <= `half_widths`_i.
    ///
    /// A step of the motion is linear in its initial state and input, x+ = Phi x + Gamma u, with
    /// Phi and Gamma that depend on where the motion leads the scheduling. They are enclosed as
    /// affine forms in y, then composed in the coordinates of the frame, from G = I on, with
    /// u = -K T y(0).
    ///
    /// # Errors
    /// No a-priori enclosure was found.
    pub fn enclose<M, const NS: usize>(
        &self,
        model: &M,
        frame: &Frame<NX>,
        centre: &SVector<f64, NX>,
        half_widths: &SVector<f64, NX>,
    ) -> Result<SampleEnclosure<NX>, FlowError>
    where
        M: AnalyticModel<NX, NU, NS>,
    {
        let t = constants(&frame.t);
        let inverse = constants(&frame.inverse);
        let symbol = |i: usize| Affine::symbol(centre[i], half_widths[i], i);
        let y: [[Affine<NX>; 1]; NX] = std::array::from_fn(|i| [symbol(i)]);
        let minus_k = matrix(|i, j| Affine::constant(-self.k[(i, j)]));
        let gain: [[Affine<NX>; NX]; NU] = product(&minus_k, &t);
        let u = product(&gain, &y);
        let steps = 1_u32 << self.halvings;
        let step = Step {
            model,
            input: std::array::from_fn(|i| u[i][0]),
            length: self.t_s / f64::from(steps),
        };
        let gain = AffineMap::of(&gain);
        let identity = matrix(|i, j| Affine::constant(if i == j { 1.0 } else { 0.0 }));
        let mut x = product(&t, &y).map(|[x]| x);
        let mut transition = Composition::from(AffineMap::of(&identity));
        let mut states: Option<[Interval; NX]> = None;
        for _ in 0..steps {
            let (end, phi, gamma, during) = step.enclose(&x)?;
            x = end;
            let phi = AffineMap::of(&product(&inverse, &product(&phi, &t)));
            let gamma = AffineMap::of(&product(&inverse, &gamma));
            transition.advance(&phi, &gamma.times(&gain));
            states = Some(match states {
                None => during,
                Some(before) => std::array::from_fn(|i| before[i].hull(during[i])),
            });
        }
        Ok(SampleEnclosure {
            transition: transition.map(),
            states: states.unwrap_or([Interval::EVERYTHING; NX]),
        })
    }
}

/// One time step. The columns Y = [x, Phi, Gamma] obey Y_dot = A(sigma(x)) Y + B(sigma(x)) W with
/// the constant W = [u, 0, I], from [x, I, 0] on.
struct Step<'a, M, const NX: usize, const NU: usize> {
    model: &'a M,
    input: [Affine<NX>; NU],
    length: f64,
}

/// The state after the step, Phi, Gamma and where the state is meanwhile.
type StepEnclosure<const NX: usize, const NU: usize> = (
    [Affine<NX>; NX],
    [[Affine<NX>; NX]; NX],
    [[Affine<NX>; NU]; NX],
    [Interval; NX],
);

impl<M, const NX: usize, const NU: usize> Step<'_, M, NX, NU> {
    fn enclose<const NS: usize>(
        &self,
        x: &[Affine<NX>; NX],
    ) -> Result<StepEnclosure<NX, NU>, FlowError>
    where
        M: AnalyticModel<NX, NU, NS>,
    {
        let unit = |is_one: bool| Affine::constant(if is_one { 1.0 } else { 0.0 });
        let mut columns = vec![*x];
        columns.extend((0..NX).map(|j| std::array::from_fn(|i| unit(i == j))));
        columns.extend((0..NU).map(|_| std::array::from_fn(|_| unit(false))));
        let mut inputs = vec![self.input];
        inputs.extend((0..NX).map(|_| std::array::from_fn(|_| unit(false))));
        inputs.extend((0..NU).map(|j| std::array::from_fn(|i| unit(i == j))));
        let (end, during) = self.advance(&columns, &inputs)?;
        let phi = std::array::from_fn(|i| std::array::from_fn(|j| end[1 + j][i]));
        let gamma = std::array::from_fn(|i| std::array::from_fn(|j| end[1 + NX + j][i]));
        Ok((end[0], phi, gamma, during))
    }

    /// The columns a step later, and where the state is during the step.
    fn advance<const NS: usize>(
        &self,
        columns: &Columns<Affine<NX>, NX>,
        affine_inputs: &Columns<Affine<NX>, NU>,
    ) -> Result<(Columns<Affine<NX>, NX>, [Interval; NX]), FlowError>
    where
        M: AnalyticModel<NX, NU, NS>,
    {
        let inputs = ranges(affine_inputs);
        let during = self.a_priori(&ranges(columns), &inputs)?;
        let remainder = &coefficients(self.model, &during, &inputs, ORDER)[ORDER];
        let series = coefficients(self.model, columns, affine_inputs, ORDER - 1);
        let step = Interval::point(self.length);
        let end = (0..columns.len()).map(|column| {
            std::array::from_fn(|i| {
                let rest = Affine::from(remainder[column][i]);
                let h = Affine::constant(self.length);
                series
                    .iter()
                    .rev()
                    .fold(rest, |sum, c| sum * h + c[column][i])
            })
        });
        let time = Interval::new(0.0, step.upper);
        let path = std::array::from_fn(|i| {
            let polynomial = series
                .iter()
                .rev()
                .fold(remainder[0][i], |sum, c| sum * time + c[0][i].range());
            polynomial.common(during[0][i])
        });
        Ok((end.collect(), path))
    }

    /// Columns that no motion leaves during the step: with Y = Y(0) + [0, h] f(Y') inside Y',
    /// the Picard iteration maps Y' into itself.
    fn a_priori<const NS: usize>(
        &self,
        start: &Columns<Interval, NX>,
        inputs: &Columns<Interval, NU>,
    ) -> Result<Columns<Interval, NX>, FlowError>
    where
        M: AnalyticModel<NX, NU, NS>,
    {
        let time = Interval::new(0.0, self.length);
        let rates = &coefficients(self.model, start, inputs, 1)[1];
        let ahead = time * Interval::point(FIRST_GUESS);
        let mut guess = zip(start, rates, |start, rate| start + ahead * rate);
        for _ in 0..MOST_PICARD_STEPS {
            let rates = &coefficients(self.model, &guess, inputs, 1)[1];
            let image = zip(start, rates, |start, rate| start + time * rate);
            let inside = |(guess, image): (&[Interval; NX], &[Interval; NX])| {
                guess
                    .iter()
                    .zip(image)
                    .all(|(guess, image)| guess.contains(*image))
            };
            if guess.iter().zip(&image).all(inside) {
                return Ok(image);
            }
            let widened =
                |x: &Interval| Interval::around(x.middle(), (1.0 + INFLATION) * x.radius());
            guess = image
                .iter()
                .map(|column| column.each_ref().map(widened))
                .collect();
            let unbounded = |x: &Interval| !x.magnitude().is_finite();
            if guess.iter().flatten().any(unbounded) {
                break;
            }
        }
        Err(FlowError { step: self.length })
    }
}

const MOST_PICARD_STEPS: usize = 30;
/// The first guess goes by the initial rate, for this many steps.
const FIRST_GUESS: f64 = 1.5;
/// Share of its width by which a guess is widened on either side.
const INFLATION: f64 = 0.05;

fn constants<const D: usize, const N: usize>(m: &[[Interval; N]; N]) -> [[Affine<D>; N]; N] {
    m.map(|row| row.map(Affine::from))
}

fn matrix<T, const R: usize, const C: usize>(f: impl Fn(usize, usize) -> T) -> [[T; C]; R] {
    std::array::from_fn(|i| std::array::from_fn(|j| f(i, j)))
}

/// The product of two matrices, given by their rows.
pub(crate) fn product<T: Arithmetic, const R: usize, const N: usize, const C: usize>(
    a: &[[T; N]; R],
    b: &[[T; C]; N],
) -> [[T; C]; R] {
    matrix(|i, j| (0..N).fold(T::constant(0.0), |sum, k| sum + a[i][k] * b[k][j]))
}

fn ranges<const D: usize, const N: usize>(columns: &Columns<Affine<D>, N>) -> Columns<Interval, N> {
    columns
        .iter()
        .map(|column| column.map(Affine::range))
        .collect()
}

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

/// The Taylor coefficients 0 to `order` of the columns' motion, the first of which is the state:
/// (k+1) Y_{k+1} = sum over j of A_j Y_{k-j} + B_k W.
fn coefficients<T, M, const NX: usize, const NU: usize, const NS: usize>(
    model: &M,
    start: &Columns<T, NX>,
    inputs: &Columns<T, NU>,
    order: usize,
) -> Vec<Columns<T, NX>>
where
    T: Arithmetic,
    M: AnalyticModel<NX, NU, NS>,
{
    let mut known = vec![start.clone()];
    for k in 0..order {
        let x = std::array::from_fn(|i| Series::new(known.iter().map(|y| y[0][i])));
        let (a, b) = model.matrices(&model.scheduling(&x));
        let share = T::constant((k + 1) as f64).reciprocal();
        let next = (0..start.len()).map(|column| {
            std::array::from_fn(|i| {
                let mut sum = T::constant(0.0);
                for (j, y) in known.iter().rev().enumerate() {
                    for m in 0..NX {
                        sum = sum + a[i][m].coefficient(j) * y[column][m];
                    }
                }
                for m in 0..NU {
                    sum = sum + b[i][m].coefficient(k) * inputs[column][m];
                }
                sum * share
            })
        });
        let next = next.collect();
        known.push(next);
    }
    known
}
