//! Families of controllers, and one controller with its memory.

use std::sync::{Arc, Mutex, MutexGuard};

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::sync::MutexExt;
use twinloop_core::{AnyLaw, Axis, Controller, Family, Gain, Mixer, Outer, Pid, Signals, StateFeedback};

use crate::arrays::{Matrix, Vector, optional_rows, rows, to_matrix, to_vector, vector};
use crate::error::{Result, given, misuse};
use crate::excitation::PyHoldBack;
use crate::law::{PythonLaw, raised};
use crate::model::PySignals;

/// A family of controllers: a bounded parameter vector and a law, one implementation for search and real run.
#[pyclass(frozen, name = "Family", module = "twinloop._core")]
pub struct PyFamily(pub Arc<Family>);

/// A number that fixes a gain, or (low, high, logarithmic).
#[derive(FromPyObject)]
pub enum GainBounds {
    Fixed(f64),
    Free(f64, f64, bool),
}

impl From<GainBounds> for Gain {
    fn from(bounds: GainBounds) -> Self {
        match bounds {
            GainBounds::Fixed(value) => Self::Fixed(value),
            GainBounds::Free(low, high, logarithmic) => Self::Free { low, high, logarithmic },
        }
    }
}

/// Matrix (n_u, outputs), offset (n_u,) and power of the map from a law's outputs to the commands.
type OutputMap<'py> = (Matrix<'py>, Vector<'py>, f64);

#[pymethods]
impl PyFamily {
    #[staticmethod]
    #[pyo3(signature = (signals, axes, gains, output = None, *, derivative_filter = 0.0, anti_windup = false))]
    fn pid(
        signals: &PySignals,
        #[pyo3(from_py_with = given)] axes: Vec<(usize, Option<usize>)>,
        #[pyo3(from_py_with = given)] gains: Vec<GainBounds>,
        #[pyo3(from_py_with = given)] output: Option<OutputMap<'_>>,
        #[pyo3(from_py_with = given)] derivative_filter: f64,
        anti_windup: bool,
    ) -> Result<Self> {
        let axes = axes.into_iter().map(|(state, rate)| Axis { state, rate, outer: None }).collect();
        Self::of_axes(&signals.0, axes, gains, output, derivative_filter, anti_windup)
    }

    #[staticmethod]
    #[pyo3(signature = (signals, axes, gains, output = None, *, derivative_filter = 0.0, anti_windup = false))]
    fn cascade(
        signals: &PySignals,
        #[pyo3(from_py_with = given)] axes: Vec<(usize, usize, f64)>,
        #[pyo3(from_py_with = given)] gains: Vec<GainBounds>,
        #[pyo3(from_py_with = given)] output: Option<OutputMap<'_>>,
        #[pyo3(from_py_with = given)] derivative_filter: f64,
        anti_windup: bool,
    ) -> Result<Self> {
        let axis = |(angle, state, limit)| Axis { state, rate: None, outer: Some(Outer { angle, limit }) };
        let axes = axes.into_iter().map(axis).collect();
        Self::of_axes(&signals.0, axes, gains, output, derivative_filter, anti_windup)
    }

    #[staticmethod]
    #[pyo3(signature = (signals, states, integrals, outputs, gains, output = None))]
    fn state_feedback(
        signals: &PySignals,
        #[pyo3(from_py_with = given)] states: Vec<usize>,
        #[pyo3(from_py_with = given)] integrals: Vec<usize>,
        #[pyo3(from_py_with = given)] outputs: usize,
        #[pyo3(from_py_with = given)] gains: Vec<GainBounds>,
        #[pyo3(from_py_with = given)] output: Option<OutputMap<'_>>,
    ) -> Result<Self> {
        let signals = &signals.0;
        let output = output_map(signals, outputs, output)?;
        let feedback = StateFeedback { states, integrals, outputs, output, dt: signals.dt };
        Self::of_law(feedback, gains, signals)
    }

    #[staticmethod]
    fn python(
        signals: &PySignals,
        make: Py<PyAny>,
        #[pyo3(from_py_with = given)] gains: Vec<GainBounds>,
    ) -> Result<Self> {
        let signals = &signals.0;
        let law = Arc::new(PythonLaw { make, gains: gains.len() });
        let gains = gains.into_iter().map(Gain::from).collect();
        let family = Family::foreign(law, gains, signals.states(), signals.command_bounds.clone())?;
        Ok(Self(Arc::new(family.with_periods(signals.periods.clone()))))
    }

    #[getter]
    fn size(&self) -> usize {
        self.0.parameters().len()
    }

    fn places<'py>(&self, py: Python<'py>, parameters: Matrix<'_>) -> Result<Bound<'py, PyArray2<f64>>> {
        self.row_by_row(py, "parameters", &parameters, |row| self.0.parameters().places(row))
    }

    fn at<'py>(&self, py: Python<'py>, places: Matrix<'_>) -> Result<Bound<'py, PyArray2<f64>>> {
        self.row_by_row(py, "places", &places, |row| self.0.parameters().at(row))
    }

    #[pyo3(signature = (parameters, excitation = None, hold_back = None))]
    fn controller(
        &self,
        parameters: Vector<'_>,
        excitation: Option<Matrix<'_>>,
        hold_back: Option<&PyHoldBack>,
    ) -> Result<PyController> {
        let controller = Controller::new(self.0.clone(), vector(&parameters))?;
        raised()?;
        let excitation = optional_rows("excitation", excitation, self.0.commands())?.concat();
        Ok(PyController(Mutex::new(controller.excited(&excitation, hold_back.map(|found| &found.0))?)))
    }
}

impl PyFamily {
    fn row_by_row<'py>(
        &self,
        py: Python<'py>,
        name: &str,
        array: &Matrix<'_>,
        mapped: impl Fn(&[f64]) -> Vec<f64>,
    ) -> Result<Bound<'py, PyArray2<f64>>> {
        let size = self.0.parameters().len();
        let found: Vec<f64> = rows(name, array, size)?.iter().flat_map(|row| mapped(row)).collect();
        Ok(to_matrix(py, size, found))
    }

    fn of_law(law: impl Into<AnyLaw>, gains: Vec<GainBounds>, signals: &Signals) -> Result<Self> {
        let gains = gains.into_iter().map(Gain::from).collect();
        let family = Family::new(law, gains, signals.states())?;
        Ok(Self(Arc::new(family.with_periods(signals.periods.clone()))))
    }

    fn of_axes(
        signals: &Signals,
        axes: Vec<Axis>,
        gains: Vec<GainBounds>,
        output: Option<OutputMap<'_>>,
        derivative_filter: f64,
        anti_windup: bool,
    ) -> Result<Self> {
        let output = output_map(signals, axes.len(), output)?;
        let pid = Pid::new(axes, output, signals.dt).filtered(derivative_filter)?;
        Self::of_law(if anti_windup { pid.with_anti_windup() } else { pid }, gains, signals)
    }
}

/// The map from a law's outputs to the commands; without one output i is command i.
fn output_map(signals: &Signals, outputs: usize, map: Option<OutputMap<'_>>) -> Result<Mixer> {
    let bounds = signals.command_bounds.clone();
    let Some((matrix, offset, power)) = map else { return Ok(Mixer::direct(bounds, outputs)?) };
    let matrix = rows("mixer matrix", &matrix, outputs)?;
    Ok(Mixer::new(matrix, vector(&offset), power, bounds, outputs)?)
}

/// One controller of a family, with its memory.
#[pyclass(frozen, name = "Controller", module = "twinloop._core")]
pub struct PyController(Mutex<Controller>);

#[pymethods]
impl PyController {
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyArray1<f64>>> {
        Ok(to_vector(py, self.lock(py)?.parameters().collect()))
    }

    fn reset(&self, py: Python<'_>) -> Result<()> {
        self.lock(py)?.reset();
        raised()
    }

    fn copied(&self, py: Python<'_>) -> Result<Self> {
        let controller = self.lock(py)?.copied();
        raised()?;
        Ok(Self(Mutex::new(controller)))
    }

    fn command<'py>(
        &self,
        py: Python<'py>,
        state: Vector<'py>,
        target: Vector<'py>,
    ) -> Result<Bound<'py, PyArray1<f64>>> {
        let command = self.lock(py)?.command(&vector(&state), &vector(&target))?;
        raised()?;
        Ok(to_vector(py, command))
    }
}

impl PyController {
    /// Another thread may wait, but not while Python does: a law in Python is called under the lock.
    fn lock(&self, py: Python<'_>) -> Result<MutexGuard<'_, Controller>> {
        self.0
            .lock_py_attached(py)
            .map_err(|_| misuse("controller: expected one that has not panicked; make a new one".into()))
    }
}
