//! Selected tests.

use std::sync::Arc;

use pyo3::prelude::*;
use twinloop_core::{Experiment, SelectedTests};

use crate::arrays::{Matrix, Vector, VectorOrRows, optional_rows, rows, vector};
use crate::controller::PyFamily;
use crate::error::Result;
use crate::model::PySignals;

/// The tests that were run on the system, with their trajectories.
#[pyclass(frozen, name = "SelectedTests", module = "twinloop._core")]
pub struct PySelectedTests(pub Arc<SelectedTests>);

#[pymethods]
impl PySelectedTests {
    #[new]
    #[pyo3(signature = (signals, family, divergence_factor = 10.0))]
    fn new(signals: &PySignals, family: &PyFamily, divergence_factor: f64) -> Result<Self> {
        let selected = SelectedTests::new(signals.0.clone(), family.0.clone(), divergence_factor)?;
        Ok(Self(Arc::new(selected)))
    }

    #[pyo3(signature = (parameters, target, states, commands, excitation = None))]
    fn with_test(
        &self,
        parameters: Vector<'_>,
        target: VectorOrRows<'_>,
        states: Matrix<'_>,
        commands: Matrix<'_>,
        excitation: Option<Matrix<'_>>,
    ) -> Result<Self> {
        let signals = self.0.signals();
        let experiment = Experiment {
            parameters: vector(&parameters),
            target: target.numbers(),
            states: rows("states", &states, signals.states())?.concat(),
            commands: rows("commands", &commands, signals.commands())?.concat(),
            excitation: optional_rows("excitation", excitation, signals.commands())?.concat(),
        };
        Ok(Self(Arc::new(self.0.with_test(experiment)?)))
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }
}
