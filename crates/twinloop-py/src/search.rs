//! The two loops as values.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use twinloop_core::pareto::Objectives;
use twinloop_core::{
    Frame, Learnt, ModelSearch, Search, Signals, Snapshot, TestSearch, TestSettings, Variation,
};

use crate::arrays::{Matrix, rows, to_matrix, to_vector};
use crate::error::{Result, misuse};
use crate::law::flown;
use crate::model::{PyModel, PySignals};
use crate::pareto::{distance, matrix as objectives_of};
use crate::program::{PyGrammar, PyProgram};
use crate::rollout::PyTask;
use crate::selected::PySelectedTests;
use crate::setting::PySetting;
use crate::workers::PyWorkers;

/// How a generation is made out of the last.
#[pyclass(frozen, name = "Variation", module = "twinloop._core")]
pub struct PyVariation(Variation);

#[pymethods]
impl PyVariation {
    #[new]
    #[pyo3(signature = (
        population, *, mutation_share = 0.6, crossover_share = 0.3, reproduction_share = 0.1, elite_share = 0.1,
        ranking_pressure = 1.8, archive_cap = 10_000, normalised_tradeoff = false,
    ))]
    #[expect(clippy::too_many_arguments, reason = "each is a named option of the paper's method")]
    fn new(
        population: usize,
        mutation_share: f64,
        crossover_share: f64,
        reproduction_share: f64,
        elite_share: f64,
        ranking_pressure: f64,
        archive_cap: usize,
        normalised_tradeoff: bool,
    ) -> Result<Self> {
        let sum = mutation_share + crossover_share + reproduction_share;
        if sum.is_nan() || (sum - 1.0).abs() > 1e-9 {
            return Err(misuse(format!(
                "variation: expected shares of the operators that sum to 1, found {sum}"
            )));
        }
        let variation = Variation {
            population,
            mutation_share,
            crossover_share,
            elite_share,
            ranking_pressure,
            archive_cap,
            distance: distance(normalised_tradeoff),
        };
        Ok(Self(variation.validated()?))
    }
}

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

/// Seed, iteration, generation, evaluations, spared, generations with a capped archive.
type Counters = (u64, u64, u64, u64, u64, u64);

fn counters<G: Send + Sync>(search: &Search<G>) -> Counters {
    (
        search.seed(),
        search.iteration(),
        search.generation(),
        search.evaluations(),
        search.spared(),
        search.capped_generations(),
    )
}

fn snapshot<G>(
    (seed, iteration, generation, evaluations, spared, capped_generations): Counters,
    population: Vec<Arc<G>>,
    objectives: &Matrix<'_>,
    members: Vec<Arc<G>>,
    points: &Matrix<'_>,
) -> Result<Snapshot<G>> {
    let (objectives, points) = (objectives_of(objectives)?, objectives_of(points)?);
    Ok(Snapshot {
        seed,
        iteration,
        generation,
        evaluations,
        spared,
        capped_generations,
        population,
        objectives,
        members,
        points,
    })
}

/// Objectives as an array.
fn array<'py>(py: Python<'py>, objectives: &Objectives) -> Bound<'py, PyArray2<f64>> {
    to_matrix(py, objectives.columns(), objectives.rows().flatten().copied().collect())
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
        distance_cap: f64,
        mutants: usize,
        mutant_step: f64,
        mutation_step: f64,
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
        seed: u64,
        iteration: u64,
        workers: &PyWorkers,
    ) -> Result<Self> {
        let (committee, frame) = judges(&committee, setting.0.signals())?;
        let (setting, task, settings, variation) =
            (setting.0.clone(), task.0.clone(), settings.0.clone(), variation.0.clone());
        let search = flown(py, || {
            TestSearch::start(
                committee, frame, setting, task, settings, variation, seed, iteration, &workers.0,
            )
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
        counters: Counters,
        flat: bool,
        population: Matrix<'_>,
        population_objectives: Matrix<'_>,
        archive: Matrix<'_>,
        archive_objectives: Matrix<'_>,
        workers: &PyWorkers,
    ) -> Result<Self> {
        let (committee, frame) = judges(&committee, setting.0.signals())?;
        let (setting, task, settings, variation) =
            (setting.0.clone(), task.0.clone(), settings.0.clone(), variation.0.clone());
        let genes = |genes: &Matrix<'_>| -> Result<Vec<Arc<Vec<f64>>>> {
            Ok(rows("genes", genes, setting.family().parameters().len())?.into_iter().map(Arc::new).collect())
        };
        let (population, members) = (genes(&population)?, genes(&archive)?);
        let parts = snapshot(counters, population, &population_objectives, members, &archive_objectives)?;
        let search = TestSearch::restored(
            committee, frame, setting, task, settings, variation, parts, flat, &workers.0,
        )?;
        Ok(Self(search))
    }

    fn advance(&self, py: Python<'_>, generations: u64, workers: &PyWorkers) -> Result<Self> {
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

/// The committee of a test search, with the frame that its models share.
fn judges(committee: &[Bound<'_, PyModel>], signals: &Signals) -> Result<(Vec<Arc<Learnt>>, Arc<Frame>)> {
    let frame = one_frame(committee)?;
    committee.iter().try_for_each(|model| model.get().fits(signals))?;
    Ok((committee.iter().map(|model| model.get().learnt.clone()).collect(), frame))
}

/// The frame that all models share.
fn one_frame(models: &[Bound<'_, PyModel>]) -> Result<Arc<Frame>> {
    match models.split_first() {
        Some((first, others)) if others.iter().all(|model| model.get().frame == first.get().frame) => {
            Ok(first.get().frame.clone())
        }
        _ => Err(misuse(
            "committee: expected one model or more, all of one form and one set of signals".into(),
        )),
    }
}
