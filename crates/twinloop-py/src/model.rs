//! Signals and models.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use twinloop_core::{Actuator, Form, Frame, Learnt, Model, RigidBody, Signals, effects, step_rows};

use crate::arrays::{Matrix, Vector, rows, to_matrix, to_vector, vector, views};
use crate::error::{Result, misuse};
use crate::program::PyProgram;
use crate::workers::{PyWorkers, or_default};

/// Period, scales, bounds and derivatives of states and commands, as numbers.
#[pyclass(frozen, name = "Signals", module = "twinloop._core")]
pub struct PySignals(pub Arc<Signals>);

#[pymethods]
impl PySignals {
    #[new]
    #[pyo3(signature = (dt, state_scales, command_bounds, command_scales, derivative_of, kinematics = None))]
    fn new(
        dt: f64,
        state_scales: Vector<'_>,
        command_bounds: Matrix<'_>,
        command_scales: Vector<'_>,
        derivative_of: Vec<Option<usize>>,
        kinematics: Option<([usize; 3], [usize; 3])>,
    ) -> Result<Self> {
        let bounds = rows("command bounds", &command_bounds, 2)?;
        let signals = Signals {
            dt,
            state_scales: vector(&state_scales),
            command_bounds: bounds.iter().map(|row| (row[0], row[1])).collect(),
            command_scales: vector(&command_scales),
            derivative_of,
            kinematics: kinematics.map(|(angles, rates)| RigidBody { angles, rates }),
        };
        Ok(Self(Arc::new(signals.validated()?)))
    }
}

/// A program with the form that makes it dynamics.
#[pyclass(frozen, name = "Model", module = "twinloop._core")]
pub struct PyModel {
    pub learnt: Arc<Learnt>,
    pub frame: Arc<Frame>,
    signals: Arc<Signals>,
}

impl PyModel {
    /// A model that was learnt in a frame.
    pub fn of(learnt: Arc<Learnt>, frame: Arc<Frame>, signals: Arc<Signals>) -> Self {
        Self { learnt, frame, signals }
    }

    /// The same model without introns, with these constants and lags.
    pub fn varied(&self, constants: &[f64], lags: &[f64]) -> Result<PyModel> {
        let program = self.learnt.program.effective().with_constants(constants)?;
        let mut actuators = self.frame.actuators().to_vec();
        if actuators.len() != lags.len() {
            return Err(misuse(format!("lags: expected {}, found {}", actuators.len(), lags.len())));
        }
        actuators.iter_mut().zip(lags).for_each(|(actuator, &lag)| actuator.lag = lag);
        let frame = if actuators.is_empty() {
            self.frame.clone()
        } else {
            Arc::new((*self.frame).clone().with_actuators(actuators)?)
        };
        Ok(PyModel::of(Arc::new(Learnt::new(program)), frame, self.signals().clone()))
    }

    /// What it is a model of.
    pub fn signals(&self) -> &Arc<Signals> {
        &self.signals
    }

    /// The engine's view of it.
    pub fn core(&self) -> Model<'_> {
        Model { code: &self.learnt.code, frame: &self.frame }
    }
}

#[pymethods]
impl PyModel {
    #[new]
    #[pyo3(signature = (program, form, signals, actuators = None))]
    fn new(
        program: &PyProgram,
        form: &str,
        signals: &PySignals,
        actuators: Option<Vec<(f64, usize, Option<f64>)>>,
    ) -> Result<Self> {
        let form: Form = form.parse()?;
        Model::check(&program.0.program, form, &signals.0)?;
        let mut frame = Frame::new(form, &signals.0);
        if let Some(actuators) = actuators {
            frame = frame.with_actuators(actuators.into_iter().map(actuator).collect())?;
        }
        Ok(Self::of(program.0.clone(), Arc::new(frame), signals.0.clone()))
    }

    /// (lag, delay, rest) of each command's actuator; empty where every command acts at once.
    #[getter]
    fn actuators(&self) -> Vec<(f64, usize, Option<f64>)> {
        self.frame.actuators().iter().map(|a| (a.lag, a.delay, a.rest)).collect()
    }

    #[staticmethod]
    fn shape(form: &str, signals: &PySignals) -> Result<(usize, usize)> {
        Ok(form.parse::<Form>()?.shape(&signals.0))
    }

    #[getter]
    fn program(&self) -> PyProgram {
        PyProgram(self.learnt.clone())
    }

    /// Constants of the effective program, in its order.
    #[getter]
    fn constants<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        to_vector(py, self.learnt.code.constants().to_vec())
    }

    /// The same model without introns, with other constants and other lags (none: the same).
    fn with_constants(&self, constants: Vec<f64>, lags: Option<Vec<f64>>) -> Result<PyModel> {
        let kept = || self.frame.actuators().iter().map(|actuator| actuator.lag).collect();
        self.varied(&constants, &lags.unwrap_or_else(kept))
    }

    #[getter]
    fn form(&self) -> &'static str {
        self.frame.form().name()
    }

    #[pyo3(signature = (states, commands, workers = None))]
    fn step<'py>(
        &self,
        py: Python<'py>,
        states: Matrix<'py>,
        commands: Matrix<'py>,
        workers: Option<&PyWorkers>,
    ) -> Result<Bound<'py, PyArray2<f64>>> {
        let (n_x, n_u) = (self.signals.states(), self.signals.commands());
        let (states, commands) = (rows("states", &states, n_x)?, rows("commands", &commands, n_u)?);
        same_length(&states, &commands)?;
        let width = or_default(workers)?.width();
        let next = py.detach(|| step_rows(&self.core(), &views(&states), &views(&commands), width));
        Ok(to_matrix(py, n_x, next))
    }
}

fn actuator((lag, delay, rest): (f64, usize, Option<f64>)) -> Actuator {
    Actuator { lag, delay, rest }
}

/// Effects of commands (n, n_u) behind actuators (lag, delay, rest) at the start, the middle and the end of each period.
#[pyfunction]
pub fn command_effects<'py>(
    py: Python<'py>,
    actuators: Vec<(f64, usize, Option<f64>)>,
    dt: f64,
    commands: Matrix<'py>,
) -> Result<[Bound<'py, PyArray2<f64>>; 3]> {
    let columns = actuators.len();
    let commands = rows("commands", &commands, columns)?.concat();
    let actuators: Vec<_> =
        actuators.into_iter().map(|a| actuator(a).validated()).collect::<std::result::Result<_, _>>()?;
    Ok(effects(&actuators, dt, &commands).map(|values| to_matrix(py, columns, values)))
}

/// Refuses states and commands of different numbers of rows.
pub fn same_length(states: &[Vec<f64>], commands: &[Vec<f64>]) -> Result<()> {
    if states.len() == commands.len() {
        return Ok(());
    }
    Err(misuse(format!("expected as many states as commands, found {} and {}", states.len(), commands.len())))
}
