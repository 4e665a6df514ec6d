//! How many bounds the answer may have, and whether that is worth the phase.

use super::{AllRetries, guess, is_large};
use crate::model::Scalar;
use crate::ocp::Ocp;
use crate::rows;
use crate::solution::{ActiveSet, Quantity, Solution};
use crate::solver::trajectory;

/// Fewer bounds of the last answer are not tried again.
pub(super) const FEWEST_REPEATED: usize = 20;
/// With so many violated bounds a few factorisations cost less than a pass for each bound.
const MANY: usize = 24;
/// So many where some are soft, which takes more factorisations, or those of a single input are known, with which the
/// dual method begins.
const MORE: usize = 32;
/// So many of several inputs where no bounds are known.
const MANY_UNKNOWN: usize = 20;
/// Of several inputs all of these are at least so many more than there are states and inputs: the more of these, the longer a
/// factorisation takes beside a pass;
const BESIDE: usize = 10;
/// where some are soft, so many more.
const BESIDE_SOFT: usize = 20;
/// [`MANY_LIMITS`] of a large plant.
const MANY_LIMITS_OF_LARGE: usize = 44;
/// Where more states are bounded than there are inputs, as speeds and accelerations are beside a position, most of what is
/// violated is not active in the answer: below so many, or as many of a single input as above, the dual method is given
const MANY_LIMITS: usize = 56;
/// so many changes first, in which it comes to an end as a rule,
const CHANGES_FIRST: usize = 64;
/// and so many of a single input, beside one for each bound that is known,
const CHANGES_OF_ONE: usize = 32;
/// which it begins with in less time than the interior-point method finds them while they are fewer than these.
const MANY_KNOWN: usize = 64;
/// So many soft ones of a single input, where all that can hold are violated: the dual method adds and drops them again.
const ALL_SOFT: usize = 20;
/// And so many inputs that the regulator saturates, where there is one of each stage.
const MANY_SATURATED: usize = 8;
/// Of several inputs, where too few are violated for the interior-point method, and none that is soft, it comes after the dual
/// method, which begins with the known bounds, too, while these are fewer than so many times as many.
const MANY_MORE_KNOWN: usize = 2;
/// Where fewer bounds were active before than one for so many that are violated, they tell little of what to expect.
const LITTLE: usize = 2;
/// Of a single input a bound that is met keeps others: while a speed stays at its limit only half of what is violated
/// becomes active.
const LITTLE_OF_ONE: usize = 4;

const _: () = assert!(FEWEST_REPEATED <= ALL_SOFT && FEWEST_REPEATED <= MANY);

/// What the trajectory without bounds violates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Violated {
    /// How many bounds.
    pub bounds: usize,
    /// How many of inputs.
    inputs: usize,
    /// Whether one is soft.
    pub soft: bool,
}

impl Violated {
    /// By the trajectory in `solution`.
    #[inline(never)]
    pub fn new<T: Scalar, const NX: usize, const NU: usize>(
        ocp: &Ocp<T, NX, NU>,
        solution: &Solution<T, NX, NU>,
    ) -> Self {
        let (mut bounds, mut inputs, mut soft) = (0, 0, false);
        rows::violated_bounds(ocp, &trajectory(solution), &mut |candidate| {
            bounds += 1;
            inputs += usize::from(matches!(candidate.bound.quantity, Quantity::Input(_)));
            soft |= candidate.soft.is_some();
        });
        Self {
            bounds,
            inputs,
            soft,
        }
    }
}

/// What can be told from the trajectory without bounds, and from the last answer.
pub(super) struct Expected {
    /// How many bounds.
    pub bounds: usize,
    /// Whether these are many enough for the phase.
    pub many: bool,
    /// Whether enough are known for a guess: fewer the dual method takes over in less time.
    pub worth_repeating: bool,
    /// How many changes the dual method has before the interior-point method, if it should come first.
    pub changes_first: Option<usize>,
    /// Whether the inputs that the regulator saturates are worth a guess.
    pub saturated: bool,
    /// Whether most of the bounds of the last answer are of rows that bind several inputs.
    pub rows: bool,
    /// Whether one that is violated is soft, or some of a single input are known.
    takes_more: bool,
}

impl Expected {
    /// Where the trajectory without bounds has `violated` these, and `last` are the active rows of the last answer: `known`
    /// of them, or 0 if they are not to be begun with.
    pub fn new<T: Scalar, const NX: usize, const NU: usize>(
        ocp: &Ocp<T, NX, NU>,
        violated: &Violated,
        last: &ActiveSet<T>,
        known: usize,
    ) -> Self {
        let Violated {
            bounds: violated,
            inputs,
            soft,
        } = *violated;
        let takes_more = soft || NU == 1 && known > 0;
        let states_and_inputs = if NU > 1 { NX + NU } else { 0 };
        let enough = match (NU == 1 && soft, known) {
            (true, 0) => ocp.length().clamp(ALL_SOFT, MORE),
            (true, _) => ALL_SOFT,
            (false, _) if takes_more => MORE.max(BESIDE_SOFT + states_and_inputs),
            (false, 0) if NU > 1 => MANY_UNKNOWN.max(BESIDE + states_and_inputs),
            (false, _) => MANY.max(BESIDE + states_and_inputs),
        };
        // Where several inputs act together, general rows that were active are taken over one by one in less time.
        let rows = NU > 1 && guess::mostly_rows(last);
        // As a rule most of those that are known hold again, and others are violated only as long as they do not.
        let little = if NU == 1 { LITTLE_OF_ONE } else { LITTLE };
        let tells = !rows && little * known >= violated;
        // No more can hold independently than there are inputs, but any number can be exceeded.
        let most = if soft { usize::MAX } else { ocp.length() * NU };
        let bounds = if tells { known } else { violated }.min(most);
        // About twice as many were violated as are known.
        let limits = if tells { 2 * known } else { violated };
        let few_hold = !soft && 2 * inputs < violated && hard_states(ocp) > NU;
        let mostly_known = !takes_more && violated < enough && bounds < MANY_MORE_KNOWN * enough;
        let (one_by_one, changes) = match NU {
            1 if tells => (known < MANY_KNOWN, known + CHANGES_OF_ONE),
            1 => (limits < MORE, known + CHANGES_OF_ONE),
            _ if is_large::<NX, NU>() => (limits < MANY_LIMITS_OF_LARGE, CHANGES_FIRST),
            _ => (limits < MANY_LIMITS, CHANGES_FIRST),
        };
        Self {
            bounds,
            changes_first: (few_hold && one_by_one || mostly_known).then_some(changes),
            many: bounds >= enough,
            worth_repeating: bounds.min(known) >= enough,
            // Those are nearly right where a single input moves the states.
            saturated: NU == 1 && 2 * inputs > violated && inputs >= MANY_SATURATED,
            rows,
            takes_more,
        }
    }

    /// Whether the interior-point method is worth a try before the dual one.
    pub fn search_is_due(&self) -> bool {
        self.many && self.changes_first.is_none()
    }

    /// Whether it is worth a try now.
    pub fn is_due(&mut self, retries: &mut AllRetries) -> bool {
        self.saturated = self.saturated && retries.saturations.are_due();
        self.saturated || self.many && retries.turns.are_due()
    }

    /// More changes than these the phase is not worth: of a single input the dual method needs one for each bound, half
    /// as many more for soft ones.
    pub fn worth<const NU: usize>(&self, any_soft: bool) -> usize {
        match (NU > 1, self.takes_more && any_soft) {
            (true, _) => usize::MAX,
            (false, true) => self.bounds + self.bounds / 2,
            (false, false) => self.bounds,
        }
    }
}

/// How many states have hard bounds in the middle of the horizon; as a rule they are the same at all stages.
fn hard_states<T: Scalar, const NX: usize, const NU: usize>(ocp: &Ocp<T, NX, NU>) -> usize {
    let common = ocp.common_at(ocp.length() / 2);
    let sides = common.x.lower.iter().zip(common.x.upper.iter());
    let bounds = sides.zip(&common.soft_x);
    let hard = bounds.filter(|((lower, upper), soft)| {
        soft.is_none() && (lower.is_finite() || upper.is_finite())
    });
    hard.count()
}
