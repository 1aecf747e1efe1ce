//! The model loop as a value.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use twinloop_core::{Learnt, ModelSearch};

use super::{Counters, PyVariation, array, counters, snapshot};
use crate::arrays::{Matrix, to_vector};
use crate::error::{Result, given};
use crate::law::flown;
use crate::model::{PyModel, PySignals};
use crate::program::{PyGrammar, PyProgram};
use crate::selected::PySelectedTests;
use crate::workers::PyWorkers;

/// The model loop as a value: every method that moves it returns a new one.
#[pyclass(frozen, name = "ModelSearch", module = "twinloop._core")]
pub struct PyModelSearch(ModelSearch);

#[pymethods]
impl PyModelSearch {
    #[staticmethod]
    fn start(
        py: Python<'_>,
        grammar: &PyGrammar,
        form: &str,
        variation: &PyVariation,
        #[pyo3(from_py_with = given)] seed: u64,
        selected: &PySelectedTests,
        workers: &PyWorkers,
    ) -> Result<Self> {
        let (grammar, form, variation) = (grammar.0.clone(), form.parse()?, variation.0.clone());
        let search =
            flown(py, || ModelSearch::start(grammar, form, variation, seed, &selected.0, &workers.0))??;
        Ok(Self(search))
    }

    #[staticmethod]
    #[expect(clippy::too_many_arguments, reason = "what a search is made with, and what it consists of")]
    fn restored(
        grammar: &PyGrammar,
        form: &str,
        variation: &PyVariation,
        signals: &PySignals,
        #[pyo3(from_py_with = given)] counters: Counters,
        population: Vec<Bound<'_, PyProgram>>,
        population_objectives: Matrix<'_>,
        archive: Vec<Bound<'_, PyProgram>>,
        archive_objectives: Matrix<'_>,
        workers: &PyWorkers,
    ) -> Result<Self> {
        let learnt = |programs: Vec<Bound<'_, PyProgram>>| -> Vec<Arc<Learnt>> {
            programs.iter().map(|program| program.get().0.clone()).collect()
        };
        let (population, members) = (learnt(population), learnt(archive));
        let parts = snapshot(counters, population, &population_objectives, members, &archive_objectives)?;
        let (grammar, form, variation) = (grammar.0.clone(), form.parse()?, variation.0.clone());
        let search = ModelSearch::restored(grammar, form, variation, signals.0.clone(), parts, &workers.0)?;
        Ok(Self(search))
    }

    fn learn(&self, py: Python<'_>, selected: &PySelectedTests, workers: &PyWorkers) -> Result<Self> {
        let search = flown(py, || self.0.clone().learn(&selected.0, &workers.0))??;
        Ok(Self(search))
    }

    fn advance(
        &self,
        py: Python<'_>,
        selected: &PySelectedTests,
        #[pyo3(from_py_with = given)] generations: u64,
        workers: &PyWorkers,
    ) -> Result<Self> {
        let search = flown(py, || self.0.clone().advance(&selected.0, generations, &workers.0))??;
        Ok(Self(search))
    }

    #[getter]
    fn counters(&self) -> Counters {
        counters(self.0.search())
    }

    #[getter]
    fn iteration(&self) -> u64 {
        self.0.search().iteration()
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
    fn spared(&self) -> u64 {
        self.0.search().spared()
    }

    #[getter]
    fn capped_generations(&self) -> u64 {
        self.0.search().capped_generations()
    }

    #[getter]
    fn intron_share(&self) -> f64 {
        self.0.intron_share()
    }

    #[getter]
    fn population(&self) -> Vec<PyProgram> {
        self.0.search().population().iter().map(|learnt| PyProgram(learnt.clone())).collect()
    }

    #[getter]
    fn population_objectives<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        array(py, self.0.search().objectives())
    }

    #[getter]
    fn archive_size(&self) -> usize {
        self.0.search().archive().len()
    }

    #[getter]
    fn archive(&self) -> Vec<PyModel> {
        (0..self.archive_size()).map(|member| PyModel(self.0.model(member))).collect()
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
    fn best_model(&self) -> PyModel {
        PyModel(self.0.model(self.0.best()))
    }

    #[getter]
    fn best_objectives<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        to_vector(py, self.0.search().archive().objectives_of(self.0.best()))
    }

    fn committee(&self, #[pyo3(from_py_with = given)] size: usize) -> Vec<usize> {
        self.0.committee(size)
    }
}
