//! Where a plant can stand, as near to the references of its state and outputs as can be.

use crate::last_input::Disturbed;
use lpvmpc::{Bounds, LpvModel};
use lpvmpc_plant::Plant;
use nalgebra::{DMatrix, DVector, SVector};

/// A steady state that is looked for: where a sample costs least, the input next to nothing beside state and
/// outputs.
pub(crate) struct Wanted<'a, const NX: usize, const NU: usize> {
    pub x_ref: SVector<f64, NX>,
    /// Q, n x n.
    pub q: &'a DMatrix<f64>,
    /// R, m x m.
    pub r: &'a DMatrix<f64>,
    /// The plant that has the outputs, F of Q_y = F'F, and y_ref; none where only the state is wanted.
    pub outputs: Option<(&'a Plant, &'a DMatrix<f64>, &'a DVector<f64>)>,
    pub x: Bounds<f64, NX>,
    pub u: Bounds<f64, NU>,
}

/// Steps for each set of components at their bounds.
const MOST_STEPS: usize = 60;
/// Steps after which they are halved, and halved again: the plant may be far from linear.
const PATIENCE: usize = 15;
/// What a state without weight costs to move, and what the input does, beside the largest weight.
const NEARLY_NOTHING: f64 = 1e-9;
/// A step this small is the end.
const SETTLED: f64 = 1e-8;
/// Where nothing moves faster than this part of its size, beside how state and input enter it, the plant stands.
const STANDS: f64 = 1e-6;
/// A component at its bound is released where its slope is more than this part of the steepest.
const DOWNHILL: f64 = 1e-6;

/// The state and the input; `None` where none was found.
///
/// Components that are to leave their bounds are held there, the farthest first, as long as the plant can stand with them,
/// and released, each of them once, where the cost falls towards the inside.
pub(crate) fn nearest<const NX: usize, const NU: usize, const NS: usize>(
    model: &Disturbed<NX, NU, NS>,
    wanted: &Wanted<'_, NX, NU>,
) -> Option<(SVector<f64, NX>, SVector<f64, NU>)> {
    let (n, m) = (wanted.q.nrows(), wanted.r.nrows());
    let bounds = |k: usize| match k.checked_sub(n) {
        None => (wanted.x.lower[k], wanted.x.upper[k]),
        Some(j) => (wanted.u.lower[j], wanted.u.upper[j]),
    };
    let within = |k: usize, value: f64| {
        let (lower, upper) = bounds(k);
        value.max(lower).min(upper)
    };
    let mut at = DVector::from_fn(n + m, |k, _| {
        within(k, if k < n { wanted.x_ref[k] } else { 0.0 })
    });
    let mut held: Vec<usize> = Vec::new();
    let mut releasable = vec![true; n + m];
    // Each is held and released once, and held again.
    for _ in 0..=3 * (n + m) {
        let end = settle(model, wanted, &mut at, &held)?;
        // Inputs first, since a state is often the consequence.
        let excess = |k: usize| (at[k] - within(k, at[k])).abs() / (1.0 + at[k].abs());
        let farthest = |places: std::ops::Range<usize>| {
            let beyond = places.filter(|k| excess(*k) > SETTLED);
            beyond.max_by(|a, b| excess(*a).total_cmp(&excess(*b)))
        };
        if let Some(k) = farthest(n..n + m).or_else(|| farthest(0..n)) {
            at[k] = within(k, at[k]);
            held.push(k);
            continue;
        }
        let released = if end.stands {
            let inside = |k: usize| match at[k] <= bounds(k).0 {
                true => -end.slope[k],
                false => end.slope[k],
            };
            let steepest = end.slope.amax().max(f64::MIN_POSITIVE);
            let downhill = (0..held.len())
                .filter(|i| releasable[held[*i]] && inside(held[*i]) > DOWNHILL * steepest);
            let next = downhill.max_by(|a, b| inside(held[*a]).total_cmp(&inside(held[*b])));
            if next.is_none() {
                let (x, u) = at.as_slice().split_at(n);
                return Some((filled(x), filled(u)));
            }
            next
        } else {
            held.iter().position(|k| releasable[*k])
        };
        let k = held.remove(released?);
        releasable[k] = false;
    }
    None
}

/// Where the steps end, with some components held.
struct End {
    /// How fast the cost grows with each component while the others keep the plant at rest.
    slope: DVector<f64>,
    /// The plant stands there.
    stands: bool,
}

/// Newton's method, with the components of `held` where they are.
fn settle<const NX: usize, const NU: usize, const NS: usize>(
    model: &Disturbed<NX, NU, NS>,
    wanted: &Wanted<'_, NX, NU>,
    at: &mut DVector<f64>,
    held: &[usize],
) -> Option<End> {
    let mut free = vec![true; at.len()];
    held.iter().for_each(|k| free[*k] = false);
    for step in 0..MOST_STEPS {
        let (moved, end) = newton_step(model, wanted, at, &free)?;
        let part = 0.5_f64.powi(i32::try_from(step / PATIENCE).unwrap_or(i32::MAX));
        *at += &moved * part;
        let settled = |(d, at): (&f64, &f64)| d.abs() <= SETTLED * (1.0 + at.abs());
        if moved.iter().zip(at.iter()).all(settled) {
            return Some(end);
        }
    }
    None
}

/// A step of Newton's method, with the Gauss-Newton matrix of the outputs, and what it tells of where it begins.
fn newton_step<const NX: usize, const NU: usize, const NS: usize>(
    model: &Disturbed<NX, NU, NS>,
    wanted: &Wanted<'_, NX, NU>,
    at: &DVector<f64>,
    free: &[bool],
) -> Option<(DVector<f64>, End)> {
    let (n, m) = (wanted.q.nrows(), wanted.r.nrows());
    let (x_at, u_at) = at.as_slice().split_at(n);
    let (x, u): (SVector<f64, NX>, SVector<f64, NU>) = (filled(x_at), filled(u_at));
    let (motion, a, b) = model.tangent(&x, &u);
    let discrete = model.period().is_some();
    let unit = |i: usize, j: usize| f64::from(u8::from(discrete && i == j));
    let jacobian = DMatrix::from_fn(n, n + m, |i, j| match j.checked_sub(n) {
        None => a[(i, j)] - unit(i, j),
        Some(j) => b[(i, j)],
    });
    let rest = DVector::from_fn(n, |i, _| motion[i] - if discrete { x[i] } else { 0.0 });
    let mut hessian = DMatrix::zeros(n + m, n + m);
    let mut gradient = DVector::zeros(n + m);
    if let Some((plant, factor, y_ref)) = wanted.outputs {
        let (y, slopes) = output_tangent(plant, x_at, u_at)?;
        let weighted = factor * slopes;
        hessian += weighted.transpose() * &weighted;
        gradient += weighted.transpose() * (factor * (y - y_ref));
    }
    let scale = hessian.amax().max(wanted.q.amax()).max(f64::MIN_POSITIVE);
    let mut q = wanted.q.clone();
    for i in 0..n {
        q[(i, i)] += NEARLY_NOTHING * scale;
    }
    let error = DVector::from_fn(n, |i, _| x[i] - wanted.x_ref[i]);
    let r = wanted.r * (NEARLY_NOTHING * scale / wanted.r.amax());
    let mut corner = hessian.view_mut((0, 0), (n, n));
    corner += &q;
    let mut corner = hessian.view_mut((n, n), (m, m));
    corner += &r;
    let mut part = gradient.rows_mut(0, n);
    part += &q * error;
    let mut part = gradient.rows_mut(n, m);
    part += &r * DVector::from_column_slice(u_at);
    // The conditions of optimality; of what does not move only its own.
    let size = 2 * n + m;
    let mut matrix = DMatrix::zeros(size, size);
    let mut right = DVector::zeros(size);
    for i in 0..n + m {
        if !free[i] {
            matrix[(i, i)] = 1.0;
            continue;
        }
        right[i] = -gradient[i];
        for j in (0..n + m).filter(|j| free[*j]) {
            matrix[(i, j)] = hessian[(i, j)];
        }
        for k in 0..n {
            matrix[(i, n + m + k)] = jacobian[(k, i)];
            matrix[(n + m + k, i)] = jacobian[(k, i)];
        }
    }
    right.rows_mut(n + m, n).copy_from(&-&rest);
    // By singular values: a row of f that nothing moves has no multiplier.
    let svd = matrix.svd(true, true);
    let least = svd.singular_values.amax() * 1e-15;
    let solved = svd.solve(&right, least).ok()?;
    // What is held stays where it is to the last bit.
    let moved = DVector::from_fn(n + m, |k, _| if free[k] { solved[k] } else { 0.0 });
    let multipliers = solved.rows(n + m, n);
    let slope = gradient + &hessian * &moved + jacobian.tr_mul(&multipliers);
    let size = jacobian.abs() * at.map(|value| 1.0 + value.abs());
    let stands = (0..n).all(|i| rest[i].abs() <= STANDS * size[i]);
    let finite = moved.iter().all(|d| d.is_finite());
    finite.then_some((moved, End { slope, stands }))
}

/// y and its derivatives with respect to state and input, n_y x (n + m).
pub(crate) fn output_tangent(
    plant: &Plant,
    x: &[f64],
    u: &[f64],
) -> Option<(DVector<f64>, DMatrix<f64>)> {
    let count = plant.data().outputs.len();
    let variables = x.len() + u.len();
    let mut slopes = DMatrix::zeros(count, variables);
    let mut y = DVector::zeros(count);
    for k in 0..variables {
        let lift = |(i, value): (usize, &f64)| {
            let mut number = lpvmpc::Dual::<f64, 1>::fixed(*value);
            number.slopes[0] = f64::from(u8::from(i == k));
            number
        };
        let all: Vec<_> = x.iter().chain(u).enumerate().map(lift).collect();
        let (x, u) = all.split_at(x.len());
        for (i, number) in plant.output(x, u).ok()?.iter().enumerate() {
            (y[i], slopes[(i, k)]) = (number.value, number.slopes[0]);
        }
    }
    Some((y, slopes))
}

fn filled<const K: usize>(values: &[f64]) -> SVector<f64, K> {
    SVector::from_fn(|i, _| values.get(i).copied().unwrap_or(0.0))
}
