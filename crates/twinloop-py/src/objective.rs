//! Objectives of models and tests.

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use twinloop_core::{Model, SelectedTests, Workers};

use crate::arrays::{Matrix, rows, to_matrix, to_vector, views};
use crate::controller::PyFamily;
use crate::error::{Result, misuse};
use crate::law::flown;
use crate::model::{PyModel, PySignals};
use crate::rollout::PyTask;
use crate::selected::PySelectedTests;
use crate::workers::{PyWorkers, or_default};

/// The models that a list of Python objects holds.
type Models<'py> = Vec<Bound<'py, PyModel>>;

/// One of the two errors of each model on each test, a row for each model.
fn errors<'py>(
    py: Python<'py>,
    models: &Models<'py>,
    selected: &PySelectedTests,
    workers: Option<&PyWorkers>,
    objective: fn(&[Model<'_>], &SelectedTests, &Workers) -> Vec<Vec<f64>>,
) -> Result<Bound<'py, PyArray2<f64>>> {
    let (workers, selected) = (or_default(workers)?, &selected.0);
    let models: Vec<_> = models.iter().map(|model| model.get().core()).collect();
    if models.iter().any(|model| !model.frame.fits(selected.signals())) {
        return Err(misuse("expected models with the states and commands of the selected tests".into()));
    }
    let rows = flown(py, || objective(&models, selected, &workers))?;
    Ok(to_matrix(py, selected.len(), rows.concat()))
}

/// One-step-ahead error of each model on each test.
#[pyfunction]
#[pyo3(signature = (models, selected, workers = None))]
pub fn open_loop<'py>(
    py: Python<'py>,
    models: Models<'py>,
    selected: &PySelectedTests,
    workers: Option<&PyWorkers>,
) -> Result<Bound<'py, PyArray2<f64>>> {
    errors(py, &models, selected, workers, twinloop_core::open_loops)
}

/// Free-run error of each model on each test, with the controller in the loop.
#[pyfunction]
#[pyo3(signature = (models, selected, workers = None))]
pub fn closed_loop<'py>(
    py: Python<'py>,
    models: Models<'py>,
    selected: &PySelectedTests,
    workers: Option<&PyWorkers>,
) -> Result<Bound<'py, PyArray2<f64>>> {
    errors(py, &models, selected, workers, twinloop_core::closed_loops)
}

/// Distance of the last state to the target, a row for each model; infinite where the run diverged.
#[pyfunction]
#[pyo3(signature = (models, family, parameters, task, signals, *, divergence_factor = 10.0, workers = None))]
#[expect(clippy::too_many_arguments, reason = "what a roll-out needs, named by keyword in Python")]
pub fn final_distances<'py>(
    py: Python<'py>,
    models: Models<'py>,
    family: &PyFamily,
    parameters: Matrix<'py>,
    task: &PyTask,
    signals: &PySignals,
    divergence_factor: f64,
    workers: Option<&PyWorkers>,
) -> Result<Bound<'py, PyArray2<f64>>> {
    let workers = or_default(workers)?;
    let parameters = rows("parameters", &parameters, family.0.parameters().len())?;
    let models: Vec<_> = models.iter().map(|model| model.get().core()).collect();
    if models.iter().any(|model| !model.frame.fits(&signals.0)) || task.0.initial.len() != signals.0.states()
    {
        return Err(misuse("expected models and a task with the states and commands of the signals".into()));
    }
    let limits = signals.0.limits(divergence_factor);
    let distances = flown(py, || {
        twinloop_core::final_distances(&models, &family.0, &views(&parameters), &task.0, &limits, &workers)
    })?;
    Ok(to_matrix(py, parameters.len(), distances.concat()))
}

/// 1 / variance over models of each test's final distances, each capped.
#[pyfunction]
pub fn discrimination<'py>(py: Python<'py>, distances: Matrix<'py>, cap: f64) -> Bound<'py, PyArray1<f64>> {
    let columns = distances.as_array();
    let of_test = |column: numpy::ndarray::ArrayView1<'_, f64>| {
        twinloop_core::discrimination(column.iter().copied(), cap)
    };
    to_vector(py, columns.columns().into_iter().map(of_test).collect())
}

/// Variance over mutants of each test's final distances; one at the cap counts as cap squared.
#[pyfunction]
pub fn instability<'py>(py: Python<'py>, distances: Matrix<'py>, cap: f64) -> Bound<'py, PyArray1<f64>> {
    let columns = distances.as_array();
    let of_test =
        |column: numpy::ndarray::ArrayView1<'_, f64>| twinloop_core::instability(column.iter().copied(), cap);
    to_vector(py, columns.columns().into_iter().map(of_test).collect())
}
