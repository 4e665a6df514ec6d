//! Boxes of states and inputs, as parts of rays from rest.

use crate::cover::Cell;
use crate::enclosure::{ScaledPlant, TaylorModel};
use lpvmpc::Number;
use nalgebra::SVector;

/// What a variable is.
#[derive(Debug, Clone, Copy)]
pub(super) enum Place {
    State(usize),
    Input(usize),
}

/// A state or input with bounds.
#[derive(Debug, Clone, Copy)]
pub(super) struct Variable {
    pub place: Place,
    /// The larger one of its bounds in size, > 0.
    pub limit: f64,
}

/// The states and inputs r v, r from 0 to 1, for which v has the variable `face` at `side` times its limit, and
/// the others within theirs: r is their share of the bounds. Coordinates of a cell are r in place of that variable,
/// and what the others have of their limits; the last place is left to the time.
pub(super) struct Rays<'a, M> {
    pub model: &'a M,
    pub variables: &'a [Variable],
    pub face: usize,
    pub side: f64,
}

impl<'a, M> Rays<'a, M> {
    /// Both sides of every variable: together all states and inputs within their bounds.
    pub fn all(model: &'a M, variables: &'a [Variable]) -> impl Iterator<Item = Self> {
        let faces = (0..variables.len()).flat_map(|face| [(face, -1.0), (face, 1.0)]);
        faces.map(move |(face, side)| Self {
            model,
            variables,
            face,
            side,
        })
    }

    /// All of them.
    pub fn whole<const D: usize>(&self) -> Cell<D> {
        let mut whole = Cell {
            centre: SVector::zeros(),
            half_widths: SVector::repeat(1.0),
        };
        whole.half_widths[D - 1] = 0.0;
        whole.centre[self.face] = 0.5;
        whole.half_widths[self.face] = 0.5;
        whole
    }

    /// A part of them: the rays, and the states that they have for r = 1.
    pub fn part<const NX: usize, const NU: usize, const D: usize>(
        &self,
        cell: &Cell<D>,
    ) -> (ScaledPlant<'a, M, TaylorModel<D>, NU>, [TaylorModel<D>; NX]) {
        let zero = TaylorModel::constant(0.0);
        let (mut y, mut input) = ([zero; NX], [zero; NU]);
        let symbol = |j: usize| TaylorModel::symbol(cell.centre[j], cell.half_widths[j], j);
        for (j, variable) in self.variables.iter().enumerate() {
            let share = match j == self.face {
                true => TaylorModel::constant(self.side),
                false => symbol(j),
            };
            let value = share * TaylorModel::constant(variable.limit);
            match variable.place {
                Place::State(i) => y[i] = value,
                Place::Input(i) => input[i] = value,
            }
        }
        let ray = ScaledPlant {
            model: self.model,
            scale: symbol(self.face),
            input,
        };
        (ray, y)
    }
}
