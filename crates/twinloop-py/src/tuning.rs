//! Tuning of a model's constants on recorded runs.

use std::sync::Arc;

use numpy::PyArray2;
use pyo3::prelude::*;
use twinloop_core::{Chain, Learnt, Noise, Observed, Predictions, Recorded, Signals, Tuning};

use crate::arrays::{Matrix, finite, rows, to_matrix};
use crate::error::{Result, given, misuse};
use crate::model::PyModel;
use crate::regression::PyGram;
use crate::rng::Name;
use crate::setting::PyLimits;
use crate::workers::{PyWorkers, or_default};

/// States, sensor variances, (process variance, gust variance, correlation time) and what features are, for each chain.
type Chains = Vec<(Vec<usize>, Vec<f64>, (f64, f64, f64), String)>;
/// Readings, weights and commands of each run.
type Records<'py> = Vec<(Matrix<'py>, Matrix<'py>, Matrix<'py>)>;

/// Whitened prediction errors, states and correlated disturbances of a run.
type OfRun<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>);

/// The signals of the limits, unless the model is for others.
fn fitting<'a>(model: &PyModel, limits: &'a PyLimits) -> Result<&'a Signals> {
    model.0.check_for(limits.0.signals())?;
    Ok(limits.0.signals())
}

fn observer(chains: Chains, dt: f64) -> Result<Vec<Observed>> {
    let of_chain = |(states, sensors, (process, gust, correlation_time), form): (
        Vec<usize>,
        Vec<f64>,
        (f64, f64, f64),
        String,
    )| {
        let chain = Chain { states: states.len(), dt, form: form.parse()? }.validated()?;
        let noise = Noise { sensors, process, gust, correlation_time }.validated(states.len())?;
        Ok(Observed { states, chain, noise })
    };
    chains.into_iter().map(of_chain).collect()
}

fn recorded(records: &Records<'_>, n_x: usize, n_u: usize) -> Result<Vec<Recorded>> {
    records
        .iter()
        .map(|(states, weights, commands)| {
            let states = rows("states", states, n_x)?.concat();
            let weights = rows("weights", weights, n_x)?.concat();
            let commands = rows("commands", commands, n_u)?.concat();
            finite("record", [&states, &weights, &commands].into_iter().flatten())?;
            Ok(Recorded { states, weights, commands })
        })
        .collect()
}

/// A model beside records, which an observer of its states reads.
struct Posed<'a> {
    model: &'a PyModel,
    limits: &'a PyLimits,
    observer: Vec<Observed>,
    records: Vec<Recorded>,
}

impl<'a> Posed<'a> {
    fn new(model: &'a PyModel, limits: &'a PyLimits, chains: Chains, records: &Records<'_>) -> Result<Self> {
        let signals = fitting(model, limits)?;
        let observer = observer(chains, signals.dt)?;
        let records = recorded(records, signals.states(), signals.commands())?;
        Ok(Self { model, limits, observer, records })
    }

    /// With what is free of a program that is the model's, or has the same constants.
    fn tuning<'b>(
        &'b self,
        program: &'b Learnt,
        free: &'b [usize],
        lags: &'b [Vec<usize>],
    ) -> Result<Tuning<'b>> {
        let Self { model, limits, observer, records } = self;
        let (code, frame, limits) = (&program.code, model.0.frame(), &limits.0);
        let tuning = Tuning { code, frame, observer, records, limits, free, lags };
        tuning.check()?;
        Ok(tuning)
    }
}

/// The model with the constants and lags of the smallest χ²; that χ², readings, covariance of the free values, and
/// members drawn from it.
#[pyfunction]
#[pyo3(signature = (
    model, limits, chains, records, *, free, lags, iterations, draws = 0, unit = None, workers = None,
))]
#[expect(clippy::too_many_arguments, reason = "what tuning needs, named by keyword in Python")]
#[expect(clippy::type_complexity, reason = "a model, χ², readings, covariance, and the free values")]
pub fn tune<'py>(
    py: Python<'py>,
    model: &PyModel,
    limits: &PyLimits,
    #[pyo3(from_py_with = given)] chains: Chains,
    #[pyo3(from_py_with = given)] records: Records<'py>,
    #[pyo3(from_py_with = given)] free: Vec<usize>,
    #[pyo3(from_py_with = given)] lags: Vec<Vec<usize>>,
    #[pyo3(from_py_with = given)] iterations: usize,
    #[pyo3(from_py_with = given)] draws: usize,
    #[pyo3(from_py_with = given)] unit: Option<Name>,
    workers: Option<&PyWorkers>,
) -> Result<(PyModel, f64, usize, Bound<'py, PyArray2<f64>>, Vec<PyModel>)> {
    let workers = or_default(workers)?;
    let posed = Posed::new(model, limits, chains, &records)?;
    let effective = Learnt::new(model.0.learnt().program.effective());
    let tuning = posed.tuning(&effective, &free, &lags)?;
    let tuned = py.detach(|| tuning.tune(iterations, &workers));
    let drawn = match unit {
        None if draws == 0 => vec![],
        None => {
            return Err(misuse(format!("tune: expected the unit that draws {draws} members, found none")));
        }
        Some(name) => {
            let unit = name.unit()?;
            py.detach(|| tuning.drawn(&tuned, &unit, draws, &workers))?
        }
    };
    let varied = |(constants, lags): &(Vec<f64>, Vec<f64>)| model.0.varied(constants, lags).map(PyModel);
    let members: Vec<_> = drawn.iter().map(varied).collect::<twinloop_core::Result<_>>()?;
    let finished = PyModel(model.0.varied(&tuned.constants, &tuned.lags)?);
    let covariance = to_matrix(py, free.len() + lags.len(), tuned.covariance);
    Ok((finished, tuned.chi_squared, tuned.readings, covariance, members))
}

/// A regression on the slopes of prediction errors by free constants and lags; none where the model diverges.
#[pyfunction]
#[pyo3(signature = (model, limits, chains, records, *, free, lags, workers = None))]
#[expect(clippy::too_many_arguments, reason = "what tuning needs, named by keyword in Python")]
pub fn linearised<'py>(
    py: Python<'py>,
    model: &PyModel,
    limits: &PyLimits,
    #[pyo3(from_py_with = given)] chains: Chains,
    #[pyo3(from_py_with = given)] records: Records<'py>,
    #[pyo3(from_py_with = given)] free: Vec<usize>,
    #[pyo3(from_py_with = given)] lags: Vec<Vec<usize>>,
    workers: Option<&PyWorkers>,
) -> Result<Option<PyGram>> {
    let workers = or_default(workers)?;
    let posed = Posed::new(model, limits, chains, &records)?;
    let tuning = posed.tuning(model.0.learnt(), &free, &lags)?;
    Ok(py.detach(|| tuning.linearised(&workers)).map(|gram| PyGram(Arc::new(gram))))
}

/// Whitened prediction errors (n + 1, n_x), and states (n + 1, n_x) and correlated disturbances (n + 1, chains) once each
/// reading was used, of each run; none where the model diverges on one of them.
#[pyfunction]
#[pyo3(signature = (model, limits, chains, records, *, workers = None))]
pub fn predictions<'py>(
    py: Python<'py>,
    model: &PyModel,
    limits: &PyLimits,
    #[pyo3(from_py_with = given)] chains: Chains,
    #[pyo3(from_py_with = given)] records: Records<'py>,
    workers: Option<&PyWorkers>,
) -> Result<Option<Vec<OfRun<'py>>>> {
    let workers = or_default(workers)?;
    let posed = Posed::new(model, limits, chains, &records)?;
    let tuning = posed.tuning(model.0.learnt(), &[], &[])?;
    let n_x = limits.0.signals().states();
    let runs = py.detach(|| tuning.predictions(&workers));
    let of_run = |run: Predictions| {
        (
            to_matrix(py, n_x, run.errors),
            to_matrix(py, n_x, run.states),
            to_matrix(py, posed.observer.len(), run.gusts),
        )
    };
    Ok(runs.map(|runs| runs.into_iter().map(of_run).collect()))
}
