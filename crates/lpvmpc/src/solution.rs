//! The answer of the solver: inputs, predicted states, active bounds with their multipliers,
//! and a status that says what the answer is worth.

use crate::list::List;
#[cfg(feature = "alloc")]
use crate::memory::Capacity;
use crate::model::Scalar;
use crate::preview::PreviewError;
use crate::retries::Retries;
use crate::working_set::{copy, first};
use core::fmt;
use nalgebra::SVector;

/// What a bound acts on; the number counts components from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// State component.
    State(usize),
    /// Input component.
    Input(usize),
    /// General row.
    Row(usize),
}

/// Which side of a bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// value >= lower
    Lower,
    /// value <= upper
    Upper,
    /// value = target (a component of the terminal equality)
    Equality,
}

/// One bound of the problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoundId {
    /// Stage, from 0 to the horizon (the terminal state).
    pub stage: usize,
    /// What is bounded.
    pub quantity: Quantity,
    /// Which side.
    pub side: Side,
}

impl fmt::Display for BoundId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let side = match self.side {
            Side::Lower => "lower bound",
            Side::Upper => "upper bound",
            Side::Equality => "terminal equality",
        };
        let (name, index) = match self.quantity {
            Quantity::State(index) => ("state", index),
            Quantity::Input(index) => ("input", index),
            Quantity::Row(index) => ("general row", index),
        };
        write!(f, "{side} of {name} {index} at stage {}", self.stage)
    }
}

/// Which part of a bound's price a row stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The bound itself: multiplier from 0 to infinity (any sign for an equality).
    Hard,
    /// The linear part of a soft bound: multiplier from 0 to the linear price.
    Linear,
    /// The quadratic part of a soft bound: multiplier = quadratic price * excess.
    Quadratic,
}

/// An active bound with its multiplier.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActiveRow<T> {
    /// The bound.
    pub bound: BoundId,
    /// Which part of it.
    pub part: Part,
    /// Lagrange multiplier, >= 0 in the direction that keeps the bound (any sign for an
    /// equality, where the Lagrangian is cost - multiplier * (x - target)), in cost per unit of
    /// the quantity.
    pub multiplier: T,
    /// The multiplier rests at the linear price: the soft bound is exceeded.
    pub exceeded: bool,
}

impl<T: Scalar> ActiveRow<T> {
    /// Filler for unused places.
    pub(crate) fn empty() -> Self {
        Self {
            bound: BoundId {
                stage: 0,
                quantity: Quantity::State(0),
                side: Side::Lower,
            },
            part: Part::Hard,
            multiplier: T::zero(),
            exceeded: false,
        }
    }
}

/// The active bounds, at most as many as there is memory for.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub struct ActiveSet<T: 'static> {
    rows: List<PackedRow<T>>,
    len: usize,
    /// For so many solves more its rows are not expected to be active again unless they are violated.
    pub(crate) doubted: u8,
    /// Whether even a few of its rows are worth beginning with: the search for them went astray, taking up others that it
    /// dropped again, or the plan is followed.
    pub(crate) trusted: bool,
    /// Whether the few rows of an earlier sample were active again, as far as is known.
    pub(crate) lasting: bool,
    /// When the next program is tried with them held by the factorisation.
    pub(crate) holds: Retries,
}

impl<T: Scalar> PartialEq for ActiveSet<T> {
    /// The same rows in the same order, whatever there are places for.
    fn eq(&self, other: &Self) -> bool {
        first(&self.rows, self.len) == first(&other.rows, other.len)
    }
}

/// An [`ActiveRow`] in a third of its memory, of which a microcontroller has little.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PackedRow<T> {
    multiplier: T,
    stage: u16,
    /// Component of the quantity.
    index: u8,
    /// Quantity, side, part (two bits each), and whether the soft bound is exceeded.
    kind: u8,
}

impl<T: Scalar> PackedRow<T> {
    /// Filler for unused places.
    pub fn empty() -> Self {
        Self {
            multiplier: T::zero(),
            stage: 0,
            index: 0,
            kind: 0,
        }
    }

    /// `None` for stages beyond 65 535 and components beyond 255.
    fn pack(row: &ActiveRow<T>) -> Option<Self> {
        let (quantity, index) = match row.bound.quantity {
            Quantity::State(index) => (0, index),
            Quantity::Input(index) => (1, index),
            Quantity::Row(index) => (2, index),
        };
        let (side, part) = (row.bound.side as u8, row.part as u8);
        Some(Self {
            multiplier: row.multiplier,
            stage: u16::try_from(row.bound.stage).ok()?,
            index: u8::try_from(index).ok()?,
            kind: quantity | side << 2 | part << 4 | u8::from(row.exceeded) << 6,
        })
    }

    fn unpack(&self) -> ActiveRow<T> {
        let index = usize::from(self.index);
        let two_bits = |shift: u8| self.kind >> shift & 3;
        ActiveRow {
            bound: BoundId {
                stage: usize::from(self.stage),
                quantity: match two_bits(0) {
                    0 => Quantity::State(index),
                    1 => Quantity::Input(index),
                    _ => Quantity::Row(index),
                },
                side: match two_bits(2) {
                    0 => Side::Lower,
                    1 => Side::Upper,
                    _ => Side::Equality,
                },
            },
            part: match two_bits(4) {
                0 => Part::Hard,
                1 => Part::Linear,
                _ => Part::Quadratic,
            },
            multiplier: self.multiplier,
            exceeded: self.kind >> 6 == 1,
        }
    }
}

impl<T: Scalar> ActiveSet<T> {
    /// An empty set in this memory.
    pub fn new(rows: List<PackedRow<T>>) -> Self {
        Self {
            rows,
            len: 0,
            doubted: 0,
            trusted: false,
            lasting: false,
            holds: Retries::default(),
        }
    }

    /// An empty set for so many bounds.
    #[cfg(feature = "alloc")]
    pub fn with_capacity(rows: usize) -> Self {
        Self::new(List::repeat(PackedRow::empty(), rows))
    }

    /// Takes over the rows of another set, as many as there are places for.
    pub fn copy_from(&mut self, other: &Self) {
        copy(&mut self.rows, &other.rows);
        self.len = other.len.min(self.rows.len());
        self.doubted = other.doubted;
        self.trusted = other.trusted;
        self.lasting = other.lasting;
        self.holds = other.holds;
    }

    /// The active rows, in no particular order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = ActiveRow<T>> {
        self.rows.iter().take(self.len).map(PackedRow::unpack)
    }

    /// The active rows at a stage.
    #[inline(always)]
    pub(crate) fn at(&self, stage: usize) -> impl Iterator<Item = ActiveRow<T>> {
        let here = move |row: &&PackedRow<T>| usize::from(row.stage) == stage;
        first(&self.rows, self.len)
            .iter()
            .filter(here)
            .map(PackedRow::unpack)
    }

    /// The stage of each row.
    pub(crate) fn stages(&self) -> impl Iterator<Item = usize> {
        let rows = first(&self.rows, self.len).iter();
        rows.map(|row| usize::from(row.stage))
    }

    /// How many rows are active.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether no row is active.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Whether the rows are those of a terminal equality alone, which are active without being known.
    pub(crate) fn is_terminal_equality(&self) -> bool {
        // Its rows come first, and the bit is in no other side.
        let of_equality = |row: &PackedRow<T>| row.kind >> 2 & Side::Equality as u8 != 0;
        first(&self.rows, self.len).last().is_some_and(of_equality)
    }

    /// Forgets all rows, so that the next solve starts cold.
    pub fn clear(&mut self) {
        self.len = 0;
    }

    /// Keeps the rows that are `wanted`.
    pub(crate) fn retain(&mut self, wanted: impl Fn(&ActiveRow<T>) -> bool) {
        let mut kept = 0;
        for place in 0..self.len {
            let row = self.rows.get(place).copied();
            let row = row.filter(|row| wanted(&row.unpack()));
            if let (Some(row), Some(free)) = (row, self.rows.get_mut(kept)) {
                *free = row;
                kept += 1;
            }
        }
        self.len = kept;
    }

    /// Adds a row; `false` if the set is full.
    pub(crate) fn push(&mut self, row: ActiveRow<T>) -> bool {
        match (self.rows.get_mut(self.len), PackedRow::pack(&row)) {
            (Some(place), Some(row)) => {
                *place = row;
                self.len += 1;
                true
            }
            _ => false,
        }
    }
}

/// What the answer is worth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Status<T> {
    /// The inputs are optimal and every bound holds.
    Solved,
    /// The plan is a rollout of the nonlinear model, and no program lowers its cost by more than the
    /// tolerance.
    Converged,
    /// The plan is a rollout of the nonlinear model that the programs of this sample have improved;
    /// more of them may improve it further.
    Improved,
    /// The plan is a rollout of the nonlinear model, the rest of the last one as a rule: no program
    /// of this sample has an answer with a lower cost.
    NoImprovement,
    /// No input satisfies all hard bounds of the quadratic program. The active rows of the solution are the proof
    /// ([`infeasibility_margin`](crate::infeasibility_margin)); this bound is the earliest of them. Of a linear plant that
    /// is a proof, too; of another one it says that its model along the last trajectory that was tried has no plan: there
    /// may be one elsewhere.
    Infeasible(BoundId),
    /// The plan of a descent is a rollout of the nonlinear model that exceeds this hard bound, the earliest of them, by more
    /// than a hundredth of its width, and nothing proves that no input keeps it.
    Exceeded(BoundId),
    /// Rounding keeps this bound from being met as closely as asked for, and nothing proves that it
    /// cannot be: the numbers of the problem are too far apart for the number type. The inputs are the
    /// best that were found.
    Inaccurate(BoundId),
    /// The cap on changes of the active set ended the search.
    MaxChanges,
    /// More bounds are active at once than the workspace or the solution has places for.
    WorkingSetFull,
    /// The problem has more stages than the problem itself, the solver or the solution has memory for.
    HorizonTooLong,
    /// R + B'PB is not positive definite at this stage: the offending pivot.
    NumericalFailure {
        /// Stage of the failing factorisation.
        stage: usize,
        /// The pivot that should be positive.
        pivot: T,
    },
    /// The problem contains a number that is not finite (or overflowed).
    NotFinite,
    /// What the sample was told makes no sense, or there is no room for it; nothing was planned.
    Refused(PreviewError),
}

impl<T: Scalar> Status<T> {
    /// Whether the inputs are a plan: the optimum of the quadratic program, or a rollout of the
    /// nonlinear model that the programs confirm or improve.
    pub fn is_solved(&self) -> bool {
        matches!(
            self,
            Self::Solved | Self::Converged | Self::Improved | Self::NoImprovement
        )
    }
}

impl<T: fmt::Display> fmt::Display for Status<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Solved => write!(f, "solved"),
            Self::Converged => write!(f, "converged"),
            Self::Improved => write!(f, "improved"),
            Self::NoImprovement => write!(f, "no improvement found"),
            Self::Infeasible(bound) => write!(f, "infeasible: {bound} cannot be met"),
            Self::Exceeded(bound) => {
                write!(f, "exceeded: no plan was found that keeps the {bound}")
            }
            Self::Inaccurate(bound) => {
                write!(f, "inaccurate: rounding keeps the {bound} from being met")
            }
            Self::MaxChanges => write!(f, "the maximum number of active-set changes was reached"),
            Self::WorkingSetFull => {
                write!(f, "more bounds are active at once than there is memory for")
            }
            Self::HorizonTooLong => write!(f, "the horizon is longer than the workspace"),
            Self::NumericalFailure { stage, pivot } => write!(
                f,
                "R + B'PB not positive definite at stage {stage} (pivot {pivot})"
            ),
            Self::NotFinite => write!(f, "a number of the problem is not finite"),
            Self::Refused(error) => write!(f, "refused: {error}"),
        }
    }
}

/// Inputs, predicted states and status of one solve.
///
/// Whatever the status of a solve, the inputs are finite and within the input bounds; unless
/// [`Status::is_solved`] they are a fallback, not an optimum. Before the first one they are zero.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Clone))]
pub struct Solution<T: 'static, const NX: usize, const NU: usize> {
    /// u_0 to u_{N-1}.
    pub u: List<SVector<T, NU>>,
    /// x_1 to x_N, predicted by the problem's linear dynamics; of a descent, by the nonlinear model.
    pub x: List<SVector<T, NX>>,
    /// Optimal value of the problem's cost, with the factor 1/2 of [`crate::Stage`] and the
    /// price of exceeded soft bounds. Of a descent, half of the cost J of the plan (with its constant terms) and of the price
    /// of what it exceeds.
    pub cost: T,
    /// What the answer is worth.
    pub status: Status<T>,
    /// Bounds that hold with equality, or are exceeded at a price. It is also the warm start
    /// of the next solve.
    pub active: ActiveSet<T>,
    /// Changes of the active set that were made.
    pub changes: usize,
}

impl<T: Scalar, const NX: usize, const NU: usize> PartialEq for Solution<T, NX, NU> {
    fn eq(&self, other: &Self) -> bool {
        let numbers = |solution: &Self| (solution.cost, solution.status, solution.changes);
        self.u == other.u
            && self.x == other.x
            && self.active == other.active
            && numbers(self) == numbers(other)
    }
}

impl<T: Scalar, const NX: usize, const NU: usize> Solution<T, NX, NU> {
    /// A solution of nothing yet, in memory for as many inputs and states as there are stages.
    pub fn new(
        u: List<SVector<T, NU>>,
        x: List<SVector<T, NX>>,
        active: List<PackedRow<T>>,
    ) -> Self {
        Self {
            u,
            x,
            cost: T::zero(),
            status: Status::Solved,
            active: ActiveSet::new(active),
            changes: 0,
        }
    }

    /// u_0: the input to apply until the next sample. Unlike an index it cannot panic; without any
    /// input it is zero.
    pub fn first_input(&self) -> SVector<T, NU> {
        self.u.first().copied().unwrap_or_else(SVector::zeros)
    }

    /// Back to a solution of nothing yet.
    pub fn clear(&mut self) {
        self.u.fill(SVector::zeros());
        self.x.fill(SVector::zeros());
        self.cost = T::zero();
        self.status = Status::Solved;
        self.active.clear();
        self.active.doubted = 0;
        self.active.trusted = false;
        self.active.lasting = false;
        self.active.holds = Retries::default();
        self.changes = 0;
    }

    /// The same on the heap.
    #[cfg(feature = "alloc")]
    pub fn allocate(Capacity { stages, active, .. }: Capacity) -> Self {
        Self::new(
            List::repeat(SVector::zeros(), stages),
            List::repeat(SVector::zeros(), stages),
            List::repeat(PackedRow::empty(), active),
        )
    }
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use super::*;

    #[test]
    fn a_solution_of_nothing_yet_doubts_nothing() {
        let mut solution = Solution::<f64, 2, 1>::allocate(Capacity::default());
        solution.active.doubted = 3;
        (solution.active.trusted, solution.active.lasting) = (true, true);
        solution.active.holds.give_up();
        solution.clear();
        assert_eq!(solution.active.doubted, 0);
        assert!(!(solution.active.trusted || solution.active.lasting));
        assert!(solution.active.holds.are_due());
    }
}
