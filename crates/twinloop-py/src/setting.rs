//! Settings: what runs are flown in.

use std::sync::Arc;

use pyo3::prelude::*;
use twinloop_core::{Limits, Setting};

use crate::controller::PyFamily;
use crate::error::{Result, given};
use crate::model::PySignals;

/// Where runs of a system count as diverged: at a multiple of the scale of a state.
#[pyclass(frozen, name = "Limits", module = "twinloop._core")]
pub struct PyLimits(pub Limits);

#[pymethods]
impl PyLimits {
    #[new]
    #[pyo3(signature = (signals, divergence_factor = 10.0))]
    fn new(signals: &PySignals, #[pyo3(from_py_with = given)] divergence_factor: f64) -> Result<Self> {
        Ok(Self(Limits::new(signals.0.clone(), divergence_factor)?))
    }
}

/// Limits, and controllers for the same signals.
#[pyclass(frozen, name = "Setting", module = "twinloop._core")]
pub struct PySetting(pub Arc<Setting>);

#[pymethods]
impl PySetting {
    #[new]
    fn new(limits: &PyLimits, family: &PyFamily) -> Result<Self> {
        Ok(Self(Arc::new(Setting::new(limits.0.clone(), family.0.clone())?)))
    }
}
