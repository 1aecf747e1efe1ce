//! Tasks and roll-outs, of a model, a plant or a step function in Python.

use std::cell::RefCell;

use numpy::{PyArray1, PyArray3};
use pyo3::prelude::*;
use twinloop_core::{
    AnyDynamics, Dynamics, Influences, Setting, Signals, Task, Trajectory, Vector as Lanes, record,
    record_one,
};

use crate::arrays::{
    Cube, Matrix, Vector, VectorOrRows, finite, optional_blocks, rows, to_cube, to_integers, to_vector,
    vector, views,
};
use crate::error::{Result, given, misuse};
use crate::excitation::PyHoldBack;
use crate::law::{flown, raised};
use crate::model::PyModel;
use crate::plant::PyQuadrotor;
use crate::setting::{PyLimits, PySetting};
use crate::workers::{PyWorkers, or_default};

/// Where runs start, where they should end, how long they last.
#[pyclass(frozen, name = "Task", module = "twinloop._core")]
pub struct PyTask(pub Task);

#[pymethods]
impl PyTask {
    #[new]
    fn new(
        initial: Vector<'_>,
        #[pyo3(from_py_with = given)] target: VectorOrRows<'_>,
        #[pyo3(from_py_with = given)] steps: usize,
    ) -> Result<Self> {
        Ok(Self(Task::new(vector(&initial), target.numbers(), steps)?))
    }
}

/// What a roll-out leaves: `m` runs of `n` steps; NaN after a run has stopped.
#[pyclass(frozen, name = "Runs", module = "twinloop._core")]
pub struct PyRuns {
    runs: Vec<Trajectory>,
    steps: usize,
    states: usize,
    commands: usize,
}

impl PyRuns {
    /// One array of all runs; rows after `lasted + extra` are NaN.
    fn stack<'py>(
        &self,
        py: Python<'py>,
        rows: usize,
        columns: usize,
        of_run: impl Fn(&Trajectory) -> &[f64],
    ) -> Bound<'py, PyArray3<f64>> {
        let extra = rows - self.steps;
        let run = |run: &Trajectory| {
            let valid = (run.lasted + extra) * columns;
            let nan = std::iter::repeat_n(f64::NAN, rows * columns - valid);
            of_run(run)[..valid].iter().copied().chain(nan).collect::<Vec<_>>()
        };
        to_cube(py, [self.runs.len(), rows, columns], self.runs.iter().flat_map(run).collect())
    }
}

#[pymethods]
impl PyRuns {
    #[getter]
    fn states<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<f64>> {
        self.stack(py, self.steps + 1, self.states, |run| &run.states)
    }

    #[getter]
    fn read<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<f64>> {
        self.stack(py, self.steps + 1, self.states, |run| &run.read)
    }

    #[getter]
    fn measured<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<f64>> {
        self.stack(py, self.steps + 1, self.states, |run| &run.measured)
    }

    #[getter]
    fn commands<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<f64>> {
        self.stack(py, self.steps, self.commands, |run| &run.commands)
    }

    #[getter]
    fn lasted<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        to_integers(py, self.runs.iter().map(|run| run.lasted))
    }
}

/// Closes the loop of each controller around the dynamics.
#[pyfunction]
#[pyo3(signature = (
    dynamics, setting, parameters, task, *, noise = None, excitation = None, hold_back = None, disturbance = None, workers = None
))]
#[expect(clippy::too_many_arguments, reason = "what a roll-out needs, named by keyword in Python")]
pub fn rollout(
    py: Python<'_>,
    dynamics: &Bound<'_, PyAny>,
    setting: &PySetting,
    parameters: Matrix<'_>,
    task: &PyTask,
    noise: Option<Cube<'_>>,
    excitation: Option<Cube<'_>>,
    hold_back: Option<&PyHoldBack>,
    disturbance: Option<Cube<'_>>,
    workers: Option<&PyWorkers>,
) -> PyResult<PyRuns> {
    let workers = or_default(workers)?;
    let (setting, task) = (&*setting.0, fitting(task, &setting.0)?);
    let signals = setting.signals();
    let parameters = rows("parameters", &parameters, setting.family().parameters().len())?;
    let (steps, states, commands) = (task.steps, signals.states(), signals.commands());
    let count = parameters.len();
    let noise = optional_blocks("noise", noise, [count, steps + 1, states])?;
    let excitation = optional_blocks("excitation", excitation, [count, steps, commands])?;
    let disturbance = optional_blocks("disturbance", disturbance, [count, steps, states])?;
    finite("rollout", [&parameters, &noise, &excitation, &disturbance].into_iter().flatten().flatten())?;
    let (parameters, noise) = (views(&parameters), views(&noise));
    let (excitation, disturbance) = (views(&excitation), views(&disturbance));
    let hold_back = hold_back.map(|found| &found.0);
    hold_back.map_or(Ok(()), |found| found.check(states)).map_err(crate::error::CoreError::from)?;
    let influences = Influences {
        noise: &noise,
        excitation: &excitation,
        hold_back,
        disturbance: &disturbance,
        anchors: &[],
    };
    let width = workers.width();
    let runs = if let Some(known) = known(dynamics, signals)? {
        flown(py, || record(known, setting, &parameters, task, influences, width))?
    } else {
        let step = StepFunction { function: dynamics, failure: RefCell::new(None) };
        let mut runs = Vec::new();
        for (i, parameters) in parameters.iter().enumerate() {
            let influences = influences.of(&(i..i + 1));
            runs.extend(record_one(&step, setting, parameters, task, influences));
            raised()?;
            if let Some(error) = step.failure.take() {
                return Err(error);
            }
        }
        runs
    };
    Ok(PyRuns { runs, steps, states, commands })
}

/// Free runs from a state under commands, each held for one period, without a controller; they go on from `anchors`
/// where these are no NaN.
#[pyfunction]
#[pyo3(signature = (dynamics, limits, initial, commands, *, noise = None, disturbance = None, anchors = None, workers = None))]
#[expect(clippy::too_many_arguments, reason = "what a run needs, named by keyword in Python")]
pub fn replay(
    py: Python<'_>,
    dynamics: &Bound<'_, PyAny>,
    limits: &PyLimits,
    initial: Vector<'_>,
    commands: Matrix<'_>,
    noise: Option<Cube<'_>>,
    disturbance: Option<Cube<'_>>,
    anchors: Option<Cube<'_>>,
    workers: Option<&PyWorkers>,
) -> Result<PyRuns> {
    let width_of_lanes = or_default(workers)?.width();
    let (limits, signals) = (&limits.0, limits.0.signals());
    let (states, width) = (signals.states(), signals.commands());
    let (initial, commands) = (vector(&initial), rows("commands", &commands, width)?);
    let steps = commands.len();
    let known = known(dynamics, signals)?;
    let drawn = [&noise, &disturbance, &anchors];
    let runs = drawn.into_iter().flatten().map(|draws| draws.as_array().shape()[0]).max();
    let count = runs.unwrap_or(1);
    let noise = optional_blocks("noise", noise, [count, steps + 1, states])?;
    let disturbance = optional_blocks("disturbance", disturbance, [count, steps, states])?;
    let anchors = optional_blocks("anchors", anchors, [count, steps + 1, states])?;
    let drawn = noise.iter().chain(&disturbance).flatten();
    let numbers = initial.iter().chain(commands.iter().flatten()).chain(drawn);
    let fits = initial.len() == states && steps > 0 && numbers.copied().all(f64::is_finite);
    let Some(dynamics) = known.filter(|_| fits) else {
        return Err(misuse(format!(
            "replay: expected a model or plant, {states} states and at least one row of commands, all finite, found {} \
             states and {steps} rows",
            initial.len()
        )));
    };
    let commands = commands.concat();
    let (noise, disturbance, anchors) = (views(&noise), views(&disturbance), views(&anchors));
    let influences =
        Influences { noise: &noise, disturbance: &disturbance, anchors: &anchors, ..Influences::default() };
    let fly = || twinloop_core::replay(dynamics, limits, &initial, &commands, influences, width_of_lanes);
    Ok(PyRuns { runs: py.detach(fly), steps, states, commands: width })
}

/// Dynamics that the engine has, for these signals; none for a function.
fn known<'a>(dynamics: &'a Bound<'_, PyAny>, signals: &Signals) -> Result<Option<AnyDynamics<'a>>> {
    if let Ok(model) = dynamics.cast::<PyModel>() {
        model.get().0.check_for(signals)?;
        return Ok(Some(AnyDynamics::Model(model.get().0.view())));
    }
    let Ok(plant) = dynamics.cast::<PyQuadrotor>() else { return Ok(None) };
    plant.get().0.check(signals)?;
    Ok(Some(AnyDynamics::Quadrotor(&plant.get().0)))
}

/// The task, unless it is not for the signals of the setting.
pub fn fitting<'a>(task: &'a PyTask, setting: &Setting) -> Result<&'a Task> {
    let (expected, found) = (setting.signals().states(), task.0.initial.len());
    if found == expected {
        return Ok(&task.0);
    }
    Err(misuse(format!("task: expected {expected} states, found {found}; make it for these signals")))
}

/// A step function in Python, called on the thread that asked for the roll-out.
struct StepFunction<'a, 'py> {
    function: &'a Bound<'py, PyAny>,
    /// The exception that ended the run; the states after it are NaN, which ends the roll-out.
    failure: RefCell<Option<PyErr>>,
}

impl StepFunction<'_, '_> {
    fn call(&self, state: &[f64], command: &[f64]) -> PyResult<Vec<f64>> {
        let py = self.function.py();
        let arguments = (to_vector(py, state.to_vec()), to_vector(py, command.to_vec()));
        let next: Vector<'_> = self.function.call1(arguments)?.extract()?;
        let next = vector(&next);
        if next.len() != state.len() {
            let (expected, found) = (state.len(), next.len());
            return Err(
                misuse(format!("expected a next state of shape ({expected},), found ({found},)")).into()
            );
        }
        Ok(next)
    }
}

impl Dynamics for StepFunction<'_, '_> {
    type Workspace<V: Lanes> = ();

    fn workspace<V: Lanes>(&self) {}

    fn remember<V: Lanes>(&self, _workspace: &mut (), _command: &[V]) {}

    fn step<V: Lanes>(&self, _workspace: &mut (), state: &mut [V], command: &[V]) {
        let lane = |values: &[V], l: usize| values.iter().map(|value| value.lane(l)).collect::<Vec<_>>();
        let next: PyResult<Vec<_>> =
            (0..V::LANES).map(|l| self.call(&lane(state, l), &lane(command, l))).collect();
        let next = next.unwrap_or_else(|error| {
            self.failure.borrow_mut().get_or_insert(error);
            vec![vec![f64::NAN; state.len()]; V::LANES]
        });
        for (j, state) in state.iter_mut().enumerate() {
            *state = V::load(&next.iter().map(|next| next[j]).collect::<Vec<_>>());
        }
    }
}
