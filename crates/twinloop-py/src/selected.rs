//! Selected tests.

use std::sync::Arc;

use pyo3::prelude::*;
use twinloop_core::{Experiment, SelectedTests};

use crate::arrays::{Matrix, Vector, VectorOrRows, optional_rows, rows, vector};
use crate::error::{Result, given};
use crate::excitation::PyHoldBack;
use crate::setting::PySetting;

/// The tests that were run on the system, with their trajectories.
#[pyclass(frozen, name = "SelectedTests", module = "twinloop._core")]
pub struct PySelectedTests(pub Arc<SelectedTests>);

#[pymethods]
impl PySelectedTests {
    #[new]
    fn new(setting: &PySetting) -> Self {
        Self(Arc::new(SelectedTests::new(setting.0.clone())))
    }

    #[pyo3(signature = (parameters, target, states, commands, excitation = None, hold_back = None))]
    fn with_test(
        &self,
        parameters: Vector<'_>,
        #[pyo3(from_py_with = given)] target: VectorOrRows<'_>,
        states: Matrix<'_>,
        commands: Matrix<'_>,
        excitation: Option<Matrix<'_>>,
        hold_back: Option<&PyHoldBack>,
    ) -> Result<Self> {
        let signals = self.0.signals();
        let experiment = Experiment {
            parameters: vector(&parameters),
            target: target.numbers(),
            states: rows("states", &states, signals.states())?.concat(),
            commands: rows("commands", &commands, signals.commands())?.concat(),
            excitation: optional_rows("excitation", excitation, signals.commands())?.concat(),
            hold_back: hold_back.map(|found| found.0.clone()),
        };
        Ok(Self(Arc::new(self.0.with_test(experiment)?)))
    }

    /// These and a run that no test asked for.
    fn with_record(&self, states: Matrix<'_>, commands: Matrix<'_>) -> Result<Self> {
        let signals = self.0.signals();
        let (parameters, target, excitation) = Default::default();
        let experiment = Experiment {
            parameters,
            target,
            states: rows("states", &states, signals.states())?.concat(),
            commands: rows("commands", &commands, signals.commands())?.concat(),
            excitation,
            hold_back: None,
        };
        Ok(Self(Arc::new(self.0.with_test(experiment)?)))
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }
}
