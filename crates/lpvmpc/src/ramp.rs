//! The rate of the input as the input: bounds and costs on how fast it may change.

use crate::model::{LpvModel, Scalar};
use crate::ocp::Bounds;
use crate::steady_state::{SteadyState, SteadyStateProblem};
use nalgebra::{SMatrix, SVector};

/// A plant of `NX` states and `NU` inputs whose inputs have become states: it is driven by
/// their rates of change, so that a controller can bound and weigh them.
///
/// ```text
/// d/dt (x, u) = (A(scheduling) x + B(scheduling) u, r)
/// ```
///
/// State (x, u) with `NXU` = `NX` + `NU` components, input r in input units per second. What is
/// to be applied from a sample on is the ramp u(t) = u + r (t - t_k), its value at the next
/// sample at the latest. Bounds on u are state bounds, bounds on r input bounds, R stands in the
/// last block of Q.
///
/// The plant is one in continuous time: between the samples of a model with a
/// [period](LpvModel::period) there is no ramp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RampedInput<P, const NX: usize>(pub P);

impl<P, const NX: usize> RampedInput<P, NX> {
    /// (x, u) as one vector.
    pub fn join<T: Scalar, const NU: usize, const NXU: usize>(
        x: &SVector<T, NX>,
        u: &SVector<T, NU>,
    ) -> SVector<T, NXU> {
        const { assert!(NXU == NX + NU, "NXU must be NX + NU") };
        let mut joint = SVector::<T, NXU>::zeros();
        for (place, value) in joint.iter_mut().zip(x.iter().chain(u.iter())) {
            *place = *value;
        }
        joint
    }

    /// The vector (x, u) in its parts.
    pub fn split<T: Scalar, const NU: usize, const NXU: usize>(
        joint: &SVector<T, NXU>,
    ) -> (SVector<T, NX>, SVector<T, NU>) {
        const { assert!(NXU == NX + NU, "NXU must be NX + NU") };
        let mut x = SVector::<T, NX>::zeros();
        let mut u = SVector::<T, NU>::zeros();
        let places = x.iter_mut().chain(u.iter_mut());
        for (place, value) in places.zip(joint.iter()) {
            *place = *value;
        }
        (x, u)
    }

    /// The plant's pair (A, B) as that of the plant with its inputs as states.
    fn join_matrices<T: Scalar, const NU: usize, const NXU: usize>(
        (a, b): (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>),
    ) -> (SMatrix<T, NXU, NXU>, SMatrix<T, NXU, NU>) {
        let joint_a = SMatrix::from_fn(|i, j| match (i < NX, j < NX) {
            (true, true) => a[(i, j)],
            (true, false) => b[(i, j - NX)],
            (false, _) => T::zero(),
        });
        let integrate = |i: usize, j: usize| if i == NX + j { T::one() } else { T::zero() };
        (joint_a, SMatrix::from_fn(integrate))
    }
}

impl<P, T, const NX: usize, const NU: usize, const NS: usize, const NXU: usize>
    LpvModel<T, NXU, NU, NS> for RampedInput<P, NX>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS>,
{
    fn scheduling(&self, joint: &SVector<T, NXU>, _rate: &SVector<T, NU>) -> SVector<T, NS> {
        let (x, u) = Self::split::<T, NU, NXU>(joint);
        self.0.scheduling(&x, &u)
    }

    #[inline(always)]
    fn offset(&self, scheduling: &SVector<T, NS>) -> Option<SVector<T, NXU>> {
        let still = SVector::<T, NU>::zeros();
        let c = self.0.offset(scheduling)?;
        Some(Self::join(&c, &still))
    }

    fn matrices(&self, scheduling: &SVector<T, NS>) -> (SMatrix<T, NXU, NXU>, SMatrix<T, NXU, NU>) {
        Self::join_matrices(self.0.matrices(scheduling))
    }

    #[inline(always)]
    fn a_times<const C: usize>(
        &self,
        a: &SMatrix<T, NXU, NXU>,
        v: &SMatrix<T, NXU, C>,
    ) -> SMatrix<T, NXU, C> {
        let plant_a = a.fixed_view::<NX, NX>(0, 0).into_owned();
        let plant_v = v.fixed_view::<NX, C>(0, 0).into_owned();
        let product = self.0.a_times(&plant_a, &plant_v);
        SMatrix::from_fn(|i, j| {
            let inputs = (NX..NXU).map(|k| a[(i, k)] * v[(k, j)]);
            let plant = product.get((i, j)).copied();
            plant.map_or(T::zero(), |plant| {
                inputs.fold(plant, |sum, term| sum + term)
            })
        })
    }

    fn derivative(&self, joint: &SVector<T, NXU>, rate: &SVector<T, NU>) -> SVector<T, NXU> {
        let (x, u) = Self::split::<T, NU, NXU>(joint);
        Self::join(&self.0.derivative(&x, &u), rate)
    }

    fn jacobian(
        &self,
        joint: &SVector<T, NXU>,
        _rate: &SVector<T, NU>,
    ) -> (SMatrix<T, NXU, NXU>, SMatrix<T, NXU, NU>) {
        let (x, u) = Self::split::<T, NU, NXU>(joint);
        Self::join_matrices(self.0.jacobian(&x, &u))
    }

    /// That of the plant, with its input as the rest of the state; it changes no more.
    fn steady_state(
        &self,
        problem: &SteadyStateProblem<T, NXU, NU>,
    ) -> Option<SteadyState<T, NXU, NU>> {
        let (x_ref, _) = Self::split::<T, NU, NXU>(&problem.x_ref);
        let (q, r) = Self::split::<T, NU, NXU>(&problem.q);
        let (lower, upper) = (problem.x.lower, problem.x.upper);
        let (x_lower, u_lower) = Self::split::<T, NU, NXU>(&lower);
        let (x_upper, u_upper) = Self::split::<T, NU, NXU>(&upper);
        let plant = self.0.steady_state(&SteadyStateProblem {
            x_ref,
            q,
            // An input without weight has to have one here.
            r: r.map(|r| r.max(T::default_epsilon())),
            x: Bounds {
                lower: x_lower,
                upper: x_upper,
            },
            u: Bounds {
                lower: u_lower,
                upper: u_upper,
            },
        })?;
        Some(SteadyState {
            x: Self::join(&plant.x, &plant.u),
            u: SVector::zeros(),
            reached: plant.reached,
        })
    }
}
