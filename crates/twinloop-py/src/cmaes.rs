//! CMA-ES as a value, and the eigenvectors that it rests on.

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use twinloop_core::{CmaEs, Eigen};

use crate::arrays::{Matrix, Vector, numbers, rows, to_matrix, to_vector, vector};
use crate::error::{Result, given};
use crate::rng::Name;

/// A search for the least value of a function as a value: ask for points, judge them, tell.
#[pyclass(frozen, name = "CmaEs", module = "twinloop._core")]
pub struct PyCmaEs(CmaEs);

#[pymethods]
impl PyCmaEs {
    #[new]
    fn new(
        mean: Vector<'_>,
        #[pyo3(from_py_with = given)] step: f64,
        #[pyo3(from_py_with = given)] population: usize,
        #[pyo3(from_py_with = given)] unit: Name,
    ) -> Result<Self> {
        Ok(Self(CmaEs::new(&vector(&mean), step, population, unit.unit()?)?))
    }

    #[getter]
    fn generation(&self) -> u64 {
        self.0.generation()
    }

    #[getter]
    fn mean<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        to_vector(py, self.0.mean().to_vec())
    }

    #[getter]
    fn step(&self) -> f64 {
        self.0.step()
    }

    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        to_matrix(py, self.0.mean().len(), self.0.covariance().to_vec())
    }

    #[getter]
    fn stopped(&self) -> bool {
        self.0.stopped()
    }

    fn ask<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        to_matrix(py, self.0.mean().len(), self.0.ask().concat())
    }

    fn tell(&self, points: Matrix<'_>, values: Vector<'_>) -> Result<Self> {
        let points = rows("points", &points, self.0.mean().len())?;
        Ok(Self(self.0.tell(&points, &vector(&values))?))
    }
}

/// Eigenvalues, ascending, and eigenvectors, a row each, of a symmetric matrix.
#[pyfunction]
#[expect(clippy::type_complexity, reason = "values and vectors")]
pub fn eigen<'py>(
    py: Python<'py>,
    matrix: Matrix<'py>,
) -> Result<(Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>)> {
    let (rows, columns) = matrix.as_array().dim();
    let found = Eigen::checked(&numbers(matrix.as_array()), [rows, columns])?;
    Ok((to_vector(py, found.values), to_matrix(py, columns, found.vectors)))
}
