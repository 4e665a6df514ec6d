//! What a plant consists of, as it stands in a file.

use crate::file::Schema;
use crate::operation::Operation;
use serde::{Deserialize, Serialize};

/// A plant as it stands in a file, not checked yet: [`Plant::new`](crate::Plant::new) checks it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlantData {
    /// The version of the format.
    pub schema: Schema,
    /// The name of the plant.
    pub name: String,
    /// The states, in the order of x.
    pub states: Vec<Signal>,
    /// The inputs, in the order of u.
    #[serde(default)]
    pub inputs: Vec<Signal>,
    /// The parameters, in the order of p.
    #[serde(default)]
    pub parameters: Vec<Parameter>,
    /// The outputs, in the order of y.
    #[serde(default)]
    pub outputs: Vec<Signal>,
    /// All formulas, as one straight-line program.
    #[serde(with = "crate::file::operations")]
    pub operations: Vec<Operation>,
    /// x_dot = f(x, u, p): for each state the operation whose result is its derivative. Empty of a plant in
    /// discrete time.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub derivative: Vec<usize>,
    /// The period of a plant in discrete time, s; absent of one in continuous time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub period: Option<f64>,
    /// x+ = F(x, u, p), the state one period later: for each state the operation whose result it is. Empty of a
    /// plant in continuous time.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub next: Vec<usize>,
    /// y = g(x, u, p): for each output the operation whose result it is.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub output: Vec<usize>,
    /// The plant's own x_dot = A(s, p) x + B(s, p) u + c(s, p), or x+ of a plant in discrete time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub embedding: Option<EmbeddingData>,
    /// A steady state within the bounds, f(x, u) = 0, or F(x, u) = x, with the parameters' values.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub equilibrium: Option<Equilibrium>,
}

impl PlantData {
    /// The formulas of the motion: [`derivative`](Self::derivative), or [`next`](Self::next) of a plant in
    /// discrete time.
    pub fn motion(&self) -> &[usize] {
        match self.period {
            None => &self.derivative,
            Some(_) => &self.next,
        }
    }

    /// For each state whether the motion is the same wherever the plant stands along it: no formula of the motion
    /// reads it, as that of a cart does not read its position. Of plants in continuous time alone.
    pub fn is_invariant_along(&self) -> Vec<bool> {
        let mut is_read = vec![self.period.is_some(); self.states.len()];
        let mut is_needed = vec![false; self.operations.len()];
        let mut needed: Vec<usize> = self.motion().to_vec();
        while let Some(place) = needed.pop() {
            if std::mem::replace(&mut is_needed[place], true) {
                continue;
            }
            let operation = &self.operations[place];
            if let Operation::State(i) = operation {
                is_read[*i] = true;
            }
            needed.extend(operation.arguments());
        }
        is_read.into_iter().map(|read| !read).collect()
    }
}

/// A state, an input or an output.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Signal {
    /// Its name.
    pub name: String,
    /// Its unit; empty for a number without unit.
    #[serde(default)]
    pub unit: String,
    /// The least value that it may have; none if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lower: Option<f64>,
    /// The largest value that it may have; none if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub upper: Option<f64>,
}

impl Signal {
    /// A signal without bounds.
    pub fn new(name: &str, unit: &str) -> Self {
        Self {
            name: name.to_owned(),
            unit: unit.to_owned(),
            ..Self::default()
        }
    }
}

/// Signals x0, x1 and so on.
pub(crate) fn numbered(symbol: &str, count: usize) -> Vec<Signal> {
    (0..count)
        .map(|i| Signal::new(&format!("{symbol}{i}"), ""))
        .collect()
}

/// A parameter.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameter {
    /// Its name.
    pub name: String,
    /// Its unit; empty for a number without unit.
    #[serde(default)]
    pub unit: String,
    /// The value that it has unless another one is set.
    pub value: f64,
}

/// An embedding x_dot = A(s, p) x + B(s, p) u + c(s, p) with s = sigma(x, u, p): the operations whose
/// results its entries are.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EmbeddingData {
    /// sigma(x, u, p).
    pub scheduling: Vec<usize>,
    /// The rows of A; of s and p alone.
    pub a: Vec<Vec<usize>>,
    /// The rows of B; of s and p alone.
    pub b: Vec<Vec<usize>>,
    /// c, of s and p alone; zero if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub c: Option<Vec<usize>>,
}

/// A steady state.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Equilibrium {
    /// The state.
    pub x: Vec<f64>,
    /// The input that holds it.
    pub u: Vec<f64>,
}
