//! What the operations of a program become: the steps that its results need, with products in the sums that read them.

use super::Function;
use crate::operation::{Binary, Operation, Unary};
use lpvmpc::{Bivariate, Elementary};
use std::collections::HashMap;

/// An operation with what it takes: the places of earlier ones.
#[derive(Clone)]
pub(super) struct Step {
    pub function: Function,
    pub sources: Vec<usize>,
}

/// Constant exponents of larger size are left to the power function.
const LARGEST_WHOLE: f64 = 64.0;

/// What the operation of an index becomes, if it is no leaf: a power with a constant exponent is products, or a root.
fn step(operations: &[Operation], index: usize) -> Option<Step> {
    let (function, sources) = match operations[index] {
        Operation::Unary(function, x) => (
            match function {
                Unary::Negative => Function::Negative,
                Unary::Square => Function::Square,
                _ => Function::Unary(function),
            },
            vec![x],
        ),
        Operation::Binary(function, x, y) => match function {
            Binary::Add => (Function::Add, vec![x, y]),
            Binary::Subtract => (Function::Subtract, vec![x, y]),
            Binary::Multiply => (Function::Multiply, vec![x, y]),
            Binary::Divide => (Function::Divide, vec![x, y]),
            Binary::Bivariate(Bivariate::Power) => match operations[y] {
                Operation::Constant(0.5) => (
                    Function::Unary(Unary::Elementary(Elementary::Sqrt)),
                    vec![x],
                ),
                Operation::Constant(n) if n == n.trunc() && n.abs() <= LARGEST_WHOLE => {
                    (Function::Whole(n as i8), vec![x])
                }
                _ => (Function::Bivariate(Bivariate::Power), vec![x, y]),
            },
            Binary::Bivariate(function) => (Function::Bivariate(function), vec![x, y]),
        },
        _ => return None,
    };
    Some(Step { function, sources })
}

/// What the operations become that `results` need: `None` for leaves and for what is not needed; and which are needed.
pub(super) fn steps(operations: &[Operation], results: &[usize]) -> (Vec<Option<Step>>, Vec<bool>) {
    let mut needed = vec![false; operations.len()];
    results.iter().for_each(|result| needed[*result] = true);
    let mut steps = vec![None; operations.len()];
    for index in (0..operations.len()).rev() {
        if needed[index] {
            steps[index] = step(operations, index);
            let step = steps[index].iter();
            step.flat_map(|step| &step.sources)
                .for_each(|source| needed[*source] = true);
        }
    }
    (steps, needed)
}

const SIN: Function = Function::Unary(Unary::Elementary(Elementary::Sin));
pub(super) const COS: Function = Function::Unary(Unary::Elementary(Elementary::Cos));

/// Of each sine and cosine of the same angle, the other.
pub(super) fn sines_and_cosines(steps: &[Option<Step>]) -> HashMap<usize, usize> {
    let mut seen: HashMap<usize, [Option<usize>; 2]> = HashMap::new();
    let mut partners = HashMap::new();
    for (index, step) in steps.iter().enumerate() {
        let Some(Step { function, sources }) = step else {
            continue;
        };
        let (this, that) = match *function {
            SIN => (0, 1),
            COS => (1, 0),
            _ => continue,
        };
        for angle in sources {
            let pair = seen.entry(*angle).or_default();
            if pair[this].is_none() {
                pair[this] = Some(index);
                if let Some(other) = pair[that] {
                    partners.insert(index, other);
                    partners.insert(other, index);
                }
            }
        }
    }
    partners
}

/// Products that are read but once, by a sum or a difference, become parts of it.
pub(super) fn join_products(steps: &mut [Option<Step>], results: &[usize]) {
    let mut reads = vec![0_usize; steps.len()];
    for read in { steps.iter().flatten() }
        .flat_map(|step| &step.sources)
        .chain(results)
    {
        reads[*read] += 1;
    }
    for index in 0..steps.len() {
        let Some(Step { function, sources }) = &steps[index] else {
            continue;
        };
        let [x, y] = sources[..] else {
            continue;
        };
        let product = |place: usize| match &steps[place] {
            Some(Step {
                function: Function::Multiply,
                sources,
            }) if reads[place] == 1 => Some(sources.clone()),
            _ => None,
        };
        let joined = match (*function, product(x), product(y)) {
            (Function::Add, Some(first), Some(second)) => {
                (Function::AddProducts, [first, second].concat())
            }
            (Function::Subtract, Some(first), Some(second)) => {
                (Function::SubtractProducts, [first, second].concat())
            }
            (Function::Add, Some(first), None) => {
                (Function::MultiplyAdd, [first, vec![y]].concat())
            }
            (Function::Add, None, Some(second)) => {
                (Function::MultiplyAdd, [second, vec![x]].concat())
            }
            (Function::Subtract, Some(first), None) => {
                (Function::MultiplySubtract, [first, vec![y]].concat())
            }
            (Function::Subtract, None, Some(second)) => {
                (Function::SubtractProduct, [second, vec![x]].concat())
            }
            _ => continue,
        };
        let inside = [x, y].map(|source| product(source).map(|_| source));
        let (function, sources) = joined;
        inside
            .into_iter()
            .flatten()
            .for_each(|source| steps[source] = None);
        steps[index] = Some(Step { function, sources });
    }
}
