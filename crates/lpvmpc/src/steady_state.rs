//! Where a plant can stand: the steady state nearest to a reference, and the input that holds it.
//!
//! A pendulum away from upright, a robot on a slope, a tank that leaks: each needs an input to stay
//! where it is. A cost that asks for no input would pull it off its set point.

mod interior_point;
mod newton;

use crate::model::{LpvModel, Scalar};
use crate::ocp::Bounds;
use interior_point::InteriorPoint;
use nalgebra::{SMatrix, SVector, convert};
use newton::{Steps, newton};

/// A steady state that is looked for: f(x, u) = 0 within the bounds, as near to the reference as
/// can be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SteadyStateProblem<T, const NX: usize, const NU: usize> {
    /// x_ref, in state units.
    pub x_ref: SVector<T, NX>,
    /// Weights of (x - x_ref)^2 by component, at least 0: the diagonal of Q.
    pub q: SVector<T, NX>,
    /// Weights of u^2 by component, above 0: the diagonal of R. The input counts next to nothing
    /// beside the state; it decides where several hold the same state.
    pub r: SVector<T, NU>,
    /// Bounds of the state.
    pub x: Bounds<T, NX>,
    /// Bounds of the input.
    pub u: Bounds<T, NU>,
}

/// A steady state, f(x, u) = 0; of a model with a period F(x, u) = x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SteadyState<T, const NX: usize, const NU: usize> {
    /// The state at which the plant stands.
    pub x: SVector<T, NX>,
    /// The input that holds it there.
    pub u: SVector<T, NU>,
    /// Whether x is the reference itself, up to eps^(1/4) of its size (1e-4 in `f64`). If not, the
    /// plant cannot stand at the reference, and x is the nearest place where it can.
    pub reached: bool,
}

/// How far inside the bounds the interior-point method begins, in parts of the room between them: near them, then, should that
/// lead nowhere, in the middle.
const INSIDE: [f64; 2] = [0.01, 0.5];

/// What each component of state and input may do.
struct Free<const NX: usize, const NU: usize> {
    x: [bool; NX],
    u: [bool; NU],
}

/// A state and an input.
type Point<T, const NX: usize, const NU: usize> = (SVector<T, NX>, SVector<T, NU>);

/// The steady state of `model` nearest to `problem.x_ref`, of the sum of `q` times squares and next to nothing of `r`.
/// `None` where none was found: the plant has none within the bounds, or none is near where the search came to an end.
///
/// Where the plant can stand at the reference, or near it without a bound, Newton's method finds it in a few steps. Elsewhere
/// an interior-point method goes there within the bounds, and tells which of them are met; Newton's method ends on them.
pub(crate) fn nearest<P, T, const NX: usize, const NU: usize, const NS: usize>(
    model: &P,
    problem: &SteadyStateProblem<T, NX, NU>,
) -> Option<SteadyState<T, NX, NU>>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS> + ?Sized,
{
    if !problem.x_ref.iter().all(|x_ref| x_ref.is_finite()) {
        return None;
    }
    let all = Free {
        x: [true; NX],
        u: [true; NU],
    };
    let begin = (
        problem.x.project(&problem.x_ref),
        problem.u.project(&SVector::zeros()),
    );
    let at_once = newton(model, problem, &all, begin, Steps::Straight);
    let found = at_once.and_then(|point| problem.within(&point));
    let (x, u) = match found {
        Some(found) => found,
        None => within_bounds(model, problem)?,
    };
    let near: T = T::default_epsilon().powf(convert(0.25));
    let mut sizes = x.iter().zip(problem.x_ref.iter());
    let reached = sizes.all(|(x, x_ref)| (*x - *x_ref).abs() <= near * (T::one() + x_ref.abs()));
    Some(SteadyState { x, u, reached })
}

/// The one that is nearest within the bounds, some of which are met.
#[cold]
#[inline(never)]
fn within_bounds<P, T, const NX: usize, const NU: usize, const NS: usize>(
    model: &P,
    problem: &SteadyStateProblem<T, NX, NU>,
) -> Option<Point<T, NX, NU>>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS> + ?Sized,
{
    let mut starts = INSIDE.iter();
    let found = starts.find_map(|inside| InteriorPoint::new(problem, *inside).minimise(model))?;
    let (free, on_bounds) = found.active();
    // Which bounds are met can be in doubt: then the point itself is the answer, which is inside.
    let ended = newton(model, problem, &free, on_bounds, Steps::Halved);
    let no_dearer = |point: &Point<T, NX, NU>| {
        let most = problem.distance(&found.point());
        problem.distance(point) <= most + T::default_epsilon().sqrt() * (T::one() + most)
    };
    let ended = { ended }.and_then(|point| problem.within(&point));
    Some({ ended }.filter(no_dearer).unwrap_or(found.point()))
}

impl<T: Scalar, const NX: usize, const NU: usize> SteadyStateProblem<T, NX, NU> {
    /// The point, if it is within the bounds up to rounding, which is taken off.
    fn within(&self, (x, u): &Point<T, NX, NU>) -> Option<Point<T, NX, NU>> {
        let inside = (self.x.project(x), self.u.project(u));
        let rounding = T::default_epsilon().sqrt();
        let same =
            |value: &T, inside: &T| (*value - *inside).abs() <= rounding * (T::one() + value.abs());
        let same_x = x.iter().zip(&inside.0).all(|(x, inside)| same(x, inside));
        let same_u = u.iter().zip(&inside.1).all(|(u, inside)| same(u, inside));
        (same_x && same_u).then_some(inside)
    }

    /// What is to be least, of the state.
    fn distance(&self, (x, _): &Point<T, NX, NU>) -> T {
        (x - self.x_ref).map(|e| e * e).dot(&self.q)
    }

    /// What a unit of each component costs. A state without weight may move, but not for nothing; an input costs next to
    /// nothing.
    fn weights(&self) -> Point<T, NX, NU> {
        let least = (self.q.amax() * convert(1e-6)).max(convert(1e-12));
        let nearly_nothing = T::default_epsilon().powf(convert(2.0 / 3.0));
        (self.q.map(|q| q.max(least)), self.r * nearly_nothing)
    }
}

/// What is zero where the plant stands: f(x, u), or F(x, u) - x of a model with a period.
fn rate<P, T, const NX: usize, const NU: usize, const NS: usize>(
    model: &P,
    x: &SVector<T, NX>,
    u: &SVector<T, NU>,
) -> SVector<T, NX>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS> + ?Sized,
{
    let there = model.derivative(x, u);
    match model.period() {
        Some(_) => there - x,
        None => there,
    }
}

/// Its derivatives.
fn rates_of<P, T, const NX: usize, const NU: usize, const NS: usize>(
    model: &P,
    x: &SVector<T, NX>,
    u: &SVector<T, NU>,
) -> (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>)
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS> + ?Sized,
{
    let (a, b) = model.jacobian(x, u);
    match model.period() {
        Some(_) => (a - SMatrix::identity(), b),
        None => (a, b),
    }
}

/// What each entry of f is measured by: the sum of its derivatives with respect to the state (`a`), and 1.
fn sizes<T: Scalar, const NX: usize>(a: &SMatrix<T, NX, NX>) -> SVector<T, NX> {
    SVector::from_fn(|i, _| a.row(i).iter().fold(T::one(), |sum, a| sum + a.abs()))
}

/// How far f bends away over a step, in its `sizes`: the difference of its derivatives at the end and at the beginning, along
/// it.
fn bent<T: Scalar, const NX: usize, const NU: usize>(
    begin: &(SMatrix<T, NX, NX>, SMatrix<T, NX, NU>),
    end: &(SMatrix<T, NX, NX>, SMatrix<T, NX, NU>),
    (dx, du): &Point<T, NX, NU>,
    sizes: &SVector<T, NX>,
) -> T {
    let bent = (end.0 - begin.0) * dx + (end.1 - begin.1) * du;
    bent.component_div(sizes).lp_norm(1)
}

/// Whether f is zero up to rounding, beside derivatives `a`.
fn stands<T: Scalar, const NX: usize>(f: &SVector<T, NX>, a: &SMatrix<T, NX, NX>) -> bool {
    let small = T::default_epsilon().sqrt();
    let measured = f.component_div(&sizes(a));
    measured.iter().all(|f| f.abs() <= small)
}

/// Whether a change of a component is next to nothing beside its `value`.
fn is_settled<T: Scalar, const K: usize>(change: &SVector<T, K>, value: &SVector<T, K>) -> bool {
    let small = T::default_epsilon().sqrt();
    let mut pairs = change.iter().zip(value.iter());
    pairs.all(|(change, value)| change.abs() <= small * (T::one() + value.abs()))
}

/// The change of x and u with f + A dx + B du = 0 that is nearest to where each component would go without that
/// (`towards`), in the `units` in which a unit of each costs 1; a component of unit zero stays. `None` if a number is not
/// finite.
fn constrained_step<T: Scalar, const NX: usize, const NU: usize>(
    f: SVector<T, NX>,
    (a, b): &(SMatrix<T, NX, NX>, SMatrix<T, NX, NU>),
    units: &Point<T, NX, NU>,
    towards: &Point<T, NX, NU>,
) -> Option<Point<T, NX, NU>> {
    let missing = f + a * towards.0 + b * towards.1;
    let columns = (scaled_columns(a, &units.0), scaled_columns(b, &units.1));
    let (away_x, away_u) = least_norm(columns, missing)?;
    Some((
        towards.0 - away_x.component_mul(&units.0),
        towards.1 - away_u.component_mul(&units.1),
    ))
}

/// M diag(`factors`)
fn scaled_columns<T: Scalar, const R: usize, const C: usize>(
    m: &SMatrix<T, R, C>,
    factors: &SVector<T, C>,
) -> SMatrix<T, R, C> {
    SMatrix::from_fn(|i, j| m[(i, j)] * factors[j])
}

/// The shortest (y, z) with A y + B z = v, by orthogonal rows: its error grows with the condition of [A B],
/// not with the square, and what the state and what the input may cost are twelve orders of magnitude apart.
/// A row that depends on those before it, as one of zeros does, is left out. `None` if a number is not finite.
fn least_norm<T: Scalar, const NX: usize, const NU: usize>(
    (mut a, mut b): (SMatrix<T, NX, NX>, SMatrix<T, NX, NU>),
    mut v: SVector<T, NX>,
) -> Option<(SVector<T, NX>, SVector<T, NU>)> {
    let rounding = T::default_epsilon() * convert(4.0 * NX as f64);
    let (mut y, mut z) = (SVector::<T, NX>::zeros(), SVector::<T, NU>::zeros());
    for i in 0..NX {
        let (mut row_a, mut row_b) = (a.row(i).into_owned(), b.row(i).into_owned());
        let before = (row_a.norm_squared() + row_b.norm_squared()).sqrt();
        // Twice, so that rounding of the first pass is taken out, too.
        for _ in 0..2 {
            for j in 0..i {
                let (one_a, one_b) = (a.row(j).into_owned(), b.row(j).into_owned());
                let share = one_a.dot(&row_a) + one_b.dot(&row_b);
                row_a -= one_a * share;
                row_b -= one_b * share;
                let known = v[j];
                v[i] -= known * share;
            }
        }
        let length = (row_a.norm_squared() + row_b.norm_squared()).sqrt();
        let own = if length > rounding * before {
            T::one() / length
        } else {
            T::zero()
        };
        v[i] *= own;
        a.set_row(i, &(row_a * own));
        b.set_row(i, &(row_b * own));
        y += a.row(i).transpose() * v[i];
        z += b.row(i).transpose() * v[i];
    }
    let finite = y.iter().chain(z.iter()).all(|entry| entry.is_finite());
    finite.then_some((y, z))
}
