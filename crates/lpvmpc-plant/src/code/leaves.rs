//! The numbers that a program is given, and the registers that they are in.

use crate::operation::Operation;
use lpvmpc::Number;

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

/// Which of the numbers that vary.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Leaf {
    State(usize),
    Input(usize),
    Scheduling(usize),
}

impl Leaves {
    /// Those of the `needed` operations, and the register of each of these. `whole` lists of what varies have what comes
    /// before the last one needed, too, so that they are copied at once.
    pub(super) fn new(operations: &[Operation], needed: &[bool], whole: bool) -> (Self, Vec<u32>) {
        let mut leaves = Self::default();
        let mut places = vec![Vec::new(); 5];
        for index in (0..operations.len()).filter(|index| needed[*index]) {
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
        let mut first = 0;
        let Self {
            constants,
            parameters,
            states,
            inputs,
            scheduling,
        } = &mut leaves;
        for count in [constants.len(), parameters.len()] {
            let places = places.remove(0);
            places
                .into_iter()
                .zip(first..)
                .for_each(|(index, place)| register[index] = place);
            first += count as u32;
        }
        for (list, places) in [states, inputs, scheduling].into_iter().zip(places) {
            for (k, index) in places.into_iter().enumerate() {
                register[index] = first + if whole { list[k] } else { k } as u32;
            }
            if whole {
                *list = (0..list.iter().max().map_or(0, |last| last + 1)).collect();
            }
            first += list.len() as u32;
        }
        (leaves, register)
    }

    /// How many there are.
    pub(super) fn count(&self) -> usize {
        let lists = [
            &self.parameters,
            &self.states,
            &self.inputs,
            &self.scheduling,
        ];
        self.constants.len() + lists.map(Vec::len).iter().sum::<usize>()
    }

    /// Puts each `leaf` into the registers behind those of the fixed numbers.
    #[inline(always)]
    pub(super) fn fill<N: Number>(&self, registers: &mut [N], leaf: impl Fn(Leaf) -> N) {
        let (states, rest) = registers.split_at_mut(self.states.len());
        for (register, i) in states.iter_mut().zip(&self.states) {
            *register = leaf(Leaf::State(*i));
        }
        let (inputs, rest) = rest.split_at_mut(self.inputs.len());
        for (register, i) in inputs.iter_mut().zip(&self.inputs) {
            *register = leaf(Leaf::Input(*i));
        }
        for (register, i) in rest.iter_mut().zip(&self.scheduling) {
            *register = leaf(Leaf::Scheduling(*i));
        }
    }
}
