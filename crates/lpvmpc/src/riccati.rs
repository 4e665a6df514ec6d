//! The Riccati kernel: one backward step of the linear-quadratic problem, and the vector
//! recursions that reuse its factor.
//!
//! With the cost-to-go x'Px/2 + p'x behind a stage, the stage's minimisation over u gives
//! u = K x + k. Written with the Cholesky factor R + B'PB = L L' and the normalised deviation
//! v = L'(u - K x - k), the whole cost becomes `constant + sum |v_i|^2 / 2`: the horizon's
//! Hessian is the identity, and a bound is a plain linear row in v.

mod unit_factor;
#[cfg(feature = "simd")]
mod widest;

use crate::model::Scalar;
use crate::ocp::{Common, Stage};
use crate::products::{self, Compiled, Products};
use crate::small_matrix::{
    add_product, add_symmetric_product, mirror, product, transposed, transposed_product,
    transposed_times,
};
use crate::transposed::StageBothWays;
use nalgebra::{SMatrix, SVector};
use unit_factor::UnitFactor;
#[cfg(feature = "simd")]
use widest::{Elimination, Passage};

/// Cost-to-go x'Px/2 + p'x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CostToGo<T, const NX: usize> {
    /// P, `NX` x `NX`, symmetric.
    pub quadratic: SMatrix<T, NX, NX>,
    /// p, `NX`.
    pub linear: SVector<T, NX>,
}

impl<T: Scalar, const NX: usize> CostToGo<T, NX> {
    /// No cost.
    pub fn zeros() -> Self {
        Self {
            quadratic: SMatrix::zeros(),
            linear: SVector::zeros(),
        }
    }
}

/// What a stage's minimisation leaves behind: the policy u = K x + k + L^-T v.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageFactor<T, const NX: usize, const NU: usize> {
    /// Feedback K, `NU` x `NX`, with the sign of u = K x; gains are for u = -K x throughout.
    pub feedback: SMatrix<T, NU, NX>,
    /// Feedforward k, `NU`.
    pub feedforward: SVector<T, NU>,
    /// L^-1, `NU` x `NU`, lower triangular.
    pub inverse_factor: SMatrix<T, NU, NU>,
}

/// What a stage and the cost-to-go behind it make of its input: u'Hu/2 + u'(G x + g), beside linear_x'x.
/// Its minimum is where H u = -(G x + g).
pub(crate) struct StageMinimum<T, const NX: usize, const NU: usize> {
    /// H, symmetric; its lower triangle is read.
    pub hessian: SMatrix<T, NU, NU>,
    /// G', whose columns are as long as the state.
    pub g_x: SMatrix<T, NX, NU>,
    pub g: SVector<T, NU>,
    pub linear_x: SVector<T, NX>,
}

impl<T: Scalar, const NX: usize, const NU: usize> StageMinimum<T, NX, NU> {
    /// Makes input `j` a constant. An unknown of its own stands in its place, at the same value.
    pub fn hold(&mut self, j: usize, value: T) {
        self.linear_x += self.g_x.column(j) * value;
        self.g_x.column_mut(j).fill(T::zero());
        self.g += self.hessian.column(j) * value;
        self.g[j] = -value;
        self.hessian.row_mut(j).fill(T::zero());
        self.hessian.column_mut(j).fill(T::zero());
        self.hessian[(j, j)] = T::one();
    }
}

/// What changes a stage's minimisation.
pub(crate) trait Adjustment<T, const NX: usize, const NU: usize> {
    fn adjust(&self, minimum: &mut StageMinimum<T, NX, NU>);
}

/// R + B'PB is not positive definite: the pivot that is not positive (or not finite).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BadPivot<T>(pub T);

impl<T: Scalar, const NX: usize, const NU: usize> StageFactor<T, NX, NU> {
    /// The factor of a stage that does nothing, to fill a workspace with.
    pub fn zeros() -> Self {
        Self {
            feedback: SMatrix::zeros(),
            feedforward: SVector::zeros(),
            inverse_factor: SMatrix::zeros(),
        }
    }

    /// One backward step: takes the cost-to-go behind `stage`, whose bounds do not matter here, to the
    /// one in front of it, and leaves the stage's factor in `self`.
    ///
    /// # Errors
    /// [`BadPivot`] if R + B'PB is not numerically positive definite.
    #[inline(never)]
    pub fn eliminate(
        &mut self,
        stage: &Stage<T, NX, NU>,
        weights: &Common<T, NX, NU>,
        cost_to_go: &mut CostToGo<T, NX>,
    ) -> Result<(), BadPivot<T>> {
        let stage = StageBothWays::new(stage);
        // Where flash is scarce, and in vectors, there is one piece of machine code for both.
        if cfg!(feature = "alloc") && !products::are_in_vectors(NX) {
            self.eliminate_here(stage, weights, cost_to_go, None, Compiled)
        } else {
            self.eliminate_adjusted(stage, weights, cost_to_go, None)
        }
    }

    /// The same, with the condition for the stage's minimum changed or not.
    #[inline(never)]
    pub(crate) fn eliminate_adjusted(
        &mut self,
        stage: StageBothWays<'_, T, NX, NU>,
        weights: &Common<T, NX, NU>,
        cost_to_go: &mut CostToGo<T, NX>,
        adjustment: Option<&dyn Adjustment<T, NX, NU>>,
    ) -> Result<(), BadPivot<T>> {
        #[cfg(feature = "simd")]
        if products::are_in_vectors(NX) {
            // Here, since code for the widest vectors gathers matrices of this size entry by entry.
            let mut transposed = None;
            return products::dispatch::<NX, _>(Elimination {
                factor: self,
                stage: stage.or_transposed_in(&mut transposed),
                weights,
                cost_to_go,
                adjustment,
            });
        }
        self.eliminate_here(stage, weights, cost_to_go, adjustment, Compiled)
    }

    #[inline(always)]
    fn eliminate_here<M: Products>(
        &mut self,
        stage: StageBothWays<'_, T, NX, NU>,
        weights: &Common<T, NX, NU>,
        cost_to_go: &mut CostToGo<T, NX>,
        adjustment: Option<&dyn Adjustment<T, NX, NU>>,
        by: M,
    ) -> Result<(), BadPivot<T>> {
        let Stage {
            a,
            b,
            c,
            linear_x,
            linear_u,
        } = &*stage;
        let CostToGo { quadratic, linear } = cost_to_go;
        // Begun as any matrix of its size: where registers are few, zeros would be stored first.
        let mut p_a = *quadratic;
        by.set_product(&mut p_a, quadratic, a);
        let p_b = by.product(quadratic, b);
        let p_next = *linear + product(quadratic, c);
        let (made_a, made_b);
        let (a, b) = match stage.transposed() {
            Some(kept) => (&kept.a, &kept.b),
            None => {
                (made_a, made_b) = (transposed(a), transposed(b));
                (&made_a, &made_b)
            }
        };

        // Of several inputs, A'(PB) has the longer columns; of one, (B'(PA))' takes as long, and in f32 torques come out
        // a third nearer to those in f64.
        let g_x = if NU == 1 {
            transposed(&(weights.s + by.product(b, &p_a)))
        } else {
            let mut g_x = by.product(a, &p_b);
            add_cross_term(&mut g_x, &weights.s);
            g_x
        };
        let mut minimum = StageMinimum {
            hessian: weights.r + by.product(b, &p_b),
            g_x,
            g: linear_u + product(b, &p_next),
            linear_x: linear_x + product(a, &p_next),
        };
        if let Some(adjustment) = adjustment {
            adjustment.adjust(&mut minimum);
        }
        let UnitFactor {
            inverse,
            reciprocals,
        } = UnitFactor::new(&minimum.hessian)?;
        // L^-1 of G and g, transposed, and -D^-1 of it.
        let transposed_inverse = transposed(&inverse);
        let l_g_x = by.product(&minimum.g_x, &transposed_inverse);
        let scaled_g_x = scaled_columns(&l_g_x, &-reciprocals);
        let scaled_g = scaled_rows(&product(&inverse, &minimum.g), &-reciprocals);
        self.feedback = transposed(&by.product(&scaled_g_x, &inverse));
        self.feedforward = product(&transposed_inverse, &scaled_g);
        self.inverse_factor = scaled_rows(&inverse, &reciprocals.map(|d| d.sqrt()));

        // A'P(A + BK) + Q + S'K, and the same for the linear part.
        let of_input = (&l_g_x, &transposed(&scaled_g_x));
        by.set_symmetric_sum(quadratic, &weights.q, (a, &p_a), of_input);
        mirror(quadratic);
        *linear = minimum.linear_x + product(&l_g_x, &scaled_g);
        Ok(())
    }

    /// The backward step of a stage whose `input` is a constant: the same as if each of them were held.
    #[inline(never)]
    pub(crate) fn pass(
        &mut self,
        stage: StageBothWays<'_, T, NX, NU>,
        weights: &Common<T, NX, NU>,
        cost_to_go: &mut CostToGo<T, NX>,
        input: &SVector<T, NU>,
    ) {
        #[cfg(feature = "simd")]
        if products::are_in_vectors(NX) {
            let mut transposed = None;
            return products::dispatch::<NX, _>(Passage {
                factor: self,
                stage: stage.or_transposed_in(&mut transposed),
                weights,
                cost_to_go,
                input,
            });
        }
        self.pass_here(stage, weights, cost_to_go, input, Compiled);
    }

    #[inline(always)]
    fn pass_here<M: Products>(
        &mut self,
        stage: StageBothWays<'_, T, NX, NU>,
        weights: &Common<T, NX, NU>,
        cost_to_go: &mut CostToGo<T, NX>,
        input: &SVector<T, NU>,
        by: M,
    ) {
        let Stage {
            a, b, c, linear_x, ..
        } = &*stage;
        let CostToGo { quadratic, linear } = cost_to_go;
        let p_a = by.product(quadratic, a);
        let p_next = *linear + product(quadratic, &(c + product(b, input)));
        let made;
        let a = match stage.transposed() {
            Some(kept) => &kept.a,
            None => {
                made = transposed(a);
                &made
            }
        };
        *linear = linear_x + product(a, &p_next) + transposed_times(&weights.s, input);
        let nothing = (&SMatrix::<T, NX, 0>::zeros(), &SMatrix::<T, 0, NX>::zeros());
        by.set_symmetric_sum(quadratic, &weights.q, (a, &p_a), nothing);
        mirror(quadratic);
        *self = Self {
            feedforward: *input,
            ..Self::zeros()
        };
    }

    /// Of a single input, behind [`Self::eliminate`]: makes it what takes component `j` of the next state to
    /// `value`, whatever that costs.
    pub(crate) fn hold_state(
        &mut self,
        stage: &Stage<T, NX, NU>,
        j: usize,
        value: T,
        cost_to_go: &mut CostToGo<T, NX>,
    ) -> Result<(), BadPivot<T>> {
        let component = |column: &[T; NX]| column.get(j).copied().unwrap_or(T::zero());
        let b = component(&stage.b.data.0[0]);
        let per_unit = T::one() / b;
        if !per_unit.is_finite() {
            return Err(BadPivot(b));
        }
        // It differs from the best input by e + d'x, and half of the square of that by H is what it costs more.
        let root = self.inverse_factor[(0, 0)];
        let h = T::one() / (root * root);
        let mut d = SVector::<T, NX>::zeros();
        let laws = self.feedback.data.0.iter_mut().zip(&stage.a.data.0);
        for (d, (law, a)) in d.data.0[0].iter_mut().zip(laws) {
            let held = -component(a) * per_unit;
            *d = held - law[0];
            law[0] = held;
        }
        let held = (value - component(&stage.c.data.0[0])) * per_unit;
        let e = held - self.feedforward[0];
        self.feedforward[0] = held;
        self.inverse_factor[(0, 0)] = T::zero();
        let CostToGo { quadratic, linear } = cost_to_go;
        add_symmetric_product(quadratic, &d, &transposed(&(d * h)));
        mirror(quadratic);
        *linear += d * (h * e);
        Ok(())
    }

    /// The input at the state `x` with the normalised deviation `v`.
    #[inline(always)]
    pub fn policy(&self, x: &SVector<T, NX>, v: &SVector<T, NU>) -> SVector<T, NU> {
        let mut u = self.feedforward;
        add_product(&mut u, &self.feedback, x);
        u += transposed_product(&self.inverse_factor, v);
        u
    }
}

/// With more entries than these, to transpose a matrix takes longer than to see that it is zero.
const FEW_ENTRIES: usize = 16;

/// g_x += S', where there is a cross term.
#[inline(always)]
fn add_cross_term<T: Scalar, const NX: usize, const NU: usize>(
    g_x: &mut SMatrix<T, NX, NU>,
    s: &SMatrix<T, NU, NX>,
) {
    // Sums of sizes, which go in vectors; with NaN it is not zero.
    let is_zero = || {
        let mut sizes = [T::zero(); NU];
        for column in &s.data.0 {
            for (size, s) in sizes.iter_mut().zip(column) {
                *size += s.abs();
            }
        }
        sizes.iter().all(|size| *size == T::zero())
    };
    if NX * NU <= FEW_ENTRIES || !is_zero() {
        *g_x += transposed(s);
    }
}

/// diag(`factors`) `m`
#[inline(always)]
fn scaled_rows<T: Scalar, const R: usize, const C: usize>(
    m: &SMatrix<T, R, C>,
    factors: &SVector<T, R>,
) -> SMatrix<T, R, C> {
    let mut out = *m;
    for column in &mut out.data.0 {
        for (entry, factor) in column.iter_mut().zip(&factors.data.0[0]) {
            *entry *= *factor;
        }
    }
    out
}

/// `m` diag(`factors`)
#[inline(always)]
fn scaled_columns<T: Scalar, const R: usize, const C: usize>(
    m: &SMatrix<T, R, C>,
    factors: &SVector<T, C>,
) -> SMatrix<T, R, C> {
    let mut out = *m;
    for (column, factor) in out.data.0.iter_mut().zip(&factors.data.0[0]) {
        for entry in column {
            *entry *= *factor;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use lpvmpc_testkit::rng::Rng;
    use nalgebra::{Matrix2, RowVector2, Vector2};

    /// A random stage, with a cross term or without.
    fn compare_with_textbook<const NX: usize, const NU: usize>(cross: f64) {
        let mut random = Rng::new((100 * NX + NU) as u64);
        let mut number = || random.uniform(-1.0, 1.0);
        let stage = Stage::<f64, NX, NU> {
            a: SMatrix::from_fn(|_, _| number()),
            b: SMatrix::from_fn(|_, _| number()),
            c: SVector::from_fn(|_, _| number()),
            linear_x: SVector::from_fn(|_, _| number()),
            linear_u: SVector::from_fn(|_, _| number()),
        };
        let root = SMatrix::<f64, NX, NX>::from_fn(|_, _| number());
        let weights = Common::<f64, NX, NU> {
            q: SMatrix::identity(),
            r: SMatrix::identity(),
            s: SMatrix::from_fn(|_, _| cross * number()),
            ..Common::default()
        };
        let behind = CostToGo {
            quadratic: root.transpose() * root,
            linear: SVector::from_fn(|_, _| number()),
        };
        let mut factor = StageFactor::zeros();
        let mut in_front = behind;
        let eliminated = factor.eliminate(&stage, &weights, &mut in_front);
        assert_eq!(eliminated, Ok(()));

        let Stage {
            a,
            b,
            c,
            linear_x,
            linear_u,
        } = stage;
        let p = behind.quadratic;
        let hessian = weights.r + b.transpose() * p * b;
        let g_x = weights.s + b.transpose() * p * a;
        let p_next = behind.linear + p * c;
        let g = linear_u + b.transpose() * p_next;
        let inverse = hessian.try_inverse().unwrap();
        let (feedback, feedforward) = (-inverse * g_x, -inverse * g);
        let quadratic = weights.q + a.transpose() * p * a + g_x.transpose() * feedback;
        let linear = linear_x + a.transpose() * p_next + g_x.transpose() * feedforward;
        let tolerance = 1e-11 * p.amax() * (NX * NX) as f64;
        assert!((factor.feedback - feedback).amax() < tolerance);
        assert!((factor.feedforward - feedforward).amax() < tolerance);
        assert!((in_front.quadratic - quadratic).amax() < tolerance);
        assert_eq!(in_front.quadratic, in_front.quadratic.transpose());
        assert!((in_front.linear - linear).amax() < tolerance);
        let l = factor.inverse_factor;
        assert!((l.transpose() * l - inverse).amax() < tolerance);
    }

    /// P = Q + A'PA - (S + B'PA)' (R + B'PB)^-1 (S + B'PA), whatever the size and however it fills the machine's vectors.
    #[test]
    fn a_backward_step_is_the_riccati_equation() {
        for cross in [0.0, 0.1] {
            compare_with_textbook::<2, 1>(cross);
            compare_with_textbook::<4, 1>(cross);
            compare_with_textbook::<6, 4>(cross);
            compare_with_textbook::<7, 2>(cross);
            compare_with_textbook::<8, 2>(cross);
            compare_with_textbook::<9, 3>(cross);
            compare_with_textbook::<12, 4>(cross);
            compare_with_textbook::<16, 4>(cross);
            compare_with_textbook::<16, 6>(cross);
            compare_with_textbook::<16, 8>(cross);
        }
    }

    /// The cost-to-go in front of a stage whose input holds a state is the cost of the stage and of what comes behind it
    /// under the law that keeps that state where it is, from any state.
    #[test]
    fn an_input_that_holds_a_state_costs_what_its_law_costs() {
        let stage = Stage::<f64, 2, 1> {
            a: Matrix2::new(1.0, 0.1, -0.3, 0.9),
            b: Vector2::new(0.02, 0.4),
            c: Vector2::new(0.1, -0.2),
            linear_x: Vector2::new(0.5, -1.0),
            linear_u: SVector::from_element(0.7),
        };
        let weights = Common::<f64, 2, 1> {
            q: Matrix2::new(2.0, 0.3, 0.3, 1.0),
            r: SMatrix::from_element(0.5),
            s: RowVector2::new(0.1, -0.2),
            ..Common::default()
        };
        let behind = CostToGo {
            quadratic: Matrix2::new(3.0, -0.5, -0.5, 4.0),
            linear: Vector2::new(-2.0, 1.0),
        };
        let value = |cost: &CostToGo<f64, 2>, x: &Vector2<f64>| {
            (cost.quadratic * x / 2.0 + cost.linear).dot(x)
        };
        for (j, level) in [(0, 0.8), (1, -0.6)] {
            let mut factor = StageFactor::zeros();
            let mut cost_to_go = behind;
            factor.eliminate(&stage, &weights, &mut cost_to_go).unwrap();
            factor
                .hold_state(&stage, j, level, &mut cost_to_go)
                .unwrap();
            let cost = |x: &Vector2<f64>| {
                let u = factor.policy(x, &SVector::from_element(7.0));
                let next = stage.next(x, &u);
                assert!((next[j] - level).abs() < 1e-12);
                let of_stage = (weights.q * x / 2.0 + stage.linear_x).dot(x)
                    + (weights.r * u / 2.0 + weights.s * x + stage.linear_u).dot(&u);
                of_stage + value(&behind, &next)
            };
            let at_zero = cost(&Vector2::zeros());
            for x in [Vector2::new(1.0, 0.0), Vector2::new(-0.4, 2.0)] {
                let difference = cost(&x) - at_zero - value(&cost_to_go, &x);
                assert!(difference.abs() < 1e-10, "{j}: {difference}");
            }
            let Err(BadPivot(pivot)) = factor.hold_state(
                &Stage {
                    b: Vector2::zeros(),
                    ..stage
                },
                j,
                level,
                &mut cost_to_go,
            ) else {
                panic!("an input that does not move the state");
            };
            assert_eq!(pivot, 0.0);
        }
    }
}
