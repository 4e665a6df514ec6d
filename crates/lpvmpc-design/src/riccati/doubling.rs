//! The doubling iteration on the triple (A, G, H), and its start for a continuous equation.

use nalgebra::{Complex, DMatrix};

use super::Time;
use crate::matrix_check::symmetric_part;
use crate::modes::poles;

/// Doubling steps allowed. A loop whose slowest pole is 1 - 1e-12 needs 45.
const DOUBLING_CAP: usize = 60;
/// A state's own cost stands still when a step changes it by less than this part: the next one squares what is left.
const AT_REST: f64 = 1e-8;

/// One state of the structure-preserving doubling algorithm for
/// X = A'X (I + G X)^-1 A + H, with G = B R^-1 B' and H = Q at the start:
///
/// ```text
/// A+ = A (I + G H)^-1 A
/// G+ = G + A (I + G H)^-1 G A'
/// H+ = H + A'H (I + G H)^-1 A          H -> X
/// ```
pub(super) struct Doubling {
    a: DMatrix<f64>,
    g: DMatrix<f64>,
    h: DMatrix<f64>,
}

/// A number, or the square of one, overflowed.
pub(super) const LEFT_THE_NUMBERS: &str = "the iteration left the finite numbers";

/// The iteration ended without a solution.
pub(super) struct Stalled {
    pub(super) reason: &'static str,
    pub(super) doublings: usize,
}

impl Doubling {
    /// The start for the equation with these A, G = B R^-1 B' and Q.
    pub(super) fn of(
        time: Time,
        a: &DMatrix<f64>,
        g: &DMatrix<f64>,
        q: &DMatrix<f64>,
    ) -> Result<Self, Stalled> {
        match time {
            Time::Continuous => Self::of_continuous(a, g, q).ok_or(Stalled {
                reason: "the equation could not be brought to discrete form",
                doublings: 0,
            }),
            Time::Discrete => Ok(Self {
                a: a.clone(),
                g: g.clone(),
                h: q.clone(),
            }),
        }
    }

    /// The discrete triple with the same stabilising solution as A'X + X A - X G X + Q = 0.
    ///
    /// The Cayley transform mu = (lambda + gamma) / (lambda - gamma), gamma > 0, takes the left
    /// half plane to the unit disc. With T = [A - gamma I, -G; -Q, -(A - gamma I)']^-1 the
    /// transformed pencil has the standard form, and
    ///
    /// ```text
    /// I + 2 gamma T = [A0, -G0; -H0, 2 I - A0']
    /// ```
    ///
    /// holds the start (A0, G0, H0). `None` when T does not exist or gamma cannot be found.
    fn of_continuous(a: &DMatrix<f64>, g: &DMatrix<f64>, q: &DMatrix<f64>) -> Option<Self> {
        let n = a.nrows();
        let gamma = cayley_shift(&poles(&block(a, g, q)).ok()?);
        let shifted = a - DMatrix::identity(n, n) * gamma;
        let t = block(&shifted, g, q).lu().try_inverse()? * (2.0 * gamma);
        Some(Self {
            a: DMatrix::identity(n, n) + t.view((0, 0), (n, n)),
            g: symmetric_part(&-t.view((0, n), (n, n)).into_owned()),
            h: symmetric_part(&-t.view((n, 0), (n, n)).into_owned()),
        })
    }

    /// Doubles until H stands still as a whole, to rounding, and the cost of each state by itself, which may be much
    /// smaller; returns it with the number of steps. Where rounding keeps a small one moving, H as a whole will do.
    pub(super) fn run(mut self) -> Result<(DMatrix<f64>, usize), Stalled> {
        let mut at_rest = false;
        for doublings in 1..=DOUBLING_CAP {
            let Some(next) = self.doubled() else {
                return Err(Stalled {
                    reason: LEFT_THE_NUMBERS,
                    doublings,
                });
            };
            let change = &next.h - &self.h;
            self = next;
            at_rest = change.norm() <= f64::EPSILON * self.h.norm();
            let (changes, costs) = (change.diagonal(), self.h.diagonal());
            let mut each = changes.iter().zip(&costs);
            if at_rest && each.all(|(change, cost)| change.abs() <= AT_REST * cost.abs()) {
                return Ok((self.h, doublings));
            }
        }
        if at_rest {
            return Ok((self.h, DOUBLING_CAP));
        }
        Err(Stalled {
            reason: "the iteration did not come to rest",
            doublings: DOUBLING_CAP,
        })
    }

    fn doubled(&self) -> Option<Self> {
        let n = self.a.nrows();
        let w = (DMatrix::identity(n, n) + &self.g * &self.h).lu();
        let wa = w.solve(&self.a)?;
        let wg = w.solve(&self.g)?;
        let next = Self {
            a: &self.a * &wa,
            g: symmetric_part(&(&self.g + &self.a * wg * self.a.transpose())),
            h: symmetric_part(&(&self.h + self.a.transpose() * &self.h * wa)),
        };
        [&next.a, &next.g, &next.h]
            .iter()
            // Where the norm overflows, nothing can be told of convergence.
            .all(|m| m.norm().is_finite())
            .then_some(next)
    }
}

/// [A, -G; -Q, -A']: the Hamiltonian matrix of the equation.
fn block(a: &DMatrix<f64>, g: &DMatrix<f64>, q: &DMatrix<f64>) -> DMatrix<f64> {
    let n = a.nrows();
    let mut m = DMatrix::zeros(2 * n, 2 * n);
    m.view_mut((0, 0), (n, n)).copy_from(a);
    m.view_mut((0, n), (n, n)).copy_from(&-g);
    m.view_mut((n, 0), (n, n)).copy_from(&-q);
    m.view_mut((n, n), (n, n)).copy_from(&-a.transpose());
    m
}

/// The gamma that makes the slowest transformed pole fastest when the poles are real: the
/// geometric mean of the smallest and the largest distance from zero. Any gamma > 0 is right, so
/// poles at zero are only kept from making it zero.
fn cayley_shift(hamiltonian_poles: &[Complex<f64>]) -> f64 {
    let largest = hamiltonian_poles
        .iter()
        .map(|z| z.norm())
        .fold(0.0, f64::max);
    if largest == 0.0 {
        return 1.0;
    }
    let smallest = hamiltonian_poles
        .iter()
        .map(|z| z.norm())
        .fold(largest, f64::min)
        .max(1e-8 * largest);
    (smallest * largest).sqrt()
}
