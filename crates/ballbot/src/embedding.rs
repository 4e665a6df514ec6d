//! The LPV embedding of the ballbot: scheduling (theta, theta_dot, phi_dot -
//! theta_dot), matrices A_c and B_c (eq. (4) and the paper's Table of elements). The third
//! scheduling parameter, the drive's speed, is for Coulomb friction alone, which the paper does not
//! have.
//!
//! The table prints B31 with an unbalanced bracket; here it is r_b (b3 - k) / (r_w d), as
//! M^-1 B~ gives. Its sinc(theta) is sin(theta)/theta.

use crate::parameters::Ballbot;
use lpvmpc::{Embedding, Number, Scalar, SteadyState, SteadyStateProblem, Tangent};
use nalgebra::{Matrix4, SMatrix, Vector1, Vector3, Vector4};

/// The accelerations phi_ddot (first row) and theta_ddot (second row), rad/s^2.
struct Accelerations<T> {
    /// Per theta, phi_dot and theta_dot: the columns of A that are not fixed by kinematics.
    a: [[T; 3]; 2],
    /// Per torque, 1/(N m).
    b: [T; 2],
}

impl<T: Number> Ballbot<T> {
    /// A and B at the tilt `theta` (rad), the tilt rate `theta_dot` and the drive's `speed`
    /// phi_dot - theta_dot (rad/s); only Coulomb friction depends on the last one.
    #[inline(always)]
    pub fn matrices_at(&self, theta: T, theta_dot: T, speed: T) -> (Matrix4<T>, Vector4<T>) {
        let (sin, cos, sinc) = theta.sin_cos_sinc();
        let bare = self.accelerations((sin, cos, sinc), theta_dot);
        let Accelerations { a: [phi, body], b } = if self.drive.is_none() {
            bare
        } else {
            bare.with_drive_friction(self.drive.coefficient(speed) / self.gear())
        };
        let zero = T::constant(0.0);
        (
            state_matrix(phi, body),
            Vector4::new(zero, zero, b[0], b[1]),
        )
    }

    /// The rows of the accelerations without friction in the drive.
    #[inline(always)]
    fn accelerations(&self, (sin, cos, sinc): (T, T, T), theta_dot: T) -> Accelerations<T> {
        let Self { b1, b3, b4, .. } = *self;
        let k = self.coupling(cos);
        let inverse = T::constant(1.0) / self.determinant(k);
        let gravity = self.pull() * sinc * inverse;
        let centrifugal = self.arm() * sin * theta_dot * inverse;
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

impl<T: Number> Accelerations<T> {
    /// The same with a drive that loses `coefficient` (N m s/rad) times its speed phi_dot - theta_dot
    /// of its torque.
    #[inline(always)]
    fn with_drive_friction(self, coefficient: T) -> Self {
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

/// The state matrix whose lower rows, phi_ddot and theta_ddot, are these per theta, phi_dot and
/// theta_dot: rates are rates, and nothing depends on phi.
#[inline(always)]
pub(crate) fn state_matrix<T: Number>(phi_ddot: [T; 3], theta_ddot: [T; 3]) -> Matrix4<T> {
    let (zero, one) = (T::constant(0.0), T::constant(1.0));
    let ([a, b, c], [d, e, f]) = (phi_ddot, theta_ddot);
    #[rustfmt::skip]
    let matrix = Matrix4::new(
        zero, zero, one,  zero,
        zero, zero, zero, one,
        zero, a,    b,    c,
        zero, d,    e,    f,
    );
    matrix
}

impl<S: Scalar + Number> Embedding<4, 1, 3> for Ballbot<S> {
    /// sigma(x) = (theta, theta_dot, phi_dot - theta_dot), rad and rad/s.
    #[inline(always)]
    fn scheduling<N: Number>(&self, x: &Vector4<N>, _torque: &Vector1<N>) -> Vector3<N> {
        Vector3::new(x[1], x[3], x[2] - x[3])
    }

    #[inline(always)]
    fn matrices<N: Number>(&self, scheduling: &Vector3<N>) -> (Matrix4<N>, Vector4<N>) {
        self.over()
            .matrices_at(scheduling[0], scheduling[1], scheduling[2])
    }

    #[inline(always)]
    fn f<N: Number>(&self, x: &Vector4<N>, u: &Vector1<N>) -> Vector4<N> {
        self.over().f(x, u[0])
    }

    #[inline(always)]
    fn tangent<T: Scalar + Number>(&self, x: &Vector4<T>, u: &Vector1<T>) -> Tangent<T, 4, 1> {
        self.over().tangent_of_f(x, u[0])
    }

    /// Without the products with what is always zero or one.
    #[inline(always)]
    fn a_times<T: Scalar, const C: usize>(
        &self,
        a: &Matrix4<T>,
        v: &SMatrix<T, 4, C>,
    ) -> SMatrix<T, 4, C> {
        let mut out = SMatrix::<T, 4, C>::zeros();
        for (out, v) in out.data.0.iter_mut().zip(&v.data.0) {
            let row = |i| a[(i, 1)] * v[1] + a[(i, 2)] * v[2] + a[(i, 3)] * v[3];
            *out = [v[2], v[3], row(2), row(3)];
        }
        out
    }

    /// Upright and at rest without torque, wherever the ball is; nowhere else.
    fn steady_state<T: Scalar + Number>(
        &self,
        problem: &SteadyStateProblem<T, 4, 1>,
    ) -> Option<SteadyState<T, 4, 1>> {
        let zero = T::zero();
        // Beside what is no number there is no nearest one.
        if !problem.x_ref.iter().all(|entry| entry.is_finite()) {
            return None;
        }
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
