//! The same problem for Clarabel, an interior-point solver.

use crate::sparse::{Csc, SparseQp};
use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SolverError, SolverStatus,
    ZeroConeT,
};
use lpvmpc::Ocp;

/// Minimise z'Pz/2 + q'z with Az + s = b; s is zero in the first rows, then nonnegative.
pub struct ConeProgram {
    /// P, its upper triangle.
    pub p: CscMatrix<f64>,
    /// q.
    pub q: Vec<f64>,
    /// A.
    pub a: CscMatrix<f64>,
    /// b.
    pub b: Vec<f64>,
    equalities: usize,
}

impl ConeProgram {
    /// Every finite side of a bound becomes a row of its own, equal bounds one together.
    pub fn new(qp: SparseQp) -> Self {
        let bounds = || qp.lower.iter().zip(&qp.upper).enumerate();
        let mut b = Vec::new();
        let mut rows_of: Vec<Vec<(usize, f64)>> = vec![Vec::new(); qp.lower.len()];
        for (row, (_, upper)) in bounds().filter(|(_, (lower, upper))| lower == upper) {
            rows_of[row].push((b.len(), 1.0));
            b.push(*upper);
        }
        let equalities = b.len();
        for (row, (lower, upper)) in bounds().filter(|(_, (lower, upper))| lower != upper) {
            for (sign, limit) in [(1.0, upper), (-1.0, lower)] {
                if limit.is_finite() {
                    rows_of[row].push((b.len(), sign));
                    b.push(sign * limit);
                }
            }
        }
        Self {
            a: expand(&qp.a, &rows_of, b.len()),
            p: matrix(qp.p),
            q: qp.q,
            b,
            equalities,
        }
    }

    /// Minimise z'Pz/2 + q'z with Az <= b, from the entries (row, column, value) of P's upper triangle
    /// and of A; entries in one place add up.
    pub fn of_entries(
        p: &[(usize, usize, f64)],
        q: Vec<f64>,
        a: &[(usize, usize, f64)],
        b: Vec<f64>,
    ) -> Self {
        let matrix = |rows, entries: &[(usize, usize, f64)]| {
            let places = entries.iter().map(|entry| entry.0).collect();
            let columns = entries.iter().map(|entry| entry.1).collect();
            let values = entries.iter().map(|entry| entry.2).collect();
            CscMatrix::new_from_triplets(rows, q.len(), places, columns, values)
        };
        Self {
            p: matrix(q.len(), p),
            a: matrix(b.len(), a),
            q,
            b,
            equalities: 0,
        }
    }

    /// Clarabel's verdict and, where it is solved, the minimiser.
    ///
    /// # Errors
    /// Clarabel refuses it.
    pub fn solve(&self) -> Result<(Verdict, Vec<f64>), SolverError> {
        let mut solver = self.solver(settings())?;
        solver.solve();
        let solution = solver.solution;
        let verdict = match solution.status {
            SolverStatus::Solved | SolverStatus::AlmostSolved => Verdict::Solved {
                primal: solution.obj_val,
            },
            SolverStatus::PrimalInfeasible => Verdict::Infeasible,
            status => Verdict::Undecided(status),
        };
        Ok((verdict, solution.x))
    }

    /// A solver with this program.
    ///
    /// # Errors
    /// Clarabel refuses it.
    pub fn solver(
        &self,
        settings: DefaultSettings<f64>,
    ) -> Result<DefaultSolver<f64>, SolverError> {
        let cones = [
            ZeroConeT(self.equalities),
            NonnegativeConeT(self.b.len() - self.equalities),
        ];
        DefaultSolver::new(&self.p, &self.q, &self.a, &self.b, &cones, settings)
    }
}

/// `a` with each of its rows in the given places, times the given factors.
fn expand(a: &Csc, rows_of: &[Vec<(usize, f64)>], rows: usize) -> CscMatrix<f64> {
    let (mut places, mut columns, mut values) = (Vec::new(), Vec::new(), Vec::new());
    for (column, range) in a.starts.windows(2).enumerate() {
        for entry in range[0]..range[1] {
            for (row, factor) in &rows_of[a.row_indices[entry]] {
                places.push(*row);
                columns.push(column);
                values.push(factor * a.values[entry]);
            }
        }
    }
    CscMatrix::new_from_triplets(rows, a.columns, places, columns, values)
}

fn matrix(csc: Csc) -> CscMatrix<f64> {
    CscMatrix {
        m: csc.rows,
        n: csc.columns,
        colptr: csc.starts,
        rowval: csc.row_indices,
        nzval: csc.values,
    }
}

/// What Clarabel says about a problem.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// The optimal value.
    Solved {
        /// Cost of its answer.
        primal: f64,
    },
    /// It has a certificate that no point satisfies all constraints.
    Infeasible,
    /// It ended without an answer.
    Undecided(SolverStatus),
}

/// Residual of the constraints (relative) at which Clarabel stops in [`solve`].
pub const FEASIBILITY: f64 = 1e-10;

/// Tighter than the defaults; what it calls "almost solved" still beats the tests' tolerance.
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
///
/// # Errors
/// Clarabel refuses it.
pub fn solve<const NX: usize, const NU: usize>(
    ocp: &Ocp<f64, NX, NU>,
) -> Result<Verdict, SolverError> {
    let qp = SparseQp::new(ocp);
    let constant = qp.constant;
    let (verdict, _) = ConeProgram::new(qp).solve()?;
    Ok(match verdict {
        Verdict::Solved { primal } => Verdict::Solved {
            primal: primal + constant,
        },
        other => other,
    })
}
