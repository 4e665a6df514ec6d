//! The damped iteration, by the crate `levenberg-marquardt` (a port of MINPACK's LMDER).

use std::cell::RefCell;

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt, TerminationReason};
use nalgebra::{DMatrix, DVector, Dyn, storage::Owned};

use super::fit::{Evaluated, Fit, Iteration, ScaledJacobian, Termination};
use super::{LeastSquaresError, LeastSquaresSettings, NoPoint, Point, ResidualModel, Weighted};

/// The first step is at most this many times ||D b||, D the column norms of W J. MINPACK's usual 100
/// lets it jump to where the residual is flat (NIST's BoxBOD from its first start).
const FIRST_STEP: f64 = 1.0;

/// Levenberg-Marquardt from `start`: Gauss-Newton steps shortened to a trust region, so that every
/// accepted iterate lowers the weighted residual (Moré 1978).
///
/// The history holds the accepted iterates. A minimum where the Jacobian is rank deficient is
/// reported as [`Termination::RankDeficient`]: other parameters fit as well. A fit that ended
/// elsewhere than at a minimum comes back with that [`Termination`]; use
/// [`Fit::require_converged`] to make it an error.
///
/// # Errors
/// The shapes, weights or settings do not fit, or the start is not finite.
pub fn levenberg_marquardt<M: ResidualModel>(
    model: &M,
    start: &DVector<f64>,
    settings: &LeastSquaresSettings,
) -> Result<Fit, LeastSquaresError> {
    let (weighted, point) = Weighted::start(model, start, settings)?;
    let problem = Problem {
        weighted: &weighted,
        b: point.b.clone(),
        progress: RefCell::new(Progress {
            history: Vec::new(),
            last: point,
            failure: None,
        }),
    };
    let (problem, report) = LevenbergMarquardt::new()
        .with_xtol(settings.step_tolerance)
        .with_ftol(settings.reduction_tolerance)
        .with_gtol(settings.orthogonality_tolerance)
        .with_patience(settings.max_iterations)
        .with_stepbound(FIRST_STEP)
        .minimize(problem);
    let b = problem.b;
    let mut progress = problem.progress.into_inner();
    // The crate asks for no Jacobian at the iterate that ends it.
    let end = progress.accept(&weighted, &b);
    let failure = match (progress.failure.take(), end) {
        (Some(failure), _) | (None, Err(failure)) => Some(failure),
        (None, Ok(())) => None,
    };
    let cap = settings.max_iterations * (b.len() + 1);
    let termination = match failure {
        Some(NoPoint::Mistake(mistake)) => return Err(mistake),
        Some(NoPoint::NonFinite(what)) => Termination::NonFinite {
            what,
            at: b.as_slice().to_vec(),
        },
        None => termination(report.termination, cap, &progress.last),
    };
    Ok(Fit::at(
        &weighted,
        &progress.last,
        progress.history,
        termination,
    ))
}

fn termination(reason: TerminationReason, cap: usize, end: &Point) -> Termination {
    let deficiency = ScaledJacobian::new(&end.jacobian).and_then(|scaled| scaled.deficiency);
    match (reason, deficiency) {
        (TerminationReason::LostPatience, _) => Termination::IterationCap { cap },
        (TerminationReason::Numerical(_), _) => Termination::NonFinite {
            what: Evaluated::Step,
            at: end.b.as_slice().to_vec(),
        },
        (_, Some(deficiency)) => Termination::RankDeficient(deficiency),
        (TerminationReason::ResidualsZero, None) => Termination::ResidualZero,
        (TerminationReason::Orthogonal, None) => Termination::Orthogonal,
        (TerminationReason::Converged { xtol: true, .. }, None) => Termination::SmallStep,
        (TerminationReason::Converged { .. }, None) => Termination::SmallReduction,
        // What is left is "no improvement possible": the mistakes in shape were found before.
        (_, None) => Termination::Stagnation,
    }
}

/// The problem as the crate wants it: it holds the current b and is told of new ones.
struct Problem<'a, M> {
    weighted: &'a Weighted<'a, M>,
    b: DVector<f64>,
    /// Written while the crate evaluates through `&self`.
    progress: RefCell<Progress>,
}

struct Progress {
    history: Vec<Iteration>,
    last: Point,
    /// Why an evaluation returned nothing.
    failure: Option<NoPoint>,
}

impl Progress {
    /// Takes `b` as the newest accepted iterate, unless it is the last one already.
    fn accept<M: ResidualModel>(
        &mut self,
        weighted: &Weighted<'_, M>,
        b: &DVector<f64>,
    ) -> Result<(), NoPoint> {
        if self
            .history
            .last()
            .is_some_and(|last| last.parameters == *b)
        {
            return Ok(());
        }
        let point = weighted.point(b)?;
        let iteration = Iteration::after(&self.history, &point.b, &point.residual);
        self.history.push(iteration);
        self.last = point;
        Ok(())
    }
}

impl<M: ResidualModel> LeastSquaresProblem<f64, Dyn, Dyn> for Problem<'_, M> {
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;
    type ParameterStorage = Owned<f64, Dyn>;

    fn set_params(&mut self, b: &DVector<f64>) {
        self.b.copy_from(b);
    }

    fn params(&self) -> DVector<f64> {
        self.b.clone()
    }

    /// A residual that is not finite is handed on: the crate then shortens the step.
    fn residuals(&self) -> Option<DVector<f64>> {
        match self.weighted.residual(&self.b) {
            Ok(residual) => Some(residual),
            Err(mistake) => {
                self.progress.borrow_mut().failure = Some(NoPoint::Mistake(mistake));
                None
            }
        }
    }

    /// The crate asks for the Jacobian at accepted iterates only.
    fn jacobian(&self) -> Option<DMatrix<f64>> {
        let mut progress = self.progress.borrow_mut();
        match progress.accept(self.weighted, &self.b) {
            Ok(()) => Some(progress.last.jacobian.clone()),
            Err(failure) => {
                progress.failure = Some(failure);
                None
            }
        }
    }
}
