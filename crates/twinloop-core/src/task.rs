//! A task: where runs start, where they should end, and how many steps they last.

use crate::difference::Periods;
use crate::error::{Result, invalid};

/// What candidate tests have in common where only the controller is searched.
#[derive(Clone, Debug, PartialEq)]
pub struct Task {
    /// First state η_1 (n_x).
    pub initial: Vec<f64>,
    /// State to lead to η_d (n_x).
    pub target: Vec<f64>,
    /// Number of steps n.
    pub steps: usize,
}

impl Task {
    /// More steps than this are refused.
    pub const MOST_STEPS: usize = 10_000_000;

    /// Refuses a task that no run can have.
    pub fn new(initial: Vec<f64>, target: Vec<f64>, steps: usize) -> Result<Self> {
        if initial.len() != target.len() || initial.is_empty() {
            return invalid(format!(
                "task: expected an initial and a target state of the same length, found {} and {}",
                initial.len(),
                target.len()
            ));
        }
        if !initial.iter().chain(&target).all(|x| x.is_finite()) || !(1..=Self::MOST_STEPS).contains(&steps) {
            return invalid(format!(
                "task: expected finite states and 1 to {} steps, found {steps}",
                Self::MOST_STEPS
            ));
        }
        Ok(Self { initial, target, steps })
    }

    /// ‖η_d − η_1‖: the final distance of a system that never moves.
    pub fn distance(&self, periods: &Periods) -> f64 {
        periods.distance(&self.initial, &self.target)
    }
}
