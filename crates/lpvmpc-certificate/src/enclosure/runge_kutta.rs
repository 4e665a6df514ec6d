//! Steps of the classical Runge-Kutta method, and what they are off by, for all states of a box.
//!
//! States and inputs are seen along a ray: x = r y and u = r v, so that y_dot = A(s) y + B(s) v with
//! s = sigma(r y, r v). The method commutes with the factor, so its error in y is that in x per r,
//! down to r = 0.
//!
//! The last symbol of the Taylor models is the time within a step, from its beginning (-1) to its
//! end (1).

use super::elementary::Arithmetic;
use super::flow::FlowError;
use super::interval::Interval;
use super::motion::{a_priori, coefficients};
use super::series::Series;
use super::taylor_model::TaylorModel;
use lpvmpc::{Embedding, Number};
use nalgebra::SVector;

/// Of the first coefficient of the method that is not the motion's.
const FIRST: usize = 5;
/// Of the remainder of the path within a step.
const PATH: usize = 4;

/// The plant along rays, that is in units of a scale, under inputs that are held.
pub(crate) struct ScaledPlant<'a, M, T, const NU: usize> {
    pub model: &'a M,
    /// r.
    pub scale: T,
    /// v.
    pub input: [T; NU],
}

impl<M, T: Arithmetic, const NU: usize> ScaledPlant<'_, M, T, NU> {
    /// y_dot, for a kind of number N into which `over` takes what does not change.
    fn rate<N: Arithmetic, const NX: usize, const NS: usize>(
        &self,
        over: impl Fn(T) -> N,
        y: &[N; NX],
    ) -> [N; NX]
    where
        M: Embedding<NX, NU, NS>,
    {
        let scale = over(self.scale);
        let v = self.input.map(&over);
        let x = SVector::from_fn(|i, _| scale * y[i]);
        let u = SVector::from_fn(|i, _| scale * v[i]);
        let (a, b) = self.model.matrices(&self.model.scheduling(&x, &u));
        std::array::from_fn(|i| {
            let by_state = (0..NX).fold(N::constant(0.0), |sum, j| {
                sum.plus_product(&a[(i, j)], &y[j])
            });
            (0..NU).fold(by_state, |sum, j| sum.plus_product(&b[(i, j)], &v[j]))
        })
    }

    /// The Taylor coefficients of the motions from `start`, up to `order`.
    pub fn coefficients<const NX: usize, const NS: usize>(
        &self,
        start: &[T; NX],
        order: usize,
    ) -> Vec<[T; NX]>
    where
        M: Embedding<NX, NU, NS>,
    {
        let (start, inputs) = (vec![*start], vec![self.input]);
        let scale = Some(self.scale);
        let all = coefficients(self.model, scale, &start, &inputs, order);
        all.into_iter().map(|columns| columns[0]).collect()
    }

    /// The method's state a step of `length` after `y`.
    pub fn step<const NX: usize, const NS: usize>(&self, y: &[T; NX], length: T) -> [T; NX]
    where
        M: Embedding<NX, NU, NS>,
    {
        step(|y| self.rate(|fixed| fixed, y), y, length)
    }

    /// The Taylor coefficient `order` of the method's step as a function of its length, about `length`.
    fn coefficient_of_step<const NX: usize, const NS: usize>(
        &self,
        y: &[T; NX],
        length: T,
        order: usize,
    ) -> [T; NX]
    where
        M: Embedding<NX, NU, NS>,
    {
        let length = Series::line(length, T::constant(1.0), order + 1);
        let rate = |y: &[Series<T>; NX]| self.rate(Series::fixed, y);
        let end = step(rate, &y.map(Series::fixed), length);
        end.map(|y| *y.coefficient(order))
    }

    /// The derivatives of y_dot with respect to y at `at`: the entry \[i\]\[j\] is that of the component i with
    /// respect to the component j.
    pub fn jacobian<const NX: usize, const NS: usize>(&self, at: &[T; NX]) -> [[T; NX]; NX]
    where
        M: Embedding<NX, NU, NS>,
    {
        let column = |j: usize| {
            let y = std::array::from_fn(|i| match i == j {
                true => Series::line(at[i], T::constant(1.0), 2),
                false => Series::fixed(at[i]),
            });
            self.rate(Series::fixed, &y)
        };
        let columns: [[Series<T>; NX]; NX] = std::array::from_fn(column);
        std::array::from_fn(|i| std::array::from_fn(|j| *columns[j][i].coefficient(1)))
    }
}

/// The method's step of `length` from `y`.
fn step<T: Arithmetic, const NX: usize>(
    rate: impl Fn(&[T; NX]) -> [T; NX],
    y: &[T; NX],
    length: T,
) -> [T; NX] {
    let share = |divisor: f64| length * T::constant(divisor).reciprocal();
    let from = |reach: T, k: &[T; NX]| std::array::from_fn(|i| y[i] + reach * k[i]);
    let two = T::constant(2.0);
    let k1 = rate(y);
    let k2 = rate(&from(share(2.0), &k1));
    let k3 = rate(&from(share(2.0), &k2));
    let k4 = rate(&from(length, &k3));
    from(
        share(6.0),
        &std::array::from_fn(|i| k1[i] + two * (k2[i] + k3[i]) + k4[i]),
    )
}

impl<M, const NU: usize, const D: usize> ScaledPlant<'_, M, TaylorModel<D>, NU> {
    /// The states during a step of `length` seconds from `y`, which stay in `during`.
    pub fn path<const NX: usize, const NS: usize>(
        &self,
        y: &[TaylorModel<D>; NX],
        length: Interval,
        during: &[Interval; NX],
    ) -> [TaylorModel<D>; NX]
    where
        M: Embedding<NX, NU, NS>,
    {
        let series = self.coefficients(y, PATH - 1);
        let rest = self.ranges().coefficients(during, PATH)[PATH];
        let time = TaylorModel::time(length);
        std::array::from_fn(|i| {
            let rest = TaylorModel::from(rest[i]);
            series.iter().rev().fold(rest, |sum, c| sum * time + c[i])
        })
    }

    /// What the method's step from `y` is off by: its end less that of the motion, whose `path` is known.
    ///
    /// As functions of the length h, both have the same Taylor coefficients up to order 4, the order of the
    /// method. So their difference is h^5 times the mean of c_5(s h) - d_5(s h) over s from 0 to 1 with the
    /// weight 5 (1 - s)^4, where c_5 and d_5 are the coefficients of order 5 about a length.
    pub fn error_of_step<const NX: usize, const NS: usize>(
        &self,
        y: &[TaylorModel<D>; NX],
        length: Interval,
        path: &[TaylorModel<D>; NX],
    ) -> [TaylorModel<D>; NX]
    where
        M: Embedding<NX, NU, NS>,
    {
        let method = self.coefficient_of_step(y, TaylorModel::time(length), FIRST);
        let motion = self.coefficients(path, FIRST)[FIRST];
        let h = TaylorModel::from(length);
        let h_5 = (1..FIRST).fold(h, |power, _| power * h);
        std::array::from_fn(|i| h_5 * (method[i] - motion[i]).mean_over_time(FIRST))
    }

    /// The same for all of the box together.
    pub fn ranges(&self) -> ScaledPlant<'_, M, Interval, NU> {
        ScaledPlant {
            model: self.model,
            scale: self.scale.range(),
            input: self.input.map(TaylorModel::range),
        }
    }
}

impl<const D: usize> TaylorModel<D> {
    const TIME: usize = D - 1;

    /// The time since a step of `length` seconds began.
    fn time(length: Interval) -> Self {
        let half = Self::from(length) * Self::constant(0.5);
        half + half * Self::symbol(0.0, 1.0, Self::TIME)
    }

    /// What depends on the time, as a polynomial in it: 1, t and t^2.
    fn by_time(self) -> [Self; 3] {
        let (slopes, squares) = (self.slopes(), self.squares());
        let without = |last: usize, value: f64| if last == Self::TIME { 0.0 } else { value };
        let mut fixed = Self::polynomial(
            self.middle,
            |i| without(i, slopes[i]),
            |i, j| without(j, squares[i][j]),
        );
        fixed.error = self.error;
        let linear = Self::polynomial(
            slopes[Self::TIME],
            |i| without(i, squares[i][Self::TIME]),
            |_, _| 0.0,
        );
        [
            fixed,
            linear,
            Self::constant(squares[Self::TIME][Self::TIME]),
        ]
    }

    /// Its mean over the time with the weight `order` (1 - s)^(`order` - 1), s from 0 to 1.
    fn mean_over_time(self, order: usize) -> Self {
        let whole = |n: usize| Interval::point(n as f64);
        // s has the mean 1/(n + 1), and s^2 has 2/((n + 1)(n + 2)); t = 2 s - 1.
        let mean = whole(order + 1).reciprocal();
        let square = whole(2) * whole((order + 1) * (order + 2)).reciprocal();
        let first = whole(2) * mean - whole(1);
        let second = whole(4) * (square - mean) + whole(1);
        let [fixed, linear, quadratic] = self.by_time();
        fixed + linear * Self::from(first) + quadratic * Self::from(second)
    }

    /// What holds at any time of the step.
    pub fn at_any_time(self) -> Self {
        let [fixed, linear, quadratic] = self.by_time();
        let t = Self::from(Interval::new(-1.0, 1.0));
        fixed + linear * t + quadratic * Self::from(Interval::new(0.0, 1.0))
    }
}

impl<M, const NU: usize> ScaledPlant<'_, M, Interval, NU> {
    /// What the motions from `start` do not leave within `length` seconds.
    pub fn during<const NX: usize, const NS: usize>(
        &self,
        start: &[Interval; NX],
        length: f64,
    ) -> Result<[Interval; NX], FlowError>
    where
        M: Embedding<NX, NU, NS>,
    {
        let inputs = vec![self.input];
        let scale = Some(self.scale);
        let during = a_priori(self.model, scale, length, &vec![*start], &inputs)?;
        Ok(during[0])
    }
}
