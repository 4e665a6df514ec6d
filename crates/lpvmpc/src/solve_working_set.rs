//! Moving to the minimiser over a given working set: the warm start, and the refinement after
//! the search.

use crate::active_set::DualActiveSet;
use crate::model::Scalar;
use crate::ocp::Ocp;
use crate::riccati::StageFactor;
use crate::rows::{self, Places, Trajectory};
use crate::solution::{ActiveRow, ActiveSet, BoundId, Part, Quantity, Side, Status};
use crate::working_set::{Terms, copy};
use nalgebra::convert;

/// Of fewer rows of an earlier sample, if they are not trusted, most that the trajectory without bounds keeps are inactive;
/// nearly all that it violates are active again,
const FEW: usize = 12;
/// and fewer of these are found from nothing in as little time.
const FEWEST_VIOLATED: usize = 3;

impl<T: Scalar, const NU: usize> DualActiveSet<T, NU> {
    /// Starts from the rows that were active before, `shift` stages earlier. Rows whose
    /// multiplier would have the wrong sign are dropped, so this never changes the result.
    ///
    /// Returns whether it did: of rows that are active one is violated without them, so where none is, they tell
    /// nothing, and where few are, little.
    pub fn warm_start<const NX: usize>(
        &mut self,
        ocp: &Ocp<T, NX, NU>,
        factors: &[StageFactor<T, NX, NU>],
        trajectory: &Trajectory<'_, T, NX, NU>,
        (before, shift): (&ActiveSet<T>, usize),
    ) -> Result<bool, Status<T>> {
        let known = || {
            let known = |row| known_row(ocp, trajectory, &row, shift);
            before.iter().filter_map(known)
        };
        // A microcontroller has no flash for what saves little.
        let few = cfg!(feature = "alloc") && shift > 0 && !before.trusted && before.len() < FEW;
        let others = if few { FEWEST_VIOLATED - 1 } else { 0 };
        let mut violated = known().filter(|(_, violated)| *violated);
        if few && before.len() <= others || violated.nth(others).is_none() {
            return Ok(false);
        }
        for (bound, violated) in known() {
            // One that the trajectory without bounds keeps is inactive as a rule where active rows change from sample to
            // sample; if not, it is found in less time than dropped.
            if !violated && (few || before.doubted > 0) || self.working.is_full() {
                continue;
            }
            rows::form_row(ocp, factors, bound, Part::Hard, None, &mut self.candidate);
            self.working.direction(&self.candidate, &mut self.direction);
            if self.direction.slope > self.candidate.dot(&self.candidate.alpha) * convert(1e-6) {
                self.count_change()?;
                self.working.append(&self.candidate, &self.direction);
            }
        }
        self.solve_working_set(ocp, factors, trajectory)?;
        Ok(true)
    }

    /// After the last violated bound: removes what rounding has left in the optimality
    /// conditions. Returns whether anything was moved.
    ///
    /// Where v has become so large that its rounding is larger than a bound, the answer is inaccurate.
    pub fn refine<const NX: usize>(
        &mut self,
        ocp: &Ocp<T, NX, NU>,
        factors: &[StageFactor<T, NX, NU>],
        trajectory: &Trajectory<'_, T, NX, NU>,
    ) -> Result<bool, Status<T>> {
        if self.active().next().is_none() {
            return Ok(false);
        }
        let (defect, bound) = self.worst_defect(ocp, trajectory);
        let largest = self.v.iter().fold(T::zero(), |m, v| m.max(v.amax()));
        let negligible = self.tolerance * largest;
        if !(self.unexplained <= negligible) {
            self.find_unexplained(ocp, factors);
            self.unexplained = self.rest.iter().fold(T::zero(), |m, v| m.max(v.amax()));
        }
        if defect <= self.tolerance && self.unexplained <= negligible {
            return Ok(false);
        }
        if self.refinements > 0 {
            self.refinements -= 1;
            self.forget_idle();
            self.solve_working_set(ocp, factors, trajectory)?;
            return Ok(true);
        }
        if defect <= self.loosest {
            Ok(false)
        } else {
            Err(Status::Inaccurate(bound))
        }
    }

    /// The active bound that is farthest from holding, relative to its size.
    fn worst_defect<const NX: usize>(
        &self,
        ocp: &Ocp<T, NX, NU>,
        trajectory: &Trajectory<'_, T, NX, NU>,
    ) -> (T, BoundId) {
        let working = self.working.rows().iter().map(|row| {
            let defect = defect(ocp, trajectory, row).abs();
            (defect, row.active.bound)
        });
        let resting = self.resting.iter().filter(|row| !row.exceeded).map(|row| {
            let slack = rows::slack(ocp, trajectory, &row.bound);
            let idle = row.multiplier == T::zero() && slack > T::zero();
            (if idle { T::zero() } else { slack.abs() }, row.bound)
        });
        let mut worst = (T::zero(), ActiveRow::<T>::empty().bound);
        for (defect, bound) in working.chain(resting) {
            let relative = defect / rows::size(ocp, &bound);
            // Negated, so that a defect that is NaN counts.
            if !(relative <= worst.0) {
                worst = (relative, bound);
            }
        }
        worst
    }

    /// Forgets the resting rows without multiplier.
    fn forget_idle(&mut self) {
        self.resting.retain(|row| row.multiplier != T::zero());
    }

    /// Moves to the minimiser over the working set, without the rows whose multiplier would
    /// leave its interval there. `trajectory` belongs to the current v.
    fn solve_working_set<const NX: usize>(
        &mut self,
        ocp: &Ocp<T, NX, NU>,
        factors: &[StageFactor<T, NX, NU>],
        trajectory: &Trajectory<'_, T, NX, NU>,
    ) -> Result<(), Status<T>> {
        loop {
            self.find_unexplained(ocp, factors);
            for (step, row) in self.step.iter_mut().zip(self.working.rows()) {
                *step = -defect(ocp, trajectory, row);
            }
            self.working.solve_lower(&mut self.step);
            self.working.project(&self.rest, &mut self.step);
            copy(&mut self.multipliers, &self.step);
            self.working.solve_upper(&mut self.multipliers);
            for (multiplier, row) in self.multipliers.iter_mut().zip(self.working.rows()) {
                *multiplier += row.active.multiplier;
            }
            let Some(position) = self.farthest_outside() else {
                for (v, rest) in self.v.iter_mut().zip(self.rest.iter()) {
                    *v -= rest;
                }
                self.unexplained += self.working.shift(&mut self.step, &mut self.v);
                return Ok(());
            };
            self.count_change()?;
            let mut row = self.working.remove(position);
            if let Some(multiplier) = self.multipliers.get(position) {
                row.active.multiplier = *multiplier;
            }
            self.release(&row)?;
        }
    }

    /// The working row whose multiplier is farthest outside its interval.
    fn farthest_outside(&self) -> Option<usize> {
        let mut farthest = None;
        let mut distance = T::zero();
        let rows = self.working.rows().iter().zip(self.multipliers.iter());
        for (position, (row, multiplier)) in rows.enumerate() {
            let outside = (-*multiplier).max(*multiplier - row.cap);
            // Negated, so that a multiplier that is NaN counts.
            if !row.equality && !(outside <= distance) {
                distance = outside;
                farthest = Some(position);
            }
        }
        farthest
    }

    /// Leaves in `rest` v - sum of multiplier * alpha over the active rows: zero but for rounding.
    fn find_unexplained<const NX: usize>(
        &mut self,
        ocp: &Ocp<T, NX, NU>,
        factors: &[StageFactor<T, NX, NU>],
    ) {
        copy(&mut self.rest, &self.v);
        let (working, resting) = (self.working.rows(), &self.resting);
        let mut places = Places::default();
        let rows = working.iter().map(Terms::reported);
        rows.chain(resting.iter())
            .filter(|row| row.multiplier != T::zero())
            .for_each(|row| places.add(row.bound.stage));
        if places.is_empty() {
            return;
        }
        let active_at = |stage: usize| {
            let here = working
                .iter()
                .filter(move |row| row.active.bound.stage == stage);
            here.map(Terms::reported).chain(resting.at(stage))
        };
        rows::subtract(ocp, factors, places, active_at, &mut self.rest);
    }
}

/// The bound of an active row, `shift` stages earlier, and whether the trajectory violates it; `None` where it is none to
/// begin with.
#[inline(never)]
fn known_row<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    trajectory: &Trajectory<'_, T, NX, NU>,
    row: &ActiveRow<T>,
    shift: usize,
) -> Option<(BoundId, bool)> {
    let hard = row.part == Part::Hard && row.bound.side != Side::Equality;
    let stage = row.bound.stage.checked_sub(shift)?;
    // The state at stage 0 is given, the input at the end does not exist.
    let free = match row.bound.quantity {
        Quantity::State(_) => stage > 0 && stage <= ocp.length(),
        Quantity::Input(_) => stage < ocp.length(),
        Quantity::Row(_) => stage <= ocp.length(),
    };
    if !hard || !free {
        return None;
    }
    let bound = BoundId { stage, ..row.bound };
    // The bound may have gone, or become soft, since.
    let slack = rows::slack(ocp, trajectory, &bound);
    let holds = slack.is_finite() && rows::soft_price(ocp, &bound).is_none();
    holds.then_some((bound, slack < T::zero()))
}

/// What is missing for `row` to hold with equality on the trajectory.
fn defect<T: Scalar, const NX: usize, const NU: usize>(
    ocp: &Ocp<T, NX, NU>,
    trajectory: &Trajectory<'_, T, NX, NU>,
    row: &Terms<T>,
) -> T {
    let slack = rows::slack(ocp, trajectory, &row.active.bound);
    let own = if row.mirrored { -slack } else { slack };
    own + row.compliance * row.active.multiplier
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use super::*;
    use crate::memory::Capacity;
    use crate::ocp::{Bounds, Stage};
    use crate::solution::Solution;
    use crate::solver::{Solver, Start};
    use crate::solver_settings::SolverSettings;
    use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

    fn compare(ocp: &Ocp<f64, 2, 1>, solver: &mut Solver<f64, 2, 1>) {
        let Solver { dual, factors, .. } = solver;
        dual.find_unexplained(ocp, factors);
        let found = dual.rest.iter().fold(0.0_f64, |most, v| most.max(v.amax()));
        let largest = dual.v.iter().fold(0.0_f64, |most, v| most.max(v.amax()));
        assert!(found <= dual.unexplained, "{found:e}");
        assert!(dual.unexplained <= 1e-10 * largest, "{largest:e}");
    }

    /// What the steps, or a warm start, say rounding leaves unexplained is no less than what is found, and small enough to
    /// tell.
    #[test]
    fn no_more_is_unexplained_than_is_allowed_for() {
        let room = Capacity {
            stages: 20,
            rows: 40,
            active: 120,
            ..Capacity::default()
        };
        let mut compared = 0;
        for k in 0..60 {
            let part = f64::from(k) / 60.0;
            let mut ocp = Ocp::<f64, 2, 1>::allocate(20);
            ocp.horizon = 20;
            ocp.x0 = Vector2::new(1.0 - part, 2.0 * part - 0.8);
            ocp.stages.fill(Stage {
                a: Matrix2::new(1.0, 0.1, 0.3 * part, 1.0),
                b: Vector2::new(0.005, 0.1),
                ..Stage::new()
            });
            ocp.common.q = Matrix2::identity();
            ocp.common.r = SMatrix::from_element(0.01);
            ocp.terminal.p = Matrix2::identity() * 10.0;
            let sides = |limit: f64| (SVector::repeat(-limit), SVector::repeat(limit));
            let (lower, upper) = sides(2.0 + part);
            ocp.common.u = Bounds { lower, upper };
            ocp.common.x.lower[1] = -0.5;
            let mut solver = Solver::allocate(room);
            let mut solution = Solution::allocate(room);
            solver.begin(&ocp, &SolverSettings::default());
            solver.factorize(&ocp).unwrap();
            solver.roll_out(&ocp, &mut solution).unwrap();
            // Without a refinement, which looks.
            if solver.search(&ocp, Start::Held, &mut solution).is_err() {
                continue;
            }
            if solver.dual.working.rows().len() < 2 {
                continue;
            }
            compare(&ocp, &mut solver);
            // The same rows at once.
            solver.dual.begin_again();
            let known = solution.active.clone();
            solver.roll_out(&ocp, &mut solution).unwrap();
            let Solution { x, u, .. } = &solution;
            let Solver { dual, factors, .. } = &mut solver;
            let begun = dual.warm_start(&ocp, factors, &Trajectory { x, u }, (&known, 0));
            assert!(begun.unwrap(), "{k}");
            compare(&ocp, &mut solver);
            compared += 1;
        }
        assert!(compared > 20, "{compared}");
    }
}
