//! The damped Gauss-Newton iteration with bounds.

use std::fmt;

use nalgebra::{DMatrix, DVector, SVector};

use super::block::Block;
use super::{Reduced, ShootingError, ShootingModel, ShootingProblem, Unknown};

/// When the iteration ends. The one place of the defaults.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShootingSettings {
    /// Converged when a step can lower chi^2 by no more than this many times chi^2 per value. A
    /// parameter that is off by 1 % of its standard deviation costs 1e-4 of that. Default 1e-4. At a
    /// kink (see [`Unknown::kinked`]) a move of that 1 % to either side, or of ten times as much, with
    /// all else fitted again, lowers chi^2 by no more, either. What rounding makes of chi^2 is not gone after.
    pub reduction_tolerance: f64,
    /// Steps at most. Default 60.
    pub max_iterations: usize,
}

impl Default for ShootingSettings {
    fn default() -> Self {
        Self {
            reduction_tolerance: 1e-4,
            max_iterations: 60,
        }
    }
}

/// Why the iteration ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ShootingTermination {
    /// Converged: no step lowers chi^2 by more than the tolerance.
    Converged,
    /// Not converged: the cap on the steps was reached.
    IterationCap {
        /// The cap.
        cap: usize,
    },
    /// Not converged: no step, however short, lowers chi^2.
    Stagnation,
}

impl fmt::Display for ShootingTermination {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Converged => write!(f, "no step improves the fit any more"),
            Self::IterationCap { cap } => write!(f, "the cap of {cap} steps was reached"),
            Self::Stagnation => write!(f, "no step, however short, improves the fit"),
        }
    }
}

/// The end of a fit, converged or not: see `termination`.
#[derive(Debug, Clone, PartialEq)]
pub struct ShootingFit<const NX: usize> {
    /// All parameters, held ones included, in the model's order.
    pub parameters: Vec<f64>,
    /// The initial state of each segment.
    pub initial: Vec<SVector<f64, NX>>,
    /// The normal equations of the free parameters that are at no bound.
    pub reduced: Reduced,
    /// chi^2 at the end.
    pub chi_square: f64,
    /// Measured values that were fitted.
    pub values: usize,
    /// chi^2 after each step; the first is that of the start.
    pub history: Vec<f64>,
    /// Why the iteration ended.
    pub termination: ShootingTermination,
}

impl<const NX: usize> ShootingFit<NX> {
    /// Values minus unknowns: what chi^2 should be if model and noise are right.
    pub fn degrees_of_freedom(&self) -> f64 {
        let unknowns = NX * self.initial.len() + self.reduced.indices.len();
        self.values as f64 - unknowns as f64
    }
}

/// Beyond this damping a step is shorter than rounding.
const LARGEST_DAMPING: f64 = 1e12;

/// At the beginning of a fit, and where the slopes that it was found for are left.
const FIRST_DAMPING: f64 = 1e-3;

/// A step with less is one without.
const SMALLEST_DAMPING: f64 = 1e-12;

/// How far to each side of a kink is looked, in what would cost the tolerance if there were none. That
/// does not matter; ten times as much is the way back from a kink beside the minimum.
const BESIDE_KINK: [f64; 4] = [1.0, -1.0, 10.0, -10.0];

/// Added to the unit diagonal, so that parameters that only act together still have a step.
const ROUNDING: f64 = 1e-14;

impl<M, const NX: usize, const NY: usize> ShootingProblem<'_, M, NX, NY>
where
    M: ShootingModel<NX, NY>,
{
    /// Fits the free parameters and all initial states, from `initial` and the unknowns' starts.
    ///
    /// Levenberg-Marquardt with each unknown measured by its own curvature. Bounds hold at every
    /// iterate: a parameter that wants to leave is held at its bound. After each step `progress`
    /// is told the number of steps.
    ///
    /// # Errors
    /// [`ShootingError`]: a mistake in the problem. That the iteration does not converge is none.
    pub fn fit(
        &self,
        initial: Vec<SVector<f64, NX>>,
        settings: &ShootingSettings,
        progress: &dyn Fn(usize),
    ) -> Result<ShootingFit<NX>, ShootingError> {
        let values = self.check(&initial)?;
        let free = indices(self.unknowns, |unknown| unknown.free);
        let start: Vec<f64> = self.unknowns.iter().map(|unknown| unknown.start).collect();
        let chi_square = self.finite_start(&start, &initial)?;
        let mut at = Iterate {
            parameters: start,
            initial,
            chi_square,
        };
        let mut damping = FIRST_DAMPING;
        let mut history = vec![at.chi_square];
        // Of values without noise nothing else is left.
        let rounding = self.rounding();
        let mut equations = Equations::new(self, &at, &free);
        let termination = loop {
            if history.len() > settings.max_iterations {
                break ShootingTermination::IterationCap {
                    cap: settings.max_iterations,
                };
            }
            let tolerance = settings.reduction_tolerance * at.chi_square / values as f64;
            let tolerance = tolerance.max(rounding);
            match equations.step(self, &at, &mut damping, tolerance) {
                Step::Better(next) => at = next,
                Step::Converged => break ShootingTermination::Converged,
                Step::None => break ShootingTermination::Stagnation,
            }
            equations = Equations::new(self, &at, &free);
            history.push(at.chi_square);
            progress(history.len() - 1);
        };
        Ok(ShootingFit {
            reduced: equations.reduced(self, &at),
            parameters: at.parameters,
            initial: at.initial,
            chi_square: at.chi_square,
            values,
            history,
            termination,
        })
    }

    /// The number of measured values, if the problem makes sense.
    fn check(&self, initial: &[SVector<f64, NX>]) -> Result<usize, ShootingError> {
        let segments = self.model.segments();
        if initial.len() != segments {
            return Err(ShootingError::InitialStates {
                expected: segments,
                found: initial.len(),
            });
        }
        let positive = |what: String, value: f64| {
            let right = value > 0.0 && value.is_finite();
            let allowed = "positive and finite";
            let error = ShootingError::Value {
                what,
                value,
                allowed,
            };
            if right { Ok(()) } else { Err(error) }
        };
        for segment in 0..segments {
            for (output, noise) in self.model.noise(segment).iter().enumerate() {
                positive(format!("the noise of output {output}"), *noise)?;
            }
        }
        for (state, scale) in self.state_scale.iter().enumerate() {
            positive(format!("the scale of state {state}"), *scale)?;
        }
        for (index, unknown) in self.unknowns.iter().enumerate() {
            positive(format!("the scale of parameter {index}"), unknown.scale)?;
            if !(unknown.lower <= unknown.start && unknown.start <= unknown.upper) {
                return Err(ShootingError::Value {
                    what: format!("the start of parameter {index}"),
                    value: unknown.start,
                    allowed: "a number within its bounds",
                });
            }
        }
        let (values, states) = (self.values(), NX * segments);
        let parameters = self.unknowns.iter().filter(|unknown| unknown.free).count();
        if values <= states + parameters {
            return Err(ShootingError::TooFewValues {
                values,
                segments,
                unknowns: states + parameters,
                states,
                parameters,
            });
        }
        Ok(values)
    }

    /// chi^2 at the start, if every segment can be simulated.
    fn finite_start(
        &self,
        parameters: &[f64],
        initial: &[SVector<f64, NX>],
    ) -> Result<f64, ShootingError> {
        let chi_square = self.chi_square(parameters, initial);
        if chi_square.is_finite() {
            return Ok(chi_square);
        }
        let segment = (0..initial.len()).find(|&segment| {
            let initial = &initial[segment];
            !self
                .segment_chi_square(segment, parameters, initial, &mut Vec::new())
                .is_finite()
        });
        Err(ShootingError::NonFiniteStart {
            segment: segment.unwrap_or(0),
        })
    }
}

fn indices(unknowns: &[Unknown], which: impl Fn(&Unknown) -> bool) -> Vec<usize> {
    let unknowns = unknowns.iter().enumerate();
    unknowns
        .filter(|(_, unknown)| which(unknown))
        .map(|(index, _)| index)
        .collect()
}

#[derive(Debug, Clone)]
struct Iterate<const NX: usize> {
    parameters: Vec<f64>,
    initial: Vec<SVector<f64, NX>>,
    chi_square: f64,
}

enum Step<const NX: usize> {
    Better(Iterate<NX>),
    Converged,
    None,
}

/// information^-1 right, in a scaling to a unit diagonal: the parameters' units are of no concern. What
/// nothing tells of is zero.
fn solved(information: &DMatrix<f64>, right: &DVector<f64>) -> Option<DVector<f64>> {
    let scale = information
        .diagonal()
        .map(|entry| if entry > 0.0 { 1.0 / entry.sqrt() } else { 0.0 });
    let scaling = DMatrix::from_diagonal(&scale);
    let mut scaled = &scaling * information * &scaling;
    for i in 0..right.len() {
        scaled[(i, i)] += ROUNDING;
    }
    let solution = scaled.cholesky()?.solve(&scale.component_mul(right));
    Some(scale.component_mul(&solution))
}

/// The normal equations at an iterate.
struct Equations<'a, const NX: usize> {
    free: &'a [usize],
    blocks: Vec<Block<NX>>,
    prior_information: DMatrix<f64>,
    prior_gradient: DVector<f64>,
}

impl<'a, const NX: usize> Equations<'a, NX> {
    fn new<M: ShootingModel<NX, NY>, const NY: usize>(
        problem: &ShootingProblem<'_, M, NX, NY>,
        at: &Iterate<NX>,
        free: &'a [usize],
    ) -> Self {
        let (prior_information, prior_gradient) = problem.prior_equations(&at.parameters, free);
        Self {
            free,
            blocks: problem.blocks(&at.parameters, &at.initial, free),
            prior_information,
            prior_gradient,
        }
    }

    fn eliminated(&self, damping: f64) -> (DMatrix<f64>, DVector<f64>) {
        let start = (self.prior_information.clone(), self.prior_gradient.clone());
        self.blocks.iter().fold(start, |(h, g), block| {
            let (information, gradient) = block.eliminated(damping);
            (h + information, g + gradient)
        })
    }

    /// Places among the free parameters that are not held at a bound.
    fn inside(&self, unknowns: &[Unknown], parameters: &[f64]) -> Vec<usize> {
        let (_, gradient) = self.eliminated(0.0);
        let inside = |place: &usize| {
            let (unknown, value) = (&unknowns[self.free[*place]], parameters[self.free[*place]]);
            let held_below = value <= unknown.lower && gradient[*place] >= 0.0;
            let held_above = value >= unknown.upper && gradient[*place] <= 0.0;
            !(held_below || held_above)
        };
        (0..self.free.len()).filter(inside).collect()
    }

    /// What is left of them where the parameters at a bound are held.
    fn reduced<M: ShootingModel<NX, NY>, const NY: usize>(
        &self,
        problem: &ShootingProblem<'_, M, NX, NY>,
        at: &Iterate<NX>,
    ) -> Reduced {
        let inside = self.inside(problem.unknowns, &at.parameters);
        let indices: Vec<usize> = inside.iter().map(|&place| self.free[place]).collect();
        let blocks: Vec<Block<NX>> = self.blocks.iter().map(|one| one.of(&inside)).collect();
        problem.reduced_from(&blocks, &at.parameters, &indices)
    }

    /// The step of the free parameters and by how much it lowers chi^2 of the quadratic model.
    fn newton(&self, inside: &[usize], damping: f64) -> Option<(DVector<f64>, f64)> {
        let (information, gradient) = self.eliminated(damping);
        let information = information.select_columns(inside).select_rows(inside);
        let gradient = gradient.select_rows(inside);
        let reduced = -solved(&information, &gradient)?;
        let mut step = DVector::zeros(self.free.len());
        for (value, place) in reduced.iter().zip(inside) {
            step[*place] = *value;
        }
        step.iter()
            .all(|value| value.is_finite())
            .then(|| (step, -gradient.dot(&reduced)))
    }

    fn step<M: ShootingModel<NX, NY>, const NY: usize>(
        &self,
        problem: &ShootingProblem<'_, M, NX, NY>,
        at: &Iterate<NX>,
        damping: &mut f64,
        tolerance: f64,
    ) -> Step<NX> {
        let inside = self.inside(problem.unknowns, &at.parameters);
        // What an undamped step of everything would gain, states included.
        let possible = self.newton(&inside, 0.0).map(|(_, gain)| gain);
        if possible.is_some_and(|gain| gain + self.state_gain() <= tolerance) {
            return Step::Converged;
        }
        let next = self.damped_step(problem, at, &inside, damping);
        let little = next
            .as_ref()
            .is_none_or(|next| at.chi_square - next.chi_square <= tolerance);
        // More was promised.
        if little && let Some(step) = self.step_at_kink(problem, at, &inside, tolerance) {
            *damping = FIRST_DAMPING;
            return step;
        }
        next.map_or(Step::None, Step::Better)
    }

    /// The first step of these places that lowers chi^2, with more and more damping.
    fn damped_step<M: ShootingModel<NX, NY>, const NY: usize>(
        &self,
        problem: &ShootingProblem<'_, M, NX, NY>,
        at: &Iterate<NX>,
        places: &[usize],
        damping: &mut f64,
    ) -> Option<Iterate<NX>> {
        while *damping < LARGEST_DAMPING {
            let next = self
                .newton(places, *damping)
                .map(|(step, _)| self.moved(problem, at, &step, *damping));
            match next {
                Some(next) if next.chi_square < at.chi_square => {
                    *damping = (*damping / 10.0).max(SMALLEST_DAMPING);
                    return Some(next);
                }
                _ => *damping *= 10.0,
            }
        }
        None
    }

    /// What to do where chi^2 may have a kink. The slopes are those of one side there, and what they
    /// promise is not to be had on the other: no step follows them, not even from the minimum. So the
    /// parameters with kinks are held until all else is at its minimum, and are then tried to both
    /// sides. `None` where no parameter has kinks, or the others do not get to their minimum.
    fn step_at_kink<M: ShootingModel<NX, NY>, const NY: usize>(
        &self,
        problem: &ShootingProblem<'_, M, NX, NY>,
        at: &Iterate<NX>,
        inside: &[usize],
        tolerance: f64,
    ) -> Option<Step<NX>> {
        let (kinked, smooth): (Vec<usize>, Vec<usize>) = inside
            .iter()
            .partition(|place| problem.unknowns[self.free[**place]].kinked);
        if kinked.is_empty() {
            return None;
        }
        let better = |next: &Iterate<NX>| at.chi_square - next.chi_square > tolerance;
        let (_, gain) = self.newton(&smooth, 0.0)?;
        let at_rest = gain + self.state_gain() <= tolerance;
        if !at_rest {
            // Nothing bends here: the whole step is the right one.
            let mut damping = SMALLEST_DAMPING;
            let next = self.damped_step(problem, at, &smooth, &mut damping);
            return next.map(Step::Better);
        }
        let mut best: Option<Iterate<NX>> = None;
        for place in kinked {
            let little = self.deviation(place, inside)? * tolerance.sqrt();
            for times in BESIDE_KINK {
                let next = self.beside(problem, at, (place, times * little), &smooth)?;
                if best
                    .as_ref()
                    .is_none_or(|best| next.chi_square < best.chi_square)
                {
                    best = Some(next);
                }
            }
        }
        Some(best.filter(better).map_or(Step::Converged, Step::Better))
    }

    /// The standard deviation of the parameter at one of the places `inside`, the others unknown, too.
    fn deviation(&self, place: usize, inside: &[usize]) -> Option<f64> {
        let (information, _) = self.eliminated(0.0);
        let information = information.select_columns(inside).select_rows(inside);
        let row = inside.iter().position(|one| *one == place)?;
        let unit = DVector::from_fn(inside.len(), |i, _| if i == row { 1.0 } else { 0.0 });
        let deviation = solved(&information, &unit)?[row].sqrt();
        deviation.is_finite().then_some(deviation)
    }

    /// The iterate with the parameter at one place moved by so much, those of the places `others` and the
    /// states at their minimum beside it, by the slopes that they have there.
    fn beside<M: ShootingModel<NX, NY>, const NY: usize>(
        &self,
        problem: &ShootingProblem<'_, M, NX, NY>,
        at: &Iterate<NX>,
        (place, by): (usize, f64),
        others: &[usize],
    ) -> Option<Iterate<NX>> {
        let mut step = DVector::zeros(self.free.len());
        step[place] = by;
        let moved = self.moved(problem, at, &step, 0.0);
        let there = Self::new(problem, &moved, self.free);
        let (step, _) = there.newton(others, 0.0)?;
        Some(there.moved(problem, &moved, &step, 0.0))
    }

    /// By how much undamped steps of the states alone lower chi^2 of the quadratic model.
    fn state_gain(&self) -> f64 {
        self.blocks.iter().map(Block::state_gain).sum()
    }

    /// The iterate after a step of the free parameters, cut at the bounds.
    fn moved<M: ShootingModel<NX, NY>, const NY: usize>(
        &self,
        problem: &ShootingProblem<'_, M, NX, NY>,
        at: &Iterate<NX>,
        step: &DVector<f64>,
        damping: f64,
    ) -> Iterate<NX> {
        let mut parameters = at.parameters.clone();
        for (value, &index) in step.iter().zip(self.free) {
            let unknown = &problem.unknowns[index];
            parameters[index] = (parameters[index] + value).clamp(unknown.lower, unknown.upper);
        }
        let places = self.free.iter();
        let taken = places.map(|&index| parameters[index] - at.parameters[index]);
        let taken = DVector::from_iterator(self.free.len(), taken);
        let pairs = at.initial.iter().zip(&self.blocks);
        let initial: Vec<_> = pairs
            .map(|(initial, block)| initial + block.state_step(&taken, damping))
            .collect();
        let chi_square = problem.chi_square(&parameters, &initial);
        Iterate {
            parameters,
            initial,
            chi_square,
        }
    }
}
