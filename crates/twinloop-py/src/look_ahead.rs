//! Looking ahead in the midst of a flight.

use std::sync::{Arc, Mutex, MutexGuard};

use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::sync::MutexExt;
use twinloop_core::{Ahead, Frame, Learnt, LookAhead, Model};

use crate::arrays::{Matrix, Vector, VectorOrRows, optional_rows, rows, to_vector, vector};
use crate::error::{Result, misuse};
use crate::excitation::PyHoldBack;
use crate::model::PyModel;
use crate::setting::PySetting;

/// Where a flight is, and what a committee says of the periods to come.
#[pyclass(frozen, name = "LookAhead", module = "twinloop._core")]
pub struct PyLookAhead {
    members: Vec<(Arc<Learnt>, Arc<Frame>)>,
    states: usize,
    commands: usize,
    ahead: Mutex<LookAhead>,
}

#[pymethods]
impl PyLookAhead {
    #[new]
    #[pyo3(signature = (
        members, setting, parameters, target, steps, envelope, *, excitation = None, hold_back = None
    ))]
    #[expect(clippy::too_many_arguments, reason = "what a flight is, named by keyword in Python")]
    fn new(
        members: Vec<PyRef<'_, PyModel>>,
        setting: &PySetting,
        parameters: Vector<'_>,
        target: VectorOrRows<'_>,
        steps: usize,
        envelope: Matrix<'_>,
        excitation: Option<Matrix<'_>>,
        hold_back: Option<&PyHoldBack>,
    ) -> Result<Self> {
        let signals = setting.0.signals();
        for member in &members {
            member.fits(signals)?;
        }
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
        let members: Vec<_> =
            members.iter().map(|member| (member.learnt.clone(), member.frame.clone())).collect();
        let ahead = Mutex::new(LookAhead::new(&models(&members), flight)?);
        Ok(Self { members, states: signals.states(), commands: signals.commands(), ahead })
    }

    fn reset(&self, py: Python<'_>) -> Result<()> {
        self.lock(py)?.reset(&models(&self.members));
        Ok(())
    }

    fn leaving(
        &self,
        py: Python<'_>,
        reading: Vector<'_>,
        horizon: usize,
    ) -> Result<Option<(usize, usize, usize)>> {
        let reading = numbers("reading", &reading, self.states)?;
        let found = self.lock(py)?.leaving(&models(&self.members), &reading, horizon);
        Ok(found.map(|leaving| (leaving.periods, leaving.state, leaving.member)))
    }

    fn sent(
        &self,
        py: Python<'_>,
        reading: Vector<'_>,
        target: Vector<'_>,
        command: Vector<'_>,
    ) -> Result<()> {
        let reading = numbers("reading", &reading, self.states)?;
        let target = numbers("target", &target, self.states)?;
        let command = numbers("command", &command, self.commands)?;
        self.lock(py)?.sent(&models(&self.members), &reading, &target, &command);
        Ok(())
    }

    fn following<'py>(
        &self,
        py: Python<'py>,
        state: Vector<'_>,
        command: Vector<'_>,
    ) -> Result<Bound<'py, PyArray1<f64>>> {
        let state = numbers("state", &state, self.states)?;
        let command = numbers("command", &command, self.commands)?;
        let following = self.lock(py)?.following(&models(&self.members), &state, &command);
        Ok(to_vector(py, following))
    }
}

impl PyLookAhead {
    fn lock(&self, py: Python<'_>) -> Result<MutexGuard<'_, LookAhead>> {
        self.ahead
            .lock_py_attached(py)
            .map_err(|_| misuse("look-ahead: expected one that has not panicked; make a new one".into()))
    }
}

/// The engine's views of the members.
fn models(members: &[(Arc<Learnt>, Arc<Frame>)]) -> Vec<Model<'_>> {
    members.iter().map(|(learnt, frame)| Model { code: &learnt.code, frame }).collect()
}

/// So many finite numbers.
fn numbers(what: &str, found: &Vector<'_>, expected: usize) -> Result<Vec<f64>> {
    let found = vector(found);
    if found.len() == expected && found.iter().all(|x| x.is_finite()) {
        return Ok(found);
    }
    Err(misuse(format!("look-ahead: expected a {what} of {expected} finite numbers, found {found:?}")))
}
