//! An exact dense route: the problem, condensed to its inputs, solved as a least-distance
//! problem by non-negative least squares (Lawson and Hanson, Solving Least Squares Problems,
//! ch. 23). It shares no step with the solver under test.

use lpvmpc_testkit::dense::DenseQp;
use nalgebra::{DMatrix, DVector};

/// The minimiser, inputs one below the other; `None` if no point satisfies the rows.
pub fn solve<const NX: usize, const NU: usize>(qp: &DenseQp<NX, NU>) -> Option<DVector<f64>> {
    let (c, d) = one_sided(qp);
    let lower = qp.hessian.clone().cholesky().unwrap().unpack();
    let unconstrained = qp.hessian.clone().cholesky().unwrap().solve(&-&qp.gradient);
    // In v = L'(u - unconstrained) the cost is |v|^2 / 2 and the rows are W v >= beta.
    let w = lower
        .solve_lower_triangular(&c.transpose())
        .unwrap()
        .transpose();
    let beta = &d - &c * &unconstrained;
    let lengths = DVector::from_fn(w.nrows(), |i, _| w.row(i).norm().max(1e-300));
    let w = DMatrix::from_fn(w.nrows(), w.ncols(), |i, j| w[(i, j)] / lengths[i]);
    let beta = beta.component_div(&lengths);
    let active = least_distance(&w, &beta)?;
    // The same point without the loss of accuracy of the detour: from its active rows.
    let rows = w.select_rows(&active);
    let right = DVector::from_fn(active.len(), |i, _| beta[active[i]]);
    let v = match active.is_empty() {
        true => DVector::zeros(w.ncols()),
        false => rows.svd(true, true).solve(&right, 1e-13).unwrap(),
    };
    Some(unconstrained + lower.transpose().solve_upper_triangular(&v).unwrap())
}

/// All rows as C u >= d; an equality is two of them.
fn one_sided<const NX: usize, const NU: usize>(
    qp: &DenseQp<NX, NU>,
) -> (DMatrix<f64>, DVector<f64>) {
    let parts = [
        (&qp.inequality, 1.0),
        (&qp.equality, 1.0),
        (&qp.equality, -1.0),
    ];
    let of_part = parts.map(|(rows, sign)| {
        let each = 0..rows.bounds.len();
        each.map(move |row| {
            (
                rows.coefficients.row(row) * sign,
                -sign * rows.constants[row],
            )
        })
    });
    let rows: Vec<_> = of_part.into_iter().flatten().collect();
    let c = DMatrix::from_fn(rows.len(), qp.gradient.len(), |i, j| rows[i].0[j]);
    (c, DVector::from_fn(rows.len(), |i, _| rows[i].1))
}

/// The active rows of the shortest v with W v >= beta; `None` if there is no such v.
fn least_distance(w: &DMatrix<f64>, beta: &DVector<f64>) -> Option<Vec<usize>> {
    let (rows, columns) = w.shape();
    let e = DMatrix::from_fn(columns + 1, rows, |i, j| {
        if i < columns { w[(j, i)] } else { beta[j] }
    });
    let mut target = DVector::zeros(columns + 1);
    target[columns] = 1.0;
    let weights = non_negative_least_squares(&e, &target);
    let residual = &e * &weights - &target;
    // |residual|^2 = 1 / (1 + |v|^2): zero means that v would have to be infinite.
    let feasible = residual.norm_squared() > 1e-14;
    feasible.then(|| (0..rows).filter(|j| weights[*j] > 0.0).collect())
}

/// Minimise |E w - f| with w >= 0 (algorithm NNLS of Lawson and Hanson).
fn non_negative_least_squares(e: &DMatrix<f64>, f: &DVector<f64>) -> DVector<f64> {
    let mut w = DVector::zeros(e.ncols());
    let mut passive: Vec<usize> = Vec::new();
    for _ in 0..50 * (e.ncols() + 1) {
        let gradient = e.tr_mul(&(f - e * &w));
        let best = (0..e.ncols())
            .filter(|j| !passive.contains(j))
            .max_by(|i, j| gradient[*i].total_cmp(&gradient[*j]));
        let Some(entering) = best.filter(|j| gradient[*j] > 1e-12 * e.column(*j).norm()) else {
            break;
        };
        passive.push(entering);
        while !passive.is_empty() {
            let part = e.select_columns(&passive).svd(true, true);
            let z = part.solve(f, 1e-14).unwrap();
            if z.iter().all(|entry| *entry > 0.0) {
                w.fill(0.0);
                for (j, value) in passive.iter().zip(z.iter()) {
                    w[*j] = *value;
                }
                break;
            }
            let step = passive
                .iter()
                .zip(z.iter())
                .filter(|(_, value)| **value <= 0.0)
                .map(|(j, value)| w[*j] / (w[*j] - value))
                .fold(1.0, f64::min);
            for (j, value) in passive.iter().zip(z.iter()) {
                w[*j] += step * (value - w[*j]);
            }
            let smallest = passive.iter().map(|j| w[*j]).fold(f64::INFINITY, f64::min);
            passive.retain(|j| w[*j] > smallest.max(0.0) && w[*j] > 1e-15);
            for j in 0..e.ncols() {
                if !passive.contains(&j) {
                    w[j] = 0.0;
                }
            }
        }
    }
    w
}
