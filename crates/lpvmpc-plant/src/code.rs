//! A program made ready for evaluation: what the results need, on as few registers as it takes.

use crate::operation::{Binary, Operation, Unary};
use lpvmpc::{Bivariate, Elementary, Number};
use std::collections::HashMap;

/// The numbers that are given, in the order of their registers, which are the first ones.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Leaves {
    pub constants: Vec<f64>,
    /// Indices of parameters, states and so on.
    pub parameters: Vec<usize>,
    pub states: Vec<usize>,
    pub inputs: Vec<usize>,
    pub scheduling: Vec<usize>,
}

/// Where given numbers come from.
#[derive(Clone, Copy)]
pub(crate) struct Given<'a, N> {
    pub parameters: &'a [f64],
    pub x: &'a [N],
    pub u: &'a [N],
    pub s: &'a [N],
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
    pub leaves: Leaves,
    pub instructions: Vec<Instruction>,
    /// The registers of the results.
    pub results: Vec<u32>,
    /// How many registers it takes.
    pub registers: usize,
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

impl Leaves {
    /// Those of the `needed` operations, and the register of each of these.
    fn new(operations: &[Operation], needed: impl Fn(&usize) -> bool) -> (Self, Vec<u32>) {
        let mut leaves = Self::default();
        let mut places = vec![Vec::new(); 5];
        for index in (0..operations.len()).filter(needed) {
            let (kind, list, given) = match operations[index] {
                Operation::Constant(value) => {
                    leaves.constants.push(value);
                    places[0].push(index);
                    continue;
                }
                Operation::Parameter(i) => (1, &mut leaves.parameters, i),
                Operation::State(i) => (2, &mut leaves.states, i),
                Operation::Input(i) => (3, &mut leaves.inputs, i),
                Operation::Scheduling(i) => (4, &mut leaves.scheduling, i),
                Operation::Unary(..) | Operation::Binary(..) => continue,
            };
            list.push(given);
            places[kind].push(index);
        }
        let mut register = vec![0; operations.len()];
        for (place, index) in places.into_iter().flatten().enumerate() {
            register[index] = place as u32;
        }
        (leaves, register)
    }

    /// How many there are.
    fn count(&self) -> usize {
        let lists = [
            &self.parameters,
            &self.states,
            &self.inputs,
            &self.scheduling,
        ];
        self.constants.len() + lists.map(Vec::len).iter().sum::<usize>()
    }

    /// Puts them into the first registers.
    #[inline(always)]
    fn fill<N: Number>(&self, registers: &mut [N], given: Given<'_, N>) {
        let (constants, rest) = registers.split_at_mut(self.constants.len());
        for (register, value) in constants.iter_mut().zip(&self.constants) {
            *register = N::constant(*value);
        }
        let (parameters, mut rest) = rest.split_at_mut(self.parameters.len());
        for (register, i) in parameters.iter_mut().zip(&self.parameters) {
            *register = N::constant(given.parameters[*i]);
        }
        for (list, values) in [
            (&self.states, given.x),
            (&self.inputs, given.u),
            (&self.scheduling, given.s),
        ] {
            let (places, others) = rest.split_at_mut(list.len());
            for (register, i) in places.iter_mut().zip(list) {
                *register = values[*i];
            }
            rest = others;
        }
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
        let (leaves, mut register) = Leaves::new(operations, needed);
        let given = leaves.count();
        let partners = sines_and_cosines(operations, needed);
        let mut free: Vec<u32> = Vec::new();
        let mut registers = given;
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
                let worked_out = register[argument] as usize >= given;
                if last_read[argument] == Some(index) && worked_out {
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

    /// Works the results out; `result` takes them by their place. No heap is needed for up to 256
    /// registers.
    #[inline(always)]
    pub fn evaluate<N: Number>(&self, given: Given<'_, N>, result: impl FnMut(usize, N)) {
        let zero = N::constant(0.0);
        match self.registers {
            0..=32 => self.evaluate_on(&mut [zero; 32], given, result),
            33..=64 => self.evaluate_on(&mut [zero; 64], given, result),
            65..=256 => self.evaluate_on(&mut [zero; 256], given, result),
            count => self.evaluate_on(&mut vec![zero; count], given, result),
        }
    }

    #[inline(always)]
    fn evaluate_on<N: Number>(
        &self,
        registers: &mut [N],
        given: Given<'_, N>,
        mut result: impl FnMut(usize, N),
    ) {
        self.leaves.fill(registers, given);
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
        let [first, second, target] =
            [instruction.first, instruction.second, instruction.target].map(|i| i as usize);
        // Each stores its own value: a common place for all values would be copied once more.
        match instruction.function {
            Function::Binary(Binary::Add) => {
                registers[target] = registers[first] + registers[second];
            }
            Function::Binary(Binary::Subtract) => {
                registers[target] = registers[first] - registers[second];
            }
            Function::Binary(Binary::Multiply) => {
                registers[target] = registers[first] * registers[second];
            }
            Function::Binary(Binary::Divide) => {
                registers[target] = registers[first] / registers[second];
            }
            Function::Unary(Unary::Negative) => registers[target] = -registers[first],
            Function::Unary(Unary::Square) => {
                registers[target] = registers[first] * registers[first];
            }
            Function::SinCos => {
                let (sin, cos) = registers[first].sin_cos();
                registers[target] = sin;
                registers[second] = cos;
            }
            Function::Unary(function) => registers[target] = function.of(registers[first]),
            Function::Binary(function) => {
                registers[target] = function.of(registers[first], registers[second]);
            }
            Function::Whole(exponent) => registers[target] = registers[first].powi(exponent),
        }
    }
}
