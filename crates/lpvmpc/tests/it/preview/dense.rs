//! The problem of a case written out over its inputs alone, and solved by Clarabel.

use super::case::{Case, Settings, T_S};
use super::plants::{NU, NX};
use lpvmpc::{InputReference, Penalty};
use lpvmpc_testkit::clarabel::{ConeProgram, Verdict};
use nalgebra::{DMatrix, DVector, SMatrix, SVector};

/// Optimal inputs and cost J, prices included; or why there are none.
pub enum Answer {
    Solved { u: Vec<SVector<f64, NU>>, cost: f64 },
    Infeasible,
    Undecided,
}

/// x = map U + free
#[derive(Clone)]
struct Affine {
    map: DMatrix<f64>,
    free: DVector<f64>,
}

/// min z'Hz + 2g'z + constant with D z <= e. The inputs are the first variables, then excesses.
struct Program {
    h: Vec<(usize, usize, f64)>,
    g: Vec<f64>,
    constant: f64,
    rows: Vec<(Vec<(usize, f64)>, f64)>,
}

impl Program {
    fn add_square<const K: usize>(&mut self, weight: &SMatrix<f64, K, K>, of: &Affine) {
        let w = DMatrix::from_fn(K, K, |i, j| weight[(i, j)]);
        let h = of.map.transpose() * &w * &of.map;
        let g = of.map.transpose() * &w * &of.free;
        for i in 0..h.nrows() {
            for j in i..h.ncols() {
                self.h.push((i, j, h[(i, j)]));
            }
            self.g[i] += g[i];
        }
        self.constant += of.free.dot(&(&w * &of.free));
    }

    /// 2 u'S x on top.
    fn add_product(&mut self, s: &SMatrix<f64, NU, NX>, u: &Affine, x: &Affine) {
        let s = DMatrix::from_fn(NU, NX, |i, j| s[(i, j)]);
        let h = u.map.transpose() * &s * &x.map;
        let h = &h + h.transpose();
        let g = u.map.transpose() * &s * &x.free + x.map.transpose() * s.transpose() * &u.free;
        for i in 0..h.nrows() {
            for j in i..h.ncols() {
                self.h.push((i, j, h[(i, j)]));
            }
            self.g[i] += g[i];
        }
        self.constant += 2.0 * u.free.dot(&(&s * &x.free));
    }

    /// price'of on top.
    fn add_linear<const K: usize>(&mut self, price: &SVector<f64, K>, of: &Affine) {
        let price = DVector::from_fn(K, |i, _| price[i]);
        let g = of.map.transpose() * &price;
        for (sum, g) in self.g.iter_mut().zip(g.iter()) {
            *sum += g / 2.0;
        }
        self.constant += of.free.dot(&price);
    }

    /// lower <= coefficients'z + constant <= upper.
    fn bound(
        &mut self,
        (coefficients, constant): (&[f64], f64),
        (lower, upper): (f64, f64),
        soft: Option<Penalty<f64>>,
    ) {
        for (sign, limit) in [(1.0, upper), (-1.0, -lower)] {
            if limit == f64::INFINITY {
                continue;
            }
            let mut row: Vec<_> = coefficients.iter().map(|c| sign * c).enumerate().collect();
            if let Some(price) = soft {
                let excess = self.g.len();
                // J has linear s + quadratic s^2 / 2; the program has g twice.
                self.g.push(price.linear / 2.0);
                self.h.push((excess, excess, price.quadratic / 2.0));
                row.push((excess, -1.0));
                self.rows.push((vec![(excess, -1.0)], 0.0));
            }
            self.rows.push((row, limit - sign * constant));
        }
    }

    fn solve(&self, inputs: usize) -> Answer {
        let twice: Vec<_> = self.h.iter().map(|(i, j, v)| (*i, *j, 2.0 * v)).collect();
        let q = self.g.iter().map(|g| 2.0 * g).collect();
        let rows = self.rows.iter().enumerate();
        let entries: Vec<_> = rows
            .flat_map(|(k, (row, _))| row.iter().map(move |(j, v)| (k, *j, *v)))
            .collect();
        let right = self.rows.iter().map(|row| row.1).collect();
        let program = ConeProgram::of_entries(&twice, q, &entries, right);
        match program.solve().unwrap() {
            (Verdict::Solved { primal }, z) => Answer::Solved {
                u: z[..inputs]
                    .chunks(NU)
                    .map(SVector::from_column_slice)
                    .collect(),
                cost: primal + self.constant,
            },
            (Verdict::Infeasible, _) => Answer::Infeasible,
            (Verdict::Undecided(_), _) => Answer::Undecided,
        }
    }
}

/// Entry `i` of a list whose last entry holds from where it ends.
fn of<V: Clone>(list: &[V], i: usize, otherwise: &V) -> V {
    list.get(i).or(list.last()).unwrap_or(otherwise).clone()
}

/// One step of the classical Runge-Kutta method for x_dot = A x + w is the Taylor polynomial of order
/// four: (A_d, what w is multiplied by).
pub fn sampled(a: &SMatrix<f64, NX, NX>) -> (SMatrix<f64, NX, NX>, SMatrix<f64, NX, NX>) {
    let m = a * T_S;
    let mut power = SMatrix::<f64, NX, NX>::identity();
    let (mut a_d, mut integral) = (SMatrix::zeros(), SMatrix::zeros());
    let mut factorial = 1.0;
    for k in 0..=4 {
        a_d += power / factorial;
        if k < 4 {
            integral += power * (T_S / (factorial * f64::from(k + 1)));
        }
        power *= m;
        factorial *= f64::from(k + 1);
    }
    (a_d, integral)
}

fn add(one: &Affine, other: &Affine, factor: f64) -> Affine {
    Affine {
        map: &one.map + &other.map * factor,
        free: &one.free + &other.free * factor,
    }
}

fn times<const R: usize, const C: usize>(m: &SMatrix<f64, R, C>, of: &Affine) -> Affine {
    let m = DMatrix::from_fn(R, C, |i, j| m[(i, j)]);
    Affine {
        map: &m * &of.map,
        free: m * &of.free,
    }
}

fn constant<const K: usize>(v: &SVector<f64, K>, size: usize) -> Affine {
    Affine {
        map: DMatrix::zeros(K, size),
        free: DVector::from_fn(K, |i, _| v[i]),
    }
}

/// The optimum of `case`, whose empty lists mean what the settings say.
pub fn solve(case: &Case, settings: &Settings) -> Answer {
    let n = case.horizon;
    let size = n * NU;
    let mut program = Program {
        h: Vec::new(),
        g: vec![0.0; size],
        constant: 0.0,
        rows: Vec::new(),
    };
    let InputReference::Given(u_ref) = settings.input_reference else {
        panic!("the cases have a given input reference");
    };
    let mut x = constant(&case.x0, size);
    for i in 0..=n {
        if i > 0 {
            let bounds = of(&case.x, i, &settings.x);
            let soft = of(&case.soft_x, i, &settings.soft_x);
            for (j, soft) in soft.into_iter().enumerate() {
                let row: Vec<f64> = x.map.row(j).iter().copied().collect();
                let limits = (bounds.lower[j], bounds.upper[j]);
                program.bound((&row, x.free[j]), limits, soft);
            }
        }
        let error = add(&x, &constant(&case.x_ref[i], size), -1.0);
        let rows = of(&case.rows, i, &Vec::new());
        let price = of(&case.linear_x, i, &SVector::zeros());
        program.add_linear(&price, &x);
        if i == n {
            program.add_square(&case.p, &error);
        }
        let mut u = constant(&SVector::<f64, NU>::zeros(), size);
        if i < n {
            u.map.view_mut((0, i * NU), (NU, NU)).fill_with_identity();
            let weights = of(&case.weights, i, &settings.weights);
            program.add_square(&weights.q, &error);
            let wanted = constant(&of(&case.u_ref, i, &u_ref), size);
            let away = add(&u, &wanted, -1.0);
            program.add_square(&weights.r, &away);
            program.add_product(&of(&case.cross, i, &SMatrix::zeros()), &away, &error);
            program.add_linear(&of(&case.linear_u, i, &SVector::zeros()), &u);
            let bounds = of(&case.u, i, &settings.u);
            for j in 0..NU {
                let row: Vec<f64> = u.map.row(j).iter().copied().collect();
                program.bound((&row, 0.0), (bounds.lower[j], bounds.upper[j]), None);
            }
        }
        for row in rows {
            let of_state = row.u.amax() == 0.0;
            if (of_state && i == 0) || (!of_state && i == n) {
                continue;
            }
            let value = add(
                &times(&row.x.transpose(), &x),
                &times(&row.u.transpose(), &u),
                1.0,
            );
            let coefficients: Vec<f64> = value.map.iter().copied().collect();
            let limits = (row.lower, row.upper);
            program.bound((&coefficients, value.free[0]), limits, row.soft);
        }
        if i < n {
            let plant = of(&case.models, i, &case.plant);
            let s = of(&case.scheduling, i, &SVector::zeros());
            let (a_d, integral) = sampled(&(plant.a + plant.a_s * s[0]));
            let d = of(&case.disturbance, i, &SVector::zeros());
            let pushed = add(&times(&plant.b, &u), &constant(&d, size), 1.0);
            x = add(&times(&a_d, &x), &times(&integral, &pushed), 1.0);
        }
    }
    program.solve(size)
}
