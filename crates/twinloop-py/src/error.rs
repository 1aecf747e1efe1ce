//! Misuse of the engine becomes a `ValueError` with the engine's own sentence.

use pyo3::PyErr;
use pyo3::exceptions::PyValueError;

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
            CoreError::Engine(error) => PyValueError::new_err(error.to_string()),
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
