//! A certificate as it stands in a file.

use crate::error::CertifyError;
use lpvmpc_any::TerminalSet;
use lpvmpc_certificate::{
    check_document_digest, document_content, document_text, read_certificate,
};
use lpvmpc_plant::Plant;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::path::Path;

/// What is claimed of a plant about an equilibrium under the law u = u_eq - K (x - x_eq), held over each
/// sample, with all that is needed to prove it again but the plant. `n` states, `m` inputs, in the order and in
/// the units of the plant; matrices are lists of rows.
///
/// With e = x - x_eq and V(e) = e'Pe, for every state with V(e) <= level: V(e+) <= (1 - contraction) V(e) - e'Qe - v'Rv
/// with v = u - u_eq, |e_i| <= `state_limits[i]` at and between the samples, |v_i| <= `input_limits[i]`. The
/// equilibrium is a state and input at which f is exactly zero (in discrete time F(x, u) is exactly x, and there is
/// nothing between the samples); it is at most `equilibrium.within` from the numbers of the file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Certificate {
    /// Program and version that wrote the file.
    pub written_by: String,
    /// The plant.
    pub plant: PlantName,
    /// Sampling time, s; of a plant in discrete time its period.
    pub t_s: f64,
    /// The equilibrium.
    pub equilibrium: EquilibriumClaim,
    /// Q of the stage cost, n x n.
    pub q: Vec<Vec<f64>>,
    /// R of the stage cost, m x m.
    pub r: Vec<Vec<f64>>,
    /// |x_i - x_eq_i| <= `state_limits[i]`; `null` for none.
    pub state_limits: Vec<Option<f64>>,
    /// |u_i - u_eq_i| <= `input_limits[i]`; `null` for none.
    pub input_limits: Vec<Option<f64>>,
    /// K, m x n, for u = u_eq **-** K (x - x_eq).
    pub k: Vec<Vec<f64>>,
    /// P, n x n, symmetric positive definite.
    pub p: Vec<Vec<f64>>,
    /// The set is e'Pe <= level, in units of the cost.
    pub level: f64,
    /// The share of e'Pe by which it decreases beyond the stage cost, at least.
    pub contraction: f64,
    /// What the run that wrote the file found; not part of the claims.
    pub record: Record,
}

/// Which plant it is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlantName {
    /// Its name.
    pub name: String,
    /// SHA-256 of its data as compact JSON, with the parameters as they were: 64 hexadecimal digits.
    pub sha256: String,
}

/// A state and input with f(x, u) = 0, in discrete time F(x, u) = x.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EquilibriumClaim {
    /// The state.
    pub x: Vec<f64>,
    /// The input that holds it.
    pub u: Vec<f64>,
    /// How far the exact one is from these numbers, at most: of each state, then of each input.
    pub within: Vec<f64>,
}

/// What the proof took when the file was written.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// Boxes of states on which the decrease was proved.
    pub boxes: usize,
    /// The smallest contraction that a box would have carried.
    pub smallest_contraction: f64,
}

impl Certificate {
    /// The file's text.
    ///
    /// # Errors
    /// A number is not finite.
    pub fn to_json(&self) -> Result<String, CertifyError> {
        Ok(document_text(self)?)
    }

    /// The certificate in the text of a file, which is as it was written. **Nothing is proved**: see
    /// [`verify`](crate::verify).
    ///
    /// # Errors
    /// It is no certificate, or was changed after it was written.
    pub fn from_json(text: &str) -> Result<Self, CertifyError> {
        let certificate = document_content(text)?;
        check_document_digest::<Self>(text)?;
        Ok(certificate)
    }

    /// The certificate in the file at `path`, as [`from_json`](Self::from_json).
    ///
    /// # Errors
    /// The file cannot be read, is no certificate, or was changed after it was written.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, CertifyError> {
        let path = path.as_ref();
        let text =
            read_certificate(path).map_err(|error| CertifyError::setting(path.display(), error))?;
        Self::from_json(&text)
    }

    /// The value e'Pe of a state x, e = x - x_eq; it is in the set where that is at most `level`. Not a number where
    /// `x` has not the plant's size.
    pub fn value(&self, x: &[f64]) -> f64 {
        let center = &self.equilibrium.x;
        if x.len() != center.len() {
            return f64::NAN;
        }
        let e: Vec<f64> = x.iter().zip(center).map(|(x, c)| x - c).collect();
        let rows = self.p.iter().zip(&e);
        rows.map(|(row, e_i)| e_i * row.iter().zip(&e).map(|(p, e_j)| p * e_j).sum::<f64>())
            .sum()
    }

    /// Whether the state x is in the set.
    pub fn contains(&self, x: &[f64]) -> bool {
        self.value(x) <= self.level
    }

    /// The terminal set of a controller for `plant`: [`lpvmpc_any::Terminal::Certified`]. **Nothing is proved**: a
    /// certificate from elsewhere is for [`verify`](crate::verify) first.
    ///
    /// # Errors
    /// It is a certificate of another plant, or its matrices are none.
    pub fn terminal_set(&self, plant: &Plant) -> Result<TerminalSet, CertifyError> {
        self.check_plant(plant)?;
        let (n, m) = (plant.data().states.len(), plant.data().inputs.len());
        let matrix = |rows: &[Vec<f64>], shape| matrix(rows, shape, "certificate");
        let limits = |limits: &[Option<f64>]| -> Vec<f64> {
            limits
                .iter()
                .map(|limit| limit.unwrap_or(f64::INFINITY))
                .collect()
        };
        Ok(TerminalSet {
            x: DVector::from_row_slice(&self.equilibrium.x),
            u: DVector::from_row_slice(&self.equilibrium.u),
            k: matrix(&self.k, (m, n))?,
            p: matrix(&self.p, (n, n))?,
            level: self.level,
            t_s: self.t_s,
            q: matrix(&self.q, (n, n))?,
            r: matrix(&self.r, (m, m))?,
            state_limits: limits(&self.state_limits),
            input_limits: limits(&self.input_limits),
        })
    }

    /// Whether it speaks of this plant with its parameters as they are now.
    ///
    /// # Errors
    /// It is a certificate of another one.
    pub fn check_plant(&self, plant: &Plant) -> Result<(), CertifyError> {
        let found = plant_hash(plant)?;
        if found == self.plant.sha256 {
            return Ok(());
        }
        Err(CertifyError::AnotherPlant {
            name: self.plant.name.clone(),
            claimed: self.plant.sha256.clone(),
            found,
        })
    }
}

/// SHA-256 of a plant's data with its parameters as they are now.
pub(crate) fn plant_hash(plant: &Plant) -> Result<String, CertifyError> {
    let mut data = plant.data().clone();
    for (parameter, value) in data.parameters.iter_mut().zip(plant.parameters()) {
        parameter.value = *value;
    }
    let text =
        serde_json::to_string(&data).map_err(|error| CertifyError::setting("plant", error))?;
    Ok(format!("{:x}", Sha256::digest(text)))
}

/// A matrix of so many rows and columns.
pub(crate) fn matrix(
    rows: &[Vec<f64>],
    (n, m): (usize, usize),
    place: &str,
) -> Result<DMatrix<f64>, CertifyError> {
    if rows.len() != n || rows.iter().any(|row| row.len() != m) {
        let fault = format!("it must have {n} rows of {m} numbers");
        return Err(CertifyError::setting(place, fault));
    }
    Ok(DMatrix::from_fn(n, m, |i, j| rows[i][j]))
}
