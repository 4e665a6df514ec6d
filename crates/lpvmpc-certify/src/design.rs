//! Law, cost and set that a proof may succeed for.

use lpvmpc::{Embedding, LpvModel};
use lpvmpc_certificate::{
    SynthesisError, TerminalIngredients, TerminalProblem, synthesize_terminal_at,
};
use lpvmpc_design::{lqr_discrete, zero_order_hold};
use lpvmpc_plant::AboutEquilibrium;
use nalgebra::{DMatrix, SMatrix, SVector};

/// What the design may ask for beyond the stage cost, of what the regulator has, and at most.
const CONTRACTION_SHARE: f64 = 0.3;
const MOST_CONTRACTION: f64 = 0.15;
/// Corners of the box of motions at which the models are imposed, at most: a unit of the work of the design.
const MOST_CORNERS: usize = 48;
/// A model that differs by less than this share does not depend on a component.
const SAME: f64 = 1e-9;
/// Without a bound, the set reaches to where the regulator's cost is this many times that of the weights' unit.
const UNBOUNDED: f64 = 1e6;

/// A plant about its equilibrium with what is asked of it.
pub(crate) struct Design<'a, const NX: usize, const NU: usize, const NS: usize> {
    pub model: &'a AboutEquilibrium<NX, NU, NS>,
    /// Sampling time, weights and limits; contraction and level are filled in.
    pub problem: TerminalProblem<NX, NU>,
    /// So many states and inputs are there.
    pub sizes: (usize, usize),
    /// Half the sides of the largest box of motions that the set may need.
    box_of_motion: SVector<f64, NS>,
    /// The components on which A and B depend.
    varying: Vec<usize>,
}

impl<'a, const NX: usize, const NU: usize, const NS: usize> Design<'a, NX, NU, NS> {
    /// `problem` has infinite limits where there are none; `enlargement` is that of the settings.
    pub fn new(
        model: &'a AboutEquilibrium<NX, NU, NS>,
        problem: TerminalProblem<NX, NU>,
        sizes: (usize, usize),
        enlargement: f64,
    ) -> Result<Self, SynthesisError> {
        let (n, m) = sizes;
        let (a, b) = LpvModel::<f64, NX, NU, NS>::matrices(model, &SVector::zeros());
        let (a, b) = (a.view((0, 0), (n, n)), b.view((0, 0), (n, m)));
        let (a, b) = (a.into_owned(), b.into_owned());
        let (a, b) = match Embedding::period(model) {
            None => zero_order_hold(&a, &b, problem.t_s)?,
            Some(_) => (a, b),
        };
        let q = problem.q.view((0, 0), (n, n)).into_owned();
        let r = problem.r.view((0, 0), (m, m)).into_owned();
        let lqr = lqr_discrete(&a, &b, &q, &r)?;
        let inverse = lqr.p.clone().cholesky();
        let inverse = inverse.ok_or(SynthesisError::NotConverged)?.inverse();
        let inputs = &lqr.k * &inverse * lqr.k.transpose();
        // The level at which the regulator's ellipsoid meets the first limit.
        let states = (0..n).map(|i| problem.state_limits[i].powi(2) / inverse[(i, i)]);
        let inputs_at = (0..m).map(|i| problem.input_limits[i].powi(2) / inputs[(i, i)]);
        let level = states.chain(inputs_at).fold(f64::INFINITY, f64::min);
        let level = if level.is_finite() {
            level
        } else {
            UNBOUNDED * q.trace()
        };
        let level = level * enlargement;
        let reach = |limit: f64, square: f64| limit.min((level * square).sqrt());
        let mut problem = problem;
        let mut box_of_motion = SVector::zeros();
        for i in 0..n {
            box_of_motion[i] = reach(problem.state_limits[i], inverse[(i, i)]);
            problem.state_limits[i] = box_of_motion[i];
        }
        for i in 0..m {
            box_of_motion[NX + i] = reach(problem.input_limits[i], inputs[(i, i)]);
            // What a sampled input cannot exceed in the set, the design may.
            problem.input_limits[i] = problem.input_limits[i].min(10.0 * box_of_motion[NX + i]);
        }
        let closed = &a - &b * &lqr.k;
        let rate = closed.complex_eigenvalues().map(|one| one.norm()).max();
        problem.level = level;
        problem.contraction = MOST_CONTRACTION
            .min(CONTRACTION_SHARE * (1.0 - rate * rate))
            .max(0.0);
        let mut design = Self {
            model,
            problem,
            sizes,
            box_of_motion,
            varying: Vec::new(),
        };
        design.varying = (0..NS).filter(|i| design.varies(*i)).collect();
        Ok(design)
    }

    /// Whether A or B depend on a component.
    fn varies(&self, component: usize) -> bool {
        let matrices = |s: &SVector<f64, NS>| LpvModel::<f64, NX, NU, NS>::matrices(self.model, s);
        let differs = |a: &DMatrix<f64>, b: &DMatrix<f64>| (a - b).amax() > SAME * a.amax();
        // Away from the origin, where products with other components show.
        [0.0, 0.3].into_iter().any(|share| {
            let others = self.box_of_motion * share;
            let base = joined(matrices(&others));
            [-0.7, 0.9].into_iter().any(|part| {
                let mut moved = others;
                moved[component] = part * self.box_of_motion[component];
                differs(&base, &joined(matrices(&moved)))
            })
        })
    }

    /// Whether the plant is linear, as far as the models tell.
    pub fn is_linear(&self) -> bool {
        self.varying.is_empty()
    }

    /// The motions at which the models are imposed, of a box of `size`: the middle, the ends of each component that
    /// matters, and corners, all of them or some that are spread evenly.
    fn points(&self, size: f64) -> Vec<SVector<f64, NS>> {
        let side = |i: usize| size * self.box_of_motion[i];
        let mut points = vec![SVector::zeros()];
        for i in &self.varying {
            for part in [-1.0, -0.5, 0.5, 1.0] {
                let mut point = SVector::zeros();
                point[*i] = part * side(*i);
                points.push(point);
            }
        }
        let dimensions = self.varying.len().min(30);
        let all = 1_usize << dimensions;
        let count = all.min(MOST_CORNERS);
        for number in 0..count {
            // Of more corners than these, those of an odd multiplier, which go through all of them.
            let corner = if count == all {
                number
            } else {
                number.wrapping_mul(0x9e37_79b1) % all
            };
            let mut point = SVector::zeros();
            for (bit, i) in self.varying.iter().enumerate() {
                let sign = if (corner >> (bit % 30)) & 1 == 1 {
                    1.0
                } else {
                    -1.0
                };
                point[*i] = sign * side(*i);
            }
            points.push(point);
        }
        points
    }

    /// Law, cost and set of largest volume in a box of `size`, without any proof. Each step of the search begins with
    /// `at_step`.
    pub fn ingredients(
        &self,
        size: f64,
        at_step: &dyn Fn(),
    ) -> Result<TerminalIngredients<NX, NU>, SynthesisError> {
        let mut problem = self.problem.clone();
        problem.state_limits *= size;
        let (middle, points) = (SVector::zeros(), self.points(size));
        synthesize_terminal_at(self.model, &middle, &points, &problem, self.sizes, at_step)
    }
}

fn joined<const NX: usize, const NU: usize>(
    (a, b): (SMatrix<f64, NX, NX>, SMatrix<f64, NX, NU>),
) -> DMatrix<f64> {
    DMatrix::from_fn(
        NX,
        NX + NU,
        |i, j| if j < NX { a[(i, j)] } else { b[(i, j - NX)] },
    )
}
