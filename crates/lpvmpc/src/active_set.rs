//! The dual active-set method (Goldfarb and Idnani 1983) in the normalised deviations v.
//!
//! Start at the minimiser without bounds; take the bound that is violated most, move along the
//! direction that restores it while the working set stays satisfied, and drop a bound whose
//! multiplier would change sign on the way. The dual cost grows with every change, so the end
//! is reached in finitely many. A soft bound's linear price is a cap on its multiplier; its
//! quadratic price is a compliance of its row.

use crate::model::Scalar;
use crate::ocp::Ocp;
use crate::riccati::StageFactor;
use crate::rows::{self, Candidate, Trajectory};
use crate::solution::{ActiveRow, ActiveSet, BoundId, Part, Quantity, Side, Status};
use crate::working_set::{Direction, Row, WorkingSet};
use nalgebra::{SVector, convert};

/// Scratch memory and state of the dual method.
#[derive(Clone, Debug)]
pub(crate) struct DualActiveSet<T, const NU: usize, const N: usize, const M: usize> {
    /// Normalised deviations of the current minimiser.
    pub v: [SVector<T, NU>; N],
    working: WorkingSet<T, NU, N, M>,
    /// Soft bounds whose multiplier rests at the linear price.
    exceeded: ActiveSet<T, M>,
    candidate: Row<T, NU, N>,
    direction: Direction<T, NU, N, M>,
    /// Relative violation that counts as none.
    tolerance: T,
    /// Tolerance that rounding may force, at most.
    loosest: T,
    pub changes: usize,
    max_changes: usize,
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

impl<T: Scalar, const NU: usize, const N: usize, const M: usize> DualActiveSet<T, NU, N, M> {
    pub fn new() -> Self {
        Self {
            v: [SVector::zeros(); N],
            working: WorkingSet::new(),
            exceeded: ActiveSet::new(),
            candidate: Row::empty(),
            direction: Direction::zeros(),
            tolerance: T::zero(),
            loosest: T::zero(),
            changes: 0,
            max_changes: 0,
        }
    }

    /// Back to the minimiser without bounds.
    pub fn reset(&mut self, tolerance: T, max_changes: usize) {
        self.v = [SVector::zeros(); N];
        self.working.clear();
        self.exceeded.clear();
        self.tolerance = tolerance;
        self.loosest = tolerance * convert(1e3);
        self.changes = 0;
        self.max_changes = max_changes;
    }

    /// The bound that is violated most, if any is.
    pub fn most_violated<const NX: usize, const NG: usize>(
        &self,
        ocp: &Ocp<T, NX, NU, N, NG>,
        trajectory: &Trajectory<'_, T, NX, NU, N>,
    ) -> Option<Candidate<T>> {
        let mut worst: Option<Candidate<T>> = None;
        let mut least = self.tolerance;
        rows::violated_bounds(ocp, trajectory, &mut |candidate| {
            // Negated, so that a violation that is not a number counts.
            if !(candidate.violation <= least)
                && let Some(part) = self.free_part(&candidate)
            {
                least = candidate.violation;
                worst = Some(Candidate { part, ..candidate });
            }
        });
        for row in self.exceeded.iter() {
            let slack = rows::slack(ocp, trajectory, &row.bound);
            if slack > least {
                least = slack;
                worst = Some(Candidate {
                    bound: row.bound,
                    part: row.part,
                    soft: rows::soft_price(ocp, &row.bound),
                    slack,
                    violation: slack,
                });
            }
        }
        worst
    }

    /// The part of the candidate's price that is neither in the working set nor exceeded.
    fn free_part(&self, candidate: &Candidate<T>) -> Option<Part> {
        let held = |part| {
            let same = |row: &ActiveRow<T>| row.bound == candidate.bound && row.part == part;
            self.working.rows().iter().any(|row| same(&row.active))
                || self.exceeded.iter().any(same)
        };
        match candidate.soft {
            None => (!held(Part::Hard)).then_some(Part::Hard),
            Some(price) if price.linear > T::zero() && !held(Part::Linear) => Some(Part::Linear),
            Some(price) => {
                let rests = price.linear <= T::zero()
                    || self.exceeded.iter().any(|row| row.bound == candidate.bound);
                (rests && price.quadratic > T::zero() && !held(Part::Quadratic))
                    .then_some(Part::Quadratic)
            }
        }
    }

    /// Makes every component of the terminal equality a row that is always active.
    pub fn impose_terminal_equality<const NX: usize, const NG: usize>(
        &mut self,
        ocp: &Ocp<T, NX, NU, N, NG>,
        factors: &[StageFactor<T, NX, NU>; N],
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
            self.working.direction(&self.candidate, &mut self.direction);
            if self.direction.slope > T::zero() {
                if self.working.is_full() {
                    return Err(Status::WorkingSetFull);
                }
                self.advance(-slack / self.direction.slope);
                self.working.append(&self.candidate, &self.direction);
            } else if !(slack.abs() <= self.loosest * (T::one() + target.abs())) {
                return Err(Status::Infeasible(bound));
            }
        }
        Ok(())
    }

    /// Takes the candidate into the working set, dropping rows whose multiplier forbids it.
    pub fn satisfy<const NX: usize, const NG: usize>(
        &mut self,
        ocp: &Ocp<T, NX, NU, N, NG>,
        factors: &[StageFactor<T, NX, NU>; N],
        violated: &Candidate<T>,
    ) -> Result<(), Status<T>> {
        let Candidate {
            bound, part, soft, ..
        } = *violated;
        rows::form_row(ocp, factors, bound, part, soft, &mut self.candidate);
        let mut slack = violated.slack;
        if !slack.is_finite() {
            // The trajectory is finite: a bound at plus or minus infinity, or no number at all.
            return Err(if slack < T::zero() {
                Status::Infeasible(bound)
            } else {
                Status::NotFinite
            });
        }
        if slack > T::zero() {
            self.take_back_exceeded(violated);
            slack = -slack;
        }
        loop {
            if self.changes >= self.max_changes {
                return Err(Status::ChangeCap);
            }
            self.changes += 1;
            self.working.direction(&self.candidate, &mut self.direction);
            let Some((step, end)) = self.step_length(slack) else {
                return self.accept_rounding_or_fail(violated, slack);
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
                    return Ok(());
                }
                StepEnd::Cap => {
                    let row = self.candidate;
                    return self.rest_at_cap(&row);
                }
                StepEnd::Blocked(position) => {
                    let row = self.working.remove(position);
                    let at_cap =
                        row.cap.is_finite() && row.active.multiplier > row.cap * convert(0.5);
                    if at_cap {
                        self.rest_at_cap(&row)?;
                    } else if row.mirrored {
                        self.rest_exceeded(&row)?;
                    }
                }
            }
        }
    }

    /// A mirrored row has the opposite slack, and its multiplier counts down from the cap.
    fn take_back_exceeded(&mut self, violated: &Candidate<T>) {
        let mut others = ActiveSet::new();
        for row in self.exceeded.iter() {
            if row.bound != violated.bound || row.part != violated.part {
                others.push(*row);
            }
        }
        self.exceeded = others;
        self.candidate.mirrored = true;
        for alpha in &mut self.candidate.alpha {
            *alpha = -*alpha;
        }
    }

    /// A multiplier has reached its linear price: an exceeded bound, or, seen in the mirror,
    /// a bound that is no longer active.
    fn rest_at_cap(&mut self, row: &Row<T, NU, N>) -> Result<(), Status<T>> {
        if row.mirrored {
            Ok(())
        } else {
            self.rest_exceeded(row)
        }
    }

    fn rest_exceeded(&mut self, row: &Row<T, NU, N>) -> Result<(), Status<T>> {
        let exceeded = ActiveRow {
            multiplier: row.cap,
            exceeded: true,
            ..row.active
        };
        if self.exceeded.push(exceeded) {
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
        if self.candidate.cap.is_finite() {
            let room = self.candidate.cap - self.candidate.active.multiplier;
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
        let violation = violated.violation * (slack / violated.slack).abs();
        if violation <= self.loosest && violated.part == Part::Hard {
            self.tolerance = self.tolerance.max(violation * convert(2.0));
            Ok(())
        } else {
            Err(Status::Infeasible(violated.bound))
        }
    }

    /// One step along the direction.
    fn advance(&mut self, step: T) {
        let rates = self.direction.dual.iter();
        for (row, rate) in self.working.rows_mut().iter_mut().zip(rates) {
            row.active.multiplier -= step * *rate;
        }
        self.candidate.active.multiplier += step;
        for (v, change) in self.v.iter_mut().zip(self.direction.primal.iter()) {
            *v += change * step;
        }
    }

    /// Moves v so that the rows of the working set hold to rounding on the trajectory, which
    /// belongs to the current v. Returns whether anything had to be moved.
    pub fn polish<const NX: usize, const NG: usize>(
        &mut self,
        ocp: &Ocp<T, NX, NU, N, NG>,
        trajectory: &Trajectory<'_, T, NX, NU, N>,
    ) -> bool {
        let mut change = [T::zero(); M];
        let mut largest = T::zero();
        for (change, row) in change.iter_mut().zip(self.working.rows()) {
            let sign = if row.mirrored { -T::one() } else { T::one() };
            let slack = rows::slack(ocp, trajectory, &row.active.bound) * sign;
            *change = -(slack + row.compliance * row.active.multiplier);
            largest = largest.max(change.abs());
        }
        if !(largest > self.tolerance) {
            return false;
        }
        self.working.solve_gram(&mut change);
        self.shift_multipliers(&change);
        true
    }

    /// Starts from the rows that were active before, `shift` stages earlier. Rows whose
    /// multiplier would have the wrong sign are dropped, so this never changes the result.
    pub fn warm_start<const NX: usize, const NG: usize>(
        &mut self,
        ocp: &Ocp<T, NX, NU, N, NG>,
        factors: &[StageFactor<T, NX, NU>; N],
        trajectory: &Trajectory<'_, T, NX, NU, N>,
        before: &ActiveSet<T, M>,
        shift: usize,
    ) {
        let equalities = self.working.len();
        for row in before.iter() {
            let hard = row.part == Part::Hard && row.bound.side != Side::Equality;
            let Some(stage) = row.bound.stage.checked_sub(shift) else {
                continue;
            };
            let given = stage == 0 && matches!(row.bound.quantity, Quantity::State(_));
            if !hard || given || self.working.is_full() {
                continue;
            }
            let bound = BoundId { stage, ..row.bound };
            rows::form_row(ocp, factors, bound, Part::Hard, None, &mut self.candidate);
            self.working.direction(&self.candidate, &mut self.direction);
            if self.direction.slope > self.candidate.dot(&self.candidate.alpha) * convert(1e-6) {
                self.working.append(&self.candidate, &self.direction);
                self.changes += 1;
            }
        }
        self.drop_negative_multipliers(ocp, trajectory, equalities);
    }

    /// Moves to the minimiser over the working set, without the rows (behind the first
    /// `equalities`) whose multiplier would be negative there.
    fn drop_negative_multipliers<const NX: usize, const NG: usize>(
        &mut self,
        ocp: &Ocp<T, NX, NU, N, NG>,
        trajectory: &Trajectory<'_, T, NX, NU, N>,
        equalities: usize,
    ) {
        loop {
            let mut change = [T::zero(); M];
            for (change, row) in change.iter_mut().zip(self.working.rows()) {
                *change = -rows::slack(ocp, trajectory, &row.active.bound);
            }
            self.working.solve_gram(&mut change);
            let multipliers = self.working.rows().iter().zip(change.iter());
            let negative = multipliers
                .map(|(row, change)| row.active.multiplier + *change)
                .enumerate()
                .skip(equalities)
                .filter(|(_, multiplier)| !(*multiplier >= T::zero()))
                .reduce(|least, other| if other.1 < least.1 { other } else { least });
            if let Some((position, _)) = negative {
                self.working.remove(position);
                self.changes += 1;
                continue;
            }
            self.shift_multipliers(&change);
            return;
        }
    }

    /// Changes the working set's multipliers, and v with them.
    fn shift_multipliers(&mut self, change: &[T; M]) {
        let v = &mut self.v;
        for (row, change) in self.working.rows_mut().iter_mut().zip(change.iter()) {
            row.active.multiplier += *change;
            row.add_to(v, *change);
        }
    }

    /// Hands over the active rows, with multipliers in the bounds' own direction.
    pub fn report(&self, active: &mut ActiveSet<T, M>) -> bool {
        active.clear();
        let working = self.working.rows().iter().map(|row| ActiveRow {
            multiplier: if row.mirrored {
                row.cap - row.active.multiplier
            } else {
                row.active.multiplier
            },
            ..row.active
        });
        working
            .chain(self.exceeded.iter().copied())
            .all(|row| active.push(row))
    }
}
