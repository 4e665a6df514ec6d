//! Linear plants as data.

use crate::data::{EmbeddingData, PlantData, numbered};
use crate::error::PlantError;
use crate::operation::{Binary, Operation};
use crate::recording::by_time;
use nalgebra::{DMatrix, DVector};

/// The matrices of a linear plant x_dot = A x + B u + c, y = C x + D u; with a period x+ = A x + B u + c.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Matrices {
    /// A, n x n; per second in continuous time.
    pub a: DMatrix<f64>,
    /// B, n x m.
    pub b: DMatrix<f64>,
    /// The affine term c, n; zero without.
    pub affine: Option<DVector<f64>>,
    /// C, with a row for each output; no outputs without.
    pub c: Option<DMatrix<f64>>,
    /// D, with a row for each output; zero without.
    pub d: Option<DMatrix<f64>>,
    /// The period of a plant in discrete time, s.
    pub period: Option<f64>,
}

/// Formulas that are sums of constants times states and inputs.
struct Sums {
    operations: Vec<Operation>,
}

impl Sums {
    fn push(&mut self, operation: Operation) -> usize {
        self.operations.push(operation);
        self.operations.len() - 1
    }

    fn binary(&mut self, function: Binary, first: usize, second: usize) -> usize {
        self.push(Operation::Binary(function, first, second))
    }

    /// `constant` + the products of the `factors`, those of zero left out.
    fn sum(&mut self, constant: f64, factors: impl Iterator<Item = (f64, usize)>) -> usize {
        let mut sum = None;
        for (factor, of) in factors.filter(|(factor, _)| *factor != 0.0) {
            let term = match factor {
                1.0 => of,
                _ => {
                    let factor = self.push(Operation::Constant(factor));
                    self.binary(Binary::Multiply, factor, of)
                }
            };
            sum = Some(match sum {
                None => term,
                Some(sum) => self.binary(Binary::Add, sum, term),
            });
        }
        match sum {
            Some(sum) if constant == 0.0 => sum,
            Some(sum) => {
                let constant = self.push(Operation::Constant(constant));
                self.binary(Binary::Add, sum, constant)
            }
            None => self.push(Operation::Constant(constant)),
        }
    }

    /// The rows of M x + N u + constants.
    fn rows(
        &mut self,
        (m, n): (&DMatrix<f64>, Option<&DMatrix<f64>>),
        constants: Option<&DVector<f64>>,
    ) -> Vec<usize> {
        let states = m.ncols();
        let rows = 0..m.nrows();
        rows.map(|i| {
            let of_x = (0..states).map(|j| (m[(i, j)], j));
            let of_u = n
                .into_iter()
                .flat_map(|n| (0..n.ncols()).map(move |j| (n[(i, j)], states + j)));
            self.sum(constants.map_or(0.0, |c| c[i]), of_x.chain(of_u))
        })
        .collect()
    }

    fn constants(&mut self, matrix: &DMatrix<f64>) -> Vec<Vec<usize>> {
        let rows = matrix.row_iter();
        rows.map(|row| {
            { row.iter() }
                .map(|entry| self.push(Operation::Constant(*entry)))
                .collect()
        })
        .collect()
    }
}

impl PlantData {
    /// A linear plant as data, in continuous time or with a period; its matrices are its embedding, too. Its
    /// states are named x0, x1 and so on, its inputs u0, its outputs y0; names, units and all else are for the
    /// caller to fill in.
    ///
    /// ```
    /// use lpvmpc_plant::{Matrices, Plant, PlantData};
    /// use nalgebra::dmatrix;
    ///
    /// // A cart, position and speed, every 0.1 s under a force.
    /// let cart = Plant::new(PlantData::of_matrices("cart", &Matrices {
    ///     a: dmatrix![1.0, 0.1; 0.0, 1.0],
    ///     b: dmatrix![0.005; 0.1],
    ///     period: Some(0.1),
    ///     ..Matrices::default()
    /// })?)?;
    /// assert_eq!(cart.next(&[1.0, 2.0], &[0.0])?, [1.2, 2.0]);
    /// # Ok::<(), lpvmpc_plant::PlantError>(())
    /// ```
    ///
    /// # Errors
    /// The matrix that does not fit the others, or has a number that is not finite.
    pub fn of_matrices(name: &str, matrices: &Matrices) -> Result<Self, PlantError> {
        let Matrices {
            a,
            b,
            affine,
            c,
            d,
            period,
        } = matrices;
        let (states, inputs) = (a.nrows(), b.ncols());
        let outputs = c.as_ref().or(d.as_ref()).map_or(0, DMatrix::nrows);
        fits("a", a, (states, states))?;
        fits("b", b, (states, inputs))?;
        if let Some(c) = c {
            fits("c", c, (outputs, states))?;
        }
        if let Some(d) = d {
            fits("d", d, (outputs, inputs))?;
        }
        if let Some(affine) = affine {
            fits(
                "affine",
                &DMatrix::from_column_slice(affine.len(), 1, affine.as_slice()),
                (states, 1),
            )?;
        }
        let states_and_inputs = (0..states)
            .map(Operation::State)
            .chain((0..inputs).map(Operation::Input));
        let mut sums = Sums {
            operations: states_and_inputs.collect(),
        };
        let motion = sums.rows((a, Some(b)), affine.as_ref());
        let none = DMatrix::zeros(outputs, states);
        let output = sums.rows((c.as_ref().unwrap_or(&none), d.as_ref()), None);
        let embedding = EmbeddingData {
            scheduling: Vec::new(),
            a: sums.constants(a),
            b: sums.constants(b),
            c: { affine.as_ref() }.map(|c| {
                { c.iter() }
                    .map(|c| sums.push(Operation::Constant(*c)))
                    .collect()
            }),
        };
        let (derivative, next) = by_time(motion, *period);
        Ok(Self {
            name: name.to_owned(),
            states: numbered("x", states),
            inputs: numbered("u", inputs),
            outputs: numbered("y", outputs),
            operations: sums.operations,
            derivative,
            period: *period,
            next,
            output,
            embedding: Some(embedding),
            ..Self::default()
        })
    }
}

fn fits(place: &str, matrix: &DMatrix<f64>, shape: (usize, usize)) -> Result<(), PlantError> {
    if matrix.shape() != shape {
        let (found, needed) = (matrix.shape(), shape);
        let fault = format!(
            "it is {} x {}; it must be {} x {}",
            found.0, found.1, needed.0, needed.1
        );
        return Err(PlantError::new(place, fault));
    }
    match matrix.iter().find(|entry| !entry.is_finite()) {
        Some(entry) => Err(PlantError::new(
            place,
            format!("an entry is {entry}; it must be finite"),
        )),
        None => Ok(()),
    }
}
