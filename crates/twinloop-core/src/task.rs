//! A task: where runs start, where they should end, and how many steps they last.

use crate::difference::Periods;
use crate::error::{Result, invalid};

/// What candidate tests have in common where only the controller is searched.
#[derive(Clone, Debug, PartialEq)]
pub struct Task {
    /// First state η_1 (n_x).
    pub initial: Vec<f64>,
    /// State to lead to η_d: constant (n_x), or a row for each state ((n + 1) × n_x).
    pub target: Vec<f64>,
    /// Number of steps n.
    pub steps: usize,
}

impl Task {
    /// More steps than this are refused.
    pub const MOST_STEPS: usize = 10_000_000;

    /// Refuses a task that no run can have.
    pub fn new(initial: Vec<f64>, target: Vec<f64>, steps: usize) -> Result<Self> {
        if initial.is_empty() || !is_target(target.len(), initial.len(), steps) {
            return invalid(format!(
                "task: expected a target state of the same length as the initial one, or a row of it for each of {} \
                 states, found {} and {} numbers",
                steps.saturating_add(1),
                target.len(),
                initial.len()
            ));
        }
        if let Some(x) = initial.iter().chain(&target).find(|x| !x.is_finite()) {
            return invalid(format!("task: expected finite states, found {x}"));
        }
        if !(1..=Self::MOST_STEPS).contains(&steps) {
            return invalid(format!("task: expected 1 to {} steps, found {steps}", Self::MOST_STEPS));
        }
        Ok(Self { initial, target, steps })
    }

    /// ‖η_d − η_1‖: the final distance of a system that never moves.
    pub fn distance(&self, periods: &Periods) -> f64 {
        periods.distance(&self.initial, target_at(&self.target, self.initial.len(), self.steps))
    }
}

/// Whether so many numbers are a target of n_x states: constant, or a row for each state of a run.
pub(crate) fn is_target(numbers: usize, n_x: usize, steps: usize) -> bool {
    numbers == n_x || Some(numbers) == steps.checked_add(1).and_then(|rows| rows.checked_mul(n_x))
}

/// The state that a target asks for at state k of a run (n_x).
#[inline(always)]
pub(crate) fn target_at<T>(target: &[T], n_x: usize, k: usize) -> &[T] {
    if target.len() == n_x { target } else { &target[k * n_x..][..n_x] }
}
