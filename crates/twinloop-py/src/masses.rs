//! Masses behind gaps.

use numpy::PyArray2;
use pyo3::prelude::*;
use twinloop_core::{Mass, Play};

use crate::arrays::{Matrix, rows, to_matrix};
use crate::error::{Result, given};

/// What presses on a mass, and its rate, at the start, the middle and the end of each period of a run (n, 6), by the rates of
/// what drives it at these times (n, 3).
#[pyfunction]
pub fn behind_gap<'py>(
    py: Python<'py>,
    #[pyo3(from_py_with = given)] mass: (f64, f64, f64, f64),
    rates: Matrix<'py>,
    #[pyo3(from_py_with = given)] dt: f64,
) -> Result<Bound<'py, PyArray2<f64>>> {
    let (turns, half, damping, time) = mass;
    let rates: Vec<[f64; 3]> = rows("rates", &rates, 3)?.iter().map(|row| [row[0], row[1], row[2]]).collect();
    let found = Mass { turns, play: Play { half, damping }, time }.driven(&rates, dt);
    Ok(to_matrix(py, 6, found.concat().concat()))
}
