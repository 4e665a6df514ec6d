//! What is bounded, and how tightly.

use crate::plant::Plant;
use lpvmpc::{GeneralRow, List, Ocp, Penalty};
use nalgebra::SVector;

/// What is bounded. Every problem of a kind has a solution, however tight its bounds are: with states or
/// rows bounded, the inputs are free.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// All inputs.
    Inputs,
    /// As many states as there are inputs, those that the inputs move most.
    States,
    /// As many general rows as there are inputs: each the sum of an input and the state that it moves most.
    Rows,
    /// All inputs, and the states of [`Kind::States`] with soft bounds.
    Soft,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Inputs, Self::States, Self::Rows, Self::Soft];

    /// The name that people write.
    pub fn name(self) -> &'static str {
        match self {
            Self::Inputs => "inputs",
            Self::States => "states",
            Self::Rows => "rows",
            Self::Soft => "soft",
        }
    }

    /// Whether inputs, states and rows are bounded.
    fn bounds(self) -> [bool; 3] {
        match self {
            Self::Inputs => [true, false, false],
            Self::States => [false, true, false],
            Self::Rows => [false, false, true],
            Self::Soft => [true, true, false],
        }
    }
}

/// The price of an exceeded soft bound: linear and quadratic, so that both kinds of multipliers occur.
const PRICE: Penalty<f64> = Penalty {
    linear: 1.0,
    quadratic: 10.0,
};

/// What plans need: of each input, of the state that it moves most, and of their sum the largest magnitude.
#[derive(Clone, Copy, Debug)]
pub struct Limits<const NU: usize> {
    input: SVector<f64, NU>,
    state: SVector<f64, NU>,
    row: SVector<f64, NU>,
}

impl<const NU: usize> Limits<NU> {
    /// Nothing yet.
    pub fn zero() -> Self {
        Self {
            input: SVector::zeros(),
            state: SVector::zeros(),
            row: SVector::zeros(),
        }
    }

    /// As wide as `x` and `u` need, too.
    pub fn widen<const NX: usize>(&mut self, x: &SVector<f64, NX>, u: &SVector<f64, NU>) {
        for j in 0..NU {
            let state = x[Plant::<NX, NU>::driven(j)];
            self.input[j] = self.input[j].max(u[j].abs());
            self.state[j] = self.state[j].max(state.abs());
            self.row[j] = self.row[j].max((state + u[j]).abs());
        }
    }

    /// Everything `scale` times as wide.
    pub fn scaled(&self, scale: f64) -> Self {
        Self {
            input: self.input * scale,
            state: self.state * scale,
            row: self.row * scale,
        }
    }

    /// The problem with these limits on what is bounded.
    pub fn impose<const NX: usize>(&self, kind: Kind, ocp: &mut Ocp<f64, NX, NU>) {
        let [inputs, states, rows] = kind.bounds();
        if inputs {
            (ocp.common.u.lower, ocp.common.u.upper) = (-self.input, self.input);
        }
        if states {
            for j in 0..NU {
                let place = Plant::<NX, NU>::driven(j);
                let price = (kind == Kind::Soft).then_some(PRICE);
                for bounds in [&mut ocp.common.x, &mut ocp.terminal.x] {
                    (bounds.lower[place], bounds.upper[place]) = (-self.state[j], self.state[j]);
                }
                ocp.common.soft_x[place] = price;
                ocp.terminal.soft_x[place] = price;
            }
        }
        if rows {
            ocp.rows_per_stage = NU;
            ocp.rows = List::repeat(GeneralRow::default(), (ocp.length() + 1) * NU);
            for (place, row) in ocp.rows.iter_mut().enumerate() {
                let j = place % NU;
                row.x[Plant::<NX, NU>::driven(j)] = 1.0;
                row.u[j] = 1.0;
                (row.lower, row.upper) = (-self.row[j], self.row[j]);
            }
        }
    }
}
