//! Signals and models.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use twinloop_core::{
    Actuation, Actuator, AnyDynamics, Form, Hidden, OwnedModel, Periods, Play, Report, RigidBody, Signals,
    Source, checked_effects, state_of,
};

use crate::arrays::{Cube, Matrix, Vector, rows, to_matrix, to_vector, vector};
use crate::error::{Result, given, misuse};
use crate::program::PyProgram;
use crate::rows::Rows;
use crate::workers::{PyWorkers, or_default};

/// Period, scales, bounds and derivatives of states and commands, as numbers.
#[pyclass(frozen, name = "Signals", module = "twinloop._core")]
pub struct PySignals(pub Arc<Signals>);

#[pymethods]
impl PySignals {
    #[new]
    #[pyo3(signature = (dt, state_scales, command_bounds, command_scales, derivative_of, kinematics = None, *, periods = None))]
    fn new(
        #[pyo3(from_py_with = given)] dt: f64,
        state_scales: Vector<'_>,
        command_bounds: Matrix<'_>,
        command_scales: Vector<'_>,
        #[pyo3(from_py_with = given)] derivative_of: Vec<Option<usize>>,
        #[pyo3(from_py_with = given)] kinematics: Option<([usize; 3], [usize; 3])>,
        #[pyo3(from_py_with = given)] periods: Option<Vec<Option<f64>>>,
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
pub struct PyModel(pub OwnedModel);

/// Models that a list of Python objects holds, as the engine keeps them.
pub fn owned(models: &[Bound<'_, PyModel>]) -> Vec<OwnedModel> {
    models.iter().map(|model| model.get().0.clone()).collect()
}

#[pymethods]
impl PyModel {
    #[new]
    #[pyo3(signature = (program, form, signals, actuators = None, hidden = vec![], offsets = vec![]))]
    fn new(
        program: &PyProgram,
        form: &str,
        signals: &PySignals,
        #[pyo3(from_py_with = given)] actuators: Option<Vec<ActuatorParts>>,
        #[pyo3(from_py_with = given)] hidden: Vec<HiddenParts>,
        #[pyo3(from_py_with = given)] offsets: Vec<f64>,
    ) -> Result<Self> {
        let acts = actuators.is_some() || !hidden.is_empty();
        let actuation = acts.then(|| actuation(actuators.unwrap_or_default(), hidden)).transpose()?;
        let model = OwnedModel::new(program.0.clone(), form.parse()?, signals.0.clone(), actuation)?;
        Ok(Self(if offsets.is_empty() { model } else { model.with_offsets(&offsets)? }))
    }

    /// The same model, of which each state is read so many s later (n_x).
    fn with_offsets(&self, #[pyo3(from_py_with = given)] offsets: Vec<f64>) -> Result<Self> {
        Ok(Self(self.0.with_offsets(&offsets)?))
    }

    /// The same model, with controllers' commands sent in levels (n_u); none of a command that is sent as it is.
    fn with_levels(&self, #[pyo3(from_py_with = given)] levels: Vec<Vec<f64>>) -> Result<Self> {
        Ok(Self(self.0.with_levels(levels)?))
    }

    /// The levels of each command; empty where all are sent as they are.
    #[getter]
    fn levels(&self) -> Vec<Vec<f64>> {
        self.0.frame().levels().each().to_vec()
    }

    /// The same model, of whose readings so much is given: (state, periods, first, age) of slow sensors, and
    /// (state, of, kept, share) of rates that are computed.
    fn with_reports(
        &self,
        #[pyo3(from_py_with = given)] held: Vec<HeldParts>,
        #[pyo3(from_py_with = given)] computed: Vec<ComputedParts>,
    ) -> Result<Self> {
        let held =
            held.into_iter().map(|(state, every, first, age)| (state, Report::Held { every, first, age }));
        let computed = computed
            .into_iter()
            .map(|(state, of, kept, share)| (state, Report::Computed { of, kept, share }));
        Ok(Self(self.0.with_reports(held.chain(computed).collect())?))
    }

    /// What is given of its readings, as `with_reports` takes it.
    #[getter]
    fn reports(&self) -> (Vec<HeldParts>, Vec<ComputedParts>) {
        let (mut held, mut computed) = (vec![], vec![]);
        for &(state, report) in self.0.frame().sensors().reports().each() {
            match report {
                Report::Held { every, first, age } => held.push((state, every, first, age)),
                Report::Computed { of, kept, share } => computed.push((state, of, kept, share)),
            }
        }
        (held, computed)
    }

    /// By how much later than others each state is read, s; empty where all are read in time.
    #[getter]
    fn offsets(&self) -> Vec<f64> {
        self.0.frame().sensors().offsets().to_vec()
    }

    /// The states (rows, n_x) whose readings these are, each at the start of a run.
    fn states_of<'py>(&self, py: Python<'py>, readings: Matrix<'py>) -> Result<Bound<'py, PyArray2<f64>>> {
        let n_x = self.0.signals().states();
        let readings = rows("readings", &readings, n_x)?;
        let states = readings.iter().flat_map(|reading| state_of(&self.0.view(), reading)).collect();
        Ok(to_matrix(py, n_x, states))
    }

    /// (lag, delay, rest) of each command's actuator; empty where every command acts at once and nothing is hidden.
    #[getter]
    fn actuators(&self) -> Vec<ActuatorParts> {
        self.0.frame().actuation().actuators.iter().map(|a| (a.lag, a.delay, a.rest, a.ramp)).collect()
    }

    /// (commands, squared, rest, time, states, settled, turns, half gap, damping) of each hidden state.
    #[getter]
    fn hidden(&self) -> Vec<HiddenParts> {
        self.0.frame().actuation().hidden.iter().map(parts).collect()
    }

    #[staticmethod]
    fn shape(form: &str, signals: &PySignals) -> Result<(usize, usize)> {
        Ok(form.parse::<Form>()?.shape(&signals.0))
    }

    #[getter]
    fn program(&self) -> PyProgram {
        PyProgram(self.0.learnt().clone())
    }

    /// Constants of the effective program, in its order.
    #[getter]
    fn constants<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        to_vector(py, self.0.learnt().code.constants().to_vec())
    }

    /// The same model without introns, with other constants, and other lags and times of hidden states (none: the same).
    fn with_constants(
        &self,
        #[pyo3(from_py_with = given)] constants: Vec<f64>,
        #[pyo3(from_py_with = given)] lags: Option<Vec<f64>>,
    ) -> Result<Self> {
        let times = lags.unwrap_or_else(|| self.0.frame().actuation().times());
        Ok(Self(self.0.varied(&constants, &times)?))
    }

    #[getter]
    fn form(&self) -> &'static str {
        self.0.frame().form().name()
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
        let (n_x, n_u) = (self.0.signals().states(), self.0.signals().commands());
        let rows = Rows::new(&states, &commands, past, n_x, n_u)?;
        let width = or_default(workers)?.width();
        let next = py.detach(|| rows.step(AnyDynamics::Model(self.0.view()), width));
        Ok(to_matrix(py, n_x, next))
    }
}

/// Lag, delay, rest, ramp.
type ActuatorParts = (f64, usize, Option<f64>, f64);
/// State, periods from one new reading to the next, period of the first one after the start, and how old they are.
type HeldParts = (usize, usize, usize, usize);
/// State, the other one, and what is kept of the last value and added of its change.
type ComputedParts = (usize, usize, f64, f64);
/// Commands, whether squared, rest, time, states, whether settled, in which it turns, half of its gap and what damps there.
type HiddenParts = (Vec<usize>, bool, Option<f64>, f64, Vec<usize>, bool, f64, f64, f64);

fn actuation(actuators: Vec<ActuatorParts>, hidden: Vec<HiddenParts>) -> Result<Actuation> {
    let actuator = |(lag, delay, rest, ramp)| Actuator { lag, delay, rest, ramp };
    Ok(Actuation {
        actuators: actuators.into_iter().map(actuator).collect(),
        hidden: hidden.into_iter().map(filled).collect::<Result<_>>()?,
    })
}

/// A hidden state of its parts; commands or states fill it, and not both.
fn filled(
    (commands, squared, rest, time, states, settled, turns, half, damping): HiddenParts,
) -> Result<Hidden> {
    let play = (half != 0.0 || damping != 0.0).then_some(Play { half, damping });
    let turns = (turns != 0.0).then_some(turns);
    let source = match (commands.is_empty(), states.is_empty(), rest) {
        (false, true, _) if !settled && turns.is_none() && play.is_none() => {
            Source::Commands { commands, rest }
        }
        (false, true, Some(rest)) | (true, false, Some(rest)) => {
            Source::States { states, commands, rest, settled, turns, play }
        }
        _ => {
            return Err(misuse(format!(
                "hidden state: expected commands, or states with a rest, that fill it, and only with these that it is \
                 settled, found commands {commands:?}, states {states:?}, rest {rest:?}"
            )));
        }
    };
    Ok(Hidden { source, squared, time })
}

/// The parts of a hidden state.
fn parts(hidden: &Hidden) -> HiddenParts {
    let Hidden { source, squared, time } = hidden;
    match source.clone() {
        Source::Commands { commands, rest } => {
            (commands, *squared, rest, *time, vec![], false, 0.0, 0.0, 0.0)
        }
        Source::States { states, commands, rest, settled, turns, play } => {
            let (half, damping) = play.map_or((0.0, 0.0), |play| (play.half, play.damping));
            (commands, *squared, Some(rest), *time, states, settled, turns.unwrap_or(0.0), half, damping)
        }
    }
}

/// Effects of commands (n, n_u) in their units behind actuators (lag, delay, rest, ramp), then the hidden states that they
/// fill (commands, squared, rest, time, no states, not settled, no turns, no gap), at the start, the middle and the end of
/// each period.
#[pyfunction]
pub fn command_effects<'py>(
    py: Python<'py>,
    #[pyo3(from_py_with = given)] actuators: Vec<ActuatorParts>,
    #[pyo3(from_py_with = given)] hidden: Vec<HiddenParts>,
    scales: Vector<'_>,
    #[pyo3(from_py_with = given)] dt: f64,
    commands: Matrix<'py>,
) -> Result<[Bound<'py, PyArray2<f64>>; 3]> {
    let commands = rows("commands", &commands, actuators.len())?.concat();
    let (found, columns) = checked_effects(actuation(actuators, hidden)?, &vector(&scales), dt, &commands)?;
    Ok(found.map(|values| to_matrix(py, columns, values)))
}
