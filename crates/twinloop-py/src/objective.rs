//! Objectives of models and tests (paper, sections IV.B and IV.C), as functions of arrays.

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use twinloop_core::{Model, Signals};

use crate::arrays::{Matrix, finite, rows, to_rows, to_vector, views};
use crate::error::{Result, given, misuse};
use crate::law::flown;
use crate::model::PyModel;
use crate::rollout::{self, PyTask};
use crate::selected::PySelectedTests;
use crate::setting::PySetting;
use crate::workers::{PyWorkers, or_default};

/// The models of a list of Python objects.
type Models<'py> = Vec<Bound<'py, PyModel>>;
/// Errors or distances, (models, tests).
type Errors<'py> = Bound<'py, PyArray2<f64>>;
/// Numbers of steps, (models, tests).
type Steps<'py> = Bound<'py, PyArray2<i64>>;

/// One-step-ahead errors (models, tests), in the states' units squared; infinite if a prediction is not finite.
#[pyfunction]
#[pyo3(signature = (models, selected, workers = None))]
pub fn open_loop<'py>(
    py: Python<'py>,
    models: Models<'py>,
    selected: &PySelectedTests,
    workers: Option<&PyWorkers>,
) -> Result<Errors<'py>> {
    let (workers, selected) = (or_default(workers)?, &selected.0);
    let models = fitting(&models, selected.signals())?;
    let rows = py.detach(|| twinloop_core::open_loops(&models, selected, &workers));
    Ok(to_rows(py, [models.len(), selected.len()], rows.concat()))
}

/// Errors (models, tests) of free runs of so many `steps` from every recorded state, in the states' units squared.
#[pyfunction]
#[pyo3(signature = (models, selected, steps, workers = None))]
pub fn k_step<'py>(
    py: Python<'py>,
    models: Models<'py>,
    selected: &PySelectedTests,
    #[pyo3(from_py_with = given)] steps: usize,
    workers: Option<&PyWorkers>,
) -> Result<Errors<'py>> {
    let (workers, selected) = (or_default(workers)?, &selected.0);
    let models = fitting(&models, selected.signals())?;
    let rows = py.detach(|| twinloop_core::k_steps(&models, selected, steps, &workers))?;
    Ok(to_rows(py, [models.len(), selected.len()], rows.concat()))
}

/// Errors (models, tests) of free runs with the controller in the loop, in the states' units squared, infinite if the run
/// diverged; and the steps (models, tests) before it did.
#[pyfunction]
#[pyo3(signature = (models, selected, workers = None))]
pub fn closed_loop<'py>(
    py: Python<'py>,
    models: Models<'py>,
    selected: &PySelectedTests,
    workers: Option<&PyWorkers>,
) -> Result<(Errors<'py>, Steps<'py>)> {
    let (workers, selected) = (or_default(workers)?, &selected.0);
    let models = fitting(&models, selected.signals())?;
    let outcomes = flown(py, || twinloop_core::closed_loops(&models, selected, &workers))?;
    let shape = [models.len(), selected.len()];
    let errors = outcomes.iter().flatten().map(|outcome| outcome.error()).collect();
    let lasted = outcomes
        .iter()
        .flat_map(|row| row.iter().zip(selected.steps()))
        .map(|(outcome, steps)| outcome.lasted(steps) as i64);
    Ok((to_rows(py, shape, errors), to_rows(py, shape, lasted.collect())))
}

/// Distances of the last state to the target (models, tests); infinite if the run diverged.
#[pyfunction]
#[pyo3(signature = (models, setting, parameters, task, *, workers = None))]
pub fn final_distances<'py>(
    py: Python<'py>,
    models: Models<'py>,
    setting: &PySetting,
    parameters: Matrix<'py>,
    task: &PyTask,
    workers: Option<&PyWorkers>,
) -> Result<Errors<'py>> {
    let workers = or_default(workers)?;
    let (setting, task) = (&*setting.0, rollout::fitting(task, &setting.0)?);
    let parameters = rows("parameters", &parameters, setting.family().parameters().len())?;
    let models = fitting(&models, setting.signals())?;
    finite("parameters", parameters.iter().flatten())?;
    let distances =
        flown(py, || twinloop_core::final_distances(&models, setting, &views(&parameters), task, &workers))?;
    Ok(to_rows(py, [models.len(), parameters.len()], distances.concat()))
}

/// The engine's view of models; refused if one is for other signals.
pub fn fitting<'a>(models: &'a [Bound<'_, PyModel>], signals: &Signals) -> Result<Vec<Model<'a>>> {
    Ok(twinloop_core::views(models.iter().map(|model| &model.get().0), signals)?)
}

/// The columns of distances (rows, tests), one for each test.
fn columns(distances: &Matrix<'_>, cap: f64) -> Result<Vec<Vec<f64>>> {
    let distances = distances.as_array();
    if !(cap.is_finite() && cap > 0.0) {
        return Err(misuse(format!("distances: expected a finite cap above 0, found {cap}")));
    }
    if distances.nrows() == 0 {
        return Err(misuse(format!(
            "distances: expected at least one row, found the shape {:?}",
            distances.shape()
        )));
    }
    if distances.iter().any(|x| x.is_nan()) {
        return Err(misuse(
            "distances: expected numbers, found NaN; infinity stands for a run that diverged".into(),
        ));
    }
    Ok(distances.columns().into_iter().map(|column| column.to_vec()).collect())
}

/// 1 / variance over models (tests,) of final distances (models, tests), each capped.
#[pyfunction]
pub fn discrimination<'py>(
    py: Python<'py>,
    distances: Matrix<'py>,
    #[pyo3(from_py_with = given)] cap: f64,
) -> Result<Bound<'py, PyArray1<f64>>> {
    let of_test = |column: Vec<f64>| twinloop_core::discrimination(column.into_iter(), cap);
    Ok(to_vector(py, columns(&distances, cap)?.into_iter().map(of_test).collect()))
}

/// Variance over mutants (tests,) of final distances (mutants, tests); one at the cap counts as cap squared.
#[pyfunction]
pub fn instability<'py>(
    py: Python<'py>,
    distances: Matrix<'py>,
    #[pyo3(from_py_with = given)] cap: f64,
) -> Result<Bound<'py, PyArray1<f64>>> {
    let of_test = |column: Vec<f64>| twinloop_core::instability(column.into_iter(), cap);
    Ok(to_vector(py, columns(&distances, cap)?.into_iter().map(of_test).collect()))
}
