//! The undamped iteration b_(k+1) = b_k - pinv(J) F.

use nalgebra::DVector;

use super::fit::{Evaluated, Fit, Iteration, ScaledJacobian, Termination};
use super::{LeastSquaresError, LeastSquaresSettings, NoPoint, Point, ResidualModel, Weighted};

/// Plain Gauss-Newton from `start`: b_(k+1) = b_k - pinv(J(b_k)) F(b_k), full steps, no damping
/// (eq. (Newton) of Karachalios and Abbas). The pseudo-inverse is taken by singular values.
///
/// A fit that ended elsewhere than at a minimum comes back with that [`Termination`]; use
/// [`Fit::require_converged`] to make it an error. A wandering iteration usually means the start is
/// too far off: [`levenberg_marquardt`](super::levenberg_marquardt) is for that.
///
/// # Errors
/// The shapes, weights or settings do not fit, or the start is not finite.
pub fn gauss_newton<M: ResidualModel>(
    model: &M,
    start: &DVector<f64>,
    settings: &LeastSquaresSettings,
) -> Result<Fit, LeastSquaresError> {
    let (weighted, mut point) = Weighted::start(model, start, settings)?;
    let mut history = vec![Iteration::after(&[], &point.b, &point.residual)];
    let mut smallest_step = SmallestStep::default();
    let termination = loop {
        let step = match Step::at(&point) {
            Ok(step) => step,
            Err(termination) => break termination,
        };
        let b = &point.b - &step.step;
        point = match weighted.point(&b) {
            Ok(next) => next,
            Err(NoPoint::Mistake(mistake)) => return Err(mistake),
            Err(NoPoint::NonFinite(what)) => {
                let at = b.as_slice().to_vec();
                break Termination::NonFinite { what, at };
            }
        };
        history.push(Iteration::after(&history, &point.b, &point.residual));
        if step.relative_size <= settings.step_tolerance {
            break Termination::SmallStep;
        }
        if smallest_step.steps_since(step.relative_size) >= settings.stagnation_steps {
            break Termination::Stagnation;
        }
        if history.len() > settings.max_iterations {
            break Termination::IterationCap {
                cap: settings.max_iterations,
            };
        }
    };
    Ok(Fit::at(&weighted, &point, history, termination))
}

struct Step {
    step: DVector<f64>,
    /// ||D step|| / (||D b|| + ||W F||), D the column norms of W J: the first-order change of the
    /// residual that a parameter-wise move by `step` can make, over what the parameters and the
    /// residual amount to. The second term keeps it defined at b = 0.
    relative_size: f64,
}

impl Step {
    fn at(point: &Point) -> Result<Self, Termination> {
        let no_step = || Termination::NonFinite {
            what: Evaluated::Step,
            at: point.b.as_slice().to_vec(),
        };
        let scaled = ScaledJacobian::new(&point.jacobian).ok_or_else(no_step)?;
        if let Some(deficiency) = scaled.deficiency {
            return Err(Termination::RankDeficient(deficiency));
        }
        let scaled_step = scaled
            .svd
            .solve(&point.residual, 0.0)
            .map_err(|_| no_step())?;
        let size = scaled.column_norms.component_mul(&point.b).norm() + point.residual.norm();
        let length = scaled_step.norm();
        Ok(Self {
            step: scaled_step.component_div(&scaled.column_norms),
            relative_size: if length > 0.0 { length / size } else { 0.0 },
        })
    }
}

#[derive(Default)]
struct SmallestStep {
    size: Option<f64>,
    steps_since: usize,
}

impl SmallestStep {
    /// Steps taken since the smallest one, with a step of this size as the newest.
    fn steps_since(&mut self, size: f64) -> usize {
        if self.size.is_none_or(|smallest| size < smallest) {
            self.size = Some(size);
            self.steps_since = 0;
        } else {
            self.steps_since += 1;
        }
        self.steps_since
    }
}
