//! Streams of random numbers, by the units of work that draw them.

use std::sync::Mutex;

use numpy::ndarray::ArrayD;
use numpy::{IntoPyArray, PyArrayDyn};
use pyo3::prelude::*;
use twinloop_core::{Purpose, Stream, Unit};

use crate::error::{Result, given, misuse};

/// A unit of work: a seed, what its numbers are for, and the numbers that lead to it.
#[derive(FromPyObject)]
pub struct Name(u64, String, Vec<u64>);

impl Name {
    /// The same for the engine.
    pub fn unit(&self) -> Result<Unit> {
        Ok(Unit::new(self.0, self.1.parse()?, &self.2)?)
    }
}

/// More numbers at once, or axes of an array, than these are refused.
const MOST_DRAWN: usize = 1 << 32;
const MOST_AXES: usize = 32;

/// The random numbers of one unit of work, one after another.
#[pyclass(frozen, name = "Stream", module = "twinloop._core")]
pub struct PyStream(Mutex<Stream>);

#[pymethods]
impl PyStream {
    #[new]
    fn new(#[pyo3(from_py_with = given)] unit: Name) -> Result<Self> {
        Ok(Self(Mutex::new(unit.unit()?.stream(0))))
    }

    /// One number, uniform between two, the first included.
    #[pyo3(signature = (low = 0.0, high = 1.0))]
    fn uniform(
        &self,
        #[pyo3(from_py_with = given)] low: f64,
        #[pyo3(from_py_with = given)] high: f64,
    ) -> Result<f64> {
        self.drawn(|stream| low + (high - low) * stream.uniform())
    }

    /// One of 0, …, n − 1.
    fn below(&self, #[pyo3(from_py_with = given)] n: usize) -> Result<usize> {
        if n == 0 {
            return Err(misuse("below: expected at least 1 number to draw from, found 0".into()));
        }
        self.drawn(|stream| stream.below(n))
    }

    /// One number, log-uniform between two above 0.
    fn log_uniform(
        &self,
        #[pyo3(from_py_with = given)] low: f64,
        #[pyo3(from_py_with = given)] high: f64,
    ) -> Result<f64> {
        if !(0.0 < low && low <= high && high.is_finite()) {
            return Err(misuse(format!("log_uniform: expected 0 < low <= high, found {low} and {high}")));
        }
        self.drawn(|stream| stream.log_uniform(low, high))
    }

    /// An array of a shape, uniform in [0, 1).
    #[pyo3(signature = (*shape))]
    fn uniforms<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = given)] shape: Vec<usize>,
    ) -> Result<Bound<'py, PyArrayDyn<f64>>> {
        self.array(py, &shape, Stream::uniform)
    }

    /// An array of a shape, standard normal.
    #[pyo3(signature = (*shape))]
    fn normals<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = given)] shape: Vec<usize>,
    ) -> Result<Bound<'py, PyArrayDyn<f64>>> {
        self.array(py, &shape, Stream::gaussian)
    }
}

impl PyStream {
    fn drawn<T>(&self, draw: impl FnOnce(&mut Stream) -> T) -> Result<T> {
        match self.0.lock() {
            Ok(mut stream) => Ok(draw(&mut stream)),
            Err(_) => Err(misuse("stream: expected one that has not panicked; make a new one".into())),
        }
    }

    fn array<'py>(
        &self,
        py: Python<'py>,
        shape: &[usize],
        draw: impl Fn(&mut Stream) -> f64,
    ) -> Result<Bound<'py, PyArrayDyn<f64>>> {
        let count = shape.iter().try_fold(1_usize, |count, &length| count.checked_mul(length));
        if shape.len() > MOST_AXES || count.is_none_or(|count| count > MOST_DRAWN) {
            return Err(misuse(format!(
                "stream: expected at most {MOST_AXES} axes and {MOST_DRAWN} numbers, found the shape {shape:?}"
            )));
        }
        let drawn = self.drawn(|stream| ArrayD::from_shape_simple_fn(shape, || draw(stream)))?;
        Ok(drawn.into_pyarray(py))
    }
}

/// Names of what random numbers may be for.
#[pyfunction]
pub fn purposes() -> Vec<&'static str> {
    Purpose::ALL.iter().map(|(name, _)| *name).collect()
}
