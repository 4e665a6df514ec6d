//! Two planes on the same three motors: what each of them may have.

use lpvmpc::Scalar;
use nalgebra::convert;

/// The pairs of plane torques (tau_x, tau_y) that no motor objects to in any heading:
/// tau_x^2 + tau_y^2 <= radius^2.
///
/// With a given heading the motors allow a hexagon around this disc, with up to 1.15 times the
/// radius at its corners. It turns with the robot; the disc does not, so a plan within it stays
/// one while the robot turns, and the two planes' problems stay apart:
///
/// 1. [`first`](Self::first) says which plane is planned first, and its bound;
/// 2. [`rest`](Self::rest) is the other plane's bound, from what that plan takes.
///
/// The applied torques, and those of the two plans at every sample of the horizon, are then in
/// the disc. A plane that needs little leaves the rest to the other, which may have all of it. A
/// plane whose last plan was cut off has at least [`equal`](Self::equal).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneTorques<T> {
    radius: T,
}

impl<T: Scalar> PlaneTorques<T> {
    /// A disc of `radius` N m; of none where it is negative or not a number.
    pub(crate) fn new(radius: T) -> Self {
        let radius = if radius > T::zero() {
            radius
        } else {
            T::zero()
        };
        Self { radius }
    }

    /// The largest torque of a plane alone, N m; zero where yaw takes all.
    pub fn alone(&self) -> T {
        self.radius
    }

    /// The largest torque that both planes can have at once, N m.
    pub fn equal(&self) -> T {
        self.radius * convert(core::f64::consts::FRAC_1_SQRT_2)
    }

    /// Which plane is planned first (0 for x, 1 for y), and its bound in N m. `needs` are what
    /// [`need`](Self::need) says of the planes, infinite without a last plan.
    ///
    /// The plane that needs more comes first. The other one keeps what it needs, up to an equal
    /// share.
    pub fn first(&self, needs: [T; 2]) -> (usize, T) {
        let [x, y] = needs;
        if x >= y {
            (0, self.rest(y.min(self.equal())))
        } else {
            (1, self.rest(x.min(self.equal())))
        }
    }

    /// What a plane needs: the largest torque of its last plan, N m, or infinite where that
    /// was cut off by the `bound` N m that it had.
    pub fn need(plan: impl IntoIterator<Item = T>, bound: T) -> T {
        let largest = |most: T, torque: T| {
            let torque = torque.abs();
            let stays = torque <= most || !most.is_finite();
            if stays { most } else { torque }
        };
        let most = plan.into_iter().fold(T::zero(), largest);
        // Negated, so that a plan that is NaN counts as cut off.
        if !(most < bound * convert(1.0 - 1e-3)) {
            convert(f64::INFINITY)
        } else {
            most
        }
    }

    /// What is left for a plane when the other one has a plan with torques up to `taken` N m.
    pub fn rest(&self, taken: T) -> T {
        let rest = self.radius * self.radius - taken * taken;
        if rest > T::zero() {
            rest.sqrt()
        } else {
            T::zero()
        }
    }
}
