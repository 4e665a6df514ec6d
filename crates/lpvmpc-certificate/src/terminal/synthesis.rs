//! A terminal gain and cost for a whole set of schedulings, by linear matrix inequalities.

use super::lmi::{AffineMatrix, LmiFailure, maximise_log_det};
use lpvmpc::LpvModel;
use lpvmpc_design::RiccatiError;
use lpvmpc_design::SchedulingGrid;
use lpvmpc_design::lqr_discrete;
use lpvmpc_design::number_text;
use lpvmpc_design::{DiscretizeError, zero_order_hold};
use lpvmpc_design::{
    MatrixError, check_positive_definite, check_positive_semidefinite, checked_symmetric,
};
use nalgebra::{DMatrix, DVector, SMatrix, SVector};
use thiserror::Error;

/// What terminal ingredients are asked of the plant x_dot = A(s) x + B(s) u, sampled at t_s, or in discrete time of
/// x+ = A(s) x + B(s) u.
#[derive(Debug, Clone, PartialEq)]
pub struct TerminalProblem<const NX: usize, const NU: usize> {
    /// Sampling time, s.
    pub t_s: f64,
    /// Q of the stage cost x'Qx + u'Ru, symmetric, positive semidefinite.
    pub q: SMatrix<f64, NX, NX>,
    /// R of the stage cost, symmetric, positive definite.
    pub r: SMatrix<f64, NU, NU>,
    /// |x_i| <= `state_limits[i]` in the set, state units; infinite for none.
    pub state_limits: SVector<f64, NX>,
    /// |u_i| <= `input_limits[i]` under the terminal law, input units.
    pub input_limits: SVector<f64, NU>,
    /// eta in V(x+) <= (1 - eta) V(x) - x'Qx - u'Ru, from 0 to 1: what is asked beyond the
    /// stage cost, because the inequality is imposed at frozen schedulings of a grid, and has
    /// to hold between its points and while the scheduling moves.
    pub contraction: f64,
    /// The level a of the terminal set x'Px <= a, in units of the cost. The larger, the larger
    /// the set, and the larger P against the cost of the unconstrained regulator.
    pub level: f64,
}

/// The terminal law u = **-K** x, the terminal cost x'Px and the terminal set x'Px <= level.
#[derive(Debug, Clone, PartialEq)]
pub struct TerminalIngredients<const NX: usize, const NU: usize> {
    /// K, for u = **-K** x.
    pub k: SMatrix<f64, NU, NX>,
    /// P, symmetric positive definite: an upper bound of the cost from x on is x'Px.
    pub p: SMatrix<f64, NX, NX>,
    /// The set is x'Px <= level.
    pub level: f64,
    /// No other solution of the same problem has a larger log det (P/level)^-1 by more than this
    /// (in the scaled unknowns; the set's volume is the square root of the determinant).
    pub log_det_gap: f64,
}

impl<const NX: usize, const NU: usize> TerminalIngredients<NX, NU> {
    /// log det (P/level)^-1: twice the logarithm of the set's volume, up to a constant. Minus
    /// infinity for a P that is not positive definite.
    pub fn log_det(&self) -> f64 {
        let factor = (self.p / self.level).cholesky();
        factor.map_or(f64::NEG_INFINITY, |factor| {
            -2.0 * factor.l().diagonal().map(f64::ln).sum()
        })
    }
}

/// There are no terminal ingredients.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SynthesisError {
    /// A number of the problem is out of range.
    #[error("{name} = {value}: it must be {expected}", value = number_text(*value))]
    Value {
        /// The field.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What would be right.
        expected: &'static str,
    },
    /// A matrix of the problem or of the model is not what it must be.
    #[error(transparent)]
    Matrix(#[from] MatrixError),
    /// The model cannot be sampled.
    #[error(transparent)]
    Discretize(#[from] DiscretizeError),
    /// The regulator at the middle of the grid, which scales the unknowns, does not exist.
    #[error("the regulator at the middle of the scheduling set: {0}")]
    Middle(#[from] RiccatiError),
    /// The inequalities have no common solution.
    #[error(
        "no common K and P decrease the cost at all {points} grid points: the scaled \
         inequalities miss by {missing:.1e}; a smaller scheduling set, a larger level or a \
         smaller contraction may have one"
    )]
    Infeasible {
        /// Grid points.
        points: usize,
        /// What is missing to a solution of the scaled inequalities.
        missing: f64,
    },
    /// Newton's method failed on the scaled problem.
    #[error("the search for K and P did not converge")]
    NotConverged,
}

/// The terminal law, cost and set of largest volume that satisfy, with u = -K x and P > 0,
///
/// ```text
/// (A_d - B_d K)' P (A_d - B_d K) <= (1 - eta) P - Q - K'RK     at every point of `grid`
/// |x_i| <= state_limits_i,  |K_i x| <= input_limits_i          wherever x'Px <= level
/// ```
///
/// with A_d and B_d sampled exactly at frozen scheduling (A and B themselves of a model with a period). In Y = level P^-1 and L = K Y these are
/// linear matrix inequalities (Boyd, El Ghaoui, Feron, Balakrishnan, Linear Matrix Inequalities
/// in System and Control Theory, 1994). This is a design, not a proof: neither the values between
/// the points nor the motion of the scheduling within a sample is looked at.
///
/// # Errors
/// Numbers out of range, a model that cannot be sampled, or no solution.
pub fn synthesize_terminal<M, const NX: usize, const NU: usize, const NS: usize>(
    model: &M,
    grid: &SchedulingGrid<NS>,
    problem: &TerminalProblem<NX, NU>,
) -> Result<TerminalIngredients<NX, NU>, SynthesisError>
where
    M: LpvModel<f64, NX, NU, NS>,
{
    let points: Vec<_> = grid.points().collect();
    synthesize_terminal_at(model, &grid.middle(), &points, problem, (NX, NU), &|| ())
}

/// As [`synthesize_terminal`], at any `points` of the scheduling; the regulator at `middle` scales the unknowns.
/// Of a plant with fewer states and inputs than places, `sizes`, only these are designed: the places behind them must
/// have nothing to do with them, K is zero there, and P/level the identity. Each step of the search begins with
/// `at_step`, for callers that tell of it or end it by unwinding.
///
/// # Errors
/// Numbers out of range, a model that cannot be sampled, or no solution.
pub fn synthesize_terminal_at<M, const NX: usize, const NU: usize, const NS: usize>(
    model: &M,
    middle: &SVector<f64, NS>,
    points: &[SVector<f64, NS>],
    problem: &TerminalProblem<NX, NU>,
    sizes: (usize, usize),
    at_step: &dyn Fn(),
) -> Result<TerminalIngredients<NX, NU>, SynthesisError>
where
    M: LpvModel<f64, NX, NU, NS>,
{
    let (n, m) = (sizes.0.min(NX), sizes.1.min(NU));
    let asked = problem.of_the_first(n, m);
    asked.check()?;
    let sampled = |scheduling: &SVector<f64, NS>| {
        let (a, b) = model.matrices(scheduling);
        let (a, b) = (first(&a, n, n), first(&b, n, m));
        match model.period() {
            None => zero_order_hold(&a, &b, problem.t_s),
            Some(_) => Ok((a, b)),
        }
    };
    let pairs = points.iter().map(sampled).collect::<Result<Vec<_>, _>>()?;
    let scaling = asked.scaling(&sampled(middle)?)?;
    let blocks = asked.blocks(&scaling, &pairs);
    let maximum =
        maximise_log_det(&blocks, unknowns(n, m), at_step).map_err(|failure| match failure {
            LmiFailure::Infeasible { missing } => SynthesisError::Infeasible {
                points: pairs.len(),
                missing,
            },
            LmiFailure::NotConverged => SynthesisError::NotConverged,
        })?;
    let (y, l) = split(&maximum.v, n, m);
    let y_inverse = y.cholesky().ok_or(SynthesisError::NotConverged)?.inverse();
    let x_inverse = DMatrix::from_diagonal(&scaling.x.map(f64::recip));
    let k = DMatrix::from_diagonal(&scaling.u) * l * &y_inverse * &x_inverse;
    let p = &x_inverse * y_inverse * &x_inverse * problem.level;
    let left_over = SMatrix::<f64, NX, NX>::identity() * problem.level;
    Ok(TerminalIngredients {
        k: SMatrix::from_fn(|i, j| k.get((i, j)).copied().unwrap_or(0.0)),
        p: SMatrix::from_fn(|i, j| match i < n && j < n {
            true => 0.5 * (p[(i, j)] + p[(j, i)]),
            false => left_over[(i, j)],
        }),
        level: problem.level,
        log_det_gap: maximum.gap,
    })
}

/// Units in which the set and the inputs are about 1.
struct Scaling {
    x: DVector<f64>,
    u: DVector<f64>,
}

/// A [`TerminalProblem`] of the states and inputs that are there.
struct Asked {
    q: DMatrix<f64>,
    r: DMatrix<f64>,
    state_limits: DVector<f64>,
    input_limits: DVector<f64>,
    contraction: f64,
    level: f64,
}

impl<const NX: usize, const NU: usize> TerminalProblem<NX, NU> {
    fn of_the_first(&self, n: usize, m: usize) -> Asked {
        Asked {
            q: first(&self.q, n, n),
            r: first(&self.r, m, m),
            state_limits: self.state_limits.rows(0, n).into_owned(),
            input_limits: self.input_limits.rows(0, m).into_owned(),
            contraction: self.contraction,
            level: self.level,
        }
    }
}

impl Asked {
    fn states(&self) -> usize {
        self.state_limits.len()
    }

    fn inputs(&self) -> usize {
        self.input_limits.len()
    }

    fn check(&self) -> Result<(), SynthesisError> {
        let refuse = |name, value, expected| {
            Err(SynthesisError::Value {
                name,
                value,
                expected,
            })
        };
        if !(self.level > 0.0 && self.level.is_finite()) {
            return refuse("level", self.level, "positive");
        }
        if !(self.contraction >= 0.0 && self.contraction < 1.0) {
            return refuse("contraction", self.contraction, "from 0 to below 1");
        }
        for limit in self.state_limits.iter() {
            if limit.is_nan() || *limit <= 0.0 {
                return refuse("state_limits", *limit, "positive, or infinite for none");
            }
        }
        for limit in self.input_limits.iter() {
            if !(*limit > 0.0 && limit.is_finite()) {
                return refuse("input_limits", *limit, "positive and finite");
            }
        }
        let q = checked_symmetric("Q", &self.q)?;
        check_positive_semidefinite("Q", &q)?;
        let r = checked_symmetric("R", &self.r)?;
        Ok(check_positive_definite("R", &r)?)
    }

    /// From the limits, and the semi-axes of the regulator's set where there is no limit.
    fn scaling(&self, (a, b): &(DMatrix<f64>, DMatrix<f64>)) -> Result<Scaling, SynthesisError> {
        let lqr = lqr_discrete(a, b, &self.q, &self.r)?;
        let inverse = lqr
            .p
            .cholesky()
            .ok_or(SynthesisError::NotConverged)?
            .inverse();
        let semi_axis = |i| (self.level * inverse[(i, i)]).sqrt();
        Ok(Scaling {
            x: DVector::from_fn(self.states(), |i, _| self.state_limits[i].min(semi_axis(i))),
            u: self.input_limits.clone(),
        })
    }

    /// Y itself, then the decrease at each pair, then the limits; all in scaled units.
    fn blocks(
        &self,
        scaling: &Scaling,
        pairs: &[(DMatrix<f64>, DMatrix<f64>)],
    ) -> Vec<AffineMatrix> {
        let (n, m) = (self.states(), self.inputs());
        let x = DMatrix::from_diagonal(&scaling.x);
        let u = DMatrix::from_diagonal(&scaling.u);
        let x_inverse = DMatrix::from_diagonal(&scaling.x.map(f64::recip));
        let cost = 1.0 / self.level.sqrt();
        let q_root = square_root(&self.q) * &x * cost;
        let r_root = square_root(&self.r) * &u * cost;
        let mut blocks = vec![block(n, m, |y, _| y.clone())];
        for (a, b) in pairs {
            let (a, b) = (&x_inverse * a * &x, &x_inverse * b * &u);
            blocks.push(block(n, m, |y, l| {
                let lower = [&a * y - &b * l, &q_root * y, &r_root * l];
                decrease(y, (1.0 - self.contraction).sqrt(), lower)
            }));
        }
        for i in (0..n).filter(|i| self.state_limits[*i].is_finite()) {
            let square = (self.state_limits[i] / scaling.x[i]).powi(2);
            blocks.push(block(n, m, |y, _| {
                DMatrix::from_element(1, 1, square - y[(i, i)])
            }));
        }
        for i in 0..m {
            blocks.push(block(n, m, |y, l| {
                let mut bound = DMatrix::identity(n + 1, n + 1);
                bound.view_mut((1, 1), (n, n)).copy_from(y);
                bound.view_mut((0, 1), (1, n)).copy_from(&l.row(i));
                bound
                    .view_mut((1, 0), (n, 1))
                    .copy_from(&l.row(i).transpose());
                bound
            }));
        }
        blocks
    }
}

/// [ (1 - eta) Y  *  *  * ; A Y - B L  Y  0  0 ; Q^1/2 Y  0  I  0 ; R^1/2 L  0  0  I ].
fn decrease(y: &DMatrix<f64>, root: f64, lower: [DMatrix<f64>; 3]) -> DMatrix<f64> {
    let n = y.nrows();
    let rows = n + lower.iter().map(DMatrix::nrows).sum::<usize>();
    let mut block = DMatrix::identity(rows, rows);
    block
        .view_mut((0, 0), (n, n))
        .copy_from(&(y * (root * root)));
    block.view_mut((n, n), (n, n)).copy_from(y);
    let mut at = n;
    for part in lower {
        block.view_mut((at, 0), part.shape()).copy_from(&part);
        block
            .view_mut((0, at), (n, part.nrows()))
            .copy_from(&part.transpose());
        at += part.nrows();
    }
    block
}

/// A block that is affine in Y and L.
fn block(
    nx: usize,
    nu: usize,
    f: impl Fn(&DMatrix<f64>, &DMatrix<f64>) -> DMatrix<f64>,
) -> AffineMatrix {
    AffineMatrix::of(unknowns(nx, nu), |v| {
        let (y, l) = split(v, nx, nu);
        f(&y, &l)
    })
}

/// Entries of a symmetric Y and of L.
fn unknowns(nx: usize, nu: usize) -> usize {
    nx * (nx + 1) / 2 + nu * nx
}

fn split(v: &DVector<f64>, nx: usize, nu: usize) -> (DMatrix<f64>, DMatrix<f64>) {
    let y = DMatrix::from_fn(nx, nx, |i, j| {
        let (low, high) = (i.min(j), i.max(j));
        v[high * (high + 1) / 2 + low]
    });
    let first = nx * (nx + 1) / 2;
    let l = DMatrix::from_fn(nu, nx, |i, j| v[first + i * nx + j]);
    (y, l)
}

/// S symmetric with S S = M, for a symmetric positive semidefinite M.
fn square_root(m: &DMatrix<f64>) -> DMatrix<f64> {
    let eigen = m.clone().symmetric_eigen();
    let roots = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
    &eigen.eigenvectors * DMatrix::from_diagonal(&roots) * eigen.eigenvectors.transpose()
}

/// The first rows and columns.
fn first<const R: usize, const C: usize>(
    m: &SMatrix<f64, R, C>,
    rows: usize,
    columns: usize,
) -> DMatrix<f64> {
    m.view((0, 0), (rows, columns)).into_owned()
}
