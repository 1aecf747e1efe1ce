//! Misuse of the engine becomes a `ValueError` with the engine's own sentence.

use pyo3::PyErr;
use pyo3::exceptions::PyValueError;

/// An error of the engine on its way to Python.
pub struct CoreError(twinloop_core::Error);

impl From<twinloop_core::Error> for CoreError {
    fn from(error: twinloop_core::Error) -> Self {
        Self(error)
    }
}

impl From<CoreError> for PyErr {
    fn from(error: CoreError) -> Self {
        PyValueError::new_err(error.0.to_string())
    }
}

/// Result of a binding that can only fail in the engine.
pub type Result<T> = std::result::Result<T, CoreError>;

/// A misuse that only the binding can see.
pub fn misuse(sentence: String) -> CoreError {
    CoreError(twinloop_core::Error::Invalid(sentence))
}
