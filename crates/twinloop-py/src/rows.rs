//! Rows of states and commands that know nothing of each other.

use twinloop_core::{AnyDynamics, Width, step_rows};

use crate::arrays::{Cube, Matrix, optional_blocks, rows, views};
use crate::error::{Result, misuse};

/// States (rows, n_x), commands (rows, n_u), and what was commanded before (rows, p, n_u), if anything was.
pub struct Rows {
    states: Vec<Vec<f64>>,
    commands: Vec<Vec<f64>>,
    past: Vec<Vec<f64>>,
}

impl Rows {
    /// Refuses different numbers of rows, and columns that are not those of the dynamics.
    pub fn new(
        states: &Matrix<'_>,
        commands: &Matrix<'_>,
        past: Option<Cube<'_>>,
        n_x: usize,
        n_u: usize,
    ) -> Result<Self> {
        let (states, commands) = (rows("states", states, n_x)?, rows("commands", commands, n_u)?);
        if states.len() != commands.len() {
            let (x, u) = (states.len(), commands.len());
            return Err(misuse(format!("expected as many states as commands, found {x} and {u}")));
        }
        let periods = past.as_ref().map_or(0, |past| past.as_array().shape()[1]);
        let past = optional_blocks("past", past, [states.len(), periods, n_u])?;
        Ok(Self { states, commands, past })
    }

    /// The next states.
    pub fn step(&self, dynamics: AnyDynamics<'_>, width: Width) -> Vec<f64> {
        step_rows(dynamics, &views(&self.states), &views(&self.commands), &views(&self.past), width)
    }
}
