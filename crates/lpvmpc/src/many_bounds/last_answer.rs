//! The last answer, a sample or more later: most of its bounds are active again, and what has changed is at the end of
//! the horizon. That is solved by itself first, at little cost, and the whole of it with what comes of it.

use super::exchange::{Program, Tolerances, exchange};
use super::guess::{self, TAIL};
use super::side::BoundSide;
use super::span::Span;
use super::{KNOWN, NEAR, newton, search};
use crate::model::Scalar;
use crate::ocp::Ocp;
use crate::riccati::StageFactor;
use crate::rows::Trajectory;
use crate::solution::ActiveSet;
use nalgebra::SVector;

/// Soft bounds, which are exceeded far from the end, too, take one stage in so many, up to
const TAIL_SOFT: usize = 4;
/// so many stages.
const LONGEST_SOFT: usize = 24;
/// So many stages at least are worth a solution of their own.
const SHORTEST: usize = 6;

/// What the bounds that were active have in common.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// Most are of general rows, each of which binds states and several inputs.
    Rows,
    /// Some are soft, where there are several inputs.
    Soft,
    /// Neither.
    Simple,
}

/// How the last answer is used.
pub(super) struct LastAnswer {
    pub kind: Kind,
    /// By how many stages it is earlier.
    pub shift: usize,
    /// So many guesses of the interior-point method are tried.
    pub trials: usize,
}

impl LastAnswer {
    /// Tries the roles that the sides have from it, its states being in the program; whether they, or what they are
    /// exchanged for, are right. The `factors` are those without bounds, `proof` is overwritten, and `count` is asked
    /// before so many stages are factorised.
    pub fn repeat<T: Scalar, const NX: usize, const NU: usize>(
        &self,
        program: &mut Program<'_, T, NX, NU>,
        sides: &mut [BoundSide<T>],
        tolerances: &Tolerances<T>,
        factors: &[StageFactor<T, NX, NU>],
        proof: &mut ActiveSet<T>,
        mut count: impl FnMut(usize) -> bool,
    ) -> bool {
        let whole = program.span;
        let n = whole.ocp.length();
        guess::tail(whole.ocp, factors, sides, (program.x, self.shift));
        let end = self.end(whole.ocp, program.x);
        // Soft bounds are found anew in less time.
        if end.is_none() && self.shift > 0 && self.kind == Kind::Soft {
            return false;
        }
        let patience = match NU > 1 && (end.is_some() || self.kind == Kind::Simple) {
            true => KNOWN,
            false => NEAR,
        };
        if let Some(end) = end {
            program.span = end;
            let sides = end.sides(sides);
            let mut count = || count(n - end.begin);
            // Of the end most may have changed; where bounds bind each other, exchanges come to nothing.
            let solved = self.kind == Kind::Simple
                && exchange(program, sides, tolerances, patience, &mut count)
                || self.solve(program, sides, tolerances, factors, proof, count);
            program.span = whole;
            if !solved {
                return false;
            }
        }
        exchange(program, sides, tolerances, patience, || count(n))
    }

    /// The end of the horizon, from where the `last` answer's states lead to; none where to solve it by itself takes
    /// longer, as a rule, than what it saves.
    fn end<'a, T: Scalar, const NX: usize, const NU: usize>(
        &self,
        ocp: &'a Ocp<T, NX, NU>,
        last: &[SVector<T, NX>],
    ) -> Option<Span<'a, T, NX, NU>> {
        let n = ocp.length();
        let length = match self.kind {
            Kind::Rows => (n / TAIL).max(SHORTEST),
            Kind::Soft => (n / TAIL).max((n / TAIL_SOFT).min(LONGEST_SOFT)),
            Kind::Simple => n / TAIL,
        };
        // Of the same horizon the last answer knows the end, too.
        if self.shift == 0 || length < SHORTEST || n <= length {
            return None;
        }
        let begin = n - length;
        Some(Span {
            ocp,
            begin,
            start: *last.get(begin + self.shift - 1)?,
        })
    }

    /// Solves the stages of the program by the interior-point method, from the policies of the `factors`; whether the
    /// sides have the roles of the answer then.
    fn solve<T: Scalar, const NX: usize, const NU: usize>(
        &self,
        program: &mut Program<'_, T, NX, NU>,
        sides: &mut [BoundSide<T>],
        tolerances: &Tolerances<T>,
        factors: &[StageFactor<T, NX, NU>],
        proof: &mut ActiveSet<T>,
        count: impl FnMut() -> bool,
    ) -> bool {
        newton::roll_out(&program.span, factors, (program.u, program.x));
        let (x, u) = (&*program.x, &*program.u);
        newton::measure(&program.span, sides, &Trajectory { x, u });
        let answer = search(program, sides, tolerances, self.trials, proof, count);
        matches!(answer, Some(Ok(())))
    }
}
