//! A program made ready for evaluation: what the results need, on as few registers as it takes.

mod leaves;
mod steps;

use crate::operation::{Operation, Unary};
use crate::registers::{FEW, Kept, Name, Registers};
use lpvmpc::{Bivariate, Number};
use steps::{COS, Step, join_products, sines_and_cosines, steps};

pub(crate) use leaves::{Leaf, Leaves};

/// What an instruction does with the numbers x, y, z and w of its sources.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Function {
    Add,
    Subtract,
    Multiply,
    Divide,
    Negative,
    Square,
    /// x y + z, rounded twice as one by one.
    MultiplyAdd,
    /// x y - z.
    MultiplySubtract,
    /// z - x y.
    SubtractProduct,
    /// x y + z w.
    AddProducts,
    /// x y - z w.
    SubtractProducts,
    /// sin and cos at once; cos goes where the second source says.
    SinCos,
    /// A power by multiplication.
    Whole(i8),
    Unary(Unary),
    Bivariate(Bivariate),
}

/// A function of the numbers in some registers, and where its value goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Instruction {
    pub function: Function,
    /// As many as the function takes; zero beyond.
    pub sources: [u32; MOST_SOURCES],
    pub target: u32,
}

/// No function takes more numbers.
const MOST_SOURCES: usize = 4;

/// The part of a program that some results need.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Code {
    pub leaves: Leaves,
    pub instructions: Vec<Instruction>,
    /// The registers of the results.
    pub results: Vec<u32>,
    /// How many registers it takes.
    pub registers: usize,
    /// The instructions again, of a code that takes few registers.
    short: Vec<ShortInstruction>,
}

/// An instruction on few registers.
#[derive(Debug, Clone, Copy, PartialEq)]
struct ShortInstruction {
    function: Function,
    sources: [u8; MOST_SOURCES],
    target: u8,
}

impl Code {
    /// What the `results` of the program need; every operation refers to earlier ones only.
    pub fn new(operations: &[Operation], results: &[usize]) -> Self {
        let (steps, needed) = steps(operations, results);
        Self::of_steps(operations, &steps, (&needed, false), results)
    }

    /// The same with products and sums in one instruction, where that is possible, and with whole lists of what varies:
    /// the same numbers in less time.
    pub fn joined(operations: &[Operation], results: &[usize]) -> Self {
        let (mut steps, needed) = steps(operations, results);
        join_products(&mut steps, results);
        Self::of_steps(operations, &steps, (&needed, true), results)
    }

    fn of_steps(
        operations: &[Operation],
        steps: &[Option<Step>],
        (needed, whole): (&[bool], bool),
        results: &[usize],
    ) -> Self {
        // When a result is read last: the index of that operation, or never again.
        let mut last_read = vec![0; operations.len()];
        for (index, step) in steps.iter().enumerate() {
            let sources = step.iter().flat_map(|step| &step.sources);
            sources.for_each(|source| last_read[*source] = index);
        }
        results
            .iter()
            .for_each(|result| last_read[*result] = usize::MAX);
        let (leaves, mut register) = Leaves::new(operations, needed, whole);
        let given = leaves.count();
        let partners = sines_and_cosines(steps);
        let mut free: Vec<u32> = Vec::new();
        let mut registers = given;
        let mut instructions = Vec::new();
        for (index, step) in steps.iter().enumerate() {
            let Some(Step { function, sources }) = step else {
                continue;
            };
            let mut instruction = Instruction {
                function: *function,
                sources: [0; MOST_SOURCES],
                target: 0,
            };
            for (place, source) in instruction.sources.iter_mut().zip(sources) {
                *place = register[*source];
            }
            // What is read for the last time makes room for the value itself.
            for (k, source) in sources.iter().enumerate() {
                let worked_out = register[*source] as usize >= given;
                let again = sources[..k].contains(source);
                if last_read[*source] == index && worked_out && !again {
                    free.push(register[*source]);
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
            instruction.target = place();
            register[index] = instruction.target;
            if let Some(partner) = partner {
                register[partner] = place();
                instruction.function = Function::SinCos;
                instruction.sources[1] = register[partner];
                if *function == COS {
                    std::mem::swap(&mut instruction.sources[1], &mut instruction.target);
                }
            }
            instructions.push(instruction);
        }
        let short = instructions.iter().filter(|_| registers <= FEW).map(short);
        Self {
            short: short.collect(),
            leaves,
            instructions,
            results: results.iter().map(|result| register[*result]).collect(),
            registers,
        }
    }

    /// The numbers that come first: constants, and of these `parameters` those that it needs.
    pub fn fixed(&self, parameters: &[f64]) -> Vec<f64> {
        let needed = self.leaves.parameters.iter().map(|i| parameters[*i]);
        self.leaves
            .constants
            .iter()
            .copied()
            .chain(needed)
            .collect()
    }

    /// Works the results out from the [`fixed`](Self::fixed) numbers and each `leaf`; `result` takes them by their place.
    /// No heap is needed for up to 256 registers.
    #[inline(always)]
    pub fn evaluate<N: Number>(
        &self,
        fixed: &[f64],
        leaf: impl Fn(Leaf) -> N,
        result: impl FnMut(usize, N),
    ) {
        let zero = N::constant(0.0);
        // Numbers that are sets may be large, and stacks of threads small.
        if size_of::<N>() > LARGE {
            return self.evaluate_on(&mut vec![zero; self.registers], fixed, leaf, result);
        }
        match self.registers {
            0..=32 => self.evaluate_on(&mut [zero; 32], fixed, leaf, result),
            33..=64 => self.evaluate_on(&mut [zero; 64], fixed, leaf, result),
            65..=256 => self.evaluate_on(&mut [zero; 256], fixed, leaf, result),
            count => self.evaluate_on(&mut vec![zero; count], fixed, leaf, result),
        }
    }

    /// The same of [`joined`](Self::joined) code, for a kind of number with registers that are kept, and in less time.
    /// There are `counts` of states, of inputs and of scheduling parameters, of which it may need fewer. Where the
    /// registers hold the numbers that are `fixed` under this `name` already, these are not written again.
    #[inline(always)]
    pub fn evaluate_fast<N: Kept>(
        &self,
        (fixed, name): (&[f64], Name),
        counts: [usize; 3],
        leaf: impl Fn(Leaf) -> N,
        mut result: impl FnMut(usize, N),
    ) {
        // With room for what is not needed.
        if self.registers + counts.iter().sum::<usize>() > FEW {
            return self.evaluate(fixed, leaf, result);
        }
        N::with(|Registers { numbers, holds }| {
            if *holds != name {
                numbers
                    .iter_mut()
                    .zip(fixed)
                    .for_each(|(register, value)| *register = N::constant(*value));
                // No instruction has them for a target.
                *holds = name;
            }
            let [states, inputs, scheduling] = counts;
            // What is not needed comes last of each, and makes way for the next and for what is worked out.
            let mut first = fixed.len();
            fill(numbers, first, states, |i| leaf(Leaf::State(i)));
            first += self.leaves.states.len();
            fill(numbers, first, inputs, |i| leaf(Leaf::Input(i)));
            first += self.leaves.inputs.len();
            fill(numbers, first, scheduling, |i| leaf(Leaf::Scheduling(i)));
            run_short(&self.short, numbers);
            for (place, register) in self.results.iter().enumerate() {
                result(place, numbers[*register as u8 as usize]);
            }
        });
    }

    #[inline(always)]
    fn evaluate_on<N: Number>(
        &self,
        registers: &mut [N],
        fixed: &[f64],
        leaf: impl Fn(Leaf) -> N,
        mut result: impl FnMut(usize, N),
    ) {
        let (places, rest) = registers.split_at_mut(fixed.len());
        for (register, value) in places.iter_mut().zip(fixed) {
            *register = N::constant(*value);
        }
        self.leaves.fill(rest, leaf);
        run(&self.instructions, registers);
        for (place, register) in self.results.iter().enumerate() {
            result(place, registers[*register as usize]);
        }
    }
}

/// Puts so many numbers into the registers from the `first` on.
#[inline(always)]
fn fill<N>(registers: &mut [N; FEW], first: usize, count: usize, number: impl Fn(usize) -> N) {
    if let Some(places) = registers.get_mut(first..first + count) {
        for (i, place) in places.iter_mut().enumerate() {
            *place = number(i);
        }
    }
}

/// Registers of kinds of numbers with more bytes are not on the stack.
const LARGE: usize = 256;

fn short(instruction: &Instruction) -> ShortInstruction {
    ShortInstruction {
        function: instruction.function,
        sources: instruction.sources.map(|source| source as u8),
        target: instruction.target as u8,
    }
}

/// The value of an instruction of these sources, each of which it reads itself: none reads more than it has. Each stores
/// its own value, too: a common place for all values would be copied once more.
macro_rules! put {
    ($set:ident, $instruction:ident, [$($source:ident),+], $value:expr) => {{
        let [$($source,)+ ..] = $instruction.sources;
        $set!($instruction.target, $value);
    }};
}

/// Works the instructions out on the registers that `at` and `set` reach.
macro_rules! work {
    ($instructions:expr, $at:ident, $set:ident) => {
        for i in $instructions {
            match i.function {
                Function::Add => put!($set, i, [x, y], $at!(x) + $at!(y)),
                Function::Subtract => put!($set, i, [x, y], $at!(x) - $at!(y)),
                Function::Multiply => put!($set, i, [x, y], $at!(x) * $at!(y)),
                Function::Divide => put!($set, i, [x, y], $at!(x) / $at!(y)),
                Function::Negative => put!($set, i, [x], -$at!(x)),
                Function::Square => put!($set, i, [x], $at!(x) * $at!(x)),
                Function::MultiplyAdd => put!($set, i, [x, y, z], $at!(x) * $at!(y) + $at!(z)),
                Function::MultiplySubtract => put!($set, i, [x, y, z], $at!(x) * $at!(y) - $at!(z)),
                Function::SubtractProduct => put!($set, i, [x, y, z], $at!(z) - $at!(x) * $at!(y)),
                Function::AddProducts => {
                    put!($set, i, [x, y, z, w], $at!(x) * $at!(y) + $at!(z) * $at!(w));
                }
                Function::SubtractProducts => {
                    put!($set, i, [x, y, z, w], $at!(x) * $at!(y) - $at!(z) * $at!(w));
                }
                Function::SinCos => {
                    let [x, y, ..] = i.sources;
                    let (sin, cos) = $at!(x).sin_cos();
                    $set!(i.target, sin);
                    $set!(y, cos);
                }
                Function::Whole(exponent) => put!($set, i, [x], $at!(x).powi(exponent.into())),
                Function::Unary(function) => put!($set, i, [x], function.of($at!(x))),
                Function::Bivariate(function) => {
                    put!($set, i, [x, y], $at!(x).bivariate($at!(y), function));
                }
            }
        }
    };
}

/// Once in the machine code for each kind of number.
#[inline(never)]
fn run<N: Number>(instructions: &[Instruction], registers: &mut [N]) {
    macro_rules! at {
        ($register:expr) => {
            registers[$register as usize]
        };
    }
    macro_rules! set {
        ($register:expr, $value:expr) => {
            registers[$register as usize] = $value
        };
    }
    work!(instructions, at, set);
}

/// The same on few registers.
#[inline(never)]
fn run_short<N: Number>(instructions: &[ShortInstruction], registers: &mut [N; FEW]) {
    macro_rules! at {
        ($register:expr) => {
            registers[usize::from($register)]
        };
    }
    macro_rules! set {
        ($register:expr, $value:expr) => {
            registers[usize::from($register)] = $value
        };
    }
    work!(instructions, at, set);
}
