//! Quadratic stability: one P for a scheduling that moves anyhow within a box.

use super::lmi::{AffineMatrix, maximise_log_det};
use super::normalised::{Normaliser, corners, minus_identity};
use crate::cover::{Cell, Covered, Finding, Uncovered, cover};
use crate::enclosure::{
    Interval, TaylorMap, TaylorModel, from_fn, is_positive_definite, product, smallest_eigenvalue,
    transposed,
};
use lpvmpc::{Embedding, LpvModel, Number};
use lpvmpc_design::SchedulingGrid;
use nalgebra::{DMatrix, SMatrix, SVector, SymmetricEigen};

/// Rates of decay that are tried, 1/s.
const RATES: [f64; 8] = [4.0, 2.0, 1.0, 0.5, 0.2, 0.1, 0.05, 0.02];

/// A common P with (A - BK)'P + P(A - BK) <= -2 rate P at the points of `grid`, for the largest
/// of a few rates that has one; `None` if none has. `scale` settles the unknowns' units.
pub(super) fn synthesize<M, const NX: usize, const NU: usize, const NS: usize>(
    model: &M,
    grid: &SchedulingGrid<NS>,
    k: &SMatrix<f64, NU, NX>,
    scale: &SVector<f64, NX>,
) -> Option<(SMatrix<f64, NX, NX>, f64)>
where
    M: LpvModel<f64, NX, NU, NS>,
{
    let loops: Vec<DMatrix<f64>> = grid
        .points()
        .map(|point| {
            let (a, b) = model.matrices(&point);
            let closed = a - b * k;
            DMatrix::from_fn(NX, NX, |i, j| closed[(i, j)] * scale[j] / scale[i])
        })
        .collect();
    RATES.into_iter().find_map(|rate| {
        let unknowns = NX * (NX + 1) / 2;
        let of = |v: &nalgebra::DVector<f64>| {
            DMatrix::from_fn(NX, NX, |i, j| v[i.max(j) * (i.max(j) + 1) / 2 + i.min(j)])
        };
        let mut blocks = vec![
            AffineMatrix::of(unknowns, of),
            AffineMatrix::of(unknowns, |v| DMatrix::identity(NX, NX) - of(v)),
        ];
        blocks.extend(loops.iter().map(|closed| {
            AffineMatrix::of(unknowns, |v| {
                let p = of(v);
                -(closed.transpose() * &p + &p * closed) - &p * (2.0 * rate)
            })
        }));
        let p = of(&maximise_log_det(&blocks, unknowns, &|| ()).ok()?.v);
        let entry = |i: usize, j: usize| 0.5 * (p[(i, j)] + p[(j, i)]) / (scale[i] * scale[j]);
        Some((SMatrix::from_fn(entry), rate))
    })
}

/// Proves (A - BK)'P + P(A - BK) < -2 rate P for every scheduling |s_i| <= `limits[i]`.
pub(super) fn prove<M, const NX: usize, const NU: usize, const NS: usize>(
    model: &M,
    k: &SMatrix<f64, NU, NX>,
    normaliser: &Normaliser<NX>,
    rate: f64,
    limits: &SVector<f64, NS>,
) -> Result<Covered, Uncovered<NS>>
where
    M: Embedding<NX, NU, NS> + Sync,
{
    const MOST_CELLS: usize = 100_000;
    let whole = Cell {
        centre: SVector::zeros(),
        half_widths: *limits,
    };
    let examine = |cell: &Cell<NS>| {
        let decay = decay(model, k, normaliser, rate, cell).affine();
        let shift = Interval::point(decay.error);
        let at = |corner: &[f64; NS]| minus_identity(&decay.at(corner), shift);
        if corners([true; NS]).all(|corner| is_positive_definite(&at(&corner))) {
            let spare = corners([true; NS]).map(|corner| smallest_eigenvalue(&at(&corner)));
            return Finding::Holds {
                spare: spare.fold(f64::INFINITY, f64::min),
            };
        }
        let middle = self::decay(model, k, normaliser, rate, &cell.middle()).affine();
        if is_false(&middle) {
            return Finding::Fails;
        }
        let weight = |i: usize| decay.weight(i);
        let across = (0..NS).max_by(|a, b| weight(*a).total_cmp(&weight(*b)));
        Finding::Open {
            across: across.unwrap_or(0),
        }
    };
    cover(whole, MOST_CELLS, examine, &|_| ())
}

/// -T'((A - BK)'P + P(A - BK) + 2 rate P)T over a cell of schedulings.
fn decay<M, const NX: usize, const NU: usize, const NS: usize>(
    model: &M,
    k: &SMatrix<f64, NU, NX>,
    normaliser: &Normaliser<NX>,
    rate: f64,
    cell: &Cell<NS>,
) -> TaylorMap<NX, NX, NS>
where
    M: Embedding<NX, NU, NS> + Sync,
{
    let symbol = |i: usize| TaylorModel::symbol(cell.centre[i], cell.half_widths[i], i);
    let (a, b) = Embedding::matrices(model, &SVector::from_fn(|i, _| symbol(i)));
    let b: [[TaylorModel<NS>; NU]; NX] = from_fn(|i, j| b[(i, j)]);
    let minus_k: [[TaylorModel<NS>; NX]; NU] = from_fn(|i, j| TaylorModel::constant(-k[(i, j)]));
    let input = product(&b, &minus_k);
    let closed: [[TaylorModel<NS>; NX]; NX] = from_fn(|i, j| a[(i, j)] + input[i][j]);
    let p: [[TaylorModel<NS>; NX]; NX] = from_fn(|i, j| TaylorModel::from(normaliser.p()[i][j]));
    let t: [[TaylorModel<NS>; NX]; NX] =
        from_fn(|i, j| TaylorModel::from(normaliser.frame.t[i][j]));
    let half = product(&transposed(&t), &product(&p, &product(&closed, &t)));
    let unit = product(&transposed(&t), &product(&p, &t));
    let rate = TaylorModel::constant(rate);
    // Symmetric to the bit, so that one triangle says what the other one does.
    TaylorMap::of(&from_fn(|i, j| {
        -(half[i][j] + half[j][i]) - rate * (unit[i][j] + unit[j][i])
    }))
}

/// Whether the matrix is not positive definite, for certain: a vector v with v'Mv < 0.
fn is_false<const N: usize, const NS: usize>(decay: &TaylorMap<N, N, NS>) -> bool {
    let middle = decay.at(&[0.0; NS]);
    let middles = DMatrix::from_fn(N, N, |i, j| middle[i.max(j)][i.min(j)].middle());
    if middles.iter().any(|entry| !entry.is_finite()) {
        return false;
    }
    let eigen = SymmetricEigen::new(middles);
    let lowest = eigen
        .eigenvectors
        .column(eigen.eigenvalues.imin())
        .clone_owned();
    let v: [[Interval; 1]; N] = from_fn(|i, _| Interval::point(lowest[i]));
    let [[form]] = product(&transposed(&v), &product(&middle, &v));
    let [[square]] = product(&transposed(&v), &v);
    let within = Interval::point(decay.error) * Interval::new(-1.0, 1.0) * square;
    (form + within).upper < 0.0
}
