//! The LPV embedding of the ballbot: scheduling (theta, theta_dot, phi_dot -
//! theta_dot), matrices A_c and B_c (eq. (4) and the paper's Table of elements). The third
//! scheduling parameter, the drive's speed, is for Coulomb friction alone, which the paper does not
//! have.
//!
//! The table prints B31 with an unbalanced bracket; here it is r_b (b3 - k) / (r_w d), as
//! M^-1 B~ gives. Its sinc(theta) is sin(theta)/theta.

use crate::parameters::{Ballbot, Field};
use crate::trigonometry::sin_cos;
use lpvmpc::{LpvModel, Scalar, SteadyState, SteadyStateProblem};
use nalgebra::{Matrix4, SMatrix, Vector1, Vector3, Vector4};

/// The scheduling (theta, theta_dot), as the embedding's formulas need it.
#[derive(Clone, Copy, Debug)]
pub struct Tilt<T> {
    /// sin(theta).
    pub sin: T,
    /// cos(theta).
    pub cos: T,
    /// sin(theta)/theta.
    pub sinc: T,
    /// theta_dot, rad/s.
    pub rate: T,
    /// The number 1.
    pub one: T,
}

/// The accelerations phi_ddot (first row) and theta_ddot (second row), rad/s^2.
#[derive(Clone, Copy, Debug)]
pub struct Accelerations<T> {
    /// Per theta, phi_dot and theta_dot: the columns of A that are not fixed by kinematics.
    pub a: [[T; 3]; 2],
    /// Per torque, 1/(N m).
    pub b: [T; 2],
}

impl<T: Field> Ballbot<T> {
    /// The embedding's rows of the accelerations, on numbers or on sets of numbers, without friction
    /// in the drive.
    #[inline(always)]
    pub fn accelerations(&self, tilt: Tilt<T>) -> Accelerations<T> {
        let Self {
            b1,
            b3,
            b4,
            geometry,
            ..
        } = *self;
        let k = self.coupling(tilt.cos);
        let inverse = tilt.one / self.determinant(k);
        let gravity = geometry.centre_of_mass * geometry.gravity * tilt.sinc * inverse;
        let centrifugal =
            geometry.centre_of_mass * geometry.ball_radius * tilt.sin * tilt.rate * inverse;
        let friction = -b4 * inverse;
        let torque = self.gear() * inverse;
        Accelerations {
            a: [
                [gravity * k, friction * b3, centrifugal * b3],
                [gravity * b1, friction * k, centrifugal * k],
            ],
            b: [torque * (b3 - k), torque * (k - b1)],
        }
    }
}

impl<T: Field> Accelerations<T> {
    /// The same with a drive that loses `coefficient` (N m s/rad) times its speed phi_dot - theta_dot
    /// of its torque.
    #[inline(always)]
    pub fn with_drive_friction(self, coefficient: T) -> Self {
        let Self {
            a: [[gravity, rolling, centrifugal], [pull, drag, swing]],
            b: [ball, body],
        } = self;
        Self {
            a: [
                [
                    gravity,
                    rolling - coefficient * ball,
                    centrifugal + coefficient * ball,
                ],
                [pull, drag - coefficient * body, swing + coefficient * body],
            ],
            b: [ball, body],
        }
    }
}

impl<T: Scalar> LpvModel<T, 4, 1, 3> for Ballbot<T> {
    /// sigma(x) = (theta, theta_dot, phi_dot - theta_dot), rad and rad/s.
    fn scheduling(&self, x: &Vector4<T>) -> Vector3<T> {
        Vector3::new(x[1], x[3], x[2] - x[3])
    }

    #[inline(always)]
    fn matrices(&self, scheduling: &Vector3<T>) -> (Matrix4<T>, Vector4<T>) {
        let (theta, theta_dot) = (scheduling[0], scheduling[1]);
        let (sin, cos) = sin_cos(theta);
        let (zero, one) = (T::zero(), T::one());
        let bare = self.accelerations(Tilt {
            sin,
            cos,
            sinc: sinc(theta, sin),
            rate: theta_dot,
            one,
        });
        let Accelerations { a: [phi, body], b } = if self.drive.is_none() {
            bare
        } else {
            bare.with_drive_friction(self.drive.coefficient(scheduling[2]) / self.gear())
        };
        #[rustfmt::skip]
        let a = Matrix4::new(
            zero, zero,    one,     zero,
            zero, zero,    zero,    one,
            zero, phi[0],  phi[1],  phi[2],
            zero, body[0], body[1], body[2],
        );
        (a, Vector4::new(zero, zero, b[0], b[1]))
    }

    /// The upper half of A says that rates are rates, and nothing depends on phi.
    #[inline(always)]
    fn a_times<const C: usize>(&self, a: &Matrix4<T>, v: &SMatrix<T, 4, C>) -> SMatrix<T, 4, C> {
        let mut out = SMatrix::<T, 4, C>::zeros();
        for (out, v) in out.data.0.iter_mut().zip(&v.data.0) {
            let row = |i| a[(i, 1)] * v[1] + a[(i, 2)] * v[2] + a[(i, 3)] * v[3];
            *out = [v[2], v[3], row(2), row(3)];
        }
        out
    }

    #[inline(always)]
    fn derivative(&self, x: &Vector4<T>, u: &Vector1<T>) -> Vector4<T> {
        self.f(x, u[0])
    }

    #[inline(always)]
    fn jacobian(&self, x: &Vector4<T>, u: &Vector1<T>) -> (Matrix4<T>, Vector4<T>) {
        let (_, a, b) = self.tangent_of_f(x, u[0]);
        (a, b)
    }

    #[inline(always)]
    fn tangent(&self, x: &Vector4<T>, u: &Vector1<T>) -> (Vector4<T>, Matrix4<T>, Vector4<T>) {
        self.tangent_of_f(x, u[0])
    }

    /// Upright and at rest without torque, wherever the ball is; nowhere else.
    fn steady_state(&self, problem: &SteadyStateProblem<T, 4, 1>) -> Option<SteadyState<T, 4, 1>> {
        let zero = T::zero();
        let upright = Vector4::new(problem.x_ref[0], zero, zero, zero);
        let (x, u) = (
            problem.x.project(&upright),
            problem.u.project(&Vector1::zeros()),
        );
        let stands = x[1] == zero && x[2] == zero && x[3] == zero && u[0] == zero;
        stands.then_some(SteadyState {
            x,
            u,
            reached: x == problem.x_ref,
        })
    }
}

/// sin(x)/x, 1 at x = 0.
fn sinc<T: Scalar>(x: T, sin_x: T) -> T {
    if x == T::zero() { T::one() } else { sin_x / x }
}
