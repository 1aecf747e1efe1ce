//! The two loops as values: what both have.

mod model_loop;
mod test_loop;

pub use model_loop::PyModelSearch;
pub use test_loop::{PyTestSearch, PyTestSettings};

use std::sync::Arc;

use numpy::PyArray2;
use pyo3::prelude::*;
use twinloop_core::pareto::Objectives;
use twinloop_core::{Search, Snapshot, Variation};

use crate::arrays::{Matrix, to_matrix};
use crate::error::{Result, given};
use crate::pareto::{distance, matrix as objectives_of};

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
        #[pyo3(from_py_with = given)] population: usize,
        #[pyo3(from_py_with = given)] mutation_share: f64,
        #[pyo3(from_py_with = given)] crossover_share: f64,
        #[pyo3(from_py_with = given)] reproduction_share: f64,
        #[pyo3(from_py_with = given)] elite_share: f64,
        #[pyo3(from_py_with = given)] ranking_pressure: f64,
        #[pyo3(from_py_with = given)] archive_cap: usize,
        normalised_tradeoff: bool,
    ) -> Result<Self> {
        let variation = Variation {
            population,
            mutation_share,
            crossover_share,
            reproduction_share,
            elite_share,
            ranking_pressure,
            archive_cap,
            distance: distance(normalised_tradeoff),
        };
        Ok(Self(variation.validated()?))
    }
}

/// Seed, iteration, generation, evaluations, spared, generations with a capped archive.
pub type Counters = (u64, u64, u64, u64, u64, u64);

pub fn counters<G: Send + Sync>(search: &Search<G>) -> Counters {
    (
        search.seed(),
        search.iteration(),
        search.generation(),
        search.evaluations(),
        search.spared(),
        search.capped_generations(),
    )
}

pub fn snapshot<G>(
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
pub fn array<'py>(py: Python<'py>, objectives: &Objectives) -> Bound<'py, PyArray2<f64>> {
    to_matrix(py, objectives.columns(), objectives.rows().flatten().copied().collect())
}
