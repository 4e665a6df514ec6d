//! The same problem for Clarabel, an interior-point solver: states, inputs and excesses of soft
//! bounds are variables, the dynamics are equalities.

use ::clarabel::algebra::CscMatrix;
use ::clarabel::solver::{
    DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus, ZeroConeT,
};
use lpvmpc::{Bounds, Common, Ocp, Penalty, Softness};
use nalgebra::SMatrix;

/// What Clarabel says about a problem.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// Optimal value, and the value of the dual problem, a lower bound up to rounding.
    Solved { primal: f64, dual: f64 },
    /// It has a certificate that no point satisfies all constraints.
    Infeasible,
    /// It ended without an answer.
    Undecided(SolverStatus),
}

/// Sparse entries (row, column, value).
#[derive(Default)]
struct Entries {
    rows: Vec<usize>,
    columns: Vec<usize>,
    values: Vec<f64>,
}

impl Entries {
    fn push(&mut self, row: usize, column: usize, value: f64) {
        if value != 0.0 {
            self.rows.push(row);
            self.columns.push(column);
            self.values.push(value);
        }
    }

    fn push_block<const R: usize, const C: usize>(
        &mut self,
        row: usize,
        column: usize,
        block: &SMatrix<f64, R, C>,
        factor: f64,
    ) {
        for i in 0..R {
            for j in 0..C {
                self.push(row + i, column + j, factor * block[(i, j)]);
            }
        }
    }

    fn push_upper<const R: usize>(&mut self, place: usize, block: &SMatrix<f64, R, R>) {
        for i in 0..R {
            for j in i..R {
                self.push(place + i, place + j, block[(i, j)]);
            }
        }
    }

    fn into_matrix(self, rows: usize, columns: usize) -> CscMatrix<f64> {
        CscMatrix::new_from_triplets(rows, columns, self.rows, self.columns, self.values)
    }
}

/// One linear expression: coefficients by variable, and a constant.
#[derive(Clone, Default)]
struct Expression {
    terms: Vec<(usize, f64)>,
    constant: f64,
}

/// Minimise z'Pz/2 + q'z + constant with equalities e(z) = 0 and inequalities e(z) >= 0.
#[derive(Default)]
struct Program {
    quadratic: Entries,
    linear: Vec<f64>,
    constant: f64,
    equalities: Vec<Expression>,
    inequalities: Vec<Expression>,
}

impl Program {
    fn new_variable(&mut self, linear: f64) -> usize {
        self.linear.push(linear);
        self.linear.len() - 1
    }

    /// lower <= value <= upper, at a price if soft.
    fn bound(&mut self, value: &Expression, limits: (f64, f64), soft: Option<Penalty<f64>>) {
        let (lower, upper) = limits;
        if lower == upper && soft.is_none() {
            let mut defect = value.clone();
            defect.constant -= lower;
            self.equalities.push(defect);
            return;
        }
        for (sign, limit) in [(1.0, lower), (-1.0, upper)] {
            if limit.is_infinite() {
                continue;
            }
            let mut slack = Expression {
                terms: value.terms.iter().map(|(k, c)| (*k, sign * c)).collect(),
                constant: sign * (value.constant - limit),
            };
            if let Some(price) = soft {
                let excess = self.new_variable(price.linear);
                self.quadratic.push(excess, excess, price.quadratic);
                slack.terms.push((excess, 1.0));
                self.inequalities.push(Expression {
                    terms: vec![(excess, 1.0)],
                    constant: 0.0,
                });
            }
            self.inequalities.push(slack);
        }
    }

    fn bounds<const K: usize>(
        &mut self,
        values: &[Expression; K],
        bounds: &Bounds<f64, K>,
        soft: &Softness<f64, K>,
    ) {
        for j in 0..K {
            self.bound(&values[j], (bounds.lower[j], bounds.upper[j]), soft[j]);
        }
    }

    fn solve(self) -> Verdict {
        let variables = self.linear.len();
        let (m_eq, m_in) = (self.equalities.len(), self.inequalities.len());
        let mut constraints = Entries::default();
        let mut right = Vec::with_capacity(m_eq + m_in);
        for (row, expression) in self.equalities.iter().chain(&self.inequalities).enumerate() {
            for (column, coefficient) in &expression.terms {
                constraints.push(row, *column, -coefficient);
            }
            right.push(expression.constant);
        }
        let quadratic = self.quadratic.into_matrix(variables, variables);
        let constraints = constraints.into_matrix(m_eq + m_in, variables);
        let cones = [ZeroConeT(m_eq), NonnegativeConeT(m_in)];
        let mut solver = DefaultSolver::new(
            &quadratic,
            &self.linear,
            &constraints,
            &right,
            &cones,
            settings(),
        )
        .unwrap();
        solver.solve();
        match solver.solution.status {
            SolverStatus::Solved | SolverStatus::AlmostSolved => Verdict::Solved {
                primal: solver.solution.obj_val + self.constant,
                dual: solver.solution.obj_val_dual + self.constant,
            },
            SolverStatus::PrimalInfeasible => Verdict::Infeasible,
            status => Verdict::Undecided(status),
        }
    }
}

/// Tighter than the defaults; what it calls "almost solved" still beats the test's tolerance.
/// Residual of the constraints (relative) at which Clarabel stops.
pub const FEASIBILITY: f64 = 1e-10;

fn settings() -> DefaultSettings<f64> {
    DefaultSettings {
        verbose: false,
        max_threads: 1,
        tol_gap_abs: 1e-11,
        tol_gap_rel: 1e-11,
        tol_feas: FEASIBILITY,
        reduced_tol_gap_abs: 1e-9,
        reduced_tol_gap_rel: 1e-9,
        reduced_tol_feas: 1e-9,
        ..DefaultSettings::default()
    }
}

/// Clarabel's verdict on `ocp`.
pub fn solve<const NX: usize, const NU: usize>(ocp: &Ocp<f64, NX, NU>) -> Verdict {
    // Variables: u_0, x_1, u_1, x_2, ...
    let mut program = Program {
        linear: vec![0.0; ocp.horizon * (NX + NU)],
        ..Program::default()
    };
    let mut x: [Expression; NX] = std::array::from_fn(|j| Expression {
        terms: Vec::new(),
        constant: ocp.x0[j],
    });
    for i in 0..ocp.horizon {
        x = add_stage(&mut program, ocp, i, &x);
    }
    add_terminal(&mut program, ocp, &x);
    program.solve()
}

/// sum_j row_j values_j
fn combine(row: impl Iterator<Item = f64>, values: &[Expression]) -> Expression {
    let mut sum = Expression::default();
    for (coefficient, value) in row.zip(values) {
        let scaled = value.terms.iter().map(|(k, c)| (*k, coefficient * c));
        sum.terms.extend(scaled);
        sum.constant += coefficient * value.constant;
    }
    sum
}

fn variable(index: usize) -> Expression {
    Expression {
        terms: vec![(index, 1.0)],
        constant: 0.0,
    }
}

/// Adds stage `i`, which begins in the state `x`; returns the state behind it.
fn add_stage<const NX: usize, const NU: usize>(
    program: &mut Program,
    ocp: &Ocp<f64, NX, NU>,
    i: usize,
    x: &[Expression; NX],
) -> [Expression; NX] {
    let stage = &ocp.stages[i];
    let input = i * (NX + NU);
    let next = input + NU;
    let u: [Expression; NU] = std::array::from_fn(|j| variable(input + j));
    let x_next: [Expression; NX] = std::array::from_fn(|j| variable(next + j));

    let Common {
        q,
        r,
        s,
        x: bounds_x,
        soft_x,
        u: bounds_u,
    } = ocp.common_at(i);
    program.quadratic.push_upper(input, r);
    for j in 0..NU {
        program.linear[input + j] += stage.linear_u[j];
    }
    if let Some(state) = input.checked_sub(NX) {
        program.quadratic.push_upper(state, q);
        let cross = s.transpose();
        program.quadratic.push_block(state, input, &cross, 1.0);
        for j in 0..NX {
            program.linear[state + j] += stage.linear_x[j];
        }
        program.bounds(x, bounds_x, soft_x);
    } else {
        let x0 = &ocp.x0;
        program.constant += (q * x0 * 0.5 + stage.linear_x).dot(x0);
        for (j, gradient) in (s * x0).iter().enumerate() {
            program.linear[input + j] += gradient;
        }
    }
    program.bounds(&u, bounds_u, &super::problems::hard());
    add_rows(program, ocp, i, x, &u);
    for j in 0..NX {
        let mut defect = combine(stage.a.row(j).iter().copied(), x);
        let of_u = combine(stage.b.row(j).iter().copied(), &u);
        defect.terms.extend(of_u.terms);
        defect.terms.push((next + j, -1.0));
        defect.constant += stage.c[j];
        program.equalities.push(defect);
    }
    x_next
}

/// The general rows of stage `i`; at the end of the horizon there is no `u`.
fn add_rows<const NX: usize, const NU: usize>(
    program: &mut Program,
    ocp: &Ocp<f64, NX, NU>,
    i: usize,
    x: &[Expression],
    u: &[Expression],
) {
    for row in (0..ocp.rows_per_stage).filter_map(|j| ocp.row(i, j)) {
        let mut value = combine(row.x.iter().copied(), x);
        let of_u = combine(row.u.iter().copied(), u);
        value.terms.extend(of_u.terms);
        program.bound(&value, (row.lower, row.upper), row.soft);
    }
}

fn add_terminal<const NX: usize, const NU: usize>(
    program: &mut Program,
    ocp: &Ocp<f64, NX, NU>,
    x: &[Expression; NX],
) {
    let end = &ocp.terminal;
    let state = ocp.horizon * (NX + NU) - NX;
    program.quadratic.push_upper(state, &end.p);
    for j in 0..NX {
        program.linear[state + j] += end.linear_x[j];
    }
    program.bounds(x, &end.x, &end.soft_x);
    add_rows(program, ocp, ocp.horizon, x, &[]);
    if let Some(target) = &end.equality {
        for j in 0..NX {
            let mut defect = x[j].clone();
            defect.constant -= target[j];
            program.equalities.push(defect);
        }
    }
}
