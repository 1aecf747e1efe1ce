//! Python bindings of the engine: conversion only, one file for each concept.

mod arrays;
mod cmaes;
mod controller;
mod elementary;
mod error;
mod excitation;
mod flights;
mod law;
mod look_ahead;
mod masses;
mod model;
mod objective;
mod pareto;
mod plant;
mod program;
mod regression;
mod rng;
mod rollout;
mod rows;
mod search;
mod selected;
mod setting;
mod tuning;
mod workers;

/// Each evaluation of a model takes and gives back a few aligned kilobytes; the system's allocator would take longer over
/// that than the model does over a short test.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// The native engine: numbers in, numbers out.
#[pyo3::pymodule]
mod _core {
    #[pymodule_export]
    use crate::cmaes::{PyCmaEs, eigen};
    #[pymodule_export]
    use crate::controller::{PyController, PyFamily};
    #[pymodule_export]
    use crate::elementary::{cos, exp, log, power, sin, tanh};
    #[pymodule_export]
    use crate::excitation::PyHoldBack;
    #[pymodule_export]
    use crate::flights::{PyFlights, PyQuality, disagreements, qualities, usages};
    #[pymodule_export]
    use crate::look_ahead::PyLookAhead;
    #[pymodule_export]
    use crate::masses::behind_gap;
    #[pymodule_export]
    use crate::model::{PyModel, PySignals, command_effects};
    #[pymodule_export]
    use crate::objective::{closed_loop, discrimination, final_distances, instability, k_step, open_loop};
    #[pymodule_export]
    use crate::pareto::{PyArchive, best_tradeoff, crowding_distances, ideal_point, ranks, select};
    #[pymodule_export]
    use crate::plant::PyQuadrotor;
    #[pymodule_export]
    use crate::program::{PyGrammar, PyProgram};
    #[pymodule_export]
    use crate::regression::{PyGram, PyRegression, most_likely_noises, search_subsets};
    #[pymodule_export]
    use crate::rng::{PyStream, purposes};
    #[pymodule_export]
    use crate::rollout::{PyRuns, PyTask, replay, rollout};
    #[pymodule_export]
    use crate::search::{PyModelSearch, PyTestSearch, PyTestSettings, PyVariation};
    #[pymodule_export]
    use crate::selected::PySelectedTests;
    #[pymodule_export]
    use crate::setting::{PyLimits, PySetting};
    #[pymodule_export]
    use crate::tuning::{linearised, predictions, tune};
    #[pymodule_export]
    use crate::workers::{PyWorkers, vector_widths};
    #[pymodule_export]
    #[expect(non_upper_case_globals, reason = "Python's name for it")]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
