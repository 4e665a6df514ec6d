//! What a step is told besides the state.

use crate::settings::{Limits, Row};
use nalgebra::{DMatrix, DVector};

/// What is known ahead of a step. Each list has one entry per stage, from the present one on; from where
/// it ends its last entry holds, and an empty one means what the settings say. So a list of one
/// entry is a value for the whole horizon.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Preview {
    /// x_ref; empty means the plant's steady state, or zero where the plant's file names none.
    pub x_ref: Vec<DVector<f64>>,
    /// u_ref, the input that costs nothing. With one, x_ref is taken as it is.
    pub u_ref: Vec<DVector<f64>>,
    /// Q and R.
    pub weights: Vec<(DMatrix<f64>, DMatrix<f64>)>,
    /// Cross weights S, m x n: 2 (u - u_ref)'S (x - x_ref) on top.
    pub cross: Vec<DMatrix<f64>>,
    /// Linear costs of the states, in cost per unit.
    pub linear_x: Vec<DVector<f64>>,
    /// Linear costs of the inputs, in cost per unit.
    pub linear_u: Vec<DVector<f64>>,
    /// Bounds of the states, as soft or hard as [`MpcSettings::state_bounds`](crate::MpcSettings::state_bounds) says.
    pub x_bounds: Vec<Limits>,
    /// Bounds of the inputs.
    pub u_bounds: Vec<Limits>,
    /// Linear rows in place of those of the settings.
    pub rows: Vec<Vec<Row>>,
    /// Measured disturbances d in state units per second: x_dot = f(x, u) + d; of a plant in discrete time in state
    /// units: x+ = F(x, u) + d.
    pub disturbance: Vec<DVector<f64>>,
    /// The plant's parameters.
    pub parameters: Vec<Vec<f64>>,
    /// y_ref; empty means the outputs where the plant stands nearest to x_ref. Without x_ref, x_ref is where the
    /// plant stands nearest to the end of y_ref.
    pub y_ref: Vec<DVector<f64>>,
    /// Q_y, where the settings have one.
    pub q_y: Vec<DMatrix<f64>>,
    /// Bounds of the outputs, as soft or hard as [`MpcSettings::output_bounds`](crate::MpcSettings::output_bounds) says.
    pub y_bounds: Vec<Limits>,
    /// R_du, where the settings have one.
    pub r_du: Vec<DMatrix<f64>>,
    /// Bounds of the changes of the input, where the settings have any.
    pub du_bounds: Vec<Limits>,
    /// Linear models x+ = A x + B u + c over the samples, in place of the plant. In continuous time a disturbance d then
    /// adds (I + A) d t_s / 2: the mean of what it adds at the end of a sample and from its beginning on.
    pub matrices: Vec<StageMatrices>,
    /// Scheduling from outside: the plant's own embedding x_dot = A(s) x + B(s) u + c(s) at these s, whatever its state.
    pub scheduling: Vec<DVector<f64>>,
}

/// A linear model of a sample, x+ = A x + B u + c.
#[derive(Debug, Clone, PartialEq)]
pub struct StageMatrices {
    /// A, n x n.
    pub a: DMatrix<f64>,
    /// B, n x m.
    pub b: DMatrix<f64>,
    /// c, n; zero without.
    pub affine: Option<DVector<f64>>,
}

impl Preview {
    /// One reference of the outputs for the whole horizon.
    pub fn to_outputs(y_ref: &[f64]) -> Self {
        Self {
            y_ref: vec![DVector::from_row_slice(y_ref)],
            ..Self::default()
        }
    }

    /// One reference for the whole horizon.
    pub fn to(x_ref: &[f64]) -> Self {
        Self {
            x_ref: vec![DVector::from_row_slice(x_ref)],
            ..Self::default()
        }
    }
}
