//! Built-in plants.

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use twinloop_core::{AnyDynamics, Quadrotor};

use crate::arrays::{Cube, Matrix, Vector, to_matrix, to_vector, vector};
use crate::error::{Result, given};
use crate::rows::Rows;
use crate::workers::{PyWorkers, or_default};

/// Attitude dynamics of a quadrotor under four rotor speeds, one Runge–Kutta step a period.
#[pyclass(frozen, name = "Quadrotor", module = "twinloop._core")]
pub struct PyQuadrotor(pub Quadrotor);

#[pymethods]
impl PyQuadrotor {
    #[new]
    #[expect(clippy::too_many_arguments, reason = "the constants of a vehicle, named by keyword in Python")]
    #[pyo3(signature = (dt, *, arm, inertia, rotor_inertia, thrust_factor, drag_factor, gyroscopic, drag = [0.0; 3], motor_lag = 0.0, hover_speed = 0.0))]
    fn new(
        #[pyo3(from_py_with = given)] dt: f64,
        #[pyo3(from_py_with = given)] arm: f64,
        #[pyo3(from_py_with = given)] inertia: [f64; 3],
        #[pyo3(from_py_with = given)] rotor_inertia: f64,
        #[pyo3(from_py_with = given)] thrust_factor: f64,
        #[pyo3(from_py_with = given)] drag_factor: f64,
        gyroscopic: &str,
        #[pyo3(from_py_with = given)] drag: [f64; 3],
        #[pyo3(from_py_with = given)] motor_lag: f64,
        #[pyo3(from_py_with = given)] hover_speed: f64,
    ) -> Result<Self> {
        let gyroscopic = gyroscopic.parse()?;
        let plant = Quadrotor {
            dt,
            arm,
            inertia,
            rotor_inertia,
            thrust_factor,
            drag_factor,
            gyroscopic,
            drag,
            motor_lag,
            hover_speed,
        };
        Ok(Self(plant.validated()?))
    }

    fn derivative<'py>(
        &self,
        py: Python<'py>,
        state: Vector<'py>,
        command: Vector<'py>,
    ) -> Result<Bound<'py, PyArray1<f64>>> {
        Ok(to_vector(py, self.0.slope(&vector(&state), &vector(&command))?))
    }

    #[pyo3(signature = (states, commands, workers = None, past = None))]
    fn step<'py>(
        &self,
        py: Python<'py>,
        states: Matrix<'py>,
        commands: Matrix<'py>,
        workers: Option<&PyWorkers>,
        past: Option<Cube<'py>>,
    ) -> Result<Bound<'py, PyArray2<f64>>> {
        let rows = Rows::new(&states, &commands, past, 6, 4)?;
        let width = or_default(workers)?.width();
        let next = py.detach(|| rows.step(AnyDynamics::Quadrotor(&self.0), width));
        Ok(to_matrix(py, 6, next))
    }
}
