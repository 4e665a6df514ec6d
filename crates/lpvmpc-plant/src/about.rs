//! A plant about its steady state, as an embedding without affine term.

use crate::error::PlantError;
use crate::factorise::{NoFactors, factorise};
use crate::plant::Plant;
use crate::prepared::{Fixed, Prepared};
use lpvmpc::{Embedding, Number};
use nalgebra::{SMatrix, SVector};
use std::sync::Arc;

/// A [`Plant`] about a steady state (x_r, u_r), in the places of `NX` states and `NU` inputs:
///
/// ```text
/// f(x_r + x, u_r + u) = A(s) x + B(s) u,     s = (x, u)
/// ```
///
/// or in discrete time F(x_r + x, u_r + u) - x_r, without remainder, on any kind of number: what intervals and Taylor models enclose is f itself. A and B follow
/// from the formulas of f alone, operation by operation (divided differences); the plant needs no embedding of its own.
/// `NS` is the number of states and inputs together.
///
/// The steady state is known as an enclosure, and the equation holds for that one in it at which f is zero (F is x_r). Places
/// that are left over decay by themselves, x_dot = -`spare_rate` x, or are zero a period later, and nothing depends on them.
#[derive(Debug, Clone)]
pub struct AboutEquilibrium<const NX: usize, const NU: usize, const NS: usize> {
    plant: Plant,
    entries: Arc<Prepared>,
    fixed: Arc<Fixed>,
    /// Row and column of each entry of [A B], by the plant's own sizes.
    places: Arc<[(usize, usize)]>,
    /// x_r, then u_r: lower and upper ends.
    equilibrium: Vec<(f64, f64)>,
    spare_rate: f64,
}

impl<const NX: usize, const NU: usize, const NS: usize> AboutEquilibrium<NX, NU, NS> {
    /// `plant`, with its parameters as they are now, about the steady state enclosed by `equilibrium`: the lower and
    /// upper end of each state, then of each input. `spare_rate` is in 1/s.
    ///
    /// # Errors
    /// It has more states or inputs than there are places; `equilibrium` has another length or an end that is not
    /// finite; or its formulas have an operation for which no exact form is known, or are too long.
    pub fn new(
        plant: &Plant,
        equilibrium: &[(f64, f64)],
        spare_rate: f64,
    ) -> Result<Self, PlantError> {
        const {
            assert!(
                NS == NX + NU,
                "the scheduling is x and u: NS must be NX + NU"
            )
        };
        let data = plant.data();
        let (states, inputs) = (data.states.len(), data.inputs.len());
        if states > NX || inputs > NU {
            let fault = format!(
                "there are {states} states and {inputs} inputs, and places for {NX} and {NU}"
            );
            return Err(PlantError::new("states", fault));
        }
        let sizes = (states, inputs);
        let factors = factorise(&data.operations, data.motion(), sizes).map_err(|none| {
            let (place, fault) = match none {
                NoFactors::TooLong => ("operations".to_owned(), "they are too long".to_owned()),
                NoFactors::Operation(i) => {
                    let (operation, place) = (&data.operations[i], format!("operations[{i}]"));
                    let name = operation.name();
                    let fault = match operation.jumps() {
                        false => format!(
                            "no proof can be had of `{name}`: no exact difference of it is known"
                        ),
                        true => format!("no proof can be had of `{name}`: it jumps"),
                    };
                    (place, fault)
                }
            };
            PlantError::new(place, fault)
        })?;
        let results: Vec<usize> = factors.entries.iter().map(|(_, _, place)| *place).collect();
        let entries = Prepared::new(&factors.operations, &results);
        let about = Self {
            plant: plant.clone(),
            fixed: Arc::new(entries.fixed(plant.parameters())),
            entries: Arc::new(entries),
            places: { factors.entries.iter() }
                .map(|(row, column, _)| (*row, *column))
                .collect(),
            equilibrium: Vec::new(),
            spare_rate,
        };
        about.about(equilibrium)
    }

    /// The same about another steady state.
    ///
    /// # Errors
    /// `equilibrium` has not an end for each state and input, or one that is not finite.
    pub fn about(mut self, equilibrium: &[(f64, f64)]) -> Result<Self, PlantError> {
        let data = self.plant.data();
        let count = data.states.len() + data.inputs.len();
        let finite = |(lower, upper): &(f64, f64)| lower <= upper && (upper - lower).is_finite();
        if equilibrium.len() != count || !equilibrium.iter().all(finite) {
            let fault = format!("it must have {count} pairs of finite ends, the lower one first");
            return Err(PlantError::new("equilibrium", fault));
        }
        self.equilibrium = equilibrium.to_vec();
        Ok(self)
    }

    /// The plant.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// The enclosure of x_r, then of u_r.
    pub fn equilibrium(&self) -> &[(f64, f64)] {
        &self.equilibrium
    }
}

impl<const NX: usize, const NU: usize, const NS: usize> Embedding<NX, NU, NS>
    for AboutEquilibrium<NX, NU, NS>
{
    fn period(&self) -> Option<f64> {
        self.plant.period()
    }

    /// (x, u).
    fn scheduling<N: Number>(&self, x: &SVector<N, NX>, u: &SVector<N, NU>) -> SVector<N, NS> {
        SVector::from_fn(|i, _| if i < NX { x[i] } else { u[i - NX] })
    }

    fn matrices<N: Number>(
        &self,
        scheduling: &SVector<N, NS>,
    ) -> (SMatrix<N, NX, NX>, SMatrix<N, NX, NU>) {
        let zero = N::constant(0.0);
        let states = self.plant.data().states.len();
        let base = { self.equilibrium.iter() }.map(|(lower, upper)| {
            if lower == upper {
                N::constant(*lower)
            } else {
                N::between(*lower, *upper)
            }
        });
        let base: Vec<N> = base.collect();
        let deviation = |i: usize| match i.checked_sub(states) {
            None => scheduling[i],
            Some(j) => scheduling[NX + j],
        };
        let at = base
            .iter()
            .enumerate()
            .map(|(i, base)| *base + deviation(i));
        let slots: Vec<N> = at.chain(base.iter().copied()).collect();
        let (mut a, mut b) = (SMatrix::repeat(zero), SMatrix::repeat(zero));
        self.entries
            .evaluate(&self.fixed, (&[], &[]), &slots, |result, value| {
                let (row, column) = self.places[result];
                match column.checked_sub(states) {
                    None => a[(row, column)] = value,
                    Some(j) => b[(row, j)] = value,
                }
            });
        for i in states..NX {
            a[(i, i)] = match self.period() {
                None => N::constant(-self.spare_rate),
                Some(_) => zero,
            };
        }
        (a, b)
    }
}
