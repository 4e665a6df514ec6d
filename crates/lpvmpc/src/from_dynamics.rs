//! Linear models of a plant that is known by its f alone.

mod along_motion;
mod along_ray;
mod gauss_legendre;

pub use along_motion::AlongMotion;
pub use along_ray::AlongRay;
pub use gauss_legendre::GaussLegendre;

use crate::embedding::{Dynamics, Tangent};
use crate::model::Scalar;
use crate::number::{Dual, Number};
use nalgebra::{SMatrix, SVector};

/// (x, u) in one vector.
fn joined<T: Scalar, const NX: usize, const NU: usize, const NS: usize>(
    x: &SVector<T, NX>,
    u: &SVector<T, NU>,
) -> SVector<T, NS> {
    let mut scheduling = SVector::<T, NS>::zeros();
    for (place, entry) in scheduling.iter_mut().zip(x.iter().chain(u.iter())) {
        *place = *entry;
    }
    scheduling
}

/// x and u of a vector of both.
fn parted<T: Scalar, const NX: usize, const NU: usize, const NS: usize>(
    scheduling: &SVector<T, NS>,
) -> (SVector<T, NX>, SVector<T, NU>) {
    let entry = |i: usize| match scheduling.get(i) {
        Some(entry) => *entry,
        None => T::zero(),
    };
    (
        SVector::from_fn(|i, _| entry(i)),
        SVector::from_fn(|i, _| entry(NX + i)),
    )
}

/// (f, df/dx, df/du) as the plant has them, or by one pass of dual numbers with `NS` = `NX` + `NU` slopes.
fn tangent<T, P, const NX: usize, const NU: usize, const NS: usize>(
    plant: &P,
    x: &SVector<T, NX>,
    u: &SVector<T, NU>,
) -> Tangent<T, NX, NU>
where
    T: Scalar + Number,
    P: Dynamics<NX, NU>,
{
    const {
        assert!(
            NS == NX + NU,
            "the scheduling is x and u: NS must be NX + NU"
        )
    };
    let mut tangents = [(SVector::zeros(), SMatrix::zeros(), SMatrix::zeros())];
    if plant.tangent_each(&[*x], &[*u], &mut tangents) {
        let [tangent] = tangents;
        return tangent;
    }
    let variable = |value: T, place: usize| {
        let mut variable = Dual::<T, NS>::fixed(value);
        if let Some(slope) = variable.slopes.get_mut(place) {
            *slope = T::one();
        }
        variable
    };
    let states = SVector::<_, NX>::from_fn(|i, _| variable(x[i], i));
    let inputs = SVector::<_, NU>::from_fn(|j, _| variable(u[j], NX + j));
    let rates = plant.f(&states, &inputs);
    let slope = |i: usize, place: usize| match rates[i].slopes.get(place) {
        Some(slope) => *slope,
        None => T::zero(),
    };
    (
        rates.map(|rate| rate.value),
        SMatrix::from_fn(slope),
        SMatrix::from_fn(|i, j| slope(i, NX + j)),
    )
}

/// [`tangent`] at several points, into places of theirs.
fn tangent_each<T, P, const NX: usize, const NU: usize, const NS: usize, const POINTS: usize>(
    plant: &P,
    x: &[SVector<T, NX>; POINTS],
    u: &[SVector<T, NU>; POINTS],
    tangents: &mut [Tangent<T, NX, NU>; POINTS],
) where
    T: Scalar + Number,
    P: Dynamics<NX, NU>,
{
    if !plant.tangent_each(x, u, tangents) {
        for (i, place) in tangents.iter_mut().enumerate() {
            *place = tangent::<_, _, NX, NU, NS>(plant, &x[i], &u[i]);
        }
    }
}
