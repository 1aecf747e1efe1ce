//! Flights, and how committees judge them.

use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use twinloop_core::{
    AnyDynamics, Candidate, Disagreement, Draws, Envelope, Flights, Model, Quality,
    disagreements as core_disagreements, qualities as core_qualities,
};

use crate::arrays::{
    Cube, Matrix, RowsOrBlocks, Vector, VectorOrRows, optional_blocks, optional_rows, rows, to_cube,
    to_integer_rows, to_vector, vector, views,
};
use crate::error::{Result, given, misuse};
use crate::excitation::PyHoldBack;
use crate::law::flown;
use crate::model::{PyModel, PySignals};
use crate::objective::fitting;
use crate::plant::PyQuadrotor;
use crate::setting::PySetting;
use crate::workers::{PyWorkers, or_default};

/// Candidate flights of one length, each with its own gains, start, target and excitation.
#[pyclass(frozen, name = "Flights", module = "twinloop._core")]
pub struct PyFlights(Flights);

#[pymethods]
impl PyFlights {
    #[new]
    #[pyo3(signature = (
        setting, parameters, initial_states, target_states, steps, *, excitation = None, hold_back = None
    ))]
    fn new(
        setting: &PySetting,
        parameters: Matrix<'_>,
        initial_states: Matrix<'_>,
        #[pyo3(from_py_with = given)] target_states: RowsOrBlocks<'_>,
        #[pyo3(from_py_with = given)] steps: usize,
        excitation: Option<Cube<'_>>,
        hold_back: Option<&PyHoldBack>,
    ) -> Result<Self> {
        let (n_x, n_u) = (setting.0.signals().states(), setting.0.signals().commands());
        let parameters = rows("parameters", &parameters, setting.0.family().parameters().len())?;
        let initial = rows("initial states", &initial_states, n_x)?;
        let target = target_states.each();
        let count = parameters.len();
        if initial.len() != count || target.len() != count {
            return Err(misuse(format!(
                "flights: expected as many initial and target states as parameters, found {}, {} and {count}",
                initial.len(),
                target.len()
            )));
        }
        let excitation = optional_blocks("excitation", excitation, [count, steps, n_u])?;
        let excitation = excitation.into_iter().chain(std::iter::repeat(vec![]));
        let candidates: Vec<_> = parameters
            .into_iter()
            .zip(initial)
            .zip(target)
            .zip(excitation)
            .map(|(((parameters, initial), target), excitation)| Candidate {
                parameters,
                initial,
                target,
                excitation,
            })
            .collect();
        let flights = Flights::new(setting.0.clone(), &candidates, steps)?;
        Ok(Self(match hold_back {
            Some(found) => flights.held_back(&found.0)?,
            None => flights,
        }))
    }

    #[getter]
    fn steps(&self) -> usize {
        self.0.steps()
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }
}

/// What a flight is judged by.
#[pyclass(frozen, name = "Quality", module = "twinloop._core")]
pub struct PyQuality(Quality);

#[pymethods]
impl PyQuality {
    #[new]
    #[pyo3(signature = (kind, weights, *, effort = 0.0, effort_rate = 0.0))]
    fn new(
        kind: &str,
        weights: Vector<'_>,
        #[pyo3(from_py_with = given)] effort: f64,
        #[pyo3(from_py_with = given)] effort_rate: f64,
    ) -> Result<Self> {
        let quality = Quality { kind: kind.parse()?, weights: vector(&weights), effort, effort_rate };
        Ok(Self(quality.validated()?))
    }

    /// Of a recorded run: states (n + 1, n_x) and commands (n, n_u).
    fn recorded(
        &self,
        signals: &PySignals,
        #[pyo3(from_py_with = given)] target: VectorOrRows<'_>,
        states: Matrix<'_>,
        commands: Matrix<'_>,
    ) -> Result<f64> {
        let signals = &signals.0;
        let states = rows("states", &states, signals.states())?.concat();
        let commands = rows("commands", &commands, signals.commands())?.concat();
        Ok(self.0.recorded(signals, &target.numbers(), &states, &commands)?)
    }

    #[getter]
    fn kind(&self) -> &'static str {
        self.0.kind.name()
    }
}

/// The largest share of an envelope that each state uses (rows,).
#[pyfunction]
pub fn usages<'py>(
    py: Python<'py>,
    signals: &PySignals,
    #[pyo3(from_py_with = given)] envelope: Vec<Option<(f64, f64)>>,
    states: Matrix<'py>,
) -> Result<Bound<'py, PyArray1<f64>>> {
    let states = rows("states", &states, signals.0.states())?.concat();
    Ok(to_vector(py, Envelope::new(&envelope)?.usages(&signals.0, &states)?))
}

/// What flights are flown on: members of a committee, or the truth.
#[derive(FromPyObject)]
pub enum Members<'py> {
    Plant(Bound<'py, PyQuadrotor>),
    Models(Vec<Bound<'py, PyModel>>),
}

/// Quality and usage of the envelope of every flight (members, draws, K).
#[pyfunction]
#[pyo3(signature = (
    dynamics, flights, quality, envelope, *, noise = None, offsets = None, disturbances = None, measured = false,
    workers = None
))]
#[expect(clippy::too_many_arguments, reason = "what a judgement needs, named by keyword in Python")]
#[expect(clippy::type_complexity, reason = "two arrays")]
pub fn qualities<'py>(
    py: Python<'py>,
    #[pyo3(from_py_with = given)] dynamics: Members<'py>,
    flights: &PyFlights,
    quality: &PyQuality,
    #[pyo3(from_py_with = given)] envelope: Vec<Option<(f64, f64)>>,
    noise: Option<Cube<'py>>,
    offsets: Option<Matrix<'py>>,
    disturbances: Option<Cube<'py>>,
    measured: bool,
    workers: Option<&PyWorkers>,
) -> Result<(Bound<'py, PyArray3<f64>>, Bound<'py, PyArray3<f64>>)> {
    let workers = or_default(workers)?;
    let (flights, quality, envelope) = (&flights.0, &quality.0, Envelope::new(&envelope)?);
    let n_x = flights.signals().states();
    let draws = noise.as_ref().or(disturbances.as_ref()).map_or(1, |given| given.as_array().shape()[0]);
    if draws == 0 || offsets.as_ref().is_some_and(|offsets| offsets.as_array().nrows() == 0) {
        return Err(misuse(
            "draws: expected at least one of noise, offsets and disturbances, found none".into(),
        ));
    }
    let noise = optional_blocks("noise", noise, [draws, flights.steps() + 1, n_x])?;
    let disturbances = optional_blocks("disturbances", disturbances, [draws, flights.steps(), n_x])?;
    let offsets = optional_rows("offsets", offsets, n_x)?;
    let (noise, offsets, disturbances) = (views(&noise), views(&offsets), views(&disturbances));
    let draws = Draws { noise: &noise, offsets: &offsets, disturbances: &disturbances, measured };
    let (members, judged) = match dynamics {
        Members::Plant(plant) => {
            let plant = plant.get();
            plant.0.check(flights.signals())?;
            let plant = [AnyDynamics::Quadrotor(&plant.0)];
            (1, flown(py, || core_qualities(&plant, flights, quality, &envelope, draws, &workers))??)
        }
        Members::Models(models) => {
            let models: Vec<_> = members(&models, flights)?.into_iter().map(AnyDynamics::Model).collect();
            let judged =
                flown(py, || core_qualities(&models, flights, quality, &envelope, draws, &workers))??;
            (models.len(), judged)
        }
    };
    let shape = [members, draws.count(), flights.len()];
    let qualities = to_cube(py, shape, judged.iter().map(|judged| judged.quality).collect());
    Ok((qualities, to_cube(py, shape, judged.iter().map(|judged| judged.usage).collect())))
}

/// Disagreement on each flight (K,), and where it is greatest (K, 4).
#[pyfunction]
#[pyo3(signature = (models, flights, sds, *, cap = 100.0, workers = None))]
#[expect(clippy::type_complexity, reason = "two arrays")]
pub fn disagreements<'py>(
    py: Python<'py>,
    models: Vec<Bound<'py, PyModel>>,
    flights: &PyFlights,
    sds: Vector<'py>,
    #[pyo3(from_py_with = given)] cap: f64,
    workers: Option<&PyWorkers>,
) -> Result<(Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<i64>>)> {
    let (workers, flights, sds) = (or_default(workers)?, &flights.0, vector(&sds));
    let models = members(&models, flights)?;
    let found = flown(py, || core_disagreements(&models, flights, &sds, cap, &workers))??;
    let place = |d: &Disagreement| [d.step, d.state, d.highest, d.lowest];
    let values = found.iter().map(|disagreement| disagreement.value).collect();
    Ok((to_vector(py, values), to_integer_rows(py, found.iter().map(place).collect())))
}

/// The engine's view of one model or more that are for the signals of the flights.
fn members<'a>(models: &'a [Bound<'_, PyModel>], flights: &Flights) -> Result<Vec<Model<'a>>> {
    if models.is_empty() {
        return Err(misuse("committee: expected at least one model, found none".into()));
    }
    fitting(models, flights.signals())
}
