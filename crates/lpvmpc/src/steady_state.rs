//! Where a plant can stand: the steady state nearest to a reference, and the input that holds it.
//!
//! A pendulum away from upright, a robot on a slope, a tank that leaks: each needs an input to stay
//! where it is. A cost that asks for no input would pull it off its set point.

use crate::model::{LpvModel, Scalar};
use crate::ocp::Bounds;
use nalgebra::{SMatrix, SVector, convert};

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

/// Newton steps at most, for each set of components at their bounds.
const MOST_STEPS: usize = 50;
/// Steps after which they are halved, and halved again: f may be far from linear.
const PATIENCE: usize = 15;

/// What each component of state and input may do.
struct Free<const NX: usize, const NU: usize> {
    x: [bool; NX],
    u: [bool; NU],
}

/// The steady state of `model` nearest to `problem.x_ref`. `None` where none was found: the plant
/// has none within the bounds, or Newton's method does not find it from the reference.
///
/// Each step solves min |x - x_ref|_Q^2 + eps^(2/3) |u|_R^2 subject to the linearised f = 0. A
/// component that ends beyond its bound is set to it, the farthest first.
pub(crate) fn nearest<P, T, const NX: usize, const NU: usize, const NS: usize>(
    model: &P,
    problem: &SteadyStateProblem<T, NX, NU>,
) -> Option<SteadyState<T, NX, NU>>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS> + ?Sized,
{
    let mut free = Free {
        x: [true; NX],
        u: [true; NU],
    };
    let mut x = problem.x.project(&problem.x_ref);
    let mut u = problem.u.project(&SVector::zeros());
    for _ in 0..=NX + NU {
        newton(model, problem, &free, &mut x, &mut u)?;
        if !bind_farthest(problem, &mut free, &mut x, &mut u) {
            let near: T = T::default_epsilon().powf(convert(0.25));
            let sizes = x.iter().zip(problem.x_ref.iter());
            let reached =
                { sizes }.all(|(x, x_ref)| (*x - *x_ref).abs() <= near * (T::one() + x_ref.abs()));
            return Some(SteadyState { x, u, reached });
        }
    }
    None
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

/// Newton's method for the free components; `None` if it does not converge.
fn newton<P, T, const NX: usize, const NU: usize, const NS: usize>(
    model: &P,
    problem: &SteadyStateProblem<T, NX, NU>,
    free: &Free<NX, NU>,
    x: &mut SVector<T, NX>,
    u: &mut SVector<T, NU>,
) -> Option<()>
where
    T: Scalar,
    P: LpvModel<T, NX, NU, NS> + ?Sized,
{
    let eps = T::default_epsilon();
    let small = eps.sqrt();
    let nearly_nothing = eps.powf(convert(2.0 / 3.0));
    let one_if = |free: bool| if free { T::one() } else { T::zero() };
    // A state without weight may move, but not for nothing.
    let least = (problem.q.amax() * convert(1e-6)).max(convert(1e-12));
    // The units in which a unit of each component costs 1; a component that is not free has none.
    let unit_x = SVector::from_fn(|i, _| one_if(free.x[i]) / problem.q[i].max(least).sqrt());
    let unit_u =
        SVector::from_fn(|i, _| one_if(free.u[i]) / (problem.r[i] * nearly_nothing).sqrt());
    for step in 0..MOST_STEPS {
        let (a, b) = rates_of(model, x, u);
        let towards_x =
            (problem.x_ref - *x).component_mul(&SVector::from_fn(|i, _| one_if(free.x[i])));
        let towards_u = (-*u).component_mul(&SVector::from_fn(|i, _| one_if(free.u[i])));
        let missing = rate(model, x, u) + a * towards_x + b * towards_u;
        let columns = (scaled_columns(&a, &unit_x), scaled_columns(&b, &unit_u));
        let (away_x, away_u) = least_norm(columns, missing)?;
        let part = convert::<f64, T>(0.5).powi(i32::try_from(step / PATIENCE).unwrap_or(i32::MAX));
        let dx = (towards_x - away_x.component_mul(&unit_x)) * part;
        let du = (towards_u - away_u.component_mul(&unit_u)) * part;
        *x += dx;
        *u += du;
        let settled = |change: &T, value: &T| change.abs() <= small * (T::one() + value.abs());
        let f = rate(model, x, u);
        let standing = f.iter().zip(a.row_iter()).all(|(f, row)| {
            let size = row.iter().fold(T::one(), |sum, a| sum + a.abs());
            f.abs() <= small * size
        });
        if standing
            && dx.iter().zip(x.iter()).all(|(d, x)| settled(d, x))
            && du.iter().zip(u.iter()).all(|(d, u)| settled(d, u))
        {
            return Some(());
        }
    }
    None
}

/// Sets the component that is farthest beyond its bound to it, for good. `false` if none is beyond.
fn bind_farthest<T: Scalar, const NX: usize, const NU: usize>(
    problem: &SteadyStateProblem<T, NX, NU>,
    free: &mut Free<NX, NU>,
    x: &mut SVector<T, NX>,
    u: &mut SVector<T, NU>,
) -> bool {
    let (within_x, within_u) = (problem.x.project(x), problem.u.project(u));
    let excess_x = (*x - within_x).abs();
    let excess_u = (*u - within_u).abs();
    let rounding = T::default_epsilon().sqrt();
    // Inputs first: a state beyond its bound is often the consequence.
    let (excess_u, j) = largest(&excess_u);
    let (excess_x, i) = largest(&excess_x);
    if excess_u > rounding * (T::one() + u[j].abs()) {
        u[j] = within_u[j];
        free.u[j] = false;
        true
    } else if excess_x > rounding * (T::one() + x[i].abs()) {
        x[i] = within_x[i];
        free.x[i] = false;
        true
    } else {
        (*x, *u) = (within_x, within_u);
        false
    }
}

/// The largest entry and its place.
fn largest<T: Scalar, const K: usize>(v: &SVector<T, K>) -> (T, usize) {
    let mut found = (-T::one(), 0);
    for (i, entry) in v.iter().enumerate() {
        if *entry > found.0 {
            found = (*entry, i);
        }
    }
    found
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
