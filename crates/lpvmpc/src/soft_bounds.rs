//! What soft state bounds cost, so that they are exceeded only where they cannot be kept.
//!
//! A price is exact where it is above the multiplier of the hard bound. Near the goal that is a matter of the bound's own
//! width: how much of the cost lies beyond it. Far away it is a matter of the way ahead: how much sooner the plant is at
//! its goal if it exceeds the bound, and how far an excess of one sample takes the other states there.

use crate::model::Scalar;
use crate::ocp::{Bounds, Penalty, SoftBounds};
use crate::settings::{ControllerSettings, TerminalIngredient, largest};
use crate::small_matrix::product;
use nalgebra::{SMatrix, SVector, convert};

/// Price of a state bound exceeded by its width, in terminal costs of a state at that width: of a
/// ballbot's plans from rest to set points up to 10 m away no multiplier of a bound of `single-setpoint` was larger
/// (`testdata/nonlinear-mpc/multipliers.py`).
const PRICE_OF_WIDTH: f64 = 20.0;

/// Price of an excess far from the goal, in roots of P_jj times the cost of a plan that stands still: twice the slope that
/// x'Px has anywhere at that cost. Of bounds of any width no multiplier was larger (`multipliers.py`: 3.2).
const PRICE_OF_WAY: f64 = 4.0;

/// The same in halves of the slope of the cost of a plan that stands still, along what one sample's excess moves the states by:
/// that slope itself.
const PRICE_OF_EXCESS: f64 = 2.0;

/// Prices of soft state bounds, high enough to be exact as a rule, from the cost x'Px of a state
/// from there on (`cost` is P): 20 P_jj times the width of the bound per unit of excess, in the unit
/// of the cost.
///
/// Exact means that a bound is exceeded only where it cannot be kept: the price is above the
/// multiplier of the hard bound. Close to the goal that one is about the slope of the cost, 2 P_jj x_j, at the bound. Far
/// away it is that of the way ahead: see [`ControllerSettings::raise_prices`].
pub fn exact_prices<T: Scalar, const NX: usize>(
    cost: &SMatrix<T, NX, NX>,
    x: &Bounds<T, NX>,
) -> SoftBounds<T, NX> {
    let sides = x.lower.iter().zip(x.upper.iter());
    let mut prices = [None; NX];
    for (j, (place, (lower, upper))) in prices.iter_mut().zip(sides).enumerate() {
        let width = width(*lower, *upper);
        *place = width.map(|width| linear_price(price_of_width(own_cost(cost, j), width)));
    }
    prices
}

/// How wide bounds are; one alone, as far as it is from zero. Bounds of no width, or one at zero, count as one unit.
/// `None` without a bound.
pub(crate) fn width<T: Scalar>(lower: T, upper: T) -> Option<T> {
    let width = match (lower.is_finite(), upper.is_finite()) {
        (true, true) => upper - lower,
        (true, false) => lower.abs(),
        (false, true) => upper.abs(),
        (false, false) => return None,
    };
    Some(if width > T::zero() { width } else { T::one() })
}

/// The prices of a sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SoftPrices<T, const NX: usize> {
    /// Where a stage has none of its own.
    common: SoftBounds<T, NX>,
    /// The least linear price of each state.
    least: SVector<T, NX>,
    /// Whether hard bounds are soft, too, while a descent looks for a plan that keeps them.
    elastic: bool,
}

impl<T: Scalar, const NX: usize> SoftPrices<T, NX> {
    /// Those of the settings.
    pub fn given(soft_x: &SoftBounds<T, NX>) -> Self {
        Self {
            common: *soft_x,
            least: SVector::zeros(),
            elastic: false,
        }
    }

    /// Those of a sample whose goal is `way` from where the state is: those of the settings, raised where they are to be.
    /// `a` is the plant's matrix where the sample begins; `of_stages`: whether stages have prices of their own. Where neither
    /// they nor the settings have any, there is nothing to raise.
    // Of its own, not within the step, whose registers it would take.
    #[inline(never)]
    pub fn new<const NU: usize, const NS: usize>(
        settings: &ControllerSettings<T, NX, NU, NS>,
        terminal: &TerminalIngredient<T, NX>,
        of_stages: bool,
        way: &SVector<T, NX>,
        a: impl FnOnce() -> SMatrix<T, NX, NX>,
    ) -> Self {
        let mut prices = Self::given(&settings.soft_x);
        if settings.raise_prices
            && (of_stages || prices.common != [None; NX])
            && let TerminalIngredient::Cost(p) = terminal
        {
            prices.least = of_way(settings, p, way, &a());
            prices.common = prices.at_least(&settings.soft_x);
        }
        prices
    }

    /// Makes hard bounds of states and general rows soft, too, at `factor` times a price that is meant to be exact.
    #[cfg(all(feature = "alloc", not(target_arch = "wasm32")))]
    pub fn soften<const NU: usize, const NS: usize>(
        &mut self,
        settings: &ControllerSettings<T, NX, NU, NS>,
        terminal: &TerminalIngredient<T, NX>,
        way: &SVector<T, NX>,
        a: &SMatrix<T, NX, NX>,
        factor: T,
    ) {
        // Without a terminal cost, that of a sample.
        let cost = match terminal {
            TerminalIngredient::Cost(p) if own_cost(p, 0) > T::zero() => p,
            _ => &settings.weights.q,
        };
        let least = of_way(settings, cost, way, a);
        self.harden(settings);
        self.elastic = true;
        let sides = settings.x.lower.iter().zip(settings.x.upper.iter());
        let states = self.common.iter_mut().zip(least.iter()).zip(sides);
        for (j, ((price, least), (lower, upper))) in states.enumerate() {
            let width = width(*lower, *upper).unwrap_or(T::one());
            let linear = largest(*least, price_of_width(own_cost(cost, j), width)) * factor;
            *price = price.or(Some(linear_price(linear)));
        }
    }

    /// Makes them hard again.
    #[cfg(all(feature = "alloc", not(target_arch = "wasm32")))]
    pub fn harden<const NU: usize, const NS: usize>(
        &mut self,
        settings: &ControllerSettings<T, NX, NU, NS>,
    ) {
        self.elastic = false;
        self.common = self.at_least(&settings.soft_x);
    }

    /// Whether hard bounds are soft.
    #[cfg(all(feature = "alloc", not(target_arch = "wasm32")))]
    pub fn is_elastic(&self) -> bool {
        self.elastic
    }

    /// Of hard general rows, the largest of a state; `None` where they are hard.
    pub fn of_rows(&self) -> Option<Penalty<T>> {
        let prices = || self.common.iter().flatten().map(|price| price.linear);
        self.elastic
            .then(|| linear_price(prices().fold(T::zero(), largest)))
    }

    /// Those of a stage that may have `own` ones.
    #[inline(always)]
    pub fn of(&self, own: Option<&SoftBounds<T, NX>>) -> SoftBounds<T, NX> {
        own.map_or(self.common, |own| self.at_least(own))
    }

    /// The prices, none below the least, and in place of hard bounds the common ones while these are soft.
    fn at_least(&self, soft: &SoftBounds<T, NX>) -> SoftBounds<T, NX> {
        let mut raised = *soft;
        if self.elastic {
            for (price, common) in raised.iter_mut().zip(self.common) {
                *price = price.or(common);
            }
        }
        for (price, least) in raised.iter_mut().zip(self.least.iter()) {
            if let Some(price) = price
                && *least > price.linear
            {
                price.linear = *least;
            }
        }
        raised
    }
}

/// The least price of each state, on this `way` to a goal where the cost x'Px (`p`) is left.
fn of_way<T: Scalar, const NX: usize, const NU: usize, const NS: usize>(
    settings: &ControllerSettings<T, NX, NU, NS>,
    p: &SMatrix<T, NX, NX>,
    way: &SVector<T, NX>,
    a: &SMatrix<T, NX, NX>,
) -> SVector<T, NX> {
    let samples: T = convert(settings.horizon as f64);
    // Of a plan that stands still, than which a good one costs no more: half of its cost's slope.
    let slope = product(p, way) + product(&settings.weights.q, way) * samples;
    let value = way.dot(&slope);
    let brought = product(&a.transpose(), &slope) - slope;
    let mut least = SVector::<T, NX>::zeros();
    for (j, (least, brought)) in least.iter_mut().zip(brought.iter()).enumerate() {
        *least = price_of_way(own_cost(p, j), value, brought.abs());
    }
    least
}

fn linear_price<T: Scalar>(linear: T) -> Penalty<T> {
    let quadratic = T::zero();
    Penalty { linear, quadratic }
}

/// Of a state that costs P_jj (`own`) and has bounds of this `width`.
fn price_of_width<T: Scalar>(own: T, width: T) -> T {
    convert::<f64, T>(PRICE_OF_WIDTH) * own * width
}

/// Of a state that costs P_jj (`own`), where a plan that stands still costs `value` and a unit of excess brings twice what
/// is `brought`; nothing where that is too much for the number type.
// Once in the machine code of a microcontroller, for its flash.
#[cfg_attr(target_arch = "arm", inline(never))]
fn price_of_way<T: Scalar>(own: T, value: T, brought: T) -> T {
    let price = largest(
        brought * convert(PRICE_OF_EXCESS),
        (own * value).sqrt() * convert(PRICE_OF_WAY),
    );
    if value.is_finite() && price.is_finite() {
        price
    } else {
        T::zero()
    }
}

/// P_jj; of a state that costs nothing, the largest entry of P, which is one of its diagonal.
fn own_cost<T: Scalar, const NX: usize>(cost: &SMatrix<T, NX, NX>, j: usize) -> T {
    let on_diagonal = |i: usize| cost.get((i, i)).copied().unwrap_or_else(T::zero);
    let own = on_diagonal(j);
    if own > T::zero() {
        return own;
    }
    (0..NX).map(on_diagonal).fold(T::zero(), largest)
}
