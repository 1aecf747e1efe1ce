//! Elementary functions over arrays, with the same bits on every processor.

use numpy::ndarray::IxDyn;
use numpy::{IntoPyArray, PyArrayDyn};
use pyo3::prelude::*;

use crate::arrays::Numbers;
use crate::error::given;

/// An argument of any shape.
type Array<'py> = Numbers<'py, IxDyn>;

fn each<'py>(py: Python<'py>, x: &Array<'py>, function: fn(f64) -> f64) -> Bound<'py, PyArrayDyn<f64>> {
    x.as_array().mapv(function).into_pyarray(py)
}

/// e to the power of each number.
#[pyfunction]
pub fn exp<'py>(py: Python<'py>, x: Array<'py>) -> Bound<'py, PyArrayDyn<f64>> {
    each(py, &x, libm::exp)
}

/// The natural logarithm of each number.
#[pyfunction]
pub fn log<'py>(py: Python<'py>, x: Array<'py>) -> Bound<'py, PyArrayDyn<f64>> {
    each(py, &x, libm::log)
}

/// The sine of each angle.
#[pyfunction]
pub fn sin<'py>(py: Python<'py>, x: Array<'py>) -> Bound<'py, PyArrayDyn<f64>> {
    each(py, &x, libm::sin)
}

/// The cosine of each angle.
#[pyfunction]
pub fn cos<'py>(py: Python<'py>, x: Array<'py>) -> Bound<'py, PyArrayDyn<f64>> {
    each(py, &x, libm::cos)
}

/// The hyperbolic tangent of each number.
#[pyfunction]
pub fn tanh<'py>(py: Python<'py>, x: Array<'py>) -> Bound<'py, PyArrayDyn<f64>> {
    each(py, &x, libm::tanh)
}

/// x to the power of y, both numbers.
#[pyfunction]
pub fn power(#[pyo3(from_py_with = given)] x: f64, #[pyo3(from_py_with = given)] y: f64) -> f64 {
    libm::pow(x, y)
}
