//! What holds an excitation back.

use pyo3::prelude::*;
use twinloop_core::HoldBack;

use crate::arrays::{Matrix, rows};
use crate::error::Result;

/// How much of an excitation is sent, by what the states do.
#[pyclass(frozen, name = "HoldBack", module = "twinloop._core")]
pub struct PyHoldBack(pub HoldBack);

#[pymethods]
impl PyHoldBack {
    #[new]
    fn new(full: Matrix<'_>, none: Matrix<'_>) -> Result<Self> {
        let ranges = |name, matrix: &Matrix<'_>| -> Result<Vec<(f64, f64)>> {
            Ok(rows(name, matrix, 2)?.iter().map(|row| (row[0], row[1])).collect())
        };
        Ok(Self(HoldBack::new(&ranges("inner ranges", &full)?, &ranges("outer ranges", &none)?)?))
    }
}
