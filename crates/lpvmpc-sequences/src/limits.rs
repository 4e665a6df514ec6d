//! What is bounded, and how tightly.

use crate::plant::Plant;
use lpvmpc::{GeneralRow, List, Ocp, Penalty};
use nalgebra::SVector;

/// What is bounded. However tight its bounds are, a problem has a solution: where states or rows of the oscillators are
/// bounded, their inputs are free, and points can brake within a dozen stages (a shorter horizon may be refused).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// All inputs of the oscillators.
    Inputs,
    /// As many states as there are inputs, those that the inputs move most.
    States,
    /// As many general rows as there are inputs: each the sum of an input and the state that it moves most.
    Rows,
    /// All inputs, and the states of [`Kind::States`] with soft bounds.
    Soft,
    /// Points on their way: all inputs, and all states but the positions, so speed, acceleration and further
    /// derivatives.
    Motion,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Inputs,
        Self::States,
        Self::Rows,
        Self::Soft,
        Self::Motion,
    ];

    /// The name that people write.
    pub fn name(self) -> &'static str {
        match self {
            Self::Inputs => "inputs",
            Self::States => "states",
            Self::Rows => "rows",
            Self::Soft => "soft",
            Self::Motion => "motion",
        }
    }

    /// Whether inputs, states and rows are bounded.
    fn bounds(self) -> [bool; 3] {
        match self {
            Self::Inputs => [true, false, false],
            Self::States => [false, true, false],
            Self::Rows => [false, false, true],
            Self::Soft | Self::Motion => [true, true, false],
        }
    }
}

/// The price of an exceeded soft bound: linear and quadratic, so that both kinds of multipliers occur.
const PRICE: Penalty<f64> = Penalty {
    linear: 1.0,
    quadratic: 10.0,
};

/// What plans need: the largest magnitudes of each input, of each state, and of the sum of each input and the state
/// that it moves most.
#[derive(Clone, Copy, Debug)]
pub struct Limits<const NX: usize, const NU: usize> {
    input: SVector<f64, NU>,
    state: SVector<f64, NX>,
    row: SVector<f64, NU>,
}

impl<const NX: usize, const NU: usize> Limits<NX, NU> {
    /// Nothing yet.
    pub fn zero() -> Self {
        Self {
            input: SVector::zeros(),
            state: SVector::zeros(),
            row: SVector::zeros(),
        }
    }

    /// As wide as `x` and `u` need, too.
    pub fn widen(&mut self, x: &SVector<f64, NX>, u: &SVector<f64, NU>) {
        let sums = SVector::<f64, NU>::from_fn(|j, _| x[driven::<NX, NU>(j)] + u[j]);
        self.input = self.input.sup(&u.abs());
        self.state = self.state.sup(&x.abs());
        self.row = self.row.sup(&sums.abs());
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
    pub fn impose(&self, kind: Kind, plant: &impl Plant<NX, NU>, ocp: &mut Ocp<f64, NX, NU>) {
        let [inputs, states, rows] = kind.bounds();
        if inputs {
            (ocp.common.u.lower, ocp.common.u.upper) = (-self.input, self.input);
        }
        if states {
            let price = (kind == Kind::Soft).then_some(PRICE);
            for place in plant.bounded_states() {
                for bounds in [&mut ocp.common.x, &mut ocp.terminal.x] {
                    (bounds.lower[place], bounds.upper[place]) =
                        (-self.state[place], self.state[place]);
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
                row.x[driven::<NX, NU>(j)] = 1.0;
                row.u[j] = 1.0;
                (row.lower, row.upper) = (-self.row[j], self.row[j]);
            }
        }
    }
}

/// The state that input `j` of the oscillators moves most.
pub fn driven<const NX: usize, const NU: usize>(j: usize) -> usize {
    j * NX / NU
}
