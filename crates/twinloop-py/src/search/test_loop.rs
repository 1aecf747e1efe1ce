//! The test loop as a value.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use twinloop_core::{TestSearch, TestSettings};

use super::{Counters, PyVariation, array, counters, snapshot};
use crate::arrays::{Matrix, rows, to_matrix, to_vector};
use crate::error::{Result, given};
use crate::law::flown;
use crate::model::{PyModel, owned};
use crate::rollout::PyTask;
use crate::setting::PySetting;
use crate::workers::PyWorkers;

/// What the test loop optimises: mutants, caps, the optional third objective.
#[pyclass(frozen, name = "TestSettings", module = "twinloop._core")]
pub struct PyTestSettings(TestSettings);

#[pymethods]
impl PyTestSettings {
    #[new]
    #[pyo3(signature = (
        *, control_quality = false, distance_cap = 3.0, mutants = 10, mutant_step = 0.05, mutation_step = 0.1,
    ))]
    fn new(
        control_quality: bool,
        #[pyo3(from_py_with = given)] distance_cap: f64,
        #[pyo3(from_py_with = given)] mutants: usize,
        #[pyo3(from_py_with = given)] mutant_step: f64,
        #[pyo3(from_py_with = given)] mutation_step: f64,
    ) -> Result<Self> {
        let settings = TestSettings { control_quality, distance_cap, mutants, mutant_step, mutation_step };
        Ok(Self(settings.validated()?))
    }
}

/// The test loop as a value.
#[pyclass(frozen, name = "TestSearch", module = "twinloop._core")]
pub struct PyTestSearch(TestSearch);

#[pymethods]
impl PyTestSearch {
    #[staticmethod]
    #[expect(clippy::too_many_arguments, reason = "models, task and settings, each a concept of its own")]
    fn start(
        py: Python<'_>,
        committee: Vec<Bound<'_, PyModel>>,
        setting: &PySetting,
        task: &PyTask,
        settings: &PyTestSettings,
        variation: &PyVariation,
        #[pyo3(from_py_with = given)] seed: u64,
        #[pyo3(from_py_with = given)] iteration: u64,
        workers: &PyWorkers,
    ) -> Result<Self> {
        let committee = owned(&committee);
        let (setting, task, settings, variation) =
            (setting.0.clone(), task.0.clone(), settings.0.clone(), variation.0.clone());
        let search = flown(py, || {
            TestSearch::start(committee, setting, task, settings, variation, seed, iteration, &workers.0)
        })??;
        Ok(Self(search))
    }

    #[staticmethod]
    #[expect(clippy::too_many_arguments, reason = "what a search is made with, and what it consists of")]
    fn restored(
        committee: Vec<Bound<'_, PyModel>>,
        setting: &PySetting,
        task: &PyTask,
        settings: &PyTestSettings,
        variation: &PyVariation,
        #[pyo3(from_py_with = given)] counters: Counters,
        flat: bool,
        population: Matrix<'_>,
        population_objectives: Matrix<'_>,
        archive: Matrix<'_>,
        archive_objectives: Matrix<'_>,
        workers: &PyWorkers,
    ) -> Result<Self> {
        let committee = owned(&committee);
        let (setting, task, settings, variation) =
            (setting.0.clone(), task.0.clone(), settings.0.clone(), variation.0.clone());
        let genes = |genes: &Matrix<'_>| -> Result<Vec<Arc<Vec<f64>>>> {
            Ok(rows("genes", genes, setting.family().parameters().len())?.into_iter().map(Arc::new).collect())
        };
        let (population, members) = (genes(&population)?, genes(&archive)?);
        let parts = snapshot(counters, population, &population_objectives, members, &archive_objectives)?;
        let search =
            TestSearch::restored(committee, setting, task, settings, variation, parts, flat, &workers.0)?;
        Ok(Self(search))
    }

    fn advance(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = given)] generations: u64,
        workers: &PyWorkers,
    ) -> Result<Self> {
        Ok(Self(flown(py, || self.0.clone().advance(generations, &workers.0))?))
    }

    #[getter]
    fn counters(&self) -> Counters {
        counters(self.0.search())
    }

    #[getter]
    fn generation(&self) -> u64 {
        self.0.search().generation()
    }

    #[getter]
    fn evaluations(&self) -> u64 {
        self.0.search().evaluations()
    }

    #[getter]
    fn capped_generations(&self) -> u64 {
        self.0.search().capped_generations()
    }

    #[getter]
    fn archive_size(&self) -> usize {
        self.0.search().archive().len()
    }

    #[getter]
    fn archive_genes<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        to_genes(py, self.0.search().archive().members())
    }

    #[getter]
    fn population<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        to_genes(py, self.0.search().population())
    }

    #[getter]
    fn population_objectives<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        array(py, self.0.search().objectives())
    }

    #[getter]
    fn archive_objectives<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        array(py, &self.0.search().archive().objectives())
    }

    #[getter]
    fn best(&self) -> usize {
        self.0.best()
    }

    #[getter]
    fn best_genes<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        to_vector(py, self.0.search().archive().members()[self.0.best()].to_vec())
    }

    #[getter]
    fn best_objectives<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        to_vector(py, self.0.search().archive().objectives_of(self.0.best()))
    }

    #[getter]
    fn flat(&self) -> bool {
        self.0.flat()
    }
}

/// Genes of at least one test as an array, a row each.
fn to_genes<'py>(py: Python<'py>, tests: &[Arc<Vec<f64>>]) -> Bound<'py, PyArray2<f64>> {
    to_matrix(py, tests[0].len(), tests.iter().flat_map(|genes| genes.iter().copied()).collect())
}
