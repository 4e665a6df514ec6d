//! The problem as a dense quadratic program in the inputs alone.
//!
//! Condensed by the adjoint of the dynamics: the work grows with the horizon squared, and a
//! sequence of problems of one pattern shares its memory, so that condensing can be timed.

use lpvmpc::{BoundId, Bounds, Ocp, Quantity, Side};
use nalgebra::{DMatrix, DVector, SMatrix, SVector};

/// Minimise U'HU/2 + g'U with E U + e = 0 and C U + d >= 0, where U = (u_0, u_1, ..).
pub struct DenseQp<const NX: usize, const NU: usize> {
    /// H, symmetric.
    pub hessian: DMatrix<f64>,
    /// g.
    pub gradient: DVector<f64>,
    /// E and e, the components of the terminal equality.
    pub equality: Rows,
    /// C and d, one row per finite side of a bound.
    pub inequality: Rows,
    /// x_1, x_2, .. for zero inputs.
    free: Vec<SVector<f64, NX>>,
    /// Derivative of x_{i+1} with respect to u_j, at i * horizon + j, for j <= i.
    response: Vec<SMatrix<f64, NX, NU>>,
}

/// Affine functions of the inputs: coefficients U + constants.
pub struct Rows {
    /// The bound that each row stands for.
    pub bounds: Vec<BoundId>,
    /// One row per bound, one column per input.
    pub coefficients: DMatrix<f64>,
    /// One per bound; a lower bound's is value - limit, an upper bound's limit - value.
    pub constants: DVector<f64>,
}

impl Rows {
    fn zeros(bounds: Vec<BoundId>, inputs: usize) -> Self {
        Self {
            coefficients: DMatrix::zeros(bounds.len(), inputs),
            constants: DVector::zeros(bounds.len()),
            bounds,
        }
    }
}

impl<const NX: usize, const NU: usize> DenseQp<NX, NU> {
    /// `ocp` in its inputs alone; `None` if a bound is soft.
    pub fn new(ocp: &Ocp<f64, NX, NU>) -> Option<Self> {
        let mut qp = Self::allocate(ocp)?;
        qp.condense(ocp);
        Some(qp)
    }

    /// Memory for problems with the horizon of `ocp` and with the same finite bounds; `None` if
    /// one of them is soft.
    pub fn allocate(ocp: &Ocp<f64, NX, NU>) -> Option<Self> {
        let stages = (0..ocp.length()).flat_map(|i| &ocp.common_at(i).soft_x);
        let mut soft_x = stages.chain(&ocp.terminal.soft_x);
        let soft = soft_x.any(Option::is_some) || ocp.rows.iter().any(|row| row.soft.is_some());
        let horizon = ocp.length();
        let inputs = horizon * NU;
        (!soft).then(|| Self {
            hessian: DMatrix::zeros(inputs, inputs),
            gradient: DVector::zeros(inputs),
            equality: Rows::zeros(equalities(ocp), inputs),
            inequality: Rows::zeros(finite_bounds(ocp), inputs),
            free: vec![SVector::zeros(); horizon],
            response: vec![SMatrix::zeros(); horizon * horizon],
        })
    }

    /// Condenses `ocp`.
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
                let place = (i * NU + row, j * NU + column);
                self.hessian[place] = block[(row, column)];
                self.hessian[(place.1, place.0)] = block[(row, column)];
            }
        }
    }

    fn constrain(&mut self, ocp: &Ocp<f64, NX, NU>) {
        let (free, response) = (&self.free, &self.response);
        let states = |stage: usize| match stage.checked_sub(1) {
            Some(last) => (&free[last], &response[last * ocp.length()..][..stage]),
            None => (&ocp.x0, &response[..0]),
        };
        for rows in [&mut self.equality, &mut self.inequality] {
            for (row, bound) in rows.bounds.iter().enumerate() {
                let sign = if bound.side == Side::Upper { -1.0 } else { 1.0 };
                let (x, responses) = states(bound.stage);
                let mut put = |i: usize, k: usize, slope: f64| {
                    rows.coefficients[(row, i * NU + k)] = sign * slope;
                };
                let value = match bound.quantity {
                    Quantity::State(j) => {
                        for (i, response) in responses.iter().enumerate() {
                            (0..NU).for_each(|k| put(i, k, response[(j, k)]));
                        }
                        x[j]
                    }
                    Quantity::Input(k) => {
                        put(bound.stage, k, 1.0);
                        0.0
                    }
                    Quantity::Row(j) => {
                        let general = ocp.row(bound.stage, j).copied().unwrap_or_default();
                        for (i, response) in responses.iter().enumerate() {
                            let slope = response.tr_mul(&general.x);
                            (0..NU).for_each(|k| put(i, k, slope[k]));
                        }
                        if bound.stage < ocp.length() {
                            (0..NU).for_each(|k| put(bound.stage, k, general.u[k]));
                        }
                        general.x.dot(x)
                    }
                };
                rows.constants[row] = sign * (value - limit(ocp, bound));
            }
        }
    }
}

fn limit<const NX: usize, const NU: usize>(ocp: &Ocp<f64, NX, NU>, bound: &BoundId) -> f64 {
    let BoundId { stage, side, .. } = *bound;
    match (bound.quantity, &ocp.terminal.equality) {
        (Quantity::State(j), Some(target)) if side == Side::Equality => target[j],
        (Quantity::State(j), _) if stage == ocp.length() => of_side(&ocp.terminal.x, j, side),
        (Quantity::State(j), _) => of_side(&ocp.common_at(stage).x, j, side),
        (Quantity::Input(j), _) => of_side(&ocp.common_at(stage).u, j, side),
        (Quantity::Row(j), _) => {
            let row = ocp.row(stage, j).copied().unwrap_or_default();
            if side == Side::Lower {
                row.lower
            } else {
                row.upper
            }
        }
    }
}

fn of_side<const K: usize>(bounds: &Bounds<f64, K>, component: usize, side: Side) -> f64 {
    match side {
        Side::Lower => bounds.lower[component],
        _ => bounds.upper[component],
    }
}

fn equalities<const NX: usize, const NU: usize>(ocp: &Ocp<f64, NX, NU>) -> Vec<BoundId> {
    let bound = |j| BoundId {
        stage: ocp.length(),
        quantity: Quantity::State(j),
        side: Side::Equality,
    };
    let components = if ocp.terminal.equality.is_some() {
        NX
    } else {
        0
    };
    (0..components).map(bound).collect()
}

fn finite_bounds<const NX: usize, const NU: usize>(ocp: &Ocp<f64, NX, NU>) -> Vec<BoundId> {
    let end = ocp.length();
    let all = (0..=end).flat_map(|stage| {
        let states = (0..if stage > 0 { NX } else { 0 }).map(Quantity::State);
        let inputs = (0..if stage < end { NU } else { 0 }).map(Quantity::Input);
        let rows = (0..ocp.rows_per_stage).map(Quantity::Row);
        let quantities = states.chain(inputs).chain(rows);
        quantities.flat_map(move |quantity| {
            [Side::Lower, Side::Upper].map(|side| BoundId {
                stage,
                quantity,
                side,
            })
        })
    });
    all.filter(|bound| limit(ocp, bound).is_finite()).collect()
}
