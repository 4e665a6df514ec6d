//! Formulas of f and its derivatives, and of f and an embedding's matrices, in one code each.

use crate::data::{EmbeddingData, PlantData};
use crate::derive::{Varying, derive};
use crate::operation::Operation;
use crate::prepared::{Fixed, Prepared};
use crate::program::Program;
use lpvmpc::{Number, Scalar, Tangent};
use nalgebra::{SMatrix, SVector};

/// A code is no longer than this, nor are there more derivatives of all operations together: it takes some 10 ms to
/// write down.
const LONGEST: usize = 30_000;

/// x_dot with two matrices: the entries that are not always zero.
#[derive(Debug)]
pub(crate) struct TangentCode {
    code: Prepared,
    /// How many entries x_dot has; these are the first results.
    rates: usize,
    /// Row and column of the results that follow, of the matrix by the state.
    by_x: Vec<(usize, usize)>,
    /// The same of the rest, of the matrix by the input.
    by_u: Vec<(usize, usize)>,
}

/// What of a matrix is not always zero: row, column, place in a program.
type Entries = Vec<(usize, usize, usize)>;

impl TangentCode {
    fn new(program: &Program, rates: &[usize], by_x: &Entries, by_u: &Entries) -> Self {
        let places = by_x.iter().chain(by_u).map(|(.., place)| *place);
        let results: Vec<usize> = rates.iter().copied().chain(places).collect();
        let positions = |entries: &Entries| entries.iter().map(|(i, j, _)| (*i, *j)).collect();
        Self {
            code: Prepared::new(program.operations(), &results),
            rates: rates.len(),
            by_x: positions(by_x),
            by_u: positions(by_u),
        }
    }

    /// f, df/dx and df/du. `None` where the formulas would be longer than dual numbers take.
    pub fn of_derivatives(data: &PlantData, length_of_f: usize) -> Option<Self> {
        let mut program = Program::new(LONGEST);
        let states = data.states.len();
        let (operations, results) = (&data.operations, data.motion());
        let derived = derive(&mut program, operations, results, states, LONGEST)?;
        let (mut by_x, mut by_u) = (Entries::new(), Entries::new());
        for (i, Varying { slopes, .. }) in derived.iter().enumerate() {
            for (variable, slope) in slopes {
                match variable.checked_sub(states) {
                    None => by_x.push((i, *variable, *slope)),
                    Some(j) => by_u.push((i, j, *slope)),
                }
            }
        }
        let rates: Vec<usize> = derived.iter().map(|rate| rate.value).collect();
        let new = Self::new(&program, &rates, &by_x, &by_u);
        let variables = states + data.inputs.len();
        let most = longest(length_of_f, variables);
        (new.code.length() <= most).then_some(new)
    }

    /// A(s) x + B(s) u + c(s), A(s) and B(s) at the scheduling of x and u. `None` where that would be too long.
    pub fn of_embedding(data: &PlantData, embedding: &EmbeddingData) -> Option<Self> {
        let mut program = Program::new(LONGEST);
        let operations = &data.operations;
        let s = program.take(operations, &embedding.scheduling, None)?;
        let take = |program: &mut Program, list: &[usize]| program.take(operations, list, Some(&s));
        let rows = |matrix: &[Vec<usize>]| matrix.concat();
        let a = take(&mut program, &rows(&embedding.a))?;
        let b = take(&mut program, &rows(&embedding.b))?;
        let c = match &embedding.c {
            Some(c) => take(&mut program, c)?,
            None => Vec::new(),
        };
        let mut rates = Vec::new();
        let (mut by_x, mut by_u) = (Entries::new(), Entries::new());
        let (states, inputs) = (data.states.len(), data.inputs.len());
        for i in 0..states {
            let mut rate = program.constant(0.0)?;
            let parts = [
                (
                    &a[i * states..][..states],
                    Operation::State as fn(usize) -> Operation,
                    &mut by_x,
                ),
                (&b[i * inputs..][..inputs], Operation::Input, &mut by_u),
            ];
            for (row, leaf, entries) in parts {
                for (j, entry) in row.iter().enumerate() {
                    if program.number(*entry) != Some(0.0) {
                        entries.push((i, j, *entry));
                        let leaf = program.push(leaf(j))?;
                        let term = program.multiply(*entry, leaf)?;
                        rate = program.add(rate, term)?;
                    }
                }
            }
            if let Some(c) = c.get(i) {
                rate = program.add(rate, *c)?;
            }
            rates.push(rate);
        }
        Some(Self::new(&program, &rates, &by_x, &by_u))
    }

    /// What follows from these values of the parameters.
    pub fn fixed(&self, parameters: &[f64]) -> Fixed {
        self.code.fixed(parameters)
    }

    /// x_dot and both matrices at states and inputs of at least the plant's sizes; what is left over is zero.
    #[inline(always)]
    pub fn evaluate_each<
        T: Scalar + Number,
        const NX: usize,
        const NU: usize,
        const POINTS: usize,
    >(
        &self,
        fixed: &Fixed,
        x: &[SVector<T, NX>; POINTS],
        u: &[SVector<T, NU>; POINTS],
        tangents: &mut [Tangent<T, NX, NU>; POINTS],
    ) {
        for (rate, a, b) in tangents.iter_mut() {
            (*rate, *a, *b) = (SVector::zeros(), SMatrix::zeros(), SMatrix::zeros());
        }
        self.code.evaluate_each(fixed, x, u, |place, values| {
            let places = tangents.iter_mut().zip(values);
            match place.checked_sub(self.rates) {
                None => places.for_each(|((rate, ..), value)| rate[place] = value),
                Some(k) => match k.checked_sub(self.by_x.len()) {
                    None => places.for_each(|((_, a, _), value)| a[self.by_x[k]] = value),
                    Some(k) => places.for_each(|((.., b), value)| b[self.by_u[k]] = value),
                },
            }
        });
    }
}

/// So many instructions take as long as a pass of dual numbers through so many, with so many variables.
fn longest(length: usize, variables: usize) -> usize {
    length.saturating_mul(2 + variables / 2) + 16
}
