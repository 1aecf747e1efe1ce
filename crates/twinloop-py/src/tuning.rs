//! Tuning of a model's constants on recorded runs.

use numpy::PyArray2;
use pyo3::prelude::*;
use twinloop_core::{Chain, Learnt, Noise, Observed, Recorded, Signals, Tuning};

use crate::arrays::{Matrix, rows, to_matrix};
use crate::error::{Result, misuse};
use crate::model::PyModel;
use crate::rng::Name;
use crate::setting::PyLimits;
use crate::workers::{PyWorkers, or_default};

/// States, sensor variances, (process variance, gust variance, memory) and whether features are derivatives, for each
/// chain.
type Chains = Vec<(Vec<usize>, Vec<f64>, (f64, f64, f64), bool)>;
/// Readings, weights and commands of each run.
type Records<'py> = Vec<(Matrix<'py>, Matrix<'py>, Matrix<'py>)>;

/// The signals of the limits, unless the model is for others.
fn fitting<'a>(model: &PyModel, limits: &'a PyLimits) -> Result<&'a Signals> {
    model.fits(limits.0.signals())?;
    Ok(limits.0.signals())
}

fn observer(chains: Chains, dt: f64) -> Result<Vec<Observed>> {
    let of_chain = |(states, sensors, (process, gust, memory), integrated): (
        Vec<usize>,
        Vec<f64>,
        (f64, f64, f64),
        bool,
    )| {
        let chain = Chain { states: states.len(), dt, integrated }.validated()?;
        let noise = Noise { sensors, process, gust, memory }.validated(states.len())?;
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
            if ![&states, &weights, &commands].into_iter().flatten().all(|x| x.is_finite()) {
                return Err(misuse("record: expected finite numbers, found NaN or an infinite one".into()));
            }
            Ok(Recorded { states, weights, commands })
        })
        .collect()
}

/// More members than this are refused.
const MOST_DRAWS: usize = 1_000_000;

/// The model with constants, and lags of its actuators, that leave the least; what is left, readings, covariance of the
/// free values, and members drawn from it.
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
    chains: Chains,
    records: Records<'py>,
    free: Vec<usize>,
    lags: Vec<Vec<usize>>,
    iterations: usize,
    draws: usize,
    unit: Option<Name>,
    workers: Option<&PyWorkers>,
) -> Result<(PyModel, f64, usize, Bound<'py, PyArray2<f64>>, Vec<PyModel>)> {
    let workers = or_default(workers)?;
    let signals = fitting(model, limits)?;
    let effective = Learnt::new(model.learnt.program.effective());
    let observer = observer(chains, signals.dt)?;
    let records = recorded(&records, signals.states(), signals.commands())?;
    let tuning = Tuning {
        code: &effective.code,
        frame: &model.frame,
        observer: &observer,
        records: &records,
        limits: &limits.0,
        free: &free,
        lags: &lags,
    };
    tuning.check()?;
    if draws > MOST_DRAWS {
        return Err(misuse(format!("tune: expected at most {MOST_DRAWS} draws, found {draws}")));
    }
    let tuned = py.detach(|| tuning.tune(iterations, &workers));
    let size = free.len() + lags.len();
    let covariance = to_matrix(py, size, tuned.covariance.clone());
    let (left, readings) = (tuned.left, tuned.readings);
    let finished = model.varied(&tuned.constants, &tuned.lags)?;
    let streams: Vec<_> = match unit {
        Some(name) => {
            let unit = name.unit()?;
            (0..draws).map(|draw| unit.stream(draw as u64)).collect()
        }
        None if draws == 0 => vec![],
        None => {
            return Err(misuse(format!("tune: expected the unit that draws {draws} members, found none")));
        }
    };
    let drawn = py.detach(|| tuning.drawn(&tuned, streams, &workers));
    let members: Vec<PyModel> =
        drawn.iter().map(|(constants, lags)| model.varied(constants, lags)).collect::<Result<_>>()?;
    Ok((finished, left, readings, covariance, members))
}

/// Whitened prediction errors (n + 1, n_x) and states once each reading was used (n + 1, n_x) of each run; none where
/// the model diverges on one of them.
#[pyfunction]
#[pyo3(signature = (model, limits, chains, records, *, workers = None))]
#[expect(clippy::type_complexity, reason = "two matrices for each run")]
pub fn predictions<'py>(
    py: Python<'py>,
    model: &PyModel,
    limits: &PyLimits,
    chains: Chains,
    records: Records<'py>,
    workers: Option<&PyWorkers>,
) -> Result<Option<Vec<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>)>>> {
    let workers = or_default(workers)?;
    let signals = fitting(model, limits)?;
    let observer = observer(chains, signals.dt)?;
    let n_x = signals.states();
    let records = recorded(&records, n_x, signals.commands())?;
    let core = model.core();
    let tuning = Tuning {
        code: core.code,
        frame: core.frame,
        observer: &observer,
        records: &records,
        limits: &limits.0,
        free: &[],
        lags: &[],
    };
    tuning.check()?;
    let order: Vec<usize> = observer.iter().flat_map(|observed| observed.states.clone()).collect();
    let runs = py.detach(|| tuning.predictions(&workers));
    Ok(runs.map(|runs| {
        runs.into_iter()
            .map(|(errors, states)| {
                // From the order of the chains to that of the states.
                let mut sorted = vec![0.0; errors.len()];
                for (at, error) in errors.iter().enumerate() {
                    sorted[at / n_x * n_x + order[at % n_x]] = *error;
                }
                (to_matrix(py, n_x, sorted), to_matrix(py, n_x, states))
            })
            .collect()
    }))
}
