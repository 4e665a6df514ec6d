//! Is there a rigid body with these parameters?
//!
//! A mass matrix must be positive definite and friction must take energy away. Written out
//! for a ball (mass m_k, inertia I_k), a body (mass m_a, inertia I_a about its centre of mass)
//! and the wheels, all divided by m_a:
//! b1 = b2 + (I_k + (m_k + m_a) r_b^2) / m_a and b3 = b2 + l^2 + I_a / m_a with b2 >= 0.

use crate::parameters::Ballbot;
use core::fmt;
use lpvmpc::{Number, Scalar};

/// The verdict on a set of parameters b over a range of tilts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Consistency<T> {
    /// Largest tilt that was looked at, rad.
    pub tilt: T,
    /// Smallest and largest det M(theta) over |theta| <= tilt, m^4.
    pub determinant: (T, T),
    /// M(theta) is positive definite over the whole range.
    pub mass_positive: bool,
    /// M(theta) is invertible over the whole range, so that the equations can be integrated.
    pub mass_invertible: bool,
    /// b4 >= 0: the friction of rolling takes energy away.
    pub rolling_dissipative: bool,
    /// Neither coefficient of the drive's friction is negative: it takes energy away.
    pub drive_dissipative: bool,
    /// b1 and the least a rigid body needs, b2 + r_b^2, m^2.
    pub ball_inertia: (T, T),
    /// b3 and the least a rigid body needs, b2 + l^2, m^2.
    pub body_inertia: (T, T),
}

impl<T: Scalar + Number> Ballbot<T> {
    /// Checks the parameters against mechanics for |theta| <= `tilt` (rad). From pi on, and for
    /// NaN, that is the whole circle.
    pub fn consistency(&self, tilt: T) -> Consistency<T> {
        let tilt = if tilt.abs() < T::pi() { tilt } else { T::pi() };
        // k grows with |theta|, so |k| is extreme at the ends of the range or at a zero of k.
        let upright = self.coupling(T::one());
        let tilted = self.coupling(Number::cos(tilt));
        let ends = (self.determinant(upright), self.determinant(tilted));
        let smallest = ends.0.min(ends.1);
        let crosses_zero = upright * tilted <= T::zero();
        let largest = if crosses_zero {
            self.determinant(T::zero())
        } else {
            ends.0.max(ends.1)
        };
        let zero = T::zero();
        let Self { geometry, .. } = self;
        let square = |length: T| length * length;
        Consistency {
            tilt,
            determinant: (smallest, largest),
            mass_positive: self.b1 > zero && self.b3 > zero && smallest > zero,
            mass_invertible: smallest > zero || largest < zero,
            rolling_dissipative: self.b4 >= zero,
            drive_dissipative: self.drive.viscous >= zero && self.drive.coulomb >= zero,
            ball_inertia: (self.b1, self.b2 + square(geometry.ball_radius)),
            body_inertia: (self.b3, self.b2 + square(geometry.centre_of_mass)),
        }
    }
}

impl<T: Scalar> Consistency<T> {
    /// Whether a rigid ballbot with these parameters exists.
    pub fn is_physical(&self) -> bool {
        self.mass_positive
            && self.rolling_dissipative
            && self.drive_dissipative
            && self.ball_inertia.0 >= self.ball_inertia.1
            && self.body_inertia.0 >= self.body_inertia.1
    }
}

impl<T: Scalar + fmt::LowerExp> fmt::Display for Consistency<T> {
    /// The verdict in words, one finding per line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_physical() {
            return write!(
                f,
                "physically consistent: the mass matrix is positive definite for |theta| <= \
                 {:.3} rad, friction takes energy away, the inertias are those of a rigid body",
                self.tilt
            );
        }
        write!(f, "no rigid ballbot has these parameters:")?;
        if !self.mass_positive {
            let (low, high) = self.determinant;
            write!(
                f,
                "\n- the mass matrix is not positive definite for |theta| <= {:.3} rad: det M is \
                 between {low:.3e} and {high:.3e} m^4",
                self.tilt
            )?;
            if self.mass_invertible {
                write!(
                    f,
                    " (it never crosses zero there, so the equations of motion still have a \
                     solution, but their kinetic energy can be negative)"
                )?;
            } else {
                write!(
                    f,
                    " (it crosses zero there: at that tilt the equations of motion have no \
                     solution)"
                )?;
            }
        }
        if !self.rolling_dissipative {
            write!(
                f,
                "\n- the friction b4 is negative: it feeds energy into the ball"
            )?;
        }
        if !self.drive_dissipative {
            write!(
                f,
                "\n- the friction in the drive is negative: it feeds energy into ball and body"
            )?;
        }
        for (name, (value, least), needs) in [
            ("b1", self.ball_inertia, "b2 + r_b^2"),
            ("b3", self.body_inertia, "b2 + l^2"),
        ] {
            if value < least {
                write!(
                    f,
                    "\n- {name} = {value:.4} m^2 is below {needs} = {least:.4} m^2, the least that \
                     any mass distribution allows"
                )?;
            }
        }
        write!(
            f,
            "\nThey reproduce the input-output behaviour they were fitted to, and nothing else: do \
             not read masses off them, and do not use them for another robot."
        )
    }
}
