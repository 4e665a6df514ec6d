//! The problem as a dense quadratic program in the inputs alone.

use lpvmpc::{Bounds, Ocp};
use nalgebra::{SMatrix, SVector};
use ndarray::{Array1, Array2};

/// Minimise U'HU/2 + g'U with E'U + e = 0 and C'U + d >= 0, where U = (u_0, u_1, ..).
pub struct CondensedQp<const NX: usize, const NU: usize> {
    /// H, symmetric.
    pub hessian: Array2<f64>,
    /// g.
    pub gradient: Array1<f64>,
    /// E, one column per component of the terminal equality.
    pub equality: Array2<f64>,
    /// e.
    pub equality_offset: Array1<f64>,
    /// C, one column per side of a bound.
    pub inequality: Array2<f64>,
    /// d.
    pub inequality_offset: Array1<f64>,
    /// x_1, x_2, .. for zero inputs.
    free: Vec<SVector<f64, NX>>,
    /// Derivative of x_{i+1} with respect to u_j, at i * horizon + j, for j <= i.
    response: Vec<SMatrix<f64, NX, NU>>,
}

impl<const NX: usize, const NU: usize> CondensedQp<NX, NU> {
    /// Memory for problems of the size of `ocp`.
    pub fn new(ocp: &Ocp<f64, NX, NU>) -> Self {
        let horizon = ocp.length();
        let inputs = horizon * NU;
        let commons = (0..horizon).map(|i| (i, ocp.common_at(i)));
        let sides: usize = commons
            .map(|(i, common)| sides(&common.u) + if i > 0 { sides(&common.x) } else { 0 })
            .sum();
        let sides = sides + self::sides(&ocp.terminal.x);
        let equalities = if ocp.terminal.equality.is_some() {
            NX
        } else {
            0
        };
        Self {
            hessian: Array2::zeros((inputs, inputs)),
            gradient: Array1::zeros(inputs),
            equality: Array2::zeros((inputs, equalities)),
            equality_offset: Array1::zeros(equalities),
            inequality: Array2::zeros((inputs, sides)),
            inequality_offset: Array1::zeros(sides),
            free: vec![SVector::zeros(); horizon],
            response: vec![SMatrix::zeros(); horizon * horizon],
        }
    }

    /// Condenses `ocp`; the work grows with the horizon squared.
    pub fn condense(&mut self, ocp: &Ocp<f64, NX, NU>) {
        self.respond(ocp);
        self.weigh(ocp);
        self.constrain(ocp);
    }

    fn respond(&mut self, ocp: &Ocp<f64, NX, NU>) {
        let horizon = ocp.length();
        let mut x = ocp.x0;
        for (i, stage) in ocp.stages.iter().enumerate().take(horizon) {
            x = stage.a * x + stage.c;
            self.free[i] = x;
            for j in 0..i {
                let before = self.response[(i - 1) * horizon + j];
                self.response[i * horizon + j] = stage.a * before;
            }
            self.response[i * horizon + i] = stage.b;
        }
    }

    /// Hessian and gradient, by the adjoint of the dynamics: one backward pass per input.
    fn weigh(&mut self, ocp: &Ocp<f64, NX, NU>) {
        let horizon = ocp.length();
        let last = horizon - 1;
        let mut slope = ocp.terminal.p * self.free[last] + ocp.terminal.linear_x;
        for (i, stage) in ocp.stages.iter().enumerate().take(horizon).rev() {
            let common = ocp.common_at(i);
            let x = if i > 0 { self.free[i - 1] } else { ocp.x0 };
            let gradient = stage.b.tr_mul(&slope) + common.s * x + stage.linear_u;
            for (k, value) in gradient.iter().enumerate() {
                self.gradient[i * NU + k] = *value;
            }
            slope = common.q * x + stage.linear_x + stage.a.tr_mul(&slope);
        }
        for j in 0..horizon {
            let mut slope = ocp.terminal.p * self.response[last * horizon + j];
            for i in (j..horizon).rev() {
                let (stage, common) = (&ocp.stages[i], ocp.common_at(i));
                let mut block = stage.b.tr_mul(&slope);
                if i > j {
                    let response = &self.response[(i - 1) * horizon + j];
                    block += common.s * response;
                    slope = common.q * response + stage.a.tr_mul(&slope);
                } else {
                    block += common.r;
                }
                self.store(i, j, &block);
            }
        }
    }

    fn store(&mut self, i: usize, j: usize, block: &SMatrix<f64, NU, NU>) {
        for row in 0..NU {
            for column in 0..NU {
                let place = [i * NU + row, j * NU + column];
                self.hessian[place] = block[(row, column)];
                self.hessian[[place[1], place[0]]] = block[(row, column)];
            }
        }
    }

    fn constrain(&mut self, ocp: &Ocp<f64, NX, NU>) {
        let horizon = ocp.length();
        let mut column = 0;
        for i in 0..horizon {
            let common = ocp.common_at(i);
            for (component, side) in each_side(&common.u) {
                self.inequality[[i * NU + component, column]] = side.sign;
                self.inequality_offset[column] = -side.sign * side.limit;
                column += 1;
            }
            if i > 0 {
                column = self.constrain_state(i - 1, horizon, &common.x, column);
            }
        }
        self.constrain_state(horizon - 1, horizon, &ocp.terminal.x, column);
        if let Some(target) = &ocp.terminal.equality {
            for component in 0..NX {
                for (input, value) in self.row(horizon - 1, horizon, component) {
                    self.equality[[input, component]] = value;
                }
                let offset = self.free[horizon - 1][component] - target[component];
                self.equality_offset[component] = offset;
            }
        }
    }

    /// The bounds on x_{i+1}; returns the next free column.
    fn constrain_state(
        &mut self,
        i: usize,
        horizon: usize,
        bounds: &Bounds<f64, NX>,
        mut column: usize,
    ) -> usize {
        for (component, side) in each_side(bounds) {
            for j in 0..=i {
                for k in 0..NU {
                    let value = self.response[i * horizon + j][(component, k)];
                    self.inequality[[j * NU + k, column]] = side.sign * value;
                }
            }
            let free = self.free[i][component];
            self.inequality_offset[column] = side.sign * (free - side.limit);
            column += 1;
        }
        column
    }

    /// How a component of x_{i+1} depends on the inputs.
    fn row(&self, i: usize, horizon: usize, component: usize) -> Vec<(usize, f64)> {
        let blocks = self.response[i * horizon..=i * horizon + i].iter();
        let entries = blocks
            .enumerate()
            .flat_map(|(j, block)| (0..NU).map(move |k| (j * NU + k, block[(component, k)])));
        entries.collect()
    }
}

/// sign * (value - limit) >= 0
struct SideOfBound {
    sign: f64,
    limit: f64,
}

fn each_side<const K: usize>(
    bounds: &Bounds<f64, K>,
) -> impl Iterator<Item = (usize, SideOfBound)> + '_ {
    let sides = [(1.0, &bounds.lower), (-1.0, &bounds.upper)];
    sides.into_iter().flat_map(|(sign, limits)| {
        let limits = limits.iter().enumerate();
        let finite = limits.filter(|(_, limit)| limit.is_finite());
        finite.map(move |(component, &limit)| (component, SideOfBound { sign, limit }))
    })
}

fn sides<const K: usize>(bounds: &Bounds<f64, K>) -> usize {
    each_side(bounds).count()
}
