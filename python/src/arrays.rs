//! Arrays of numpy as vectors and matrices, and back.

use crate::errors::setting;
use nalgebra::{DMatrix, DVector};
use numpy::ndarray::Array2;
use numpy::{PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;

/// A vector.
pub type Vector<'py> = PyReadonlyArray1<'py, f64>;
/// A matrix, or one vector per stage as its rows.
pub type Matrix<'py> = PyReadonlyArray2<'py, f64>;
/// One matrix per stage.
pub type Matrices<'py> = PyReadonlyArray3<'py, f64>;

/// The entries of a vector.
pub fn entries(vector: &Vector<'_>) -> Vec<f64> {
    vector.as_array().to_vec()
}

/// A matrix.
pub fn matrix(matrix: &Matrix<'_>) -> DMatrix<f64> {
    let view = matrix.as_array();
    DMatrix::from_fn(view.nrows(), view.ncols(), |i, j| view[[i, j]])
}

/// The rows of a matrix; none without one.
pub fn rows(matrix: Option<&Matrix<'_>>) -> Vec<DVector<f64>> {
    let Some(matrix) = matrix else {
        return Vec::new();
    };
    let rows = matrix.as_array();
    let rows = rows.rows().into_iter();
    rows.map(|row| DVector::from_iterator(row.len(), row.iter().copied()))
        .collect()
}

/// The matrices of a stack; none without one.
pub fn stack(stack: Option<&Matrices<'_>>) -> Vec<DMatrix<f64>> {
    let Some(stack) = stack else {
        return Vec::new();
    };
    let views = stack.as_array();
    let views = views.outer_iter();
    views
        .map(|view| DMatrix::from_fn(view.nrows(), view.ncols(), |i, j| view[[i, j]]))
        .collect()
}

/// Pairs of two lists that must be equally long.
pub fn pairs<A, B>(place: &str, one: Vec<A>, other: Vec<B>) -> PyResult<Vec<(A, B)>> {
    if one.len() != other.len() {
        let fault = format!(
            "one part has {} stages, the other {}; they must be as many",
            one.len(),
            other.len()
        );
        return Err(setting(place, &fault));
    }
    Ok(one.into_iter().zip(other).collect())
}

/// A matrix as an array of numpy.
pub fn to_numpy<'py>(py: Python<'py>, matrix: &DMatrix<f64>) -> Bound<'py, PyArray2<f64>> {
    let array = Array2::from_shape_fn(matrix.shape(), |(i, j)| matrix[(i, j)]);
    PyArray2::from_owned_array(py, array)
}
