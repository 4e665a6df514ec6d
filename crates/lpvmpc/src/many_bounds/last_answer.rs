//! The last answer, a sample or more later: most of its bounds are active again, and what has changed is at the end of
//! the horizon. That is solved by itself first, at little cost, and the whole of it with what comes of it.

use super::exchange::{Patience, Program, Tolerances, exchange};
use super::guess::{self, TAIL};
use super::newton;
use super::search::search;
use super::side::{self, BoundSide};
use super::span::Span;
use crate::model::Scalar;
use crate::retries::Retries;
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

/// A shorter horizon has no such end, and soft bounds of the sample before are of no use: they are found anew in less time.
pub(super) const fn shortest_with_soft<const NU: usize>() -> usize {
    match NU {
        1 => TAIL * SHORTEST,
        _ => TAIL_SOFT * SHORTEST,
    }
}

/// What the bounds that were active have in common.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// Most are of general rows, each of which binds states and several inputs.
    Rows,
    /// Some are soft, where there are several inputs.
    Soft,
    /// Neither, but bounds of inputs and of states bind each other.
    Mixed,
    /// None of these.
    Simple,
}

impl Kind {
    /// Of the `sides` of all bounds; `rows`: whether most that were active are of rows that bind several inputs.
    pub fn new<T, const NU: usize>(sides: &[BoundSide<T>], rows: bool) -> Self {
        if rows {
            Self::Rows
        } else if NU > 1 && side::any_soft(sides) {
            Self::Soft
        } else if side::are_mixed(sides) {
            Self::Mixed
        } else {
            Self::Simple
        }
    }
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
        (factors, proof): (&[StageFactor<T, NX, NU>], &mut ActiveSet<T>),
        without_end: &mut Retries,
        mut count: impl FnMut(usize) -> bool,
    ) -> bool {
        let whole = program.span;
        let n = whole.ocp.length();
        let end = self.end(&whole, program.x);
        // Soft bounds are found anew in less time.
        if end.is_none() && self.shift > 0 && self.kind == Kind::Soft {
            return false;
        }
        guess::tail(whole.ocp, factors, sides, (program.x, self.shift));
        let patience = match self.kind {
            Kind::Simple if NU > 1 => Patience::KNOWN,
            Kind::Rows if NU > 1 && end.is_some() => Patience::KNOWN,
            Kind::Soft if NU > 1 && end.is_some() => Patience::SOFT,
            Kind::Mixed => Patience::BINDING,
            _ => Patience::NEAR,
        };
        // Of a short horizon the end is a large part, and as a rule there is nothing new in it.
        if self.kind == Kind::Mixed && n / TAIL < SHORTEST && end.is_some() && without_end.are_due()
        {
            let found = exchange(program, sides, tolerances, Patience::BINDING, || count(n));
            without_end.learn(found);
            if found {
                return true;
            }
            // Of the end, which is solved next, nothing else is known.
            guess::known(sides);
        }
        if let Some(end) = end {
            program.span = end;
            let sides = end.sides(sides);
            let mut count = || count(n - end.begin);
            // Of the end most may have changed; where bounds bind each other, exchanges come to nothing.
            let solved = matches!(self.kind, Kind::Simple | Kind::Mixed)
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
        whole: &Span<'a, T, NX, NU>,
        last: &[SVector<T, NX>],
    ) -> Option<Span<'a, T, NX, NU>> {
        let n = whole.ocp.length();
        let length = match self.kind {
            Kind::Rows | Kind::Mixed => (n / TAIL).max(SHORTEST),
            Kind::Soft => (n / TAIL).max((n / TAIL_SOFT).min(LONGEST_SOFT)),
            Kind::Simple => n / TAIL,
        };
        // Of the same horizon the last answer knows the end, too.
        if self.shift == 0 || length < SHORTEST || n <= length {
            return None;
        }
        let begin = n - length;
        Some(Span {
            begin,
            start: *last.get(begin + self.shift - 1)?,
            ..*whole
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
        newton::roll_out(&program.span, factors, &[], (program.u, program.x));
        let (x, u) = (&*program.x, &*program.u);
        newton::measure(&program.span, sides, &Trajectory { x, u });
        let doubted = proof.doubted;
        let answer = search(program, sides, tolerances, self.trials, proof, count);
        // Before the end all sides have the roles of the last answer.
        proof.doubted = doubted;
        matches!(answer, Some(Ok(())))
    }
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use super::*;
    use crate::list::List;
    use crate::many_bounds::exchange::Tolerances;
    use crate::many_bounds::fixture::{self, Fixture};
    use crate::many_bounds::side::Role;
    use crate::memory::Capacity;
    use crate::ocp::{Bounds, GeneralRow, Ocp};
    use crate::solution::{BoundId, Solution};
    use crate::solver::Solver;
    use crate::solver_settings::SolverSettings;
    use alloc::vec;
    use lpvmpc_testkit::rng::Rng;
    use nalgebra::{Matrix2, Vector1, Vector2};

    const N: usize = 14;
    const BEGIN: usize = 8;

    /// A double integrator with weights, bounds and a row of its own at every stage.
    fn problem(random: &mut Rng) -> Ocp<f64, 2, 1> {
        let mut ocp = Ocp::<f64, 2, 1>::allocate(N);
        ocp.own = List::repeat(ocp.common, N);
        ocp.rows = List::repeat(GeneralRow::default(), N + 1);
        ocp.rows_per_stage = 1;
        for (stage, own) in ocp.stages.iter_mut().zip(ocp.own.iter_mut()) {
            stage.a = Matrix2::new(1.0, random.uniform(0.1, 0.3), 0.0, 1.0);
            stage.b = Vector2::new(0.02, random.uniform(0.1, 0.3));
            stage.linear_x = Vector2::from_fn(|_, _| random.uniform(-3.0, 3.0));
            own.q = Matrix2::identity() * random.uniform(0.5, 2.0);
            own.r[(0, 0)] = random.uniform(0.05, 0.2);
            let limit = random.uniform(0.5, 1.0);
            own.u = Bounds {
                lower: Vector1::new(-limit),
                upper: Vector1::new(limit),
            };
            own.x.upper[1] = random.uniform(0.3, 0.6);
        }
        for row in ocp.rows.iter_mut() {
            row.x = Vector2::new(0.3, random.uniform(-1.0, -0.5));
            row.u[0] = 0.1;
            row.upper = random.uniform(0.3, 0.5);
        }
        ocp.terminal.p = Matrix2::identity();
        ocp.terminal.x.upper[0] = 0.5;
        ocp
    }

    /// The last stages, as a problem that knows nothing of the others.
    fn shorter(ocp: &Ocp<f64, 2, 1>, start: Vector2<f64>) -> Ocp<f64, 2, 1> {
        let length = N - BEGIN;
        let mut end = Ocp::<f64, 2, 1>::allocate(length);
        end.x0 = start;
        end.stages.copy_from_slice(&ocp.stages[BEGIN..]);
        end.own = List::repeat(ocp.common, length);
        end.own.copy_from_slice(&ocp.own[BEGIN..]);
        end.rows = List::repeat(GeneralRow::default(), length + 1);
        end.rows.copy_from_slice(&ocp.rows[BEGIN..]);
        end.rows_per_stage = 1;
        end.terminal = ocp.terminal;
        end
    }

    /// The end of a horizon has the active bounds of the problem that it is by itself, as the dual method finds them.
    #[test]
    fn the_end_is_the_shorter_problem() {
        let room = Capacity {
            stages: N,
            rows: 40,
            active: 40,
            ..Capacity::default()
        };
        let mut active = 0;
        for seed in 0..40 {
            let mut random = Rng::new(seed);
            let ocp = problem(&mut random);
            let start = Vector2::new(random.uniform(-0.2, 0.2), random.uniform(-0.2, 0.2));
            let mut expected = Solution::allocate(room);
            let shorter = shorter(&ocp, start);
            Solver::allocate(room).solve(&shorter, &SolverSettings::default(), &mut expected);
            assert!(expected.status.is_solved(), "{seed}: {}", expected.status);
            let mut sides = fixture::sides(&ocp);
            let span = Span {
                ocp: &ocp,
                begin: BEGIN,
                start,
                transposed: &[],
            };
            let mut factors = vec![StageFactor::zeros(); N];
            newton::factorize(&span, &sides[..0], &mut factors).unwrap();
            let mut fixture = Fixture::new(room);
            let mut program = fixture.program(span);
            let tolerances = Tolerances {
                violation: 1e-10,
                scale: 1.0,
                penalty: 1e6,
            };
            let answer = LastAnswer {
                kind: Kind::Rows,
                shift: 1,
                trials: 10,
            };
            let mut proof = ActiveSet::with_capacity(40);
            let end = span.sides(&mut sides);
            let mut stages = 0;
            let count = || {
                stages += N - BEGIN;
                stages < 100 * N
            };
            assert!(
                answer.solve(&mut program, end, &tolerances, &factors, &mut proof, count),
                "{seed}"
            );
            let held = || end.iter().filter(|side| side.role == Role::Held);
            assert_eq!(held().count(), expected.active.len(), "{seed}");
            for BoundId {
                stage,
                quantity,
                side,
            } in expected.active.iter().map(|row| row.bound)
            {
                let bound = BoundId {
                    stage: stage + BEGIN,
                    quantity,
                    side,
                };
                assert!(held().any(|side| side.bound == bound), "{seed}: {bound}");
            }
            active += expected.active.len();
        }
        assert!(active > 80, "{active}");
    }
}
