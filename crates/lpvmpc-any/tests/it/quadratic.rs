//! Plans of linear plants as quadratic programs in the inputs, solved by Clarabel: nothing is shared with the
//! controller but the problem.

use lpvmpc_testkit::clarabel::{ConeProgram, Verdict};
use nalgebra::{DMatrix, DVector};

/// Linear functions of the unknowns: values = offset + slope z.
#[derive(Clone)]
pub struct Affine {
    pub offset: DVector<f64>,
    pub slope: DMatrix<f64>,
}

impl Affine {
    pub fn times(&self, m: &DMatrix<f64>) -> Self {
        Self {
            offset: m * &self.offset,
            slope: m * &self.slope,
        }
    }

    pub fn plus(&self, other: &Self) -> Self {
        Self {
            offset: &self.offset + &other.offset,
            slope: &self.slope + &other.slope,
        }
    }

    pub fn minus(&self, other: &Self) -> Self {
        self.plus(&Self {
            offset: -&other.offset,
            slope: -&other.slope,
        })
    }

    pub fn shifted(&self, by: &DVector<f64>) -> Self {
        Self {
            offset: &self.offset + by,
            slope: self.slope.clone(),
        }
    }
}

/// Minimise the sum of weighted squares and of prices, with bounds.
pub struct Quadratic {
    unknowns: usize,
    p: DMatrix<f64>,
    q: DVector<f64>,
    constant: f64,
    rows: Vec<(DVector<f64>, f64)>,
}

impl Quadratic {
    pub fn new(unknowns: usize) -> Self {
        Self {
            unknowns,
            p: DMatrix::zeros(unknowns, unknowns),
            q: DVector::zeros(unknowns),
            constant: 0.0,
            rows: Vec::new(),
        }
    }

    /// The unknowns from `first` on.
    pub fn unknown(&self, first: usize, count: usize) -> Affine {
        Affine {
            offset: DVector::zeros(count),
            slope: DMatrix::from_fn(count, self.unknowns, |i, j| {
                f64::from(u8::from(first + i == j))
            }),
        }
    }

    pub fn given(&self, values: &[f64]) -> Affine {
        Affine {
            offset: DVector::from_row_slice(values),
            slope: DMatrix::zeros(values.len(), self.unknowns),
        }
    }

    /// v'Wv on top of the cost.
    pub fn weigh(&mut self, v: &Affine, w: &DMatrix<f64>) {
        self.p += v.slope.transpose() * w * &v.slope * 2.0;
        self.q += v.slope.transpose() * w * &v.offset * 2.0;
        self.constant += v.offset.dot(&(w * &v.offset));
    }

    /// A price of each value on top of the cost.
    pub fn price(&mut self, v: &Affine, price: f64) {
        self.q += v.slope.row_sum().transpose() * price;
        self.constant += v.offset.sum() * price;
    }

    /// Every value at most `upper`.
    pub fn at_most(&mut self, v: &Affine, upper: f64) {
        for i in 0..v.offset.len() {
            let row = v.slope.row(i).transpose();
            self.rows.push((row, upper - v.offset[i]));
        }
    }

    pub fn within(&mut self, v: &Affine, lower: f64, upper: f64) {
        self.at_most(v, upper);
        let negative = DMatrix::from_diagonal_element(v.offset.len(), v.offset.len(), -1.0);
        self.at_most(&v.times(&negative), -lower);
    }

    /// The minimum and where it is.
    pub fn solve(&self) -> (f64, Vec<f64>) {
        let entries = |m: &DMatrix<f64>, upper: bool| -> Vec<(usize, usize, f64)> {
            let places = (0..m.ncols()).flat_map(|j| (0..m.nrows()).map(move |i| (i, j)));
            places
                .filter(|(i, j)| (!upper || i <= j) && m[(*i, *j)] != 0.0)
                .map(|(i, j)| (i, j, m[(i, j)]))
                .collect()
        };
        let a = DMatrix::from_fn(self.rows.len(), self.unknowns, |i, j| self.rows[i].0[j]);
        let b = self.rows.iter().map(|row| row.1).collect();
        let q = self.q.as_slice().to_vec();
        let program = ConeProgram::of_entries(&entries(&self.p, true), q, &entries(&a, false), b);
        match program.solve().unwrap() {
            (Verdict::Solved { primal }, z) => (primal + self.constant, z),
            (verdict, _) => panic!("{verdict:?}"),
        }
    }
}
