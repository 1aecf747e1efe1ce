//! The model loop as a value.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use twinloop_core::{Learnt, ModelSearch, Signals};

use super::{Counters, PyVariation, array, counters, snapshot};
use crate::arrays::{Matrix, to_vector};
use crate::error::Result;
use crate::law::flown;
use crate::model::{PyModel, PySignals};
use crate::program::{PyGrammar, PyProgram};
use crate::selected::PySelectedTests;
use crate::workers::PyWorkers;

/// The model loop as a value: every method that moves it returns a new one.
#[pyclass(frozen, name = "ModelSearch", module = "twinloop._core")]
pub struct PyModelSearch {
    search: ModelSearch,
    signals: Arc<Signals>,
}

impl PyModelSearch {
    fn model(&self, member: usize) -> PyModel {
        let learnt = self.search.search().archive().members()[member].clone();
        PyModel::of(learnt, self.search.frame().clone(), self.signals.clone())
    }
}

#[pymethods]
impl PyModelSearch {
    #[staticmethod]
    fn start(
        py: Python<'_>,
        grammar: &PyGrammar,
        form: &str,
        variation: &PyVariation,
        seed: u64,
        selected: &PySelectedTests,
        workers: &PyWorkers,
    ) -> Result<Self> {
        let (grammar, form, variation) = (grammar.0.clone(), form.parse()?, variation.0.clone());
        let search =
            flown(py, || ModelSearch::start(grammar, form, variation, seed, &selected.0, &workers.0))??;
        Ok(Self { search, signals: selected.0.signals().clone() })
    }

    #[staticmethod]
    #[expect(clippy::too_many_arguments, reason = "what a search is made with, and what it consists of")]
    fn restored(
        grammar: &PyGrammar,
        form: &str,
        variation: &PyVariation,
        signals: &PySignals,
        counters: Counters,
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
        let search = ModelSearch::restored(grammar, form, variation, &signals.0, parts, &workers.0)?;
        Ok(Self { search, signals: signals.0.clone() })
    }

    fn learn(&self, py: Python<'_>, selected: &PySelectedTests, workers: &PyWorkers) -> Result<Self> {
        let search = flown(py, || self.search.clone().learn(&selected.0, &workers.0))??;
        Ok(Self { search, signals: self.signals.clone() })
    }

    fn advance(
        &self,
        py: Python<'_>,
        selected: &PySelectedTests,
        generations: u64,
        workers: &PyWorkers,
    ) -> Result<Self> {
        let search = flown(py, || self.search.clone().advance(&selected.0, generations, &workers.0))??;
        Ok(Self { search, signals: self.signals.clone() })
    }

    #[getter]
    fn counters(&self) -> Counters {
        counters(self.search.search())
    }

    #[getter]
    fn iteration(&self) -> u64 {
        self.search.search().iteration()
    }

    #[getter]
    fn generation(&self) -> u64 {
        self.search.search().generation()
    }

    #[getter]
    fn evaluations(&self) -> u64 {
        self.search.search().evaluations()
    }

    #[getter]
    fn spared(&self) -> u64 {
        self.search.search().spared()
    }

    #[getter]
    fn capped_generations(&self) -> u64 {
        self.search.search().capped_generations()
    }

    #[getter]
    fn intron_share(&self) -> f64 {
        self.search.intron_share()
    }

    #[getter]
    fn population(&self) -> Vec<PyProgram> {
        self.search.search().population().iter().map(|learnt| PyProgram(learnt.clone())).collect()
    }

    #[getter]
    fn population_objectives<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        array(py, self.search.search().objectives())
    }

    #[getter]
    fn archive_size(&self) -> usize {
        self.search.search().archive().len()
    }

    #[getter]
    fn archive(&self) -> Vec<PyModel> {
        (0..self.archive_size()).map(|member| self.model(member)).collect()
    }

    #[getter]
    fn archive_objectives<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        array(py, &self.search.search().archive().objectives())
    }

    #[getter]
    fn best(&self) -> usize {
        self.search.best()
    }

    #[getter]
    fn best_model(&self) -> PyModel {
        self.model(self.search.best())
    }

    #[getter]
    fn best_objectives<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        to_vector(py, self.search.search().archive().objectives_of(self.search.best()))
    }

    fn committee(&self, size: usize) -> Vec<usize> {
        self.search.committee(size)
    }
}
