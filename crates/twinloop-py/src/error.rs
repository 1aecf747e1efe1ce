//! Misuse of the engine becomes an `InvalidInput` with the engine's own sentence.

use pyo3::conversion::FromPyObjectOwned;
use pyo3::exceptions::{PyOverflowError, PyTypeError, PyValueError};
use pyo3::prelude::*;

pyo3::import_exception!(twinloop.errors, InvalidInput);

/// An error on its way to Python: of the engine, or of what the engine has called there.
pub enum CoreError {
    Engine(twinloop_core::Error),
    Python(PyErr),
}

impl From<twinloop_core::Error> for CoreError {
    fn from(error: twinloop_core::Error) -> Self {
        Self::Engine(error)
    }
}

impl From<PyErr> for CoreError {
    fn from(error: PyErr) -> Self {
        Self::Python(error)
    }
}

impl From<CoreError> for PyErr {
    fn from(error: CoreError) -> Self {
        match error {
            CoreError::Engine(error) => invalid(error.to_string()),
            CoreError::Python(error) => error,
        }
    }
}

/// Result of a binding.
pub type Result<T> = std::result::Result<T, CoreError>;

/// A misuse that only the binding can see.
pub fn misuse(sentence: String) -> CoreError {
    CoreError::Engine(twinloop_core::Error::Invalid(sentence))
}

/// An argument that is a number, a list or a tuple, or our refusal: `from_py_with` of each of them.
pub fn given<'py, T: FromPyObjectOwned<'py>>(argument: &Bound<'py, PyAny>) -> PyResult<T> {
    argument.extract::<T>().map_err(Into::into).map_err(|error| refused(argument.py(), "", error))
}

/// PyO3's error for an argument that it cannot convert, as ours; anything else, such as Ctrl-C, as it is.
pub fn refused(py: Python<'_>, expected: &str, error: PyErr) -> PyErr {
    let of_conversion = error.is_instance_of::<PyTypeError>(py)
        || error.is_instance_of::<PyValueError>(py)
        || error.is_instance_of::<PyOverflowError>(py);
    if !of_conversion || error.is_instance_of::<InvalidInput>(py) {
        return error;
    }
    let refusal = invalid(format!("{expected}{}", error.value(py)));
    refusal.set_cause(py, Some(error));
    refusal
}

fn invalid(mut sentence: String) -> PyErr {
    if !sentence.ends_with(['.', '?']) {
        sentence.push('.');
    }
    InvalidInput::new_err(sentence)
}
