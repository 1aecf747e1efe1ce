//! Signals and models.

use std::sync::Arc;

use numpy::PyArray2;
use pyo3::prelude::*;
use twinloop_core::{Form, Frame, Learnt, Model, Signals, step_rows};

use crate::arrays::{Matrix, Vector, rows, to_matrix, vector, views};
use crate::error::{Result, misuse};
use crate::program::PyProgram;
use crate::workers::{PyWorkers, or_default};

/// Period, scales, bounds and derivatives of states and commands, as numbers.
#[pyclass(frozen, name = "Signals", module = "twinloop._core")]
pub struct PySignals(pub Arc<Signals>);

#[pymethods]
impl PySignals {
    #[new]
    fn new(
        dt: f64,
        state_scales: Vector<'_>,
        command_bounds: Matrix<'_>,
        command_scales: Vector<'_>,
        derivative_of: Vec<Option<usize>>,
    ) -> Result<Self> {
        let bounds = rows("command bounds", &command_bounds, 2)?;
        let signals = Signals {
            dt,
            state_scales: vector(&state_scales),
            command_bounds: bounds.iter().map(|row| (row[0], row[1])).collect(),
            command_scales: vector(&command_scales),
            derivative_of,
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

    /// The engine's view of it.
    pub fn core(&self) -> Model<'_> {
        Model { code: &self.learnt.code, frame: &self.frame }
    }
}

#[pymethods]
impl PyModel {
    #[new]
    fn new(program: &PyProgram, form: &str, signals: &PySignals) -> Result<Self> {
        let form: Form = form.parse()?;
        Model::check(&program.0.program, form, &signals.0)?;
        let frame = Arc::new(Frame::new(form, &signals.0));
        Ok(Self::of(program.0.clone(), frame, signals.0.clone()))
    }

    #[staticmethod]
    fn shape(form: &str, signals: &PySignals) -> Result<(usize, usize)> {
        Ok(form.parse::<Form>()?.shape(&signals.0))
    }

    #[getter]
    fn program(&self) -> PyProgram {
        PyProgram(self.learnt.clone())
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

/// Refuses states and commands of different numbers of rows.
pub fn same_length(states: &[Vec<f64>], commands: &[Vec<f64>]) -> Result<()> {
    if states.len() == commands.len() {
        return Ok(());
    }
    Err(misuse(format!("expected as many states as commands, found {} and {}", states.len(), commands.len())))
}
