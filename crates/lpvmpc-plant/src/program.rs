//! Programs that are made here: each operation once, and none whose result is known.

use crate::derive::needed;
use crate::operation::{Binary, Operation, Unary};
use lpvmpc::{Bivariate, Elementary};
use std::collections::HashMap;

/// A program under construction.
///
/// It leaves out what changes no number: x + 0, 1 x, -(-x) and so on, by which a zero may change its sign. Where
/// numbers alone meet, their result is worked out at once, in `f64`, unless the program is an exact one.
pub(crate) struct Program {
    operations: Vec<Operation>,
    known: HashMap<Key, usize>,
    longest: usize,
    /// Numbers that meet stay as they are: their result would be rounded.
    exact: bool,
}

/// So many operations deep it is asked whether a number is above zero.
const DEEPEST: usize = 6;

/// An operation that can be looked up.
#[derive(PartialEq, Eq, Hash)]
enum Key {
    Constant(u64),
    State(usize),
    Input(usize),
    Parameter(usize),
    Scheduling(usize),
    Unary(Unary, usize),
    Binary(Binary, usize, usize),
}

impl From<Operation> for Key {
    fn from(operation: Operation) -> Self {
        match operation {
            Operation::Constant(value) => Self::Constant(value.to_bits()),
            Operation::State(i) => Self::State(i),
            Operation::Input(i) => Self::Input(i),
            Operation::Parameter(i) => Self::Parameter(i),
            Operation::Scheduling(i) => Self::Scheduling(i),
            Operation::Unary(function, x) => Self::Unary(function, x),
            Operation::Binary(function, x, y) => Self::Binary(function, x, y),
        }
    }
}

/// What an operation of earlier results comes to. Each answers with the place of its result, or with `None` once the
/// program would be too long.
impl Program {
    /// An empty one that may have so many operations.
    pub fn new(longest: usize) -> Self {
        Self {
            operations: Vec::new(),
            known: HashMap::new(),
            longest,
            exact: false,
        }
    }

    /// One for proofs: nothing in it is rounded.
    pub fn exact(longest: usize) -> Self {
        Self {
            exact: true,
            ..Self::new(longest)
        }
    }

    /// Whether nothing more can be put into it.
    pub fn is_full(&self) -> bool {
        self.operations.len() >= self.longest
    }

    /// What it has come to.
    pub fn operations(&self) -> &[Operation] {
        &self.operations
    }

    /// The number at a place, if it is one.
    pub fn number(&self, place: usize) -> Option<f64> {
        match self.operations.get(place) {
            Some(Operation::Constant(value)) => Some(*value),
            _ => None,
        }
    }

    fn is(&self, place: usize, value: f64) -> bool {
        self.number(place) == Some(value)
    }

    /// Whether it is a number, a parameter, or one of x, u and s: what is finite where the plant is.
    fn is_given(&self, place: usize) -> bool {
        !matches!(
            self.operations.get(place),
            Some(Operation::Unary(..) | Operation::Binary(..)) | None
        )
    }

    /// -x of the place of x.
    fn negated(&self, place: usize) -> Option<usize> {
        match self.operations.get(place) {
            Some(Operation::Unary(Unary::Negative, x)) => Some(*x),
            _ => None,
        }
    }

    /// Whether it is never below zero where it is a number, or, with `strictly`, above it; looked at no deeper than this.
    fn is_above_zero(&self, place: usize, strictly: bool, depth: usize) -> bool {
        let (Some(operation), Some(depth)) = (self.operations.get(place), depth.checked_sub(1))
        else {
            return false;
        };
        match *operation {
            Operation::Constant(value) => value > 0.0 || (value == 0.0 && !strictly),
            // A small square is rounded to zero.
            Operation::Binary(Binary::Multiply, x, y) => x == y && !strictly,
            Operation::Binary(Binary::Add, x, y) => {
                let is = |place, strictly| self.is_above_zero(place, strictly, depth);
                is(x, false) && is(y, false) && (!strictly || is(x, true) || is(y, true))
            }
            Operation::Unary(Unary::Elementary(Elementary::Sqrt), x) => {
                self.is_above_zero(x, strictly, depth)
            }
            _ => false,
        }
    }

    /// The operation as it is.
    pub fn push(&mut self, operation: Operation) -> Option<usize> {
        let next = self.operations.len();
        let place = *self.known.entry(operation.into()).or_insert(next);
        if place == next {
            if next >= self.longest {
                return None;
            }
            self.operations.push(operation);
        }
        Some(place)
    }

    /// A number.
    pub fn constant(&mut self, value: f64) -> Option<usize> {
        self.push(Operation::Constant(value))
    }

    /// -x.
    pub fn negative(&mut self, x: usize) -> Option<usize> {
        self.unary(Unary::Negative, x)
    }

    /// x + y.
    pub fn add(&mut self, x: usize, y: usize) -> Option<usize> {
        self.binary(Binary::Add, x, y)
    }

    /// x - y.
    pub fn subtract(&mut self, x: usize, y: usize) -> Option<usize> {
        self.binary(Binary::Subtract, x, y)
    }

    /// x y.
    pub fn multiply(&mut self, x: usize, y: usize) -> Option<usize> {
        self.binary(Binary::Multiply, x, y)
    }

    /// x/y.
    pub fn divide(&mut self, x: usize, y: usize) -> Option<usize> {
        self.binary(Binary::Divide, x, y)
    }

    /// 1/x.
    pub fn inverse(&mut self, x: usize) -> Option<usize> {
        self.unary(Unary::Inverse, x)
    }

    /// An elementary function of x.
    pub fn elementary(&mut self, function: Elementary, x: usize) -> Option<usize> {
        self.unary(Unary::Elementary(function), x)
    }

    /// A function of x and y that is no operation of arithmetic.
    pub fn bivariate(&mut self, function: Bivariate, x: usize, y: usize) -> Option<usize> {
        self.binary(Binary::Bivariate(function), x, y)
    }

    /// A function of x.
    pub fn unary(&mut self, function: Unary, x: usize) -> Option<usize> {
        if let Some(value) = self.number(x)
            && (!self.exact || function == Unary::Negative)
        {
            return self.constant(function.of(value));
        }
        match (function, self.negated(x)) {
            (Unary::Negative, Some(x)) => Some(x),
            (Unary::Square, _) => self.multiply(x, x),
            _ => self.push(Operation::Unary(function, x)),
        }
    }

    /// A function of x and y.
    pub fn binary(&mut self, function: Binary, x: usize, y: usize) -> Option<usize> {
        if let (Some(x), Some(y)) = (self.number(x), self.number(y))
            && !self.exact
        {
            return self.constant(function.of(x, y));
        }
        let operation = Operation::Binary(function, x, y);
        match function {
            Binary::Add => match (self.negated(x), self.negated(y)) {
                _ if self.is(x, 0.0) => Some(y),
                _ if self.is(y, 0.0) => Some(x),
                (_, Some(y)) => self.subtract(x, y),
                (Some(x), None) => self.subtract(y, x),
                (None, None) => self.push(Operation::Binary(function, x.min(y), x.max(y))),
            },
            Binary::Subtract => match self.negated(y) {
                _ if self.is(y, 0.0) => Some(x),
                _ if self.is(x, 0.0) => self.negative(y),
                Some(y) => self.add(x, y),
                None => self.push(operation),
            },
            Binary::Multiply => {
                let (x, y) = (x.min(y), x.max(y));
                match (self.negated(x), self.negated(y)) {
                    _ if self.is(x, 0.0) && self.is_given(y) => Some(x),
                    _ if self.is(y, 0.0) && self.is_given(x) => Some(y),
                    _ if self.is(x, 1.0) => Some(y),
                    _ if self.is(y, 1.0) => Some(x),
                    _ if self.is(x, -1.0) => self.negative(y),
                    _ if self.is(y, -1.0) => self.negative(x),
                    (Some(x), Some(y)) => self.multiply(x, y),
                    (Some(negated), None) => self.negative_product(negated, y),
                    (None, Some(negated)) => self.negative_product(x, negated),
                    (None, None) => self.push(Operation::Binary(function, x, y)),
                }
            }
            Binary::Divide => match self.negated(x) {
                _ if self.is(y, 1.0) => Some(x),
                _ if self.is(x, 1.0) => self.inverse(y),
                // Friction that a plant has none of, as a rule.
                _ if self.is(x, 0.0) && self.is_above_zero(y, true, DEEPEST) => Some(x),
                Some(x) => {
                    let quotient = self.divide(x, y)?;
                    self.negative(quotient)
                }
                None => self.push(operation),
            },
            Binary::Bivariate(Bivariate::IfElseZero) => match self.number(x) {
                Some(value) if value != 0.0 => Some(y),
                Some(_) => self.constant(0.0),
                None if self.is(y, 0.0) => Some(y),
                None => self.push(operation),
            },
            Binary::Bivariate(Bivariate::Power) => match self.number(y) {
                Some(0.0) => self.constant(1.0),
                Some(1.0) => Some(x),
                Some(2.0) => self.multiply(x, x),
                _ => self.push(operation),
            },
            Binary::Bivariate(_) => self.push(operation),
        }
    }

    /// The `results` of `operations`, whose scheduling parameters have these places here, or stay what they are.
    pub fn take(
        &mut self,
        operations: &[Operation],
        results: &[usize],
        scheduling: Option<&[usize]>,
    ) -> Option<Vec<usize>> {
        let needed = needed(operations, results);
        let mut places = vec![0; operations.len()];
        for (index, operation) in operations.iter().enumerate() {
            if needed[index] {
                places[index] = match (*operation, scheduling) {
                    (Operation::Scheduling(i), Some(scheduling)) => *scheduling.get(i)?,
                    (Operation::Unary(function, x), _) => self.unary(function, places[x])?,
                    (Operation::Binary(function, x, y), _) => {
                        self.binary(function, places[x], places[y])?
                    }
                    (leaf, _) => self.push(leaf)?,
                };
            }
        }
        Some(results.iter().map(|result| places[*result]).collect())
    }

    /// -(x y).
    fn negative_product(&mut self, x: usize, y: usize) -> Option<usize> {
        let product = self.multiply(x, y)?;
        self.negative(product)
    }
}
