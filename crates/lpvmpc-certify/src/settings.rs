//! What a certificate is asked for.

use nalgebra::{DMatrix, DVector};

/// What a certificate is asked for. `n` states, `m` inputs, in the order and in the units of the plant.
#[derive(Debug, Clone, PartialEq)]
pub struct CertifySettings {
    /// Sampling time, s; of a plant in discrete time its period.
    pub t_s: f64,
    /// Q, n x n, symmetric positive semidefinite, of the stage cost e'Qe + v'Rv, e and v the deviations from the
    /// equilibrium.
    pub q: DMatrix<f64>,
    /// R, m x m, symmetric positive definite.
    pub r: DMatrix<f64>,
    /// The equilibrium (x, u); `None` for the plant's, or zero where it names none.
    pub equilibrium: Option<(Vec<f64>, Vec<f64>)>,
    /// Least and largest values of the states; `None` for those of the plant. The set is symmetric about the
    /// equilibrium, so of the two the nearer one counts.
    pub x_bounds: Option<(Vec<f64>, Vec<f64>)>,
    /// The same of the inputs.
    pub u_bounds: Option<(Vec<f64>, Vec<f64>)>,
    /// How much dearer the terminal cost may be than the regulator's, to have a larger set, at least 1: the level is
    /// this many times that at which the regulator's own ellipsoid meets the first bound.
    pub enlargement: f64,
    /// Boxes of states that one proof may look at; `None` for 4000 of up to eight states, and 8 of more, of which each
    /// takes long.
    pub most_boxes: Option<usize>,
    /// Proofs of larger sets that are tried once there is one.
    pub trials: usize,
    /// Program and version that go into the file.
    pub written_by: String,
}

impl CertifySettings {
    /// Sampling time, and diagonals of Q and R; the rest serves as a rule.
    pub fn new(t_s: f64, q: &[f64], r: &[f64]) -> Self {
        let diagonal = |entries: &[f64]| DMatrix::from_diagonal(&DVector::from_row_slice(entries));
        Self {
            t_s,
            q: diagonal(q),
            r: diagonal(r),
            equilibrium: None,
            x_bounds: None,
            u_bounds: None,
            enlargement: 10.0,
            most_boxes: None,
            trials: 4,
            written_by: format!("lpvmpc {}", env!("CARGO_PKG_VERSION")),
        }
    }
}
