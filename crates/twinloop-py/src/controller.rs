//! Families of controllers, and one controller with its memory.

use std::sync::{Arc, Mutex};

use numpy::PyArray1;
use pyo3::prelude::*;
use twinloop_core::{Axis, Controller, Family, Mixer, Parameters, Pid, Signals, StateFeedback};

use crate::arrays::{Matrix, Vector, optional_rows, rows, to_vector, vector};
use crate::error::{Result, misuse};
use crate::model::PySignals;

/// A family of controllers: a bounded parameter vector and a law, one implementation for search and real run.
#[pyclass(frozen, name = "Family", module = "twinloop._core")]
pub struct PyFamily(pub Arc<Family>);

#[pymethods]
impl PyFamily {
    #[staticmethod]
    #[expect(clippy::too_many_arguments, reason = "a PID, its box and its output map, as numbers")]
    fn pid(
        signals: &PySignals,
        axes: Vec<(usize, Option<usize>)>,
        low: Vector<'_>,
        high: Vector<'_>,
        logarithmic: Vec<bool>,
        matrix: Option<Matrix<'_>>,
        offset: Option<Vector<'_>>,
        power: f64,
    ) -> Result<Self> {
        let signals = &signals.0;
        let output = output_map(signals, axes.len(), matrix, offset, power)?;
        let axes = axes.into_iter().map(|(angle, rate)| Axis { angle, rate }).collect();
        let parameters = Parameters::new(&vector(&low), &vector(&high), &logarithmic)?;
        let pid = Pid { axes, output, dt: signals.dt };
        Ok(Self(Arc::new(Family::pid(pid, parameters, signals.states())?)))
    }

    #[staticmethod]
    #[expect(clippy::too_many_arguments, reason = "a law, its box and its output map, as numbers")]
    fn state_feedback(
        signals: &PySignals,
        states: Vec<usize>,
        integrals: Vec<usize>,
        outputs: usize,
        low: Vector<'_>,
        high: Vector<'_>,
        logarithmic: Vec<bool>,
        matrix: Option<Matrix<'_>>,
        offset: Option<Vector<'_>>,
        power: f64,
    ) -> Result<Self> {
        let signals = &signals.0;
        let output = output_map(signals, outputs, matrix, offset, power)?;
        let parameters = Parameters::new(&vector(&low), &vector(&high), &logarithmic)?;
        let feedback = StateFeedback { states, integrals, outputs, output, dt: signals.dt };
        Ok(Self(Arc::new(Family::state_feedback(feedback, parameters, signals.states())?)))
    }

    #[getter]
    fn size(&self) -> usize {
        self.0.parameters().len()
    }

    #[pyo3(signature = (parameters, excitation = None))]
    fn controller(&self, parameters: Vector<'_>, excitation: Option<Matrix<'_>>) -> Result<PyController> {
        let controller = Controller::new(self.0.clone(), vector(&parameters))?;
        let excitation = optional_rows("excitation", excitation, self.0.commands())?.concat();
        Ok(PyController(Mutex::new(controller.excited(&excitation)?)))
    }
}

/// The map from a law's outputs to the commands; without a matrix output i is command i.
fn output_map(
    signals: &Signals,
    outputs: usize,
    matrix: Option<Matrix<'_>>,
    offset: Option<Vector<'_>>,
    power: f64,
) -> Result<Mixer> {
    let bounds = signals.command_bounds.clone();
    let Some(matrix) = matrix else { return Ok(Mixer::direct(bounds, outputs)?) };
    let matrix = rows("mixer matrix", &matrix, outputs)?;
    let offset = offset.map_or_else(|| vec![0.0; bounds.len()], |offset| vector(&offset));
    Ok(Mixer::new(matrix, offset, power, bounds, outputs)?)
}

/// One controller of a family, with its memory.
#[pyclass(frozen, name = "Controller", module = "twinloop._core")]
pub struct PyController(Mutex<Controller>);

#[pymethods]
impl PyController {
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyArray1<f64>>> {
        Ok(to_vector(py, self.lock()?.parameters().collect()))
    }

    fn reset(&self) -> Result<()> {
        self.lock()?.reset();
        Ok(())
    }

    fn command<'py>(
        &self,
        py: Python<'py>,
        state: Vector<'py>,
        target: Vector<'py>,
    ) -> Result<Bound<'py, PyArray1<f64>>> {
        let command = self.lock()?.command(&vector(&state), &vector(&target))?;
        Ok(to_vector(py, command))
    }
}

impl PyController {
    fn lock(&self) -> Result<std::sync::MutexGuard<'_, Controller>> {
        self.0
            .lock()
            .map_err(|_| misuse("controller: expected one that has not panicked; make a new one".into()))
    }
}
