//! Looking ahead in the midst of a flight.

use std::sync::{Mutex, MutexGuard};

use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::sync::MutexExt;
use twinloop_core::{Ahead, LookAhead};

use crate::arrays::{Matrix, Vector, VectorOrRows, optional_rows, rows, to_vector, vector};
use crate::error::{Result, given, misuse};
use crate::excitation::PyHoldBack;
use crate::model::{PyModel, owned};
use crate::setting::PySetting;

/// Where a flight is, and what a committee says of the periods to come.
#[pyclass(frozen, name = "LookAhead", module = "twinloop._core")]
pub struct PyLookAhead(Mutex<LookAhead>);

#[pymethods]
impl PyLookAhead {
    #[new]
    #[pyo3(signature = (
        members, setting, parameters, target, steps, envelope, *, excitation = None, hold_back = None
    ))]
    #[expect(clippy::too_many_arguments, reason = "what a flight is, named by keyword in Python")]
    fn new(
        members: Vec<Bound<'_, PyModel>>,
        setting: &PySetting,
        parameters: Vector<'_>,
        #[pyo3(from_py_with = given)] target: VectorOrRows<'_>,
        #[pyo3(from_py_with = given)] steps: usize,
        envelope: Matrix<'_>,
        excitation: Option<Matrix<'_>>,
        hold_back: Option<&PyHoldBack>,
    ) -> Result<Self> {
        let signals = setting.0.signals();
        let bounds = rows("envelope", &envelope, 2)?;
        let flight = Ahead {
            setting: setting.0.clone(),
            parameters: vector(&parameters),
            target: target.numbers(),
            excitation: optional_rows("excitation", excitation, signals.commands())?.concat(),
            hold_back: hold_back.map(|found| found.0.clone()),
            steps,
            envelope: bounds.iter().map(|row| (row[0], row[1])).collect(),
        };
        Ok(Self(Mutex::new(LookAhead::new(owned(&members), flight)?)))
    }

    fn reset(&self, py: Python<'_>) -> Result<()> {
        self.lock(py)?.reset();
        Ok(())
    }

    fn leaving(
        &self,
        py: Python<'_>,
        reading: Vector<'_>,
        #[pyo3(from_py_with = given)] horizon: usize,
    ) -> Result<Option<(usize, usize, usize)>> {
        let found = self.lock(py)?.leaving(&vector(&reading), horizon)?;
        Ok(found.map(|leaving| (leaving.periods, leaving.state, leaving.member)))
    }

    fn sent(
        &self,
        py: Python<'_>,
        reading: Vector<'_>,
        target: Vector<'_>,
        command: Vector<'_>,
    ) -> Result<()> {
        Ok(self.lock(py)?.sent(&vector(&reading), &vector(&target), &vector(&command))?)
    }

    fn following<'py>(
        &self,
        py: Python<'py>,
        state: Vector<'_>,
        command: Vector<'_>,
    ) -> Result<Bound<'py, PyArray1<f64>>> {
        Ok(to_vector(py, self.lock(py)?.following(&vector(&state), &vector(&command))?))
    }
}

impl PyLookAhead {
    fn lock(&self, py: Python<'_>) -> Result<MutexGuard<'_, LookAhead>> {
        self.0
            .lock_py_attached(py)
            .map_err(|_| misuse("look-ahead: expected one that has not panicked; make a new one".into()))
    }
}
