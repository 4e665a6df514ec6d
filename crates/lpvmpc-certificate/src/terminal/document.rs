//! How vectors and matrices stand in a certificate file.

use nalgebra::SMatrix;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A matrix as a list of its rows.
pub(super) mod rows {
    use super::*;

    pub fn serialize<S: Serializer, const R: usize, const C: usize>(
        matrix: &SMatrix<f64, R, C>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        let rows = matrix.row_iter();
        let rows: Vec<Vec<f64>> = rows.map(|row| row.iter().copied().collect()).collect();
        rows.serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>, const R: usize, const C: usize>(
        deserializer: D,
    ) -> Result<SMatrix<f64, R, C>, D::Error> {
        let rows = Vec::<Vec<f64>>::deserialize(deserializer)?;
        if rows.len() != R || rows.iter().any(|row| row.len() != C) {
            return Err(D::Error::custom(format!(
                "expected {R} rows of {C} numbers"
            )));
        }
        Ok(SMatrix::from_fn(|i, j| rows[i][j]))
    }
}

/// A vector as a list; `null` where it is infinite, which JSON cannot say.
pub(super) mod limits {
    use super::*;
    use nalgebra::SVector;

    pub fn serialize<S: Serializer, const N: usize>(
        limits: &SVector<f64, N>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        let limits: Vec<Option<f64>> = limits
            .iter()
            .map(|limit| Some(*limit).filter(|limit| limit.is_finite()))
            .collect();
        limits.serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>, const N: usize>(
        deserializer: D,
    ) -> Result<SVector<f64, N>, D::Error> {
        let limits = Vec::<Option<f64>>::deserialize(deserializer)?;
        if limits.len() != N {
            return Err(D::Error::custom(format!(
                "expected {N} numbers (null for no limit)"
            )));
        }
        Ok(SVector::from_fn(|i, _| limits[i].unwrap_or(f64::INFINITY)))
    }
}
