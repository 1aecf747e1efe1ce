//! Workers.

use std::sync::Arc;

use pyo3::prelude::*;
use twinloop_core::{Width, Workers};

use crate::error::{Result, given};

/// How work is carried out, never what comes out: a number of threads and a vector width.
#[pyclass(frozen, name = "Workers", module = "twinloop._core")]
pub struct PyWorkers(pub Arc<Workers>);

#[pymethods]
impl PyWorkers {
    #[new]
    #[pyo3(signature = (threads = 1, width = "auto"))]
    fn new(#[pyo3(from_py_with = given)] threads: usize, width: &str) -> Result<Self> {
        Ok(Self(Arc::new(Workers::new(threads, width.parse()?)?)))
    }

    #[getter]
    fn threads(&self) -> usize {
        self.0.threads()
    }

    #[getter]
    fn width(&self) -> &'static str {
        self.0.width().name()
    }
}

/// The workers that were given, or one thread of the widest vectors.
pub fn or_default(workers: Option<&PyWorkers>) -> Result<Arc<Workers>> {
    match workers {
        Some(workers) => Ok(workers.0.clone()),
        None => Ok(Arc::new(Workers::new(1, Width::widest())?)),
    }
}

/// Vector widths that this processor has, narrowest first.
#[pyfunction]
pub fn vector_widths() -> Vec<&'static str> {
    Width::available().into_iter().map(Width::name).collect()
}
