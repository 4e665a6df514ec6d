//! From sizes that a user chose to places that were compiled: shapes are checked, what is left over
//! is filled.

use crate::error::MpcError;
use crate::settings::{Limits, Row};
use lpvmpc::{Bounds, GeneralRow, Penalty, Weights};
use lpvmpc_design::{
    MatrixError, check_positive_definite, check_positive_semidefinite, checked_symmetric,
};
use lpvmpc_plant::{Plant, Signal};
use nalgebra::{DMatrix, DVector, SMatrix, SVector};

/// The names of a plant's states, inputs and outputs.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Names {
    pub states: Vec<String>,
    pub inputs: Vec<String>,
    pub outputs: Vec<String>,
}

/// Which of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Axis {
    States,
    Inputs,
    Outputs,
}

impl Names {
    pub fn new(plant: &Plant) -> Self {
        let all = |signals: &[Signal]| signals.iter().map(|one| one.name.clone()).collect();
        Self {
            states: all(&plant.data().states),
            inputs: all(&plant.data().inputs),
            outputs: all(&plant.data().outputs),
        }
    }

    pub fn of(&self, axis: Axis) -> &[String] {
        match axis {
            Axis::States => &self.states,
            Axis::Inputs => &self.inputs,
            Axis::Outputs => &self.outputs,
        }
    }

    /// Which output is called `name`: one that a sensor can measure, so none `of_input`.
    pub fn measurable_output(
        &self,
        place: &str,
        name: &str,
        of_input: &[bool],
    ) -> Result<usize, MpcError> {
        let fault = match self.outputs.iter().position(|known| known == name) {
            Some(k) if !of_input[k] => return Ok(k),
            Some(_) => format!("{name:?} depends on the input, which a sensor must not"),
            None => {
                let known = [&self.states[..], &self.outputs[..]].concat().join(", ");
                format!("{name:?} is no state or output; there are {known}")
            }
        };
        Err(MpcError::new(place, fault))
    }

    /// "4 (position, angle, ...)", as a message says what was expected.
    fn expected(&self, axis: Axis) -> String {
        let names = self.of(axis);
        format!("{} ({})", names.len(), names.join(", "))
    }

    /// As many entries as there are states, inputs or outputs.
    fn check_length(&self, axis: Axis, place: &str, length: usize) -> Result<(), MpcError> {
        if length == self.of(axis).len() {
            return Ok(());
        }
        let fault = format!(
            "it has {length} entries; there must be {}",
            self.expected(axis)
        );
        Err(MpcError::new(place, fault))
    }

    /// A vector with an entry for each state or input.
    pub fn vector<const K: usize>(
        &self,
        axis: Axis,
        place: &str,
        entries: &[f64],
    ) -> Result<SVector<f64, K>, MpcError> {
        self.check_length(axis, place, entries.len())?;
        Ok(SVector::from_fn(|i, _| {
            entries.get(i).copied().unwrap_or(0.0)
        }))
    }

    /// A vector of finite numbers.
    pub fn finite<const K: usize>(
        &self,
        axis: Axis,
        place: &str,
        entries: &[f64],
    ) -> Result<SVector<f64, K>, MpcError> {
        self.check_finite(axis, place, entries)?;
        self.vector(axis, place, entries)
    }

    /// Finite numbers, one for each state, input or output.
    pub fn check_finite(&self, axis: Axis, place: &str, entries: &[f64]) -> Result<(), MpcError> {
        self.check_length(axis, place, entries.len())?;
        match entries.iter().position(|entry| !entry.is_finite()) {
            None => Ok(()),
            Some(i) => {
                let fault = format!("{} is {}; it must be finite", self.of(axis)[i], entries[i]);
                Err(MpcError::new(place, fault))
            }
        }
    }

    /// A matrix of finite numbers, with rows and columns for these; `rest` stands on the diagonal of
    /// what is left over.
    pub fn matrix<const R: usize, const C: usize>(
        &self,
        axes: (Axis, Axis),
        place: &str,
        entries: &DMatrix<f64>,
        rest: f64,
    ) -> Result<SMatrix<f64, R, C>, MpcError> {
        self.check_matrix(axes, place, entries)?;
        Ok(filled(entries, rest))
    }

    /// A matrix with rows and columns for these, symmetric up to rounding, of which the symmetric part is taken; `rest` as of
    /// [`Self::matrix`].
    pub fn symmetric<const K: usize>(
        &self,
        axis: Axis,
        place: &str,
        symbol: &'static str,
        entries: &DMatrix<f64>,
        rest: f64,
    ) -> Result<SMatrix<f64, K, K>, MpcError> {
        let entries = self.symmetric_part(axis, place, symbol, entries)?;
        Ok(filled(&entries, rest))
    }

    fn symmetric_part(
        &self,
        axis: Axis,
        place: &str,
        symbol: &'static str,
        entries: &DMatrix<f64>,
    ) -> Result<DMatrix<f64>, MpcError> {
        self.check_matrix((axis, axis), place, entries)?;
        checked_symmetric(symbol, entries).map_err(|error| MpcError::new(place, error.to_string()))
    }

    /// A matrix of finite numbers, with rows and columns for these.
    pub fn check_matrix(
        &self,
        axes: (Axis, Axis),
        place: &str,
        entries: &DMatrix<f64>,
    ) -> Result<(), MpcError> {
        let shape = (self.of(axes.0).len(), self.of(axes.1).len());
        if entries.shape() != shape {
            let fault = format!(
                "it is {} x {}; it must be {} x {} ({} by {})",
                entries.nrows(),
                entries.ncols(),
                shape.0,
                shape.1,
                self.of(axes.0).join(", "),
                self.of(axes.1).join(", ")
            );
            return Err(MpcError::new(place, fault));
        }
        for i in 0..shape.0 {
            for j in 0..shape.1 {
                if !entries[(i, j)].is_finite() {
                    let fault = format!(
                        "the entry ({i}, {j}) is {}; it must be finite",
                        entries[(i, j)]
                    );
                    return Err(MpcError::new(place, fault));
                }
            }
        }
        Ok(())
    }

    /// Bounds for each state or input.
    pub fn bounds<const K: usize>(
        &self,
        axis: Axis,
        place: &str,
        limits: &Limits,
    ) -> Result<Bounds<f64, K>, MpcError> {
        self.check_limits(axis, place, limits)?;
        let mut bounds = Bounds::none();
        let sides = limits.lower.iter().zip(&limits.upper);
        for (i, (lower, upper)) in sides.enumerate() {
            (bounds.lower[i], bounds.upper[i]) = (*lower, *upper);
        }
        Ok(bounds)
    }

    /// A lower bound that does not exceed the upper one, for each of these.
    pub fn check_limits(&self, axis: Axis, place: &str, limits: &Limits) -> Result<(), MpcError> {
        let Limits { lower, upper } = limits;
        self.check_length(axis, &format!("{place}, lower"), lower.len())?;
        self.check_length(axis, &format!("{place}, upper"), upper.len())?;
        for (name, (least, most)) in self.of(axis).iter().zip(lower.iter().zip(upper)) {
            // Negated, so that a bound that is NaN fails.
            if !(least <= most && *least < f64::INFINITY && *most > f64::NEG_INFINITY) {
                let fault = format!(
                    "{name} must lie from {least} to {most}; the lower bound must not exceed the \
                     upper one"
                );
                return Err(MpcError::new(place, fault));
            }
        }
        Ok(())
    }

    /// A symmetric positive semidefinite weight called `symbol`.
    pub fn check_weight(
        &self,
        axis: Axis,
        place: &str,
        symbol: &'static str,
        weight: &DMatrix<f64>,
    ) -> Result<(), MpcError> {
        let weight = self.symmetric_part(axis, place, symbol, weight)?;
        check_positive_semidefinite(symbol, &weight)
            .map_err(|error| MpcError::new(place, error.to_string()))
    }

    /// Q and R.
    pub fn weights<const NX: usize, const NU: usize>(
        &self,
        place: &str,
        q: &DMatrix<f64>,
        r: &DMatrix<f64>,
    ) -> Result<Weights<f64, NX, NU>, MpcError> {
        let refused = |error: MatrixError| MpcError::new(place, error.to_string());
        let q = self.symmetric_part(Axis::States, &format!("{place}, q"), "Q", q)?;
        let r = self.symmetric_part(Axis::Inputs, &format!("{place}, r"), "R", r)?;
        check_positive_semidefinite("Q", &q).map_err(refused)?;
        check_positive_definite("R", &r).map_err(refused)?;
        Ok(Weights {
            q: filled(&q, 0.0),
            // An input that is left over must cost something to be none.
            r: filled(&r, 1.0),
        })
    }

    /// Linear rows.
    pub fn rows<const NX: usize, const NU: usize>(
        &self,
        place: &str,
        rows: &[Row],
    ) -> Result<Vec<GeneralRow<f64, NX, NU>>, MpcError> {
        let rows = rows.iter();
        rows.map(|row| self.row(place, row)).collect()
    }

    /// A linear row.
    fn row<const NX: usize, const NU: usize>(
        &self,
        place: &str,
        row: &Row,
    ) -> Result<GeneralRow<f64, NX, NU>, MpcError> {
        let place = format!("{place} `{}`", row.name);
        let entries = |vector: &DVector<f64>| vector.as_slice().to_vec();
        if !(row.lower <= row.upper && row.lower < f64::INFINITY && row.upper > f64::NEG_INFINITY) {
            let fault = format!(
                "its lower bound is {} and its upper one {}; the lower must not exceed the upper",
                row.lower, row.upper
            );
            return Err(MpcError::new(place, fault));
        }
        if let Some(price) = &row.soft {
            check_price(&place, "it", price)?;
        }
        Ok(GeneralRow {
            x: self.finite(Axis::States, &format!("{place}, x"), &entries(&row.x))?,
            u: self.finite(Axis::Inputs, &format!("{place}, u"), &entries(&row.u))?,
            lower: row.lower,
            upper: row.upper,
            soft: row.soft,
        })
    }
}

/// In the places that were compiled, with `rest` on the diagonal of what is left over.
fn filled<const R: usize, const C: usize>(entries: &DMatrix<f64>, rest: f64) -> SMatrix<f64, R, C> {
    SMatrix::from_fn(|i, j| match entries.get((i, j)) {
        Some(entry) => *entry,
        None if i == j => rest,
        None => 0.0,
    })
}

/// The price of exceeding a bound of `whose`.
pub(crate) fn check_price(place: &str, whose: &str, price: &Penalty<f64>) -> Result<(), MpcError> {
    let sound = |price: f64| price >= 0.0 && price.is_finite();
    if sound(price.linear) && sound(price.quadratic) {
        return Ok(());
    }
    let fault = format!(
        "the prices of exceeding {whose} are {} and {}; they must be finite and not negative",
        price.linear, price.quadratic
    );
    Err(MpcError::new(place, fault))
}
