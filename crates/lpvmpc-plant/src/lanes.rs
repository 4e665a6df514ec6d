//! Several numbers at once.

use crate::registers::{Kept, Registers};
use lpvmpc::{Bivariate, Elementary, Number};
use std::any::Any;
use std::array::from_fn;
use std::cell::RefCell;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// The same quantity at several points. An instruction is read once for all of them, and none waits for another's
/// result.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Lanes<const POINTS: usize>(pub [f64; POINTS]);

impl<const POINTS: usize> Lanes<POINTS> {
    #[inline(always)]
    fn with(self, other: Self, of: impl Fn(f64, f64) -> f64) -> Self {
        Self(from_fn(|k| of(self.0[k], other.0[k])))
    }
}

impl<const POINTS: usize> Add for Lanes<POINTS> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.with(other, |a, b| a + b)
    }
}

impl<const POINTS: usize> Sub for Lanes<POINTS> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.with(other, |a, b| a - b)
    }
}

impl<const POINTS: usize> Mul for Lanes<POINTS> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.with(other, |a, b| a * b)
    }
}

impl<const POINTS: usize> Div for Lanes<POINTS> {
    type Output = Self;

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.with(other, |a, b| a / b)
    }
}

impl<const POINTS: usize> Neg for Lanes<POINTS> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.map(|a| -a))
    }
}

impl<const POINTS: usize> Number for Lanes<POINTS> {
    #[inline(always)]
    fn constant(value: f64) -> Self {
        Self([value; POINTS])
    }

    #[inline(always)]
    fn elementary(self, function: Elementary) -> Self {
        Self(self.0.map(|a| a.elementary(function)))
    }

    #[inline(always)]
    fn bivariate(self, other: Self, function: Bivariate) -> Self {
        self.with(other, |a, b| a.bivariate(b, function))
    }

    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (mut sin, mut cos) = (self, self);
        for k in 0..POINTS {
            (sin.0[k], cos.0[k]) = Number::sin_cos(self.0[k]);
        }
        (sin, cos)
    }
}

thread_local! {
    static FOURS: RefCell<Registers<Lanes<4>>> =
        const { RefCell::new(Registers::of(Lanes([0.0; 4]))) };
}

impl<const POINTS: usize> Kept for Lanes<POINTS> {
    /// Kept for the number of points that a controller takes together.
    #[inline(always)]
    fn with(run: impl FnOnce(&mut Registers<Self>)) {
        FOURS.with_borrow_mut(|fours| {
            let fours: &mut dyn Any = fours;
            match fours.downcast_mut() {
                Some(registers) => run(registers),
                None => run(&mut Registers::of(Self([0.0; POINTS]))),
            }
        });
    }
}
