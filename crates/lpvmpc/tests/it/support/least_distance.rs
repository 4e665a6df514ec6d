//! An exact dense route: the problem condensed to its inputs, and solved as a least-distance
//! problem by non-negative least squares (Lawson and Hanson, Solving Least Squares Problems,
//! ch. 23). It shares no step with the solver under test.

use lpvmpc::{Bounds, Common, Ocp};
use nalgebra::{DMatrix, DVector, SMatrix, SVector, Vector1};

/// Minimise u'Hu/2 + g'u with C u >= d.
pub struct Dense {
    pub h: DMatrix<f64>,
    pub g: DVector<f64>,
    pub c: DMatrix<f64>,
    pub d: DVector<f64>,
}

/// `ocp` in its inputs alone. `None` if a bound is soft.
pub fn condense<const NX: usize, const NU: usize>(ocp: &Ocp<f64, NX, NU>) -> Option<Dense> {
    let n = ocp.length();
    let size = n * NU;
    let mut dense = Dense {
        h: DMatrix::zeros(size, size),
        g: DVector::zeros(size),
        c: DMatrix::zeros(0, size),
        d: DVector::zeros(0),
    };
    // x_i = map * u + free
    let mut map = DMatrix::<f64>::zeros(NX, size);
    let mut free = dynamic(&ocp.x0);
    for (i, stage) in ocp.stages.iter().enumerate().take(n) {
        let mut select = DMatrix::<f64>::zeros(NU, size);
        select.view_mut((0, i * NU), (NU, NU)).fill_with_identity();
        let Common { q, r, s, x, u, .. } = ocp.common_at(i);
        let (q, r, s) = (dynamic(q), dynamic(r), dynamic(s));
        let cross = select.tr_mul(&(&s * &map));
        dense.h += map.tr_mul(&(&q * &map)) + select.tr_mul(&(&r * &select));
        dense.h += &cross + cross.transpose();
        dense.g += map.tr_mul(&(&q * &free + dynamic(&stage.linear_x)));
        dense.g += select.tr_mul(&(&s * &free + dynamic(&stage.linear_u)));
        if i > 0 {
            dense.bound(&map, &free, x);
        }
        dense.bound(&select, &DMatrix::zeros(NU, 1), u);
        dense.rows(ocp, i, (&map, &free), Some(&select));
        let (a, b) = (dynamic(&stage.a), dynamic(&stage.b));
        map = &a * map + b * select;
        free = a * free + dynamic(&stage.c);
    }
    let end = &ocp.terminal;
    let p = dynamic(&end.p);
    dense.h += map.tr_mul(&(&p * &map));
    dense.g += map.tr_mul(&(&p * &free + dynamic(&end.linear_x)));
    dense.bound(&map, &free, &end.x);
    dense.rows(ocp, n, (&map, &free), None);
    if let Some(target) = end.equality {
        let pinned = Bounds {
            lower: target,
            upper: target,
        };
        dense.bound(&map, &free, &pinned);
    }
    let stages = (0..n).flat_map(|i| &ocp.common_at(i).soft_x);
    let mut soft_x = stages.chain(&end.soft_x);
    let soft = soft_x.any(Option::is_some) || ocp.rows.iter().any(|row| row.soft.is_some());
    (!soft).then_some(dense)
}

fn dynamic<const R: usize, const C: usize>(m: &SMatrix<f64, R, C>) -> DMatrix<f64> {
    DMatrix::from_fn(R, C, |i, j| m[(i, j)])
}

impl Dense {
    /// The general rows of stage `i`, where x = map u + free and the stage's input is `select` u.
    fn rows<const NX: usize, const NU: usize>(
        &mut self,
        ocp: &Ocp<f64, NX, NU>,
        i: usize,
        (map, free): (&DMatrix<f64>, &DMatrix<f64>),
        select: Option<&DMatrix<f64>>,
    ) {
        for row in (0..ocp.rows_per_stage).filter_map(|j| ocp.row(i, j)) {
            let of_x = dynamic(&row.x.transpose());
            let of_u = select.map(|select| dynamic(&row.u.transpose()) * select);
            let through_x = &of_x * map;
            let whole = of_u.map_or_else(|| through_x.clone(), |of_u| &through_x + of_u);
            let limits = Bounds {
                lower: Vector1::new(row.lower),
                upper: Vector1::new(row.upper),
            };
            self.bound(&whole, &(&of_x * free), &limits);
        }
    }

    /// lower <= map * u + free <= upper
    fn bound<const K: usize>(
        &mut self,
        map: &DMatrix<f64>,
        free: &DMatrix<f64>,
        bounds: &Bounds<f64, K>,
    ) {
        let mut push = |row: nalgebra::RowDVector<f64>, limit: f64| {
            if limit.is_finite() {
                let last = self.c.nrows();
                self.c = std::mem::replace(&mut self.c, DMatrix::zeros(0, 0)).insert_row(last, 0.0);
                self.c.set_row(last, &row);
                self.d = std::mem::replace(&mut self.d, DVector::zeros(0)).insert_row(last, limit);
            }
        };
        let lower: &SVector<f64, K> = &bounds.lower;
        for j in 0..K {
            push(map.row(j).into_owned(), lower[j] - free[j]);
            push(-map.row(j).into_owned(), free[j] - bounds.upper[j]);
        }
    }

    /// The minimiser, inputs one below the other; `None` if no point satisfies the rows.
    pub fn solve(&self) -> Option<DVector<f64>> {
        let lower = self.h.clone().cholesky().unwrap().unpack();
        let unconstrained = self.h.clone().cholesky().unwrap().solve(&-&self.g);
        // In v = L'(u - unconstrained) the cost is |v|^2 / 2 and the rows are W v >= beta.
        let w = lower
            .solve_lower_triangular(&self.c.transpose())
            .unwrap()
            .transpose();
        let beta = &self.d - &self.c * &unconstrained;
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
