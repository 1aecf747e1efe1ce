//! Laws written in Python. The engine calls them on the thread that asked for the work, one controller at a time.

use std::cell::RefCell;

use pyo3::prelude::*;
use pyo3::types::PyList;
use twinloop_core::{ForeignController, ForeignLaw};

use crate::arrays::{Vector, to_vector, vector};
use crate::error::{Result, misuse};

thread_local! {
    /// The first exception of a law since the engine was called on this thread; from then on its commands are NaN.
    static FAILURE: RefCell<Option<PyErr>> = const { RefCell::new(None) };
}

/// Lets the engine work, and raises what a law has raised meanwhile.
pub fn flown<T: Send>(py: Python<'_>, work: impl Send + FnOnce() -> T) -> Result<T> {
    let value = py.detach(work);
    raised()?;
    Ok(value)
}

/// Raises what a law has raised on this thread.
pub fn raised() -> Result<()> {
    FAILURE.take().map_or(Ok(()), |error| Err(error.into()))
}

/// Calls Python unless a law has failed already; nothing if it fails now.
fn call<T>(body: impl FnOnce(Python<'_>) -> PyResult<T>) -> Option<T> {
    if FAILURE.with_borrow(Option::is_some) {
        return None;
    }
    Python::attach(body).map_err(|error| FAILURE.set(Some(error))).ok()
}

/// What makes a controller of a list of gains.
#[derive(Debug)]
pub struct PythonLaw {
    pub make: Py<PyAny>,
    pub gains: usize,
}

impl ForeignLaw for PythonLaw {
    fn gains(&self) -> usize {
        self.gains
    }

    fn start(&self, gains: &[f64]) -> Box<dyn ForeignController> {
        let controller = call(|py| self.make.call1(py, (PyList::new(py, gains)?,)));
        let mut controller = PythonController(controller);
        controller.reset();
        Box::new(controller)
    }
}

/// One controller, unless its law failed to make it.
struct PythonController(Option<Py<PyAny>>);

impl ForeignController for PythonController {
    fn reset(&mut self) {
        if let Some(controller) = &self.0 {
            call(|py| controller.call_method0(py, "reset"));
        }
    }

    fn command(&mut self, state: &[f64], target: &[f64], command: &mut [f64]) {
        let Some(controller) = &self.0 else { return };
        let found = call(|py| {
            let arguments = (to_vector(py, state.to_vec()), to_vector(py, target.to_vec()));
            let answer = controller.call_method1(py, "command", arguments)?.into_bound(py);
            let found = answer.extract::<Vector<'_>>().map(|found| vector(&found)).unwrap_or_default();
            if found.len() != command.len() || !found.iter().all(|x| x.is_finite()) {
                return Err(misuse(format!(
                    "controller in Python: expected a command of {} finite numbers, found {}; mend its command(state, \
                     target)",
                    command.len(),
                    answer.repr()?
                ))
                .into());
            }
            Ok(found)
        });
        if let Some(found) = found {
            command.copy_from_slice(&found);
        }
    }

    fn copied(&self) -> Box<dyn ForeignController> {
        let copy = |controller: &Py<PyAny>| {
            call(|py| Ok(py.import("copy")?.call_method1("deepcopy", (controller,))?.unbind()))
        };
        Box::new(Self(self.0.as_ref().and_then(copy)))
    }
}
