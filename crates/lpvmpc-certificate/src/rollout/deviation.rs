//! The difference of two motions of the same plant, which moves on by the Jacobian between them.

use crate::enclosure::{Arithmetic, FlowError, Interval, TaylorModel, product};
use lpvmpc::Number;

/// More rounds than this do not help.
const MOST_ROUNDS: usize = 30;
/// Share of its width by which a guess is widened on either side.
const INFLATION: f64 = 0.1;

/// What the difference does not leave within a step of `length` seconds, from `start` on, where it changes by
/// `slopes` times itself.
pub(super) fn during<const NX: usize>(
    start: &[Interval; NX],
    slopes: &[[Interval; NX]; NX],
    length: Interval,
) -> Result<[Interval; NX], FlowError> {
    let time = Interval::new(0.0, length.upper);
    let picard = |v: &[Interval; NX]| -> [Interval; NX] {
        let rate = times(slopes, v);
        std::array::from_fn(|i| start[i] + time * rate[i])
    };
    let mut guess = picard(start);
    for _ in 0..MOST_ROUNDS {
        // A difference of zero is widened, too.
        let radius = |x: Interval| (1.0 + INFLATION) * x.radius() + f64::MIN_POSITIVE;
        let wide = guess.map(|x| Interval::around(x.middle(), radius(x)));
        let image = picard(&wide);
        if (0..NX).all(|i| wide[i].contains(image[i])) {
            return Ok(image);
        }
        guess = std::array::from_fn(|i| image[i].hull(guess[i]));
    }
    Err(FlowError::NoEnclosure { step: length.upper })
}

/// The difference after the step: with M its `slopes` at some times, (I + h M + h^2/2 M M) e from `start` on, and
/// h^3/6 M M M e of the difference `during` the step. The matrices are summed first, so that what dies away does.
pub(super) fn after<const NX: usize, const D: usize>(
    start: &[TaylorModel<D>; NX],
    slopes: &[[TaylorModel<D>; NX]; NX],
    during: &[Interval; NX],
    length: Interval,
) -> [TaylorModel<D>; NX] {
    let h = TaylorModel::<D>::from(length);
    let half = h * h * TaylorModel::constant(0.5);
    let sixth = half * h * TaylorModel::constant(3.0).reciprocal();
    let square = product(slopes, slopes);
    let step: [[TaylorModel<D>; NX]; NX] = std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let unit = TaylorModel::constant(if i == j { 1.0 } else { 0.0 });
            unit + h * slopes[i][j] + half * square[i][j]
        })
    });
    let moved = times(&step, start);
    let rest = times(slopes, &times(&square, &during.map(TaylorModel::from)));
    std::array::from_fn(|i| moved[i] + sixth * rest[i])
}

fn times<T: Arithmetic, const NX: usize>(m: &[[T; NX]; NX], v: &[T; NX]) -> [T; NX] {
    product(m, &v.map(|entry| [entry])).map(|[entry]| entry)
}
