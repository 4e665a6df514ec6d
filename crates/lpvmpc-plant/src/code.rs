//! A program made ready for evaluation: what the results need, on as few registers as it takes.

use crate::operation::{Binary, Operation, Unary};
use lpvmpc::{Bivariate, Elementary, Number};
use std::collections::HashMap;

/// Where a number comes from that is not worked out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Leaf {
    Constant(f64),
    State(usize),
    Input(usize),
    Parameter(usize),
    Scheduling(usize),
}

/// What an instruction does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Function {
    Unary(Unary),
    Binary(Binary),
    /// A power by multiplication.
    Whole(i32),
    /// sin and cos at once; cos goes where `second` says.
    SinCos,
}

/// A function of the numbers in one or two registers, and where its value goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Instruction {
    pub function: Function,
    pub first: u32,
    pub second: u32,
    pub target: u32,
}

/// The part of a program that some results need.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Code {
    /// What the first registers hold.
    pub leaves: Vec<Leaf>,
    pub instructions: Vec<Instruction>,
    /// The registers of the results.
    pub results: Vec<u32>,
    registers: usize,
}

/// Constant exponents of larger size are left to the power function.
const LARGEST_WHOLE: f64 = 64.0;

/// What the operation of an index becomes: a power with a constant exponent is products, or a root.
fn function_of(operations: &[Operation], index: usize) -> Option<Function> {
    match operations[index] {
        Operation::Unary(function, _) => Some(Function::Unary(function)),
        Operation::Binary(Binary::Bivariate(Bivariate::Power), _, exponent) => {
            Some(match operations[exponent] {
                Operation::Constant(0.5) => Function::Unary(Unary::Elementary(Elementary::Sqrt)),
                Operation::Constant(n) if n == n.trunc() && n.abs() <= LARGEST_WHOLE => {
                    Function::Whole(n as i32)
                }
                _ => Function::Binary(Binary::Bivariate(Bivariate::Power)),
            })
        }
        Operation::Binary(function, ..) => Some(Function::Binary(function)),
        _ => None,
    }
}

const SIN: Function = Function::Unary(Unary::Elementary(Elementary::Sin));
const COS: Function = Function::Unary(Unary::Elementary(Elementary::Cos));

/// Of each sine and cosine of the same angle, the other.
fn sines_and_cosines(
    operations: &[Operation],
    needed: impl Fn(&usize) -> bool,
) -> HashMap<usize, usize> {
    let mut seen: HashMap<usize, [Option<usize>; 2]> = HashMap::new();
    let mut partners = HashMap::new();
    for index in (0..operations.len()).filter(needed) {
        let (this, that) = match function_of(operations, index) {
            Some(SIN) => (0, 1),
            Some(COS) => (1, 0),
            _ => continue,
        };
        for angle in operations[index].arguments() {
            let pair = seen.entry(angle).or_default();
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

fn leaf_of(operation: Operation) -> Option<Leaf> {
    match operation {
        Operation::Constant(value) => Some(Leaf::Constant(value)),
        Operation::State(i) => Some(Leaf::State(i)),
        Operation::Input(i) => Some(Leaf::Input(i)),
        Operation::Parameter(i) => Some(Leaf::Parameter(i)),
        Operation::Scheduling(i) => Some(Leaf::Scheduling(i)),
        Operation::Unary(..) | Operation::Binary(..) => None,
    }
}

/// The earlier results that the operation of this index needs, given what it becomes.
fn needs(operations: &[Operation], index: usize) -> impl Iterator<Item = usize> + use<> {
    let count = match function_of(operations, index) {
        Some(Function::Binary(_)) => 2,
        Some(Function::Unary(_) | Function::Whole(_) | Function::SinCos) => 1,
        None => 0,
    };
    operations[index].arguments().take(count)
}

impl Code {
    /// What the `results` of the program need; every operation refers to earlier ones only.
    pub fn new(operations: &[Operation], results: &[usize]) -> Self {
        // When a result is read last: the index of that operation, or never again.
        let mut last_read = vec![None; operations.len()];
        for result in results {
            last_read[*result] = Some(usize::MAX);
        }
        for index in (0..operations.len()).rev() {
            if last_read[index].is_some() {
                for argument in needs(operations, index) {
                    last_read[argument] = last_read[argument].max(Some(index));
                }
            }
        }
        let needed = |index: &usize| last_read[*index].is_some();
        let mut register = vec![0_u32; operations.len()];
        let mut leaves: Vec<Leaf> = Vec::new();
        for index in (0..operations.len()).filter(needed) {
            if let Some(leaf) = leaf_of(operations[index]) {
                register[index] = leaves.len() as u32;
                leaves.push(leaf);
            }
        }
        let partners = sines_and_cosines(operations, needed);
        let mut free: Vec<u32> = Vec::new();
        let mut registers = leaves.len();
        let mut instructions = Vec::new();
        for index in (0..operations.len()).filter(needed) {
            let Some(function) = function_of(operations, index) else {
                continue;
            };
            let mut arguments: Vec<usize> = needs(operations, index).collect();
            let at = |k: usize| arguments.get(k).map_or(0, |argument| register[*argument]);
            let (first, second) = (at(0), at(1));
            // What is read for the last time makes room for the value itself.
            arguments.dedup();
            for argument in arguments {
                let is_leaf = leaf_of(operations[argument]).is_some();
                if last_read[argument] == Some(index) && !is_leaf {
                    free.push(register[argument]);
                }
            }
            let mut place = || {
                free.pop().unwrap_or_else(|| {
                    registers += 1;
                    registers as u32 - 1
                })
            };
            let partner = partners.get(&index).copied();
            if partner.is_some_and(|partner| partner < index) {
                // It is there already.
                continue;
            }
            let target = place();
            register[index] = target;
            let mut instruction = Instruction {
                function,
                first,
                second,
                target,
            };
            if let Some(partner) = partner {
                register[partner] = place();
                instruction.function = Function::SinCos;
                instruction.second = register[partner];
                if function == COS {
                    std::mem::swap(&mut instruction.second, &mut instruction.target);
                }
            }
            instructions.push(instruction);
        }
        Self {
            leaves,
            instructions,
            results: results.iter().map(|result| register[*result]).collect(),
            registers,
        }
    }

    /// Works the results out: `leaf` gives the numbers that are given, `result` takes the results by
    /// their place. No heap is needed for up to 256 registers.
    #[inline(always)]
    pub fn evaluate<N: Number>(&self, leaf: impl Fn(Leaf) -> N, result: impl FnMut(usize, N)) {
        let zero = N::constant(0.0);
        match self.registers {
            0..=16 => self.evaluate_on(&mut [zero; 16], leaf, result),
            17..=32 => self.evaluate_on(&mut [zero; 32], leaf, result),
            33..=64 => self.evaluate_on(&mut [zero; 64], leaf, result),
            65..=256 => self.evaluate_on(&mut [zero; 256], leaf, result),
            count => self.evaluate_on(&mut vec![zero; count], leaf, result),
        }
    }

    #[inline(always)]
    fn evaluate_on<N: Number>(
        &self,
        registers: &mut [N],
        leaf: impl Fn(Leaf) -> N,
        mut result: impl FnMut(usize, N),
    ) {
        for (register, given) in registers.iter_mut().zip(&self.leaves) {
            *register = leaf(*given);
        }
        run(&self.instructions, registers);
        for (place, register) in self.results.iter().enumerate() {
            result(place, registers[*register as usize]);
        }
    }
}

/// Once in the machine code for each kind of number.
#[inline(never)]
fn run<N: Number>(instructions: &[Instruction], registers: &mut [N]) {
    for instruction in instructions {
        let x = registers[instruction.first as usize];
        let second = instruction.second as usize;
        registers[instruction.target as usize] = match instruction.function {
            Function::Unary(function) => function.of(x),
            Function::Binary(function) => function.of(x, registers[second]),
            Function::Whole(exponent) => x.powi(exponent),
            Function::SinCos => {
                let (sin, cos) = x.sin_cos();
                registers[second] = cos;
                sin
            }
        };
    }
}
