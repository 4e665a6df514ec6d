//! Codes with what can be worked out before they are evaluated.

use crate::code::{Code, Leaf};
use crate::lanes::Lanes;
use crate::operation::Operation;
use crate::program::Program;
use crate::registers::Name;
use lpvmpc::Number;
use nalgebra::SVector;
use std::any::{Any, TypeId};

/// The part of a program that some results need, in two forms.
#[derive(Debug)]
pub(crate) struct Prepared {
    /// For any kind of number: all of it.
    pub code: Code,
    /// Of numbers and parameters alone.
    settled: Code,
    /// For `f64`: the rest; the results of `settled` are its parameters.
    moving: Code,
}

/// What a [`Prepared`] code has of the values of the parameters.
#[derive(Debug, Clone)]
pub(crate) struct Fixed {
    code: Vec<f64>,
    moving: Vec<f64>,
    /// The name of `moving`.
    name: Name,
}

impl PartialEq for Fixed {
    /// The same numbers.
    fn eq(&self, other: &Self) -> bool {
        (&self.code, &self.moving) == (&other.code, &other.moving)
    }
}

impl Prepared {
    /// What the `results` of the program need.
    pub fn new(operations: &[Operation], results: &[usize]) -> Self {
        let code = Code::new(operations, results);
        // Each once, and none whose result is known.
        let mut program = Program::new(usize::MAX);
        let taken = program.take(operations, results, None);
        match &taken {
            Some(results) => Self::with_code(code, program.operations(), results),
            None => Self::with_code(code, operations, results),
        }
    }

    fn with_code(code: Code, operations: &[Operation], results: &[usize]) -> Self {
        let mut settled = vec![false; operations.len()];
        for (index, operation) in operations.iter().enumerate() {
            settled[index] = match operation {
                Operation::Constant(_) | Operation::Parameter(_) => true,
                Operation::Unary(..) | Operation::Binary(..) => {
                    operation.arguments().all(|argument| settled[argument])
                }
                _ => false,
            };
        }
        let mut of_settled = Vec::new();
        let mut rest = Vec::with_capacity(operations.len());
        for (operation, settled) in operations.iter().zip(&settled) {
            // A constant exponent stays one.
            rest.push(match operation {
                Operation::Constant(_) => *operation,
                _ if *settled => {
                    of_settled.push(rest.len());
                    Operation::Parameter(of_settled.len() - 1)
                }
                _ => *operation,
            });
        }
        let mut moving = Code::joined(&rest, results);
        // Only what it asks for is worked out, in the order in which it asks.
        let asked = moving.leaves.parameters.iter().map(|i| of_settled[*i]);
        let settled = Code::new(operations, &asked.collect::<Vec<usize>>());
        moving.leaves.parameters = (0..moving.leaves.parameters.len()).collect();
        Self {
            code,
            settled,
            moving,
        }
    }

    /// What follows from these values of the parameters.
    pub fn fixed(&self, parameters: &[f64]) -> Fixed {
        let mut settled = Vec::with_capacity(self.settled.results.len());
        let fixed = self.settled.fixed(parameters);
        // It has no leaf.
        let evaluated = |_, value| settled.push(value);
        self.settled.evaluate(&fixed, |_| f64::NAN, evaluated);
        Fixed {
            code: self.code.fixed(parameters),
            moving: self.moving.fixed(&settled),
            name: Name::new(),
        }
    }

    /// Works the results out at a state, an input and a scheduling of at least the plant's sizes; `result` takes them by
    /// their place. In `f64` they are the same to the last bit, the sign of zeros apart, in less time.
    #[inline(always)]
    pub fn evaluate<N: Number>(
        &self,
        fixed: &Fixed,
        (x, u): (&[N], &[N]),
        s: &[N],
        mut result: impl FnMut(usize, N),
    ) {
        let leaf = |leaf: Leaf| match leaf {
            Leaf::State(i) => x[i],
            Leaf::Input(i) => u[i],
            Leaf::Scheduling(i) => s[i],
        };
        // Known when this is compiled.
        if TypeId::of::<N>() == TypeId::of::<f64>() {
            let leaf = |of| float(leaf(of));
            let result = |place, value| result(place, N::constant(value));
            let counts = [x.len(), u.len(), s.len()];
            self.moving
                .evaluate_fast((&fixed.moving, fixed.name), counts, leaf, result);
        } else {
            self.code.evaluate(&fixed.code, leaf, result);
        }
    }

    /// The results at several states and inputs of at least the plant's sizes: in `f64` at once.
    #[inline(always)]
    pub fn evaluate_each<N: Number, const NX: usize, const NU: usize, const POINTS: usize>(
        &self,
        fixed: &Fixed,
        x: &[SVector<N, NX>; POINTS],
        u: &[SVector<N, NU>; POINTS],
        mut result: impl FnMut(usize, [N; POINTS]),
    ) {
        // Known when this is compiled.
        if TypeId::of::<N>() == TypeId::of::<f64>() && POINTS > 1 {
            let leaf = |leaf: Leaf| match leaf {
                Leaf::State(i) => Lanes(std::array::from_fn(|k| float(x[k][i]))),
                Leaf::Input(i) => Lanes(std::array::from_fn(|k| float(u[k][i]))),
                Leaf::Scheduling(_) => Lanes([f64::NAN; POINTS]),
            };
            let result = |place, values: Lanes<POINTS>| result(place, values.0.map(N::constant));
            let named = (&fixed.moving[..], fixed.name);
            return self.moving.evaluate_fast(named, [NX, NU, 0], leaf, result);
        }
        if POINTS == 1 {
            let motion = (x[0].as_slice(), u[0].as_slice());
            return self.evaluate(fixed, motion, &[], |place, value| {
                result(place, [value; POINTS]);
            });
        }
        let mut points = vec![[N::constant(0.0); POINTS]; self.code.results.len()];
        for k in 0..POINTS {
            let motion = (x[k].as_slice(), u[k].as_slice());
            self.evaluate(fixed, motion, &[], |place, value| points[place][k] = value);
        }
        for (place, values) in points.into_iter().enumerate() {
            result(place, values);
        }
    }

    /// How many instructions one evaluation in `f64` takes.
    pub fn length(&self) -> usize {
        self.moving.instructions.len()
    }
}

/// A number that is an `f64`; not a number if it is none.
#[inline(always)]
fn float<N: Number>(value: N) -> f64 {
    let value: &dyn Any = &value;
    value.downcast_ref().copied().unwrap_or(f64::NAN)
}
