//! The dual active-set method (Goldfarb and Idnani 1983) in the normalised deviations v.
//!
//! Start at the minimiser without bounds; take the bound that is violated most, move along the
//! direction that restores it while the working set stays satisfied, and drop a bound whose
//! multiplier would change sign on the way. The dual cost grows with every change, so the end
//! is reached in finitely many. A soft bound's linear price is a cap on its multiplier; its
//! quadratic price is a compliance of its row.

use crate::list::List;
use crate::memory::DualMemory;
use crate::model::Scalar;
use crate::ocp::Ocp;
use crate::riccati::StageFactor;
use crate::rows::{self, Candidate, Trajectory};
use crate::solution::{ActiveRow, ActiveSet, BoundId, Part, Quantity, Side, Status};
use crate::working_set::{Direction, Row, Terms, WorkingSet};
use nalgebra::{SVector, convert};

/// An earlier bound with less than this part of its violation left waits for the next look along the trajectory.
const LEFT: f64 = 0.5;

/// Scratch memory and state of the dual method.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub(crate) struct DualActiveSet<T: 'static, const NU: usize> {
    /// Normalised deviations of the current minimiser.
    pub v: List<SVector<T, NU>>,
    pub(crate) working: WorkingSet<T, NU>,
    /// Rows whose multiplier stays where it is: exceeded soft bounds at their linear price, and
    /// bounds that hold to rounding because other rows do.
    pub(crate) resting: ActiveSet<T>,
    pub(crate) candidate: Row<T, NU>,
    pub(crate) direction: Direction<T, NU>,
    /// Scratch: what the multipliers leave of v.
    pub(crate) rest: List<SVector<T, NU>>,
    /// Scratch: a step of the working rows' slacks, and their multipliers after it.
    pub(crate) step: List<T>,
    pub(crate) multipliers: List<T>,
    /// Relative violation that counts as none.
    pub(crate) tolerance: T,
    /// Relative violation that counts as rounding where no step can remove it.
    pub(crate) loosest: T,
    pub changes: usize,
    max_changes: usize,
    /// An entry of v differs by no more from the sum of multiplier * alpha over the active rows, which rounding allows for.
    pub(crate) unexplained: T,
    /// Refinements that are left.
    pub(crate) refinements: usize,
    /// Sign of the candidate's multiplier where it contradicts the working set; zero before.
    contradicting: T,
    /// Whether every change is followed by a look along the trajectory.
    pub one_at_a_time: bool,
}

/// Why a step along the direction ends.
enum StepEnd {
    /// The candidate holds with equality.
    Full,
    /// The candidate's multiplier reaches its linear price.
    Cap,
    /// The multiplier of the working row at this position reaches 0 or its linear price.
    Blocked(usize),
}

impl<T: Scalar, const NU: usize> DualActiveSet<T, NU> {
    pub fn new(memory: DualMemory<T, NU>) -> Self {
        let stages = memory.deviations[0].len();
        let most = memory.rows(stages);
        let [v, alpha, primal, rest] = memory.deviations;
        let [coefficients, spanned, dual, step, multipliers] = memory.numbers;
        Self {
            working: WorkingSet::new((memory.terms, most), memory.factor, (memory.basis, stages)),
            resting: ActiveSet::new(memory.resting),
            candidate: Row::new(alpha),
            direction: Direction::new(primal, [coefficients, spanned, dual]),
            v,
            rest,
            step,
            multipliers,
            tolerance: T::zero(),
            loosest: T::zero(),
            changes: 0,
            max_changes: 0,
            unexplained: T::zero(),
            refinements: 0,
            contradicting: T::zero(),
            one_at_a_time: false,
        }
    }

    /// Back to the minimiser without bounds.
    pub fn reset(&mut self, tolerance: T, max_changes: usize) {
        self.v.fill(SVector::zeros());
        self.working.clear();
        self.resting.clear();
        self.tolerance = tolerance;
        self.loosest = tolerance.max(T::default_epsilon().sqrt());
        self.changes = 0;
        self.unexplained = T::zero();
        self.max_changes = max_changes;
        self.refinements = 3;
        self.contradicting = T::zero();
        self.one_at_a_time = false;
    }

    /// Back to the minimiser without bounds, with the changes that are left.
    pub fn begin_again(&mut self) {
        let left = self.changes_left();
        self.reset(self.tolerance, left);
    }

    /// The bound that is violated most, and the one that is violated most of those before it along the horizon.
    pub fn most_violated<const NX: usize>(
        &self,
        ocp: &Ocp<T, NX, NU>,
        trajectory: &Trajectory<'_, T, NX, NU>,
    ) -> [Option<Candidate<T>>; 2] {
        let [mut worst, mut earlier]: [Option<Candidate<T>>; 2] = [None; 2];
        let mut least = -T::one();
        rows::violated_bounds(ocp, trajectory, &mut |candidate| {
            // Negated, so that a violation that is NaN counts; it stays the worst.
            if !(candidate.rank <= least)
                && worst.is_none_or(|worst| worst.slack.is_finite())
                && !(candidate.violation() <= self.tolerance)
                && let Some(part) = self.free_part(&candidate)
            {
                least = candidate.rank;
                earlier = worst.replace(Candidate { part, ..candidate });
                if self.one_at_a_time {
                    earlier = None;
                }
            }
        });
        for row in self.resting.iter().filter(|row| row.exceeded) {
            let slack = rows::slack(ocp, trajectory, &row.bound);
            let limits = rows::limits(ocp, &row.bound);
            let violation = slack / rows::size_of_bound(limits.0, limits.1);
            let rank = slack / rows::room(ocp, &row.bound);
            if rank > least && violation > self.tolerance {
                least = rank;
                earlier = None;
                worst = Some(Candidate {
                    bound: row.bound,
                    part: row.part,
                    soft: rows::soft_price(ocp, &row.bound),
                    slack,
                    limits,
                    rank,
                });
            }
        }
        [worst, earlier]
    }

    /// The part of the candidate's price that is neither in the working set nor exceeded.
    fn free_part(&self, candidate: &Candidate<T>) -> Option<Part> {
        let held = |part| self.has(&candidate.bound, part);
        match candidate.soft {
            None => (!held(Part::Hard)).then_some(Part::Hard),
            Some(price) if price.linear > T::zero() && !held(Part::Linear) => Some(Part::Linear),
            Some(price) => {
                let rests = price.linear <= T::zero()
                    || self.resting.iter().any(|row| row.bound == candidate.bound);
                (rests && price.quadratic > T::zero() && !held(Part::Quadratic))
                    .then_some(Part::Quadratic)
            }
        }
    }

    /// Whether this part of the bound's price is in the working set or exceeded.
    #[inline(never)]
    fn has(&self, bound: &BoundId, part: Part) -> bool {
        let same = |row: &ActiveRow<T>| row.bound == *bound && row.part == part;
        self.working.rows().iter().any(|row| same(&row.active))
            || self.resting.at(bound.stage).any(|row| same(&row))
    }

    /// Makes every component of the terminal equality a row that is always active.
    pub fn impose_terminal_equality<const NX: usize>(
        &mut self,
        ocp: &Ocp<T, NX, NU>,
        factors: &[StageFactor<T, NX, NU>],
        x_n: &SVector<T, NX>,
    ) -> Result<(), Status<T>> {
        let Some(target) = &ocp.terminal.equality else {
            return Ok(());
        };
        for (j, (reached, target)) in x_n.iter().zip(target.iter()).enumerate() {
            let bound = BoundId {
                stage: ocp.length(),
                quantity: Quantity::State(j),
                side: Side::Equality,
            };
            rows::form_row(ocp, factors, bound, Part::Hard, None, &mut self.candidate);
            // `reached` belongs to v = 0; the rows before have moved v since.
            let moved = self.candidate.dot(&self.v);
            let slack = *reached - *target + moved;
            if !slack.is_finite() {
                return Err(Status::NotFinite);
            }
            self.working.direction(&self.candidate, &mut self.direction);
            if self.direction.slope > T::zero() {
                if self.working.is_full() {
                    return Err(Status::WorkingSetFull);
                }
                self.advance(-slack / self.direction.slope);
                self.working.append(&self.candidate, &self.direction);
            } else if !(slack.abs() <= self.loosest * (T::one() + target.abs())) {
                return Err(self.conflict(bound, -slack));
            }
        }
        Ok(())
    }

    /// Takes the bound that is violated most into the working set, and with it the `earlier` one if it is still violated
    /// then, which saves a rollout.
    pub fn satisfy<const NX: usize>(
        &mut self,
        ocp: &Ocp<T, NX, NU>,
        factors: &[StageFactor<T, NX, NU>],
        violated: &Candidate<T>,
        earlier: Option<Candidate<T>>,
    ) -> Result<(), Status<T>> {
        self.form(ocp, factors, violated);
        let step = self.take_in(violated)?;
        if let (Some(mut earlier), Some(step)) = (earlier, step) {
            self.form(ocp, factors, &earlier);
            let before = earlier.slack;
            earlier.slack += self.candidate.dot(&self.direction.primal) * step;
            if earlier.slack < before * convert(LEFT) && earlier.violation() > self.tolerance {
                self.take_in(&earlier)?;
            }
        }
        Ok(())
    }

    /// Writes the row of the bound to the candidate.
    fn form<const NX: usize>(
        &mut self,
        ocp: &Ocp<T, NX, NU>,
        factors: &[StageFactor<T, NX, NU>],
        violated: &Candidate<T>,
    ) {
        let Candidate {
            bound, part, soft, ..
        } = *violated;
        rows::form_row(ocp, factors, bound, part, soft, &mut self.candidate);
    }

    /// Takes the candidate, whose bound is `violated`, into the working set, dropping rows whose multiplier forbids it.
    /// Returns how far v has moved along the direction, if that was the only one.
    #[inline(never)]
    fn take_in(&mut self, violated: &Candidate<T>) -> Result<Option<T>, Status<T>> {
        let bound = violated.bound;
        let mut slack = violated.slack;
        let mut single = true;
        if !slack.is_finite() {
            // The trajectory is finite: a bound at plus or minus infinity, or no number at all.
            return Err(if slack < T::zero() {
                self.direction.dual.fill(T::zero());
                self.conflict(bound, T::one())
            } else {
                Status::NotFinite
            });
        }
        if slack > T::zero() {
            self.take_back_exceeded(violated);
            slack = -slack;
        }
        loop {
            self.count_change()?;
            self.working.direction(&self.candidate, &mut self.direction);
            if !self.direction.slope.is_finite() {
                return Err(Status::NotFinite);
            }
            if self.is_rounding(slack) {
                self.rest(self.candidate.terms.reported())?;
                return Ok(None);
            }
            let Some((step, end)) = self.step_length(slack) else {
                self.accept_rounding_or_fail(violated, slack)?;
                return Ok(None);
            };
            if !step.is_finite() {
                return Err(Status::NotFinite);
            }
            self.advance(step);
            slack += step * self.direction.slope;
            match end {
                StepEnd::Full if self.working.is_full() => return Err(Status::WorkingSetFull),
                StepEnd::Full => {
                    self.working.append(&self.candidate, &self.direction);
                    return Ok(single.then_some(step));
                }
                StepEnd::Cap => {
                    let row = self.candidate.terms;
                    self.release(&row)?;
                    return Ok(None);
                }
                StepEnd::Blocked(position) => {
                    let row = self.working.remove(position);
                    self.release(&row)?;
                    single = false;
                }
            }
        }
    }

    /// Whether a violation is no larger than what rounding makes of it: the candidate then
    /// holds as well as the working rows that it depends on.
    fn is_rounding(&self, slack: T) -> bool {
        let squares = self.v.iter().map(|v| v.norm_squared());
        let length_squared = squares.fold(T::zero(), |sum, square| sum + square);
        let length = slack / self.direction.noise;
        length * length <= length_squared
    }

    /// Changes of the active set that are still allowed.
    pub fn changes_left(&self) -> usize {
        self.max_changes - self.changes
    }

    /// No more than so many are allowed in all.
    pub fn allow_at_most(&mut self, changes: usize) {
        self.max_changes = self.max_changes.min(changes);
    }

    /// So many of them are for later, or another method.
    pub fn keep_back(&mut self, changes: usize) {
        self.max_changes = self.max_changes.saturating_sub(changes);
    }

    /// So many that were kept back are allowed now.
    pub fn give_back(&mut self, changes: usize) {
        self.max_changes += changes;
    }

    /// Counts one more change of the active set.
    pub(crate) fn count_change(&mut self) -> Result<(), Status<T>> {
        if self.changes >= self.max_changes {
            return Err(Status::MaxChanges);
        }
        self.changes += 1;
        Ok(())
    }

    /// A mirrored row has the opposite slack, and its multiplier counts down from the cap.
    fn take_back_exceeded(&mut self, violated: &Candidate<T>) {
        self.resting
            .retain(|row| row.bound != violated.bound || row.part != violated.part);
        self.candidate.terms.mirrored = true;
        for alpha in self.candidate.alpha.iter_mut() {
            *alpha = -*alpha;
        }
    }

    /// A row leaves at one end of its multiplier's interval. At the linear price, which in the
    /// mirror is the other end, it stays an exceeded bound.
    pub(crate) fn release(&mut self, row: &Terms<T>) -> Result<(), Status<T>> {
        let at_cap = row.cap.is_finite() && row.active.multiplier > row.cap * convert(0.5);
        if at_cap == row.mirrored {
            return Ok(());
        }
        self.rest(ActiveRow {
            multiplier: row.cap,
            exceeded: true,
            ..row.active
        })
    }

    fn rest(&mut self, row: ActiveRow<T>) -> Result<(), Status<T>> {
        if self.resting.push(row) {
            Ok(())
        } else {
            Err(Status::WorkingSetFull)
        }
    }

    /// How far the candidate's multiplier may grow; `None` if without end.
    fn step_length(&self, slack: T) -> Option<(T, StepEnd)> {
        let mut shortest = None;
        let mut keep = |step: T, end: StepEnd| {
            if !matches!(&shortest, Some((best, _)) if *best <= step) {
                shortest = Some((step.max(T::zero()), end));
            }
        };
        if self.direction.slope > T::zero() {
            keep(-slack / self.direction.slope, StepEnd::Full);
        }
        if self.candidate.terms.cap.is_finite() {
            let room = self.candidate.terms.cap - self.candidate.terms.active.multiplier;
            keep(room, StepEnd::Cap);
        }
        let rows = self.working.rows().iter().zip(self.direction.dual.iter());
        for (position, (row, rate)) in rows.enumerate() {
            if row.equality {
                continue;
            }
            if *rate > T::zero() {
                keep(row.active.multiplier / *rate, StepEnd::Blocked(position));
            } else if *rate < T::zero() && row.cap.is_finite() {
                let room = row.cap - row.active.multiplier;
                keep(room / -*rate, StepEnd::Blocked(position));
            }
        }
        shortest
    }

    /// The candidate depends on the working set and no multiplier blocks: the problem is
    /// infeasible, unless the violation is of the size of rounding.
    fn accept_rounding_or_fail(
        &mut self,
        violated: &Candidate<T>,
        slack: T,
    ) -> Result<(), Status<T>> {
        let violation = violated.violation() * (slack / violated.slack).abs();
        if violation <= self.loosest && violated.part == Part::Hard {
            self.rest(self.candidate.terms.reported())
        } else {
            Err(self.conflict(violated.bound, T::one()))
        }
    }

    /// The candidate, the row of `bound`, contradicts the working set as far as the numbers can tell;
    /// whether that is a proof is for the caller to check. Its multiplier counts in the direction of `sign`.
    fn conflict(&mut self, bound: BoundId, sign: T) -> Status<T> {
        self.contradicting = T::one().copysign(sign);
        Status::Inaccurate(bound)
    }

    /// Leaves in `proof` the multipliers of the last conflict, if there was one: those of the working
    /// set move with the candidate's so that the rows cancel out.
    pub fn report_conflict(&self, proof: &mut ActiveSet<T>) -> bool {
        let sign = self.contradicting;
        proof.clear();
        if sign == T::zero() {
            return false;
        }
        let candidate = ActiveRow {
            multiplier: sign,
            ..self.candidate.terms.active
        };
        let rates = self.direction.dual.iter();
        let mut rows = self.working.rows().iter().zip(rates);
        let rounding = self.direction.size * T::default_epsilon();
        proof.push(candidate)
            && rows.all(|(row, rate)| {
                let multiplier = -*rate * sign;
                // What is smaller is rounding.
                let counts = row.equality || multiplier * row.size > rounding;
                !counts
                    || proof.push(ActiveRow {
                        multiplier,
                        ..row.active
                    })
            })
    }

    /// One step along the direction.
    fn advance(&mut self, step: T) {
        let rates = self.direction.dual.iter();
        for (row, rate) in self.working.rows_mut().iter_mut().zip(rates) {
            row.active.multiplier -= step * *rate;
        }
        self.candidate.terms.active.multiplier += step;
        self.unexplained += self.direction.noise * step.abs();
        for (v, change) in self.v.iter_mut().zip(self.direction.primal.iter()) {
            *v += change * step;
        }
    }

    /// The active rows, with multipliers in the bounds' own direction.
    pub(crate) fn active(&self) -> impl Iterator<Item = ActiveRow<T>> {
        let working = self.working.rows().iter().map(Terms::reported);
        // What rests without a multiplier holds because other rows do.
        let resting = self.resting.iter();
        working.chain(resting.filter(|row| row.multiplier != T::zero()))
    }

    /// Hands over the active rows.
    pub fn report(&self, active: &mut ActiveSet<T>) -> bool {
        active.clear();
        self.active().all(|row| active.push(row))
    }
}
