//! Enclosures of a plant's motion over one sample, for all initial states in a box.

use super::Columns;
use super::composition::{Composition, Uncertain};
use super::elementary::Arithmetic;
use super::interval::Interval;
use super::motion::{a_priori, coefficients, iterated, matrices_during};
use super::rows::{from_fn, product};
use super::series::CAPACITY;
use super::taylor_map::{ROUNDING, TaylorMap};
use super::taylor_model::TaylorModel;
use lpvmpc::{Embedding, Number};
use nalgebra::{SMatrix, SVector};
use thiserror::Error;

/// A motion that could not be enclosed.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum FlowError {
    /// The numbers grew too large; a smaller box may help.
    #[error("the motion from this box of initial states has no enclosure over a step of {step} s")]
    NoEnclosure {
        /// The time step, s.
        step: f64,
    },
    /// A motion with an affine term is not linear in initial state and input.
    #[error("the plant has an affine term: its motion is not linear in initial state and input")]
    AffineTerm,
    /// The plant is sampled itself, with another period.
    #[error("t_s = {t_s} s: the plant is in discrete time with a period of {period} s")]
    Period {
        /// The sampling time of the law, s.
        t_s: f64,
        /// The plant's, s.
        period: f64,
    },
}

/// The law u = **-K** x(0), held over a sample of `t_s` seconds.
#[derive(Debug, Clone, Copy)]
pub struct SampledLaw<const NX: usize, const NU: usize> {
    /// K.
    pub k: SMatrix<f64, NU, NX>,
    /// Sampling time, s; of a plant in discrete time its period.
    pub t_s: f64,
    /// log2 of the number of time steps, so that they fill the sample exactly; a plant in discrete time has none.
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

/// What is known of every motion over a sample that starts in a box of y, which `D` coordinates describe.
#[derive(Debug, Clone)]
pub struct SampleEnclosure<const NX: usize, const D: usize> {
    /// G + E in y(t_s) = (G + E) y(0), over the box: G, affine and without error.
    pub transition: TaylorMap<NX, NX, D>,
    /// S, with E'E <= S over the box.
    pub error_square: SMatrix<f64, NX, NX>,
    /// How much G depends on each coordinate of the box, in the Frobenius norm.
    pub dependence: [f64; D],
    /// Where the states x are during the sample; of a plant in discrete time at its beginning.
    pub states: [Interval; NX],
}

/// The y with |y| <= `radius`: where a motion begins. A box around a set of many coordinates reaches much farther than
/// the set, by the root of their number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ball {
    /// The radius; infinite for none.
    pub radius: f64,
}

impl Ball {
    /// All of the box.
    pub const EVERYWHERE: Self = Self {
        radius: f64::INFINITY,
    };
}

/// The part of the box y = `centre` + diag(`half_widths`) z that is in the ball.
struct Within<'a, const D: usize> {
    ball: Ball,
    centre: &'a SVector<f64, D>,
    half_widths: &'a SVector<f64, D>,
}

impl<const D: usize> Within<'_, D> {
    /// The values of a model over that part. Its linear part is g'(y - centre), g its slopes over the half widths: at
    /// most |g| radius from -g'centre.
    fn range(&self, model: &TaylorModel<D>) -> Interval {
        let whole = model.range();
        if !self.ball.radius.is_finite() {
            return whole;
        }
        let (mut shift, mut square) = (Interval::point(0.0), Interval::point(0.0));
        for (i, slope) in model.slopes().iter().enumerate() {
            // Without a width it does not depend on the coordinate.
            if *slope != 0.0 {
                let over = Interval::point(self.half_widths[i]).reciprocal();
                let g = Interval::point(*slope) * over;
                shift = shift - g * Interval::point(self.centre[i]);
                square = square + g.square();
            }
        }
        let reach = (square.square_root() * Interval::point(self.ball.radius)).upper;
        let squares = model.squares();
        let mut flat = TaylorModel::<D>::polynomial(model.middle, |_| 0.0, |i, j| squares[i][j]);
        flat.error = model.error;
        whole.common(flat.range() + shift + Interval::new(-reach, reach))
    }
}

/// Coefficients of the power series in time; the remainder is of this order.
const ORDER: usize = 6;
const _: () = assert!(ORDER < CAPACITY);

impl<const NX: usize, const NU: usize> SampledLaw<NX, NU> {
    /// Encloses the motions from x = T y with |y_i - `centre`_i| <= `half_widths`_i, as far as they begin in `ball`.
    ///
    /// A step of the motion is linear in its initial state and input, x+ = Phi x + Gamma u, with
    /// Phi and Gamma that depend on where the motion leads the scheduling. They are enclosed as
    /// Taylor models in y, then composed in the coordinates of the frame, from G = I on, with
    /// u = -K T y(0). A plant in discrete time makes one step, whose Phi and Gamma are A(s) and B(s).
    ///
    /// # Errors
    /// No enclosure was found: the box is too large; or the plant has an affine term, or another period.
    pub fn enclose<M, const NS: usize>(
        &self,
        model: &M,
        frame: &Frame<NX>,
        centre: &SVector<f64, NX>,
        half_widths: &SVector<f64, NX>,
        ball: Ball,
    ) -> Result<SampleEnclosure<NX, NX>, FlowError>
    where
        M: Embedding<NX, NU, NS>,
    {
        let symbol = |i: usize| [TaylorModel::symbol(centre[i], half_widths[i], i)];
        let within = Within {
            ball,
            centre,
            half_widths,
        };
        self.enclose_from(model, frame, std::array::from_fn(symbol), &within)
    }

    /// Encloses the motion from x = T y with y in intervals that are nearly points: faster, since nothing is known
    /// of how it depends on y.
    ///
    /// # Errors
    /// As of [`Self::enclose`].
    pub fn enclose_point<M, const NS: usize>(
        &self,
        model: &M,
        frame: &Frame<NX>,
        y: &[Interval; NX],
    ) -> Result<SampleEnclosure<NX, 0>, FlowError>
    where
        M: Embedding<NX, NU, NS>,
    {
        let nowhere = SVector::zeros();
        let within = Within {
            ball: Ball::EVERYWHERE,
            centre: &nowhere,
            half_widths: &nowhere,
        };
        self.enclose_from(model, frame, y.map(|y| [TaylorModel::from(y)]), &within)
    }

    fn enclose_from<M, const NS: usize, const D: usize>(
        &self,
        model: &M,
        frame: &Frame<NX>,
        y: [[TaylorModel<D>; 1]; NX],
        within: &Within<'_, D>,
    ) -> Result<SampleEnclosure<NX, D>, FlowError>
    where
        M: Embedding<NX, NU, NS>,
    {
        let t = constants(&frame.t);
        let inverse = constants(&frame.inverse);
        let minus_k = from_fn(|i, j| TaylorModel::constant(-self.k[(i, j)]));
        let gain: [[TaylorModel<D>; NX]; NU] = product(&minus_k, &t);
        let u = product(&gain, &y);
        let steps = match model.period() {
            None => 1_u32 << self.halvings,
            Some(period) if period == self.t_s => 1,
            Some(period) => {
                let t_s = self.t_s;
                return Err(FlowError::Period { t_s, period });
            }
        };
        let step = Step {
            model,
            input: std::array::from_fn(|i| u[i][0]),
            length: self.t_s / f64::from(steps),
        };
        let gain = TaylorMap::of(&gain);
        let mut x = product(&t, &y).map(|[x]| x);
        let scheduling = model.scheduling(&SVector::from(x), &SVector::from(step.input));
        if model.offset(&scheduling).is_some() {
            return Err(FlowError::AffineTerm);
        }
        let mut transition = Composition::identity();
        let mut states: Option<[Interval; NX]> = None;
        for _ in 0..steps {
            let (end, phi, gamma, during) = match model.period() {
                None => step.enclose(&x, within)?,
                Some(_) => step.jump(&x),
            };
            x = end;
            let phi = uncertain(&inverse, &phi, &t);
            let unit = from_fn(|i, j| TaylorModel::constant(if i == j { 1.0 } else { 0.0 }));
            let gamma = uncertain(&inverse, &gamma, &unit);
            transition.advance(&phi, &gamma, &gain);
            states = Some(match states {
                None => during,
                Some(before) => std::array::from_fn(|i| before[i].hull(during[i])),
            });
        }
        let dependence = transition.dependence();
        let (transition, error_square) = transition.affine();
        if error_square.iter().any(|entry| !entry.is_finite()) {
            return Err(FlowError::NoEnclosure { step: step.length });
        }
        Ok(SampleEnclosure {
            transition,
            error_square,
            dependence,
            states: states.unwrap_or([Interval::EVERYTHING; NX]),
        })
    }
}

/// One time step. The columns Y = [x, Phi, Gamma] obey Y_dot = A(sigma(x)) Y + B(sigma(x)) W with
/// the constant W = [u, 0, I], from [x, I, 0] on.
struct Step<'a, M, const NU: usize, const D: usize> {
    model: &'a M,
    input: [TaylorModel<D>; NU],
    length: f64,
}

/// The state after the step, Phi, Gamma and where the state is meanwhile.
type StepEnclosure<const NX: usize, const NU: usize, const D: usize> = (
    [TaylorModel<D>; NX],
    [[TaylorModel<D>; NX]; NX],
    [[TaylorModel<D>; NU]; NX],
    [Interval; NX],
);

impl<M, const NU: usize, const D: usize> Step<'_, M, NU, D> {
    fn enclose<const NX: usize, const NS: usize>(
        &self,
        x: &[TaylorModel<D>; NX],
        within: &Within<'_, D>,
    ) -> Result<StepEnclosure<NX, NU, D>, FlowError>
    where
        M: Embedding<NX, NU, NS>,
    {
        let unit = |is_one: bool| TaylorModel::constant(if is_one { 1.0 } else { 0.0 });
        let mut columns = vec![*x];
        columns.extend((0..NX).map(|j| std::array::from_fn(|i| unit(i == j))));
        columns.extend((0..NU).map(|_| std::array::from_fn(|_| unit(false))));
        let mut inputs = vec![self.input];
        inputs.extend((0..NX).map(|_| std::array::from_fn(|_| unit(false))));
        inputs.extend((0..NU).map(|j| std::array::from_fn(|i| unit(i == j))));
        let (end, during) = self.advance(&columns, &inputs, within)?;
        let phi = std::array::from_fn(|i| std::array::from_fn(|j| end[1 + j][i]));
        let gamma = std::array::from_fn(|i| std::array::from_fn(|j| end[1 + NX + j][i]));
        Ok((end[0], phi, gamma, during))
    }

    /// The same of a plant in discrete time, whose state is where it was meanwhile.
    fn jump<const NX: usize, const NS: usize>(
        &self,
        x: &[TaylorModel<D>; NX],
    ) -> StepEnclosure<NX, NU, D>
    where
        M: Embedding<NX, NU, NS>,
    {
        let (state, input) = (SVector::from(*x), SVector::from(self.input));
        let (a, b) = self.model.matrices(&self.model.scheduling(&state, &input));
        let (phi, gamma) = (from_fn(|i, j| a[(i, j)]), from_fn(|i, j| b[(i, j)]));
        let (of_state, of_input) = (
            product(&phi, &x.map(|one| [one])),
            product(&gamma, &self.input.map(|one| [one])),
        );
        let end = std::array::from_fn(|i| of_state[i][0] + of_input[i][0]);
        (end, phi, gamma, x.map(TaylorModel::range))
    }

    /// The columns a step later, and where the state is during the step.
    fn advance<const NX: usize, const NS: usize>(
        &self,
        columns: &Columns<TaylorModel<D>, NX>,
        model_inputs: &Columns<TaylorModel<D>, NU>,
        within: &Within<'_, D>,
    ) -> Result<(Columns<TaylorModel<D>, NX>, [Interval; NX]), FlowError>
    where
        M: Embedding<NX, NU, NS>,
    {
        let inputs = ranges(model_inputs);
        let during = a_priori(self.model, None, self.length, &ranges(columns), &inputs)?;
        let mut remainder =
            coefficients(self.model, None, &during, &inputs, ORDER).swap_remove(ORDER);
        let bounded = |column: &[Interval; NX]| column.iter().all(|x| x.magnitude().is_finite());
        let series = if remainder.iter().all(bounded) {
            coefficients(self.model, None, columns, model_inputs, ORDER - 1)
        } else {
            // A kink is in the way: there are no derivatives of the motion.
            let matrices = matrices_during(self.model, &during, &inputs);
            remainder = iterated(&matrices, &during, &inputs, ORDER).swap_remove(ORDER);
            iterated(&matrices, columns, model_inputs, ORDER - 1)
        };
        let step = Interval::point(self.length);
        let end = (0..columns.len()).map(|column| {
            std::array::from_fn(|i| {
                let rest = TaylorModel::from(remainder[column][i]);
                let h = TaylorModel::constant(self.length);
                series
                    .iter()
                    .rev()
                    .fold(rest, |sum, c| sum * h + c[column][i])
            })
        });
        let time = Interval::new(0.0, step.upper);
        let path = std::array::from_fn(|i| {
            let polynomial = series.iter().rev().fold(remainder[0][i], |sum, c| {
                sum * time + within.range(&c[0][i])
            });
            polynomial.common(during[0][i])
        });
        Ok((end.collect(), path))
    }
}

/// T^-1 M R for an uncertain M: its error is T^-1 E R, and a column of E that is nearly zero stays
/// apart. With W = diag(w) R, F = T^-1 E diag(1/w).
fn uncertain<const D: usize, const N: usize, const K: usize>(
    inverse: &[[TaylorModel<D>; N]; N],
    m: &[[TaylorModel<D>; K]; N],
    right: &[[TaylorModel<D>; K]; K],
) -> Uncertain<N, K, D> {
    let mut exact = *m;
    for entry in exact.iter_mut().flatten() {
        entry.error = 0.0;
    }
    let column = |j: usize| {
        let entry = |i: usize| -> f64 {
            let terms = inverse[i].iter().zip(m);
            terms
                .map(|(t, row)| t.range().magnitude() * row[j].error)
                .sum()
        };
        (0..N).map(|i| entry(i).powi(2)).sum::<f64>().sqrt()
    };
    let right_rows = SMatrix::<f64, K, K>::from_fn(|i, j| right[i][j].middle);
    let lengths: [f64; K] = std::array::from_fn(|j| right_rows.row(j).norm());
    // Column by column what is E's share of T^-1 E R.
    let shares: [f64; K] = std::array::from_fn(|j| column(j) * lengths[j]);
    let largest = shares.iter().fold(0.0, |a: f64, b| a.max(*b));
    let weight = |j: usize| {
        if largest > 0.0 {
            (shares[j] / largest).sqrt() / lengths[j]
        } else {
            0.0
        }
    };
    Uncertain {
        map: TaylorMap::of(&product(inverse, &product(&exact, right))),
        // |F|_F^2 = sum of c_j^2 / w_j^2.
        size: (shares.iter().sum::<f64>() * largest).sqrt() * (1.0 + ROUNDING),
        acts_on: SMatrix::from_fn(|i, j| weight(i) * right_rows[(i, j)]),
    }
}

fn constants<const D: usize, const N: usize>(m: &[[Interval; N]; N]) -> [[TaylorModel<D>; N]; N] {
    from_fn(|i, j| TaylorModel::from(m[i][j]))
}

fn ranges<const D: usize, const N: usize>(
    columns: &Columns<TaylorModel<D>, N>,
) -> Columns<Interval, N> {
    columns
        .iter()
        .map(|column| column.map(TaylorModel::range))
        .collect()
}
