//! An exact dense route to the controller's quadratic program.
//!
//! It shares nothing with the controller but the problem's numbers: the states are eliminated by
//! prediction matrices, the Hessian is dense, and the dual method of Goldfarb and Idnani (1983)
//! factorises its working set afresh by QR at every change.

use super::{NX, Problem};
use lpvmpc::{BoundId, Bounds, Quantity, Side};
use nalgebra::{Const, DMatrix, DVector, Dyn, OMatrix, SVector, Vector1};

/// How `K` quantities depend on the inputs of the whole horizon.
type Map<const K: usize> = OMatrix<f64, Const<K>, Dyn>;

/// A row of the dense problem: normal'u >= limit, or = limit for an equality.
pub struct DenseRow {
    pub bound: BoundId,
    normal: DVector<f64>,
    limit: f64,
}

/// Minimise u'Hu/2 + g'u subject to rows. Equalities come first.
pub struct Dense {
    h: DMatrix<f64>,
    g: DVector<f64>,
    pub rows: Vec<DenseRow>,
    pub equalities: usize,
}

/// The minimiser with the rows that hold it, and their multipliers.
pub struct Optimum {
    pub u: DVector<f64>,
    /// Places in [`Dense::rows`].
    pub active: Vec<(usize, f64)>,
}

impl Dense {
    /// The problem in its inputs alone. The controller's problems have no cross weight S, no
    /// general rows and no soft bounds.
    pub fn condense(ocp: &Problem) -> Self {
        let n = ocp.length();
        let mut dense = Self {
            h: DMatrix::zeros(n, n),
            g: DVector::zeros(n),
            rows: Vec::new(),
            equalities: 0,
        };
        // x_i = map u + free
        let mut map = Map::<NX>::zeros(n);
        let mut free = ocp.x0;
        for (i, stage) in ocp.stages.iter().enumerate().take(n) {
            let common = ocp.common_at(i);
            assert!(common.s.amax() == 0.0 && common.soft_x == [None; NX]);
            dense.h += map.tr_mul(&(common.q * &map));
            dense.g += map.tr_mul(&(common.q * free + stage.linear_x));
            dense.h[(i, i)] += common.r[0];
            dense.g[i] += stage.linear_u[0];
            if i > 0 {
                dense.bound(&map, &free, &common.x, i, Quantity::State);
            }
            let mut own = Map::<1>::zeros(n);
            own[i] = 1.0;
            dense.bound(&own, &Vector1::zeros(), &common.u, i, Quantity::Input);
            map = stage.a * map;
            map.column_mut(i).copy_from(&stage.b);
            free = stage.a * free + stage.c;
        }
        dense.h += map.tr_mul(&(ocp.terminal.p * &map));
        dense.g += map.tr_mul(&(ocp.terminal.p * free + ocp.terminal.linear_x));
        dense.bound(&map, &free, &ocp.terminal.x, n, Quantity::State);
        if let Some(target) = &ocp.terminal.equality {
            dense.reach(&map, &free, target, n);
        }
        dense
    }

    /// lower <= map u + free <= upper
    fn bound<const K: usize>(
        &mut self,
        map: &Map<K>,
        free: &SVector<f64, K>,
        bounds: &Bounds<f64, K>,
        stage: usize,
        quantity: fn(usize) -> Quantity,
    ) {
        for j in 0..K {
            let sides = [
                (Side::Lower, 1.0, bounds.lower[j]),
                (Side::Upper, -1.0, bounds.upper[j]),
            ];
            for (side, sign, limit) in sides {
                if limit.is_finite() {
                    self.rows.push(DenseRow {
                        bound: BoundId {
                            stage,
                            quantity: quantity(j),
                            side,
                        },
                        normal: map.row(j).transpose() * sign,
                        limit: (limit - free[j]) * sign,
                    });
                }
            }
        }
    }

    /// map u + free = target
    fn reach(
        &mut self,
        map: &Map<NX>,
        free: &SVector<f64, NX>,
        target: &SVector<f64, NX>,
        stage: usize,
    ) {
        let equalities = (0..NX).map(|j| DenseRow {
            bound: BoundId {
                stage,
                quantity: Quantity::State(j),
                side: Side::Equality,
            },
            normal: map.row(j).transpose(),
            limit: target[j] - free[j],
        });
        self.rows.splice(0..0, equalities);
        self.equalities = NX;
    }

    /// In z = L'(u - u_free) with H = LL' the cost is |z|^2 / 2; each row is made of length 1.
    ///
    /// `None` if no inputs satisfy the rows.
    pub fn solve(&self) -> Option<Optimum> {
        let cholesky = self.h.clone().cholesky().unwrap();
        let l = cholesky.l();
        let u_free = cholesky.solve(&-&self.g);
        let normalised: Vec<_> = self
            .rows
            .iter()
            .map(|row| {
                let w = l.solve_lower_triangular(&row.normal).unwrap();
                let limit = row.limit - row.normal.dot(&u_free);
                (w.clone() / w.norm(), limit / w.norm(), w.norm())
            })
            .collect();
        let rows = LeastDistance {
            rows: normalised
                .iter()
                .map(|(w, limit, _)| (w.clone(), *limit))
                .collect(),
            equalities: self.equalities,
        };
        let (z, active) = rows.solve()?;
        let multipliers = active
            .into_iter()
            .map(|(row, multiplier)| (row, multiplier / normalised[row].2));
        Some(Optimum {
            u: u_free + l.transpose().solve_upper_triangular(&z).unwrap(),
            active: multipliers.collect(),
        })
    }

    /// The largest violation of an optimality condition, relative to its largest term.
    pub fn residual(&self, optimum: &Optimum) -> f64 {
        let mut gradient = &self.h * &optimum.u + &self.g;
        let mut terms = (self.h.abs() * optimum.u.abs()).amax().max(self.g.amax());
        let mut worst: f64 = 0.0;
        for (row, multiplier) in &optimum.active {
            let DenseRow { normal, limit, .. } = &self.rows[*row];
            gradient -= normal * *multiplier;
            terms = terms.max(normal.amax() * multiplier.abs());
            let slack = normal.dot(&optimum.u) - limit;
            worst = worst.max(slack.abs() / (1.0 + limit.abs()));
            if *row >= self.equalities {
                assert!(*multiplier >= 0.0, "multiplier {multiplier}");
            }
        }
        for row in &self.rows[self.equalities..] {
            let slack = row.normal.dot(&optimum.u) - row.limit;
            worst = worst.max(-slack / (1.0 + row.limit.abs()));
        }
        worst.max(gradient.amax() / terms)
    }
}

/// A minimiser, with the active rows and their multipliers.
type Minimiser = (DVector<f64>, Vec<(usize, f64)>);

/// Minimise |z|^2 / 2 with w'z >= limit for every row of length 1; the first are equalities.
struct LeastDistance {
    rows: Vec<(DVector<f64>, f64)>,
    equalities: usize,
}

impl LeastDistance {
    /// The minimiser, with the active rows and their multipliers; `None` if there is none.
    fn solve(&self) -> Option<Minimiser> {
        let mut active: Vec<usize> = (0..self.equalities).collect();
        for _ in 0..10 * self.rows.len() {
            let (z, multipliers) = self.minimise_over(&active);
            let violation = |row: usize| self.rows[row].1 - self.rows[row].0.dot(&z);
            let worst = (self.equalities..self.rows.len())
                .max_by(|a, b| violation(*a).total_cmp(&violation(*b)))
                .filter(|row| violation(*row) > 1e-12 * (1.0 + z.norm()));
            match worst {
                Some(row) => self.satisfy(&mut active, multipliers, z, row)?,
                None => return Some((z, active.into_iter().zip(multipliers).collect())),
            }
        }
        panic!("the dense method does not end");
    }

    /// Q and R of the active rows as columns.
    fn factorise(&self, active: &[usize]) -> (DMatrix<f64>, DMatrix<f64>) {
        let columns: Vec<_> = active.iter().map(|row| self.rows[*row].0.clone()).collect();
        let qr = DMatrix::from_columns(&columns).qr();
        (qr.q(), qr.r())
    }

    /// The shortest z at which the active rows hold with equality.
    fn minimise_over(&self, active: &[usize]) -> (DVector<f64>, Vec<f64>) {
        let size = self.rows[0].0.len();
        if active.is_empty() {
            return (DVector::zeros(size), Vec::new());
        }
        let (q, r) = self.factorise(active);
        let limits =
            DVector::from_iterator(active.len(), active.iter().map(|row| self.rows[*row].1));
        let in_basis = r.transpose().solve_lower_triangular(&limits).unwrap();
        let multipliers = r.solve_upper_triangular(&in_basis).unwrap();
        (q * in_basis, multipliers.iter().copied().collect())
    }

    /// Takes `row` in, and drops rows whose multiplier would become negative on the way. `None`
    /// if the row contradicts those that cannot be dropped.
    fn satisfy(
        &self,
        active: &mut Vec<usize>,
        mut multipliers: Vec<f64>,
        mut z: DVector<f64>,
        row: usize,
    ) -> Option<()> {
        let (w, limit) = &self.rows[row];
        loop {
            let mut primal = w.clone();
            let mut rates = DVector::zeros(0);
            if !active.is_empty() {
                let (q, r) = self.factorise(active);
                rates = r.solve_upper_triangular(&q.tr_mul(w)).unwrap();
                primal -= &q * q.tr_mul(w);
                primal -= &q * q.tr_mul(&primal);
            }
            let blocking = (self.equalities..active.len())
                .filter(|k| rates[*k] > 0.0)
                .map(|k| (multipliers[k].max(0.0) / rates[k], k))
                .min_by(|a, b| a.0.total_cmp(&b.0));
            let slope = primal.norm_squared();
            let full = (slope > 1e-20).then(|| (limit - w.dot(&z)) / slope);
            let step = match (full, blocking) {
                (Some(full), Some((blocked, _))) => full.min(blocked),
                (Some(full), None) => full,
                (None, Some((blocked, _))) => blocked,
                (None, None) => return None,
            };
            z += primal * step;
            for (multiplier, rate) in multipliers.iter_mut().zip(rates.iter()) {
                *multiplier -= step * rate;
            }
            match blocking {
                Some((blocked, position)) if full.is_none_or(|full| blocked < full) => {
                    active.remove(position);
                    multipliers.remove(position);
                }
                _ => break,
            }
        }
        active.push(row);
        Some(())
    }
}
