//! Ranking and archive: functions of a matrix of objectives.

use std::sync::Mutex;

use numpy::ndarray::Ix1;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use twinloop_core::pareto::{self, Distance, NumberedArchive, Objectives};

use crate::arrays::{Matrix, Numbers, numbers, to_integers, to_matrix, to_vector};
use crate::error::{Result, given, misuse};

/// The one door at which numbers that are not finite are refused.
pub fn matrix(array: &Matrix<'_>) -> Result<Objectives> {
    let array = array.as_array();
    Ok(Objectives::new(array.ncols(), numbers(array))?)
}

/// Front of each row, 0 for the non-dominated.
#[pyfunction]
pub fn ranks<'py>(py: Python<'py>, objectives: Matrix<'py>) -> Result<Bound<'py, PyArray1<i64>>> {
    let ranks = pareto::ranks(&matrix(&objectives)?);
    Ok(to_integers(py, ranks.into_iter().map(|rank| rank as usize)))
}

/// Room around each row within its front; infinite at the edges.
#[pyfunction]
pub fn crowding_distances<'py>(
    py: Python<'py>,
    objectives: Matrix<'py>,
    ranks: Numbers<'py, Ix1, i64>,
) -> Result<Bound<'py, PyArray1<f64>>> {
    let objectives = matrix(&objectives)?;
    let ranks: Option<Vec<u32>> = ranks.as_array().iter().map(|&rank| u32::try_from(rank).ok()).collect();
    match ranks {
        Some(ranks) if ranks.len() == objectives.len() => {
            Ok(to_vector(py, pareto::crowding_distances(&objectives, &ranks)))
        }
        _ => {
            Err(misuse(format!("ranks: expected a front, 0 or more, for each of {} rows", objectives.len())))
        }
    }
}

/// The best rows, best first, by front and then by room.
#[pyfunction]
pub fn select<'py>(
    py: Python<'py>,
    objectives: Matrix<'py>,
    #[pyo3(from_py_with = given)] count: usize,
) -> Result<Bound<'py, PyArray1<i64>>> {
    Ok(to_integers(py, pareto::select(&matrix(&objectives)?, count)))
}

/// Smallest value of each column.
#[pyfunction]
pub fn ideal_point<'py>(py: Python<'py>, objectives: Matrix<'py>) -> Result<Bound<'py, PyArray1<f64>>> {
    let objectives = matrix(&objectives)?;
    if objectives.is_empty() {
        return Err(misuse("ideal point: expected at least one row of objectives, found none".into()));
    }
    Ok(to_vector(py, pareto::ideal_point(&objectives)))
}

/// The row nearest to the ideal point.
#[pyfunction]
#[pyo3(signature = (objectives, normalised = false))]
pub fn best_tradeoff(objectives: Matrix<'_>, normalised: bool) -> Result<usize> {
    let best = pareto::best_tradeoff(&matrix(&objectives)?, distance(normalised));
    best.ok_or_else(|| misuse("best trade-off: expected at least one row of objectives, found none".into()))
}

/// How distances to the ideal point are measured.
pub fn distance(normalised: bool) -> Distance {
    if normalised { Distance::Normalised } else { Distance::Raw }
}

/// Non-dominated set of rows, each with the number under which it was offered.
#[pyclass(frozen, name = "Archive", module = "twinloop._core")]
pub struct PyArchive(Mutex<NumberedArchive>);

#[pymethods]
impl PyArchive {
    #[new]
    #[pyo3(signature = (columns, width = "auto"))]
    fn new(#[pyo3(from_py_with = given)] columns: usize, width: &str) -> Result<Self> {
        Ok(Self(Mutex::new(NumberedArchive::new(columns, width.parse()?)?)))
    }

    fn offer<'py>(&self, py: Python<'py>, objectives: Matrix<'py>) -> Result<Bound<'py, PyArray1<i64>>> {
        self.lock()?.offer(&matrix(&objectives)?)?;
        self.members(py)
    }

    fn prune(&self, #[pyo3(from_py_with = given)] cap: usize) -> Result<bool> {
        Ok(self.lock()?.prune(cap))
    }

    #[getter]
    fn objectives<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyArray2<f64>>> {
        let objectives = self.lock()?.archive().objectives();
        Ok(to_matrix(py, objectives.columns(), objectives.rows().flatten().copied().collect()))
    }

    #[getter]
    fn members<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyArray1<i64>>> {
        Ok(to_integers(py, self.lock()?.archive().members().iter().copied()))
    }

    fn __len__(&self) -> Result<usize> {
        Ok(self.lock()?.archive().len())
    }
}

impl PyArchive {
    fn lock(&self) -> Result<std::sync::MutexGuard<'_, NumberedArchive>> {
        self.0
            .lock()
            .map_err(|_| misuse("archive: expected one that has not panicked; make a new one".into()))
    }
}
