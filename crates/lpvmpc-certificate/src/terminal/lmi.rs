//! Maximal determinant under linear matrix inequalities (LMI), by a log-barrier Newton method.
//!
//! ```text
//! maximise  log det F_0(v)   subject to  F_j(v) >= 0,  j = 0, 1, ...
//! ```
//!
//! with symmetric F_j that are affine in the unknowns v (Boyd and Vandenberghe, Convex
//! Optimization, 2004, ch. 11; Vandenberghe, Boyd and Wu 1998). Dense, for a few dozen unknowns.

use lpvmpc_design::each;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// F(v) = F_constant + sum of v_i F_i, symmetric.
#[derive(Debug, Clone)]
pub(super) struct AffineMatrix {
    constant: DMatrix<f64>,
    slopes: Vec<DMatrix<f64>>,
}

impl AffineMatrix {
    /// The coefficients of `f`, which must be affine in its `unknowns` arguments.
    pub fn of(unknowns: usize, f: impl Fn(&DVector<f64>) -> DMatrix<f64>) -> Self {
        let constant = f(&DVector::zeros(unknowns));
        let slope = |i| {
            let mut unit = DVector::zeros(unknowns);
            unit[i] = 1.0;
            f(&unit) - &constant
        };
        let slopes = (0..unknowns).map(slope).collect();
        Self { constant, slopes }
    }

    pub fn at(&self, v: &DVector<f64>) -> DMatrix<f64> {
        let terms = self.slopes.iter().zip(v.iter());
        terms.fold(self.constant.clone(), |sum, (slope, v)| sum + slope * *v)
    }

    fn rows(&self) -> usize {
        self.constant.nrows()
    }

    fn is_finite(&self) -> bool {
        let mut matrices = std::iter::once(&self.constant).chain(&self.slopes);
        matrices.all(|matrix| matrix.iter().all(|entry| entry.is_finite()))
    }

    /// The same with one unknown more, s: F(v) + s I.
    fn relaxed(&self) -> Self {
        let rows = self.rows();
        let mut relaxed = self.clone();
        relaxed.slopes.push(DMatrix::identity(rows, rows));
        relaxed
    }

    /// The scalar v_index + offset as a 1 x 1 matrix.
    fn unknown(unknowns: usize, index: usize, offset: f64) -> Self {
        Self::of(unknowns, |v| DMatrix::from_element(1, 1, v[index] + offset))
    }
}

/// Why there is no solution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum LmiFailure {
    /// No v makes every F_j positive definite: this much is missing at the best one.
    Infeasible {
        /// The smallest s with F_j(v) + s I >= 0 for all j, as far as it was minimised.
        missing: f64,
    },
    /// Newton's method did not converge.
    NotConverged,
}

/// A maximiser, with the bound that duality gives on what is missing to the maximum.
#[derive(Debug, Clone)]
pub(super) struct Maximum {
    pub v: DVector<f64>,
    /// No feasible v has a log det F_0 larger than this one's by more than this.
    pub gap: f64,
}

/// Maximises log det of the first block, with the others positive semidefinite. Each step of Newton's method begins with
/// `at_step`.
///
/// # Errors
/// No strictly feasible v, or no convergence.
pub(super) fn maximise_log_det(
    blocks: &[AffineMatrix],
    unknowns: usize,
    at_step: &dyn Fn(),
) -> Result<Maximum, LmiFailure> {
    // An eigenvalue of what is not finite would be looked for without end.
    if !blocks.iter().all(AffineMatrix::is_finite) {
        return Err(LmiFailure::NotConverged);
    }
    let mut v = strictly_feasible(blocks, unknowns, at_step)?;
    let rows: usize = blocks.iter().skip(1).map(AffineMatrix::rows).sum();
    let mut first_weight = 1.0;
    loop {
        let barrier = Barrier {
            blocks,
            linear: DVector::zeros(unknowns),
            first_weight,
            at_step,
        };
        v = barrier.centre(v, |_| false)?;
        // The multipliers F_j^-1 / first_weight of a centre are dual feasible.
        let gap = rows as f64 / first_weight;
        if gap <= GAP {
            return Ok(Maximum { v, gap });
        }
        first_weight *= WEIGHT_GROWTH;
    }
}

/// Where the gap in log det is small enough.
const GAP: f64 = 1e-4;
const WEIGHT_GROWTH: f64 = 10.0;
/// Half the Newton decrement squared at which a centre is found.
const CENTRED: f64 = 1e-6;
const MOST_STEPS: usize = 200;

/// Minimises s over F_j(v) + s I >= 0 until s < 0.
fn strictly_feasible(
    blocks: &[AffineMatrix],
    unknowns: usize,
    at_step: &dyn Fn(),
) -> Result<DVector<f64>, LmiFailure> {
    let mut relaxed: Vec<AffineMatrix> = blocks.iter().map(AffineMatrix::relaxed).collect();
    // Bounded below, or the analytic centre of a feasible set without bound would not exist.
    relaxed.push(AffineMatrix::unknown(unknowns + 1, unknowns, 1.0));
    let mut v = DVector::zeros(unknowns + 1);
    let at_zero = blocks
        .iter()
        .map(|block| block.constant.symmetric_eigenvalues().min());
    v[unknowns] = 1.0 - at_zero.fold(0.0, f64::min);
    let rows: usize = relaxed.iter().map(AffineMatrix::rows).sum();
    let mut weight = 1.0;
    while rows as f64 / weight > SMALLEST_SLACK {
        let mut linear = DVector::zeros(unknowns + 1);
        linear[unknowns] = weight;
        let barrier = Barrier {
            blocks: &relaxed,
            linear,
            first_weight: 1.0,
            at_step,
        };
        v = barrier.centre(v, |v| v[unknowns] < 0.0)?;
        if v[unknowns] < 0.0 {
            return Ok(v.rows(0, unknowns).into_owned());
        }
        weight *= WEIGHT_GROWTH;
    }
    Err(LmiFailure::Infeasible {
        missing: v[unknowns],
    })
}

/// Below this the blocks have no inside worth a search.
const SMALLEST_SLACK: f64 = 1e-6;

/// The Cholesky factors of all blocks.
type Factors = Vec<Cholesky<f64, Dyn>>;

/// linear'v - first_weight log det F_0(v) - sum over the other j of log det F_j(v).
struct Barrier<'a> {
    blocks: &'a [AffineMatrix],
    linear: DVector<f64>,
    first_weight: f64,
    at_step: &'a dyn Fn(),
}

impl Barrier<'_> {
    fn weight(&self, block: usize) -> f64 {
        if block == 0 { self.first_weight } else { 1.0 }
    }

    fn factors(&self, v: &DVector<f64>) -> Option<Factors> {
        self.blocks
            .iter()
            .map(|block| block.at(v).cholesky())
            .collect()
    }

    fn value(&self, v: &DVector<f64>, factors: &Factors) -> f64 {
        let log_dets = factors.iter().enumerate().map(|(block, factor)| {
            let diagonal = factor.l_dirty().diagonal();
            2.0 * self.weight(block) * diagonal.map(f64::ln).sum()
        });
        self.linear.dot(v) - log_dets.sum::<f64>()
    }

    /// Minimises by damped Newton steps from the strictly feasible `v`, or until `enough`.
    fn centre(
        &self,
        mut v: DVector<f64>,
        enough: impl Fn(&DVector<f64>) -> bool,
    ) -> Result<DVector<f64>, LmiFailure> {
        let mut factors = self.factors(&v).ok_or(LmiFailure::NotConverged)?;
        for _ in 0..MOST_STEPS {
            (self.at_step)();
            let (gradient, hessian) = self.derivatives(&factors);
            let hessian = hessian.cholesky().ok_or(LmiFailure::NotConverged)?;
            let step = -hessian.solve(&gradient);
            let decrease = -gradient.dot(&step);
            if !(decrease.is_finite()) {
                return Err(LmiFailure::NotConverged);
            }
            if decrease / 2.0 <= CENTRED || enough(&v) {
                return Ok(v);
            }
            let value = self.value(&v, &factors);
            let Some((next, next_factors)) = self.line_search(&v, &step, value, decrease) else {
                // Rounding leaves nothing to gain.
                return Ok(v);
            };
            (v, factors) = (next, next_factors);
        }
        Err(LmiFailure::NotConverged)
    }

    fn line_search(
        &self,
        v: &DVector<f64>,
        step: &DVector<f64>,
        value: f64,
        decrease: f64,
    ) -> Option<(DVector<f64>, Factors)> {
        let lengths = (0..50).map(|halvings| 0.5_f64.powi(halvings));
        lengths.into_iter().find_map(|length| {
            let next = v + step * length;
            let factors = self.factors(&next)?;
            let enough = value - 0.1 * length * decrease;
            (self.value(&next, &factors) <= enough).then_some((next, factors))
        })
    }

    fn derivatives(&self, factors: &Factors) -> (DVector<f64>, DMatrix<f64>) {
        let unknowns = self.linear.len();
        let mut gradient = self.linear.clone();
        let mut hessian = DMatrix::zeros(unknowns, unknowns);
        let of_blocks = each(factors, |block, factor| {
            let (traces, columns) = normalised(factor, &self.blocks[block].slopes);
            // A product with a transposed copy is several times as fast as one that transposes.
            (traces, columns.transpose() * columns)
        });
        for (block, (traces, products)) in of_blocks.into_iter().enumerate() {
            gradient -= traces * self.weight(block);
            hessian += products * self.weight(block);
        }
        (gradient, hessian)
    }
}

/// The traces of N_i = L^-1 F_i L^-T, with the factor's L, and their entries as columns whose inner products are those
/// of the matrices, the second derivatives: off the diagonal times the root of 2.
fn normalised(
    factor: &Cholesky<f64, Dyn>,
    slopes: &[DMatrix<f64>],
) -> (DVector<f64>, DMatrix<f64>) {
    let l = factor.l_dirty();
    let rows = l.nrows();
    let mut inverse = DMatrix::identity(rows, rows);
    l.solve_lower_triangular_unchecked_mut(&mut inverse);
    let mut traces = DVector::zeros(slopes.len());
    let mut columns = DMatrix::zeros(rows * (rows + 1) / 2, slopes.len());
    let mut half = DMatrix::zeros(rows, rows);
    for (i, slope) in slopes.iter().enumerate() {
        // F = G + G' with a lower triangular G, which has few columns that are not zero: of each the outer product.
        half.fill(0.0);
        for c in 0..rows {
            let mut of_g = slope.column(c).into_owned();
            of_g.rows_mut(0, c).fill(0.0);
            of_g[c] *= 0.5;
            if of_g.iter().all(|entry| *entry == 0.0) {
                continue;
            }
            l.solve_lower_triangular_unchecked_mut(&mut of_g);
            half.ger(1.0, &of_g, &inverse.column(c), 1.0);
        }
        let mut place = 0;
        let mut column = columns.column_mut(i);
        for b in 0..rows {
            for a in b..rows {
                let entry = half[(a, b)] + half[(b, a)];
                column[place] = match a == b {
                    true => entry,
                    false => entry * std::f64::consts::SQRT_2,
                };
                place += 1;
            }
            traces[i] += 2.0 * half[(b, b)];
        }
    }
    (traces, columns)
}
