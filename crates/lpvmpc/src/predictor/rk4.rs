//! The classical Runge-Kutta method of order four: of the nonlinear model, and of the pairs along its motion.

use super::MOST_STEPS;
use super::sampled::{follow_periods, periods, unmoved};
use crate::embedding::Tangent;
use crate::model::{LpvModel, Scalar};
use crate::small_matrix::{add_scaled, extend, product, scale};
use nalgebra::{SMatrix, SVector, convert};

/// f and the continuous-time pair (A, B) at a state.
#[cfg(target_os = "none")]
type TangentAt<'a, T, const NX: usize, const NU: usize> =
    dyn Fn(&[SVector<T, NX>; 1], &mut [Tangent<T, NX, NU>; 1]) + 'a;

/// Classical Runge-Kutta method of order four with `substeps` equal steps per sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rk4 {
    /// Steps per sample, at least 1; the paper uses 1.
    pub substeps: usize,
}

impl Rk4 {
    /// As few steps over `duration` s as none is longer than `longest_step` s, at most 1000.
    pub fn with_steps_up_to<T: Scalar>(longest_step: T, duration: T) -> Self {
        let mut substeps = 1;
        while convert::<f64, T>(substeps as f64) * longest_step < duration && substeps < MOST_STEPS
        {
            substeps += 1;
        }
        Self { substeps }
    }

    /// x_{k+1} = A_d x_k + B_d u_k over one sample of `t_s` seconds, for the constant
    /// continuous-time pair (`a`, `b`).
    ///
    /// With h = t_s / substeps and M = hA, one step is
    /// A_h = I + M + M^2/2 + M^3/6 + M^4/24 and B_h = h (I + M/2 + M^2/6 + M^3/24) B: the
    /// Taylor polynomials of order four of the exact zero-order-hold pair. Frozen scheduling
    /// over the whole sample is the paper's predictor.
    #[inline(always)]
    pub fn discretize<T: Scalar, const NX: usize, const NU: usize>(
        self,
        a: &SMatrix<T, NX, NX>,
        b: &SMatrix<T, NX, NU>,
        t_s: T,
    ) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>) {
        self.discretize_with(product, a, b, t_s)
    }

    /// [`Rk4::discretize`] with its own way to multiply with `a`.
    #[inline(always)]
    pub(super) fn discretize_with<T: Scalar, const NX: usize, const NU: usize>(
        self,
        a_times: impl Fn(&SMatrix<T, NX, NX>, &SMatrix<T, NX, NX>) -> SMatrix<T, NX, NX>,
        a: &SMatrix<T, NX, NX>,
        b: &SMatrix<T, NX, NU>,
        t_s: T,
    ) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>) {
        let (a_step, b_step) = taylor_step(|v| a_times(a, v), a, b, self.step_length(t_s));
        if self.substeps == 1 {
            return (a_step, b_step);
        }
        let (mut a_d, mut b_d) = (a_step, b_step);
        for _ in 1..self.substeps {
            b_d = product(&a_step, &b_d) + b_step;
            a_d = product(&a_step, &a_d);
        }
        (a_d, b_d)
    }

    /// A_d x + B_d u = [`Rk4::advance`] at the given `x` and `u`, of a model without affine term: the
    /// steps' matrices with the scheduling that the nonlinear steps have at each of their stages.
    // Not inlined, so that the frozen kinds keep the registers.
    #[inline(never)]
    pub fn linearize<T, P, const NX: usize, const NU: usize, const NS: usize>(
        self,
        model: &P,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
        t_s: T,
    ) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>)
    where
        T: Scalar,
        P: LpvModel<T, NX, NU, NS>,
    {
        let embedding = |x: &[SVector<T, NX>; 1], tangents: &mut [Tangent<T, NX, NU>; 1]| {
            *tangents = [model.embedded(&x[0], u)];
        };
        #[cfg(target_os = "none")]
        let embedding: &TangentAt<'_, T, NX, NU> = &embedding;
        let [(_, a_d, b_d)] = self.compose(model, &[*x], t_s, embedding);
        (a_d, b_d)
    }

    /// The state after a sample from each `x` under its `u`, with the matrices of [`Rk4::linearize`].
    #[inline(never)]
    pub fn linearize_each<
        T,
        P,
        const NX: usize,
        const NU: usize,
        const NS: usize,
        const POINTS: usize,
    >(
        self,
        model: &P,
        x: &[SVector<T, NX>; POINTS],
        u: &[SVector<T, NU>; POINTS],
        t_s: T,
    ) -> [Tangent<T, NX, NU>; POINTS]
    where
        T: Scalar,
        P: LpvModel<T, NX, NU, NS>,
    {
        let at = |x: &_, tangents: &mut _| model.embedded_each(x, u, tangents);
        self.compose(model, x, t_s, at)
    }

    /// The state after a sample from each `x` under its `u`, with the derivatives of [`Rk4::differentiate`].
    #[inline(never)]
    pub fn differentiate_each<
        T,
        P,
        const NX: usize,
        const NU: usize,
        const NS: usize,
        const POINTS: usize,
    >(
        self,
        model: &P,
        x: &[SVector<T, NX>; POINTS],
        u: &[SVector<T, NU>; POINTS],
        t_s: T,
    ) -> [Tangent<T, NX, NU>; POINTS]
    where
        T: Scalar,
        P: LpvModel<T, NX, NU, NS>,
    {
        let at = |x: &_, tangents: &mut _| model.tangent_each(x, u, tangents);
        self.compose(model, x, t_s, at)
    }

    /// The derivatives of [`Rk4::advance`] with respect to `x` and `u`: the same recursion with the
    /// Jacobian of f in place of the embedding's matrices.
    // Not inlined, so that the frozen kinds keep the registers.
    #[inline(never)]
    pub fn differentiate<T, P, const NX: usize, const NU: usize, const NS: usize>(
        self,
        model: &P,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
        t_s: T,
    ) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>)
    where
        T: Scalar,
        P: LpvModel<T, NX, NU, NS>,
    {
        let tangent = |x: &[SVector<T, NX>; 1], tangents: &mut [Tangent<T, NX, NU>; 1]| {
            *tangents = [model.tangent(&x[0], u)];
        };
        #[cfg(target_os = "none")]
        let tangent: &TangentAt<'_, T, NX, NU> = &tangent;
        let [(_, a_d, b_d)] = self.compose(model, &[*x], t_s, tangent);
        (a_d, b_d)
    }

    /// The state after the steps from each `x`, and the steps' matrices, from f and the continuous-time pairs `at` each
    /// Runge-Kutta stage.
    ///
    /// With A_j, B_j at stage j, the stages' slopes are K_j x + L_j u (up to a constant where the
    /// pairs are Jacobians): K_1 = A_1, L_1 = B_1, K_2 = A_2 (I + h/2 K_1),
    /// L_2 = B_2 + h/2 A_2 L_1, and so on. f takes the state from stage to stage. In discrete time there is nothing
    /// to integrate.
    // On a microcontroller, where flash is scarce, both kinds of pairs share its machine code.
    #[cfg_attr(target_os = "none", inline(never))]
    #[cfg_attr(not(target_os = "none"), inline(always))]
    fn compose<T, P, const NX: usize, const NU: usize, const NS: usize, const POINTS: usize>(
        self,
        model: &P,
        x: &[SVector<T, NX>; POINTS],
        t_s: T,
        at: impl Fn(&[SVector<T, NX>; POINTS], &mut [Tangent<T, NX, NU>; POINTS]),
    ) -> [Tangent<T, NX, NU>; POINTS]
    where
        T: Scalar,
        P: LpvModel<T, NX, NU, NS>,
    {
        if let Some(period) = model.period() {
            return follow_periods(x, periods(period, t_s), at);
        }
        let h = self.step_length(t_s);
        let part_of_h = |part: f64| h * convert::<f64, T>(part);
        let (half, third, sixth) = (part_of_h(0.5), part_of_h(1.0 / 3.0), part_of_h(1.0 / 6.0));
        let mut reached = unmoved(x);
        let mut there = reached;
        for _ in 0..self.substeps {
            let mut next = reached;
            let mut rates = [SVector::zeros(); POINTS];
            let mut slopes = [(SMatrix::zeros(), SMatrix::zeros()); POINTS];
            let stages = [(T::zero(), sixth), (half, third), (half, third), (h, sixth)];
            for (reach, weight) in stages {
                for (rate, (x, ..)) in rates.iter_mut().zip(&reached) {
                    extend(rate, x, reach);
                }
                at(&rates, &mut there);
                for i in 0..POINTS {
                    // In place, since copies cost as much as the products where nothing is unrolled.
                    let ((k, l), (_, a_d, b_d)) = (&mut slopes[i], &reached[i]);
                    extend(k, a_d, reach);
                    extend(l, b_d, reach);
                    let (rate, a, b) = &there[i];
                    rates[i] = *rate;
                    (*k, *l) = (model.a_times(a, k), model.a_times(a, l));
                    add_scaled(l, b, T::one());
                    let (x_next, a_next, b_next) = &mut next[i];
                    add_scaled(x_next, rate, weight);
                    add_scaled(a_next, k, weight);
                    add_scaled(b_next, l, weight);
                }
            }
            reached = next;
        }
        reached
    }

    /// The state `t_s` seconds after `x` under the constant input `u`, of the nonlinear plant.
    pub fn advance<T, M, const NX: usize, const NU: usize, const NS: usize>(
        self,
        model: &M,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
        t_s: T,
    ) -> SVector<T, NX>
    where
        T: Scalar,
        M: LpvModel<T, NX, NU, NS>,
    {
        if let Some(period) = model.period() {
            let periods = periods(period, t_s);
            return (0..periods).fold(*x, |x, _| model.derivative(&x, u));
        }
        self.advance_through(model, x, u, t_s, |_| ())
    }

    /// The same, with the state after `each` step. In discrete time a step is as many periods as fit into it.
    #[inline(always)]
    pub(crate) fn advance_through<T, M, const NX: usize, const NU: usize, const NS: usize>(
        self,
        model: &M,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
        t_s: T,
        mut each: impl FnMut(&SVector<T, NX>),
    ) -> SVector<T, NX>
    where
        T: Scalar,
        M: LpvModel<T, NX, NU, NS>,
    {
        let h = self.step_length(t_s);
        let discrete = model.period().is_some();
        let mut x = *x;
        for _ in 0..self.substeps {
            x = if discrete {
                Self { substeps: 1 }.advance(model, &x, u, h)
            } else {
                Self::step(model, &x, u, h)
            };
            each(&x);
        }
        x
    }

    /// The state `h` seconds after `x` under the input `u`, by one step.
    #[inline(always)]
    pub fn step<T, M, const NX: usize, const NU: usize, const NS: usize>(
        model: &M,
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
        h: T,
    ) -> SVector<T, NX>
    where
        T: Scalar,
        M: LpvModel<T, NX, NU, NS>,
    {
        let half: T = h * convert::<f64, T>(0.5);
        let sixth: T = h * convert::<f64, T>(1.0 / 6.0);
        let two: T = convert(2.0);
        let k1 = model.derivative(x, u);
        let k2 = model.derivative(&(x + k1 * half), u);
        let k3 = model.derivative(&(x + k2 * half), u);
        let k4 = model.derivative(&(x + k3 * h), u);
        x + (k1 + (k2 + k3) * two + k4) * sixth
    }

    fn step_length<T: Scalar>(self, t_s: T) -> T {
        t_s / convert::<f64, T>(self.substeps as f64)
    }
}

/// One step of length `h` seconds for a constant pair, the Taylor polynomials of order four: with
/// S = I + M/2 (I + M/3 (I + M/4)) they are A_h = I + M S and B_h = h S B.
#[inline(always)]
fn taylor_step<T: Scalar, const NX: usize, const NU: usize>(
    a_times: impl Fn(&SMatrix<T, NX, NX>) -> SMatrix<T, NX, NX>,
    a: &SMatrix<T, NX, NX>,
    b: &SMatrix<T, NX, NU>,
    h: T,
) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>) {
    let identity_plus = |mut v: SMatrix<T, NX, NX>, part: f64| {
        scale(&mut v, h * convert::<f64, T>(part));
        for i in 0..NX {
            v[(i, i)] += T::one();
        }
        v
    };
    let s = identity_plus(*a, 0.25);
    let s = identity_plus(a_times(&s), 1.0 / 3.0);
    let s = identity_plus(a_times(&s), 0.5);
    let mut b_step = product(&s, b);
    scale(&mut b_step, h);
    (identity_plus(a_times(&s), 1.0), b_step)
}
