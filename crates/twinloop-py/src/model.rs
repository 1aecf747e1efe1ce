//! Signals and models.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use twinloop_core::{
    Actuation, Actuator, AnyDynamics, Form, Frame, Hidden, Learnt, Model, Periods, RigidBody, Sensors,
    Signals, Width, effects, state_of, step_rows,
};

use crate::arrays::{Cube, Matrix, Vector, optional_blocks, rows, to_matrix, to_vector, vector, views};
use crate::error::{Result, misuse};
use crate::program::PyProgram;
use crate::workers::{PyWorkers, or_default};

/// Period, scales, bounds and derivatives of states and commands, as numbers.
#[pyclass(frozen, name = "Signals", module = "twinloop._core")]
pub struct PySignals(pub Arc<Signals>);

#[pymethods]
impl PySignals {
    #[new]
    #[pyo3(signature = (dt, state_scales, command_bounds, command_scales, derivative_of, kinematics = None, *, periods = None))]
    fn new(
        dt: f64,
        state_scales: Vector<'_>,
        command_bounds: Matrix<'_>,
        command_scales: Vector<'_>,
        derivative_of: Vec<Option<usize>>,
        kinematics: Option<([usize; 3], [usize; 3])>,
        periods: Option<Vec<Option<f64>>>,
    ) -> Result<Self> {
        let bounds = rows("command bounds", &command_bounds, 2)?;
        let signals = Signals {
            dt,
            state_scales: vector(&state_scales),
            command_bounds: bounds.iter().map(|row| (row[0], row[1])).collect(),
            command_scales: vector(&command_scales),
            derivative_of,
            kinematics: kinematics.map(|(angles, rates)| RigidBody { angles, rates }),
            periods: Periods::new(periods.unwrap_or_default())?,
        };
        Ok(Self(Arc::new(signals.validated()?)))
    }

    #[getter]
    fn substeps(&self) -> usize {
        self.0.substeps()
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

    /// The same model without introns, with these constants, lags and times of hidden states.
    pub fn varied(&self, constants: &[f64], lags: &[f64]) -> Result<PyModel> {
        let program = self.learnt.program.effective().with_constants(constants)?;
        let actuation = self.frame.actuation();
        let other = actuation.with_times(lags)?;
        let frame = if actuation.is_direct() {
            self.frame.clone()
        } else {
            Arc::new((*self.frame).clone().with_actuation(other)?)
        };
        Ok(PyModel::of(Arc::new(Learnt::new(program)), frame, self.signals().clone()))
    }

    /// What it is a model of.
    pub fn signals(&self) -> &Arc<Signals> {
        &self.signals
    }

    /// Refuses signals of other states or commands, another period or other derivatives.
    pub fn fits(&self, signals: &Signals) -> Result<()> {
        if self.frame.fits(signals) {
            return Ok(());
        }
        Err(misuse(
            "model: expected one with the states, commands and period of the signals, found another; make or learn it \
             for them"
                .into(),
        ))
    }

    /// The engine's view of it.
    pub fn core(&self) -> Model<'_> {
        Model { code: &self.learnt.code, frame: &self.frame }
    }
}

#[pymethods]
impl PyModel {
    #[new]
    #[pyo3(signature = (program, form, signals, actuators = None, hidden = vec![], offsets = vec![]))]
    fn new(
        program: &PyProgram,
        form: &str,
        signals: &PySignals,
        actuators: Option<Vec<ActuatorParts>>,
        hidden: Vec<HiddenParts>,
        offsets: Vec<f64>,
    ) -> Result<Self> {
        let form: Form = form.parse()?;
        Model::check(&program.0.program, form, &signals.0, hidden.len())?;
        let mut frame = Frame::new(form, &signals.0);
        if let Some(actuators) = actuators {
            frame = frame.with_actuation(actuation(actuators, hidden))?;
        } else if !hidden.is_empty() {
            return Err(misuse("model: expected actuators with hidden states, found none".into()));
        }
        let model = Self::of(program.0.clone(), Arc::new(frame), signals.0.clone());
        if offsets.is_empty() { Ok(model) } else { model.with_offsets(offsets) }
    }

    /// The same model, of which each state is read so many s later (n_x).
    fn with_offsets(&self, offsets: Vec<f64>) -> Result<PyModel> {
        let frame = (*self.frame).clone().with_sensors(Sensors::new(&offsets, &self.signals)?);
        Ok(Self::of(self.learnt.clone(), Arc::new(frame), self.signals.clone()))
    }

    /// By how much later than others each state is read, s; empty where all are read in time.
    #[getter]
    fn offsets(&self) -> Vec<f64> {
        self.frame.sensors().offsets().to_vec()
    }

    /// The states (rows, n_x) whose readings these are, each at the start of a run.
    fn states_of<'py>(&self, py: Python<'py>, readings: Matrix<'py>) -> Result<Bound<'py, PyArray2<f64>>> {
        let n_x = self.signals.states();
        let readings = rows("readings", &readings, n_x)?;
        let states = readings.iter().flat_map(|reading| state_of(&self.core(), reading)).collect();
        Ok(to_matrix(py, n_x, states))
    }

    /// (lag, delay, rest) of each command's actuator; empty where every command acts at once and nothing is hidden.
    #[getter]
    fn actuators(&self) -> Vec<ActuatorParts> {
        self.frame.actuation().actuators.iter().map(|a| (a.lag, a.delay, a.rest)).collect()
    }

    /// (commands, squared, rest, time) of each hidden state.
    #[getter]
    fn hidden(&self) -> Vec<HiddenParts> {
        let parts = |h: &Hidden| (h.commands.clone(), h.squared, h.rest, h.time);
        self.frame.actuation().hidden.iter().map(parts).collect()
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

    /// The same model without introns, with other constants, and other lags and times of hidden states (none: the same).
    fn with_constants(&self, constants: Vec<f64>, lags: Option<Vec<f64>>) -> Result<PyModel> {
        self.varied(&constants, &lags.unwrap_or_else(|| self.frame.actuation().times()))
    }

    #[getter]
    fn form(&self) -> &'static str {
        self.frame.form().name()
    }

    #[pyo3(signature = (states, commands, workers = None, past = None))]
    fn step<'py>(
        &self,
        py: Python<'py>,
        states: Matrix<'py>,
        commands: Matrix<'py>,
        workers: Option<&PyWorkers>,
        past: Option<Cube<'py>>,
    ) -> Result<Bound<'py, PyArray2<f64>>> {
        let (n_x, n_u) = (self.signals.states(), self.signals.commands());
        let rows = Rows::new(&states, &commands, past, n_x, n_u)?;
        let width = or_default(workers)?.width();
        let next = py.detach(|| rows.step(AnyDynamics::Model(self.core()), width));
        Ok(to_matrix(py, n_x, next))
    }
}

/// Lag, delay, rest.
type ActuatorParts = (f64, usize, Option<f64>);
/// Commands, whether squared, rest, time.
type HiddenParts = (Vec<usize>, bool, Option<f64>, f64);

fn actuation(actuators: Vec<ActuatorParts>, hidden: Vec<HiddenParts>) -> Actuation {
    let actuator = |(lag, delay, rest)| Actuator { lag, delay, rest };
    let filled = |(commands, squared, rest, time)| Hidden { commands, squared, rest, time };
    Actuation {
        actuators: actuators.into_iter().map(actuator).collect(),
        hidden: hidden.into_iter().map(filled).collect(),
    }
}

/// Effects of commands (n, n_u) in their units behind actuators (lag, delay, rest), then the hidden states that they
/// fill (commands, squared, rest, time), at the start, the middle and the end of each period.
#[pyfunction]
pub fn command_effects<'py>(
    py: Python<'py>,
    actuators: Vec<ActuatorParts>,
    hidden: Vec<HiddenParts>,
    scales: Vector<'_>,
    dt: f64,
    commands: Matrix<'py>,
) -> Result<[Bound<'py, PyArray2<f64>>; 3]> {
    let n_u = actuators.len();
    if n_u == 0 {
        return Err(misuse("actuators: expected one for each command, found none".into()));
    }
    let commands = rows("commands", &commands, n_u)?.concat();
    let scales = vector(&scales);
    let positive = |x: f64| x.is_finite() && x > 0.0;
    if scales.len() != n_u || !scales.iter().chain([&dt]).all(|&x| positive(x)) {
        return Err(misuse(format!("expected {n_u} scales and a period above 0, found {scales:?} and {dt}")));
    }
    let factors: Vec<f64> = scales.iter().map(|scale| 1.0 / scale).collect();
    let asked = actuation(actuators, hidden);
    let all = asked.actuators.clone();
    // Actuators that all act at once are kept: here they only pass commands on.
    let checked = Actuation { actuators: all, ..asked.validated(n_u)? };
    let columns = n_u + checked.hidden.len();
    Ok(effects(&checked, &factors, dt, &commands).map(|values| to_matrix(py, columns, values)))
}

/// States (rows, n_x), commands (rows, n_u), and what was commanded before (rows, p, n_u), if anything was.
pub struct Rows {
    states: Vec<Vec<f64>>,
    commands: Vec<Vec<f64>>,
    past: Vec<Vec<f64>>,
}

impl Rows {
    /// Refuses different numbers of rows, and columns that are not those of the dynamics.
    pub fn new(
        states: &Matrix<'_>,
        commands: &Matrix<'_>,
        past: Option<Cube<'_>>,
        n_x: usize,
        n_u: usize,
    ) -> Result<Self> {
        let (states, commands) = (rows("states", states, n_x)?, rows("commands", commands, n_u)?);
        if states.len() != commands.len() {
            let (x, u) = (states.len(), commands.len());
            return Err(misuse(format!("expected as many states as commands, found {x} and {u}")));
        }
        let periods = past.as_ref().map_or(0, |past| past.as_array().shape()[1]);
        let past = optional_blocks("past", past, [states.len(), periods, n_u])?;
        Ok(Self { states, commands, past })
    }

    /// The next states.
    pub fn step(&self, dynamics: AnyDynamics<'_>, width: Width) -> Vec<f64> {
        step_rows(dynamics, &views(&self.states), &views(&self.commands), &views(&self.past), width)
    }
}
