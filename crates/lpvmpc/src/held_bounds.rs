//! Bounds that are held by the factorisation, instead of as rows of the dual method.
//!
//! A bound as a row is met by pushing the regulator away from what it would ask for. Where that is
//! many times the bound, the bound drowns in the rounding of the difference. An input that is held is
//! no unknown any more: it is exact, and the regulator is that of the other inputs. A single input can
//! hold a state behind its stage instead, whatever that costs.

use crate::adjoint::Adjoint;
use crate::list::List;
use crate::model::Scalar;
#[cfg(feature = "alloc")]
use crate::ocp::Bounds;
use crate::ocp::{Common, Ocp};
use crate::riccati::{Adjustment, BadPivot, CostToGo, StageFactor, StageMinimum};
#[cfg(feature = "alloc")]
use crate::rows::size_of_bound;
use crate::rows::{self, Trajectory};
#[cfg(feature = "alloc")]
use crate::small_matrix::transposed_product;
use crate::solution::{ActiveRow, ActiveSet, BoundId, Part, Quantity, Side, Solution, Status};
use crate::solver::{Solver, Start};
use crate::transposed::StageBothWays;

/// Searches with held inputs; two are enough in `f64`, more than ten are rare in `f32`.
const MOST_SEARCHES: usize = 20;
/// Whether bounds drown is looked at where the number of changes is a multiple of this.
#[cfg(feature = "alloc")]
const CHANGES_PER_LOOK: usize = 64;

/// What an input holds at a bound: nothing, itself, or, if it is a single one, a component of the next state. In a byte, of
/// which a microcontroller has few.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct HeldBound(u8);

impl HeldBound {
    pub const NOTHING: Self = Self(0);

    /// The input itself, or the component `state` of the next state.
    fn new(state: Option<usize>, side: Side) -> Self {
        let side = if side == Side::Upper { 2 } else { 1 };
        let place = state.map_or(Some(0), |j| u8::try_from(j + 1).ok());
        place
            .filter(|place| *place < 64)
            .map_or(Self::NOTHING, |place| Self(place << 2 | side))
    }

    /// The component of the next state, or none for the input itself, and the side.
    fn get(self) -> Option<(Option<usize>, Side)> {
        let side = match self.0 & 3 {
            0 => return None,
            1 => Side::Lower,
            _ => Side::Upper,
        };
        Some((usize::from(self.0 >> 2).checked_sub(1), side))
    }
}

/// What the inputs of a stage hold.
pub(crate) type HeldAt<const NU: usize> = [HeldBound; NU];

/// What is held at every stage.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub(crate) struct HeldBounds<const NU: usize> {
    stages: List<HeldAt<NU>>,
    any: bool,
}

/// What the multipliers of the held bounds say.
pub(crate) struct Verdict<T> {
    /// How many bounds were let go.
    pub released: usize,
    /// All others found a place among the active rows.
    pub listed: bool,
    /// What is left of the gradient in the inputs that hold nothing, relative to its largest term.
    pub rest: T,
}

impl<const NU: usize> HeldBounds<NU> {
    /// None, in memory for as many stages as these.
    pub fn none(mut stages: List<HeldAt<NU>>) -> Self {
        stages.fill([HeldBound::NOTHING; NU]);
        Self { stages, any: false }
    }

    pub fn release_all(&mut self) {
        self.stages.fill([HeldBound::NOTHING; NU]);
        self.any = false;
    }

    /// What is held at `stage`; `None` where nothing is.
    #[inline(always)]
    pub fn at(&self, stage: usize) -> Option<&HeldAt<NU>> {
        if self.any {
            self.stages
                .get(stage)
                .filter(|held| **held != [HeldBound::NOTHING; NU])
        } else {
            None
        }
    }

    /// Holds the inputs whose bounds are among `rows`; whether that is news.
    fn take_in<T: Scalar>(&mut self, rows: impl Iterator<Item = ActiveRow<T>>) -> bool {
        let mut news = false;
        for row in rows {
            if let Quantity::Input(_) = row.bound.quantity {
                news |= self.hold(row.bound);
            }
        }
        news
    }

    /// Holds a bound, if there is an input that can, instead of what it holds; whether that is news.
    #[inline(never)]
    pub fn hold(&mut self, bound: BoundId) -> bool {
        let BoundId {
            stage,
            quantity,
            side,
        } = bound;
        let (stage, input, state) = match quantity {
            Quantity::Input(j) => (Some(stage), j, None),
            Quantity::State(j) if NU == 1 => (stage.checked_sub(1), 0, Some(j)),
            _ => return false,
        };
        let held = stage.and_then(|stage| self.stages.get_mut(stage));
        let Some(place) = held.and_then(|held| held.get_mut(input)) else {
            return false;
        };
        let bound = HeldBound::new(state, side);
        let news = *place != bound;
        *place = bound;
        self.any |= news;
        news
    }

    /// Lets go of the bounds that are not needed, by the cost of `trajectory` and the rows
    /// `active`, or by these rows alone: their multiplier is below zero. The others join `active`.
    pub fn release<T: Scalar, const NX: usize>(
        &mut self,
        ocp: &Ocp<T, NX, NU>,
        trajectory: Option<&Trajectory<'_, T, NX, NU>>,
        active: &mut ActiveSet<T>,
        tolerance: T,
    ) -> Verdict<T> {
        let (mut largest, mut rest) = (T::zero(), T::zero());
        let (mut released, mut listed) = (0, true);
        let mut adjoint = Adjoint::new(ocp, trajectory, active);
        while let Some(at) = adjoint.step(active) {
            largest = largest.max(at.dynamics.amax()).max(at.rows.amax());
            let Some(held) = self.stages.get_mut(at.stage) else {
                continue;
            };
            for (j, (place, slope)) in held.iter_mut().zip(at.gradient.iter()).enumerate() {
                let Some((state, side)) = place.get() else {
                    rest = rest.max(slope.abs());
                    continue;
                };
                let (slope, stage, quantity) = match state {
                    None => (*slope, at.stage, Quantity::Input(j)),
                    Some(j) => (adjoint.hold_state(&at, j), at.stage + 1, Quantity::State(j)),
                };
                let multiplier = if side == Side::Upper { -slope } else { slope };
                if multiplier < -tolerance * largest {
                    *place = HeldBound::NOTHING;
                    released += 1;
                } else {
                    listed &= active.push(ActiveRow {
                        bound: BoundId {
                            stage,
                            quantity,
                            side,
                        },
                        part: Part::Hard,
                        multiplier: multiplier.max(T::zero()),
                        exceeded: false,
                    });
                }
            }
        }
        Verdict {
            released,
            listed,
            rest: if rest > T::zero() {
                rest / largest
            } else {
                rest
            },
        }
    }
}

/// [`StageFactor::eliminate`] with what is `held`: inputs are constants, which no deviation moves, and so is the state
/// behind `stage`.
#[cold]
#[inline(never)]
pub(crate) fn eliminate_held<T: Scalar, const NX: usize, const NU: usize>(
    factor: &mut StageFactor<T, NX, NU>,
    (ocp, stage): (&Ocp<T, NX, NU>, usize),
    held: &HeldAt<NU>,
    cost_to_go: &mut CostToGo<T, NX>,
) -> Result<(), BadPivot<T>> {
    let common = ocp.common_at(stage);
    let Some(data) = ocp.stages.get(stage) else {
        return Ok(());
    };
    if let [Some((Some(j), side))] = held.map(HeldBound::get)[..] {
        let bound = BoundId {
            stage: stage + 1,
            quantity: Quantity::State(j),
            side,
        };
        factor.eliminate(data, common, cost_to_go)?;
        let (lower, upper) = rows::limits(ocp, &bound);
        let value = if side == Side::Upper { upper } else { lower };
        return factor.hold_state(data, j, value, cost_to_go);
    }
    let constants = Constants { held, common };
    factor.eliminate_adjusted(
        StageBothWays::new(data),
        common,
        cost_to_go,
        Some(&constants),
    )?;
    for (j, side) in held.iter().enumerate() {
        if *side != HeldBound::NOTHING {
            factor.inverse_factor[(j, j)] = T::zero();
        }
    }
    Ok(())
}

/// Inputs that are constants of a stage.
struct Constants<'a, T, const NX: usize, const NU: usize> {
    held: &'a HeldAt<NU>,
    common: &'a Common<T, NX, NU>,
}

impl<T: Scalar, const NX: usize, const NU: usize> Adjustment<T, NX, NU>
    for Constants<'_, T, NX, NU>
{
    fn adjust(&self, minimum: &mut StageMinimum<T, NX, NU>) {
        let bounds = &self.common.u;
        for (j, held) in self.held.iter().enumerate() {
            match held.get() {
                Some((_, Side::Upper)) => minimum.hold(j, bounds.upper[j]),
                Some(_) => minimum.hold(j, bounds.lower[j]),
                None => {}
            }
        }
    }
}

impl<T: Scalar, const NX: usize, const NU: usize> Solver<T, NX, NU> {
    /// Fails where the dual method, looked at now and then, has pushed an input so far from what the regulator asks for that
    /// its bound drowns in the rounding of the difference. The dual cost only grows: without held inputs the search
    /// would take thousands of changes more and end in the same place. Beside hard bounds of states and rows it goes on,
    /// for it may be on its way to a proof that they cannot be kept.
    #[cfg(feature = "alloc")]
    #[inline(always)]
    pub(crate) fn check_rounding(&self, ocp: &Ocp<T, NX, NU>) -> Result<(), Status<T>> {
        if self.dual.changes.is_multiple_of(CHANGES_PER_LOOK) && self.dual.changes > 0 {
            self.drowned_input(ocp)
                .map_or(Ok(()), |bound| Err(Status::Inaccurate(bound)))
        } else {
            Ok(())
        }
    }

    #[cfg(feature = "alloc")]
    #[cold]
    #[inline(never)]
    fn drowned_input(&self, ocp: &Ocp<T, NX, NU>) -> Option<BoundId> {
        let can_be_kept = |row: ActiveRow<T>| {
            matches!(row.bound.quantity, Quantity::Input(_)) || row.part != Part::Hard
        };
        if !self.dual.active().all(can_be_kept) {
            return None;
        }
        let policies = self.factors.iter().zip(self.dual.v.iter());
        let mut stages = policies.take(ocp.length()).enumerate();
        stages.find_map(|(stage, (factor, v))| {
            let pushed = transposed_product(&factor.inverse_factor, v);
            let Bounds { lower, upper } = &ocp.common_at(stage).u;
            let drowns = |j: &usize| {
                let bounded = lower[*j].is_finite() || upper[*j].is_finite();
                let rounding = pushed[*j].abs() * T::default_epsilon();
                bounded && rounding > size_of_bound(lower[*j], upper[*j])
            };
            (0..NU).find(drowns).map(|j| BoundId {
                stage,
                quantity: Quantity::Input(j),
                side: match pushed[j] > T::zero() {
                    true => Side::Lower,
                    false => Side::Upper,
                },
            })
        })
    }

    /// Tries to answer what the dual method could not, for the rounding at `bound`: with the inputs that
    /// it has found at their bounds held there. `spent` counts the changes of the active set.
    #[cold]
    #[inline(never)]
    pub(crate) fn search_with_held_inputs(
        &mut self,
        ocp: &Ocp<T, NX, NU>,
        solution: &mut Solution<T, NX, NU>,
        bound: BoundId,
        spent: &mut usize,
    ) -> Result<(), Status<T>> {
        self.held.take_in(self.dual.active());
        let inaccurate = Status::Inaccurate(bound);
        let outcome = match self.factorize(ocp) {
            Ok(()) => self.exchange_held_inputs(ocp, solution, inaccurate, spent),
            Err(_) => Err(inaccurate),
        };
        // Whoever follows the plan needs the regulator of the problem itself.
        self.held.release_all();
        self.factorize(ocp).and(outcome)
    }

    /// Searches with the held inputs, whose factors are known, and exchanges them after each, as long as
    /// that changes any. What ends without an answer is `inaccurate`.
    ///
    /// Those go that are pulled into their bounds, those come that the search has found at a bound. The
    /// answer of a search is among the choices of the next one, so that the cost does not rise and, but
    /// for rounding, no set of held inputs comes twice.
    pub(crate) fn exchange_held_inputs(
        &mut self,
        ocp: &Ocp<T, NX, NU>,
        solution: &mut Solution<T, NX, NU>,
        inaccurate: Status<T>,
        spent: &mut usize,
    ) -> Result<(), Status<T>> {
        let inaccurate = Err(inaccurate);
        let mut outcome = inaccurate;
        for search in 0..MOST_SEARCHES {
            if search > 0 && self.factorize(ocp).is_err() {
                return inaccurate;
            }
            outcome = self.search_again(ocp, solution, spent);
            let point = Trajectory {
                x: &solution.x,
                u: &solution.u,
            };
            let point = match outcome {
                Ok(()) => Some(&point),
                Err(Status::Inaccurate(_)) => None,
                Err(_) => break,
            };
            if point.is_none() {
                if let Some(infeasible) = self.prove(ocp, &mut solution.active) {
                    outcome = Err(infeasible);
                    break;
                }
                self.dual.report_conflict(&mut solution.active);
            }
            // What goes on for so long goes in circles, for rounding.
            let tolerance = if search < MOST_SEARCHES / 2 {
                self.dual.tolerance
            } else {
                self.dual.loosest
            };
            let verdict = self
                .held
                .release(ocp, point, &mut solution.active, tolerance);
            if outcome.is_ok() && verdict.released == 0 {
                if !verdict.listed {
                    outcome = Err(Status::WorkingSetFull);
                } else if !(verdict.rest <= self.dual.loosest) {
                    outcome = inaccurate;
                }
                break;
            }
            let news = self.held.take_in(self.dual.active());
            if !(verdict.released > 0 || news) {
                break;
            }
            outcome = inaccurate;
        }
        outcome
    }

    /// One search with the factors as they are, from the active rows of the last one but for those of
    /// inputs.
    fn search_again(
        &mut self,
        ocp: &Ocp<T, NX, NU>,
        solution: &mut Solution<T, NX, NU>,
        spent: &mut usize,
    ) -> Result<(), Status<T>> {
        solution.active.clear();
        for row in self.dual.active() {
            if !matches!(row.bound.quantity, Quantity::Input(_)) {
                solution.active.push(row);
            }
        }
        self.dual.begin_again();
        let begun = self.roll_out(ocp, solution);
        let outcome = begun.and_then(|()| self.search(ocp, Start::Last(0), solution));
        *spent += self.dual.changes;
        outcome
    }
}
