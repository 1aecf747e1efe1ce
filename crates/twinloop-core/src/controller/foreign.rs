//! A law outside of the engine, such as one written in Python: one controller at a time, on the thread that asked.

use std::fmt::Debug;

use crate::lanes::{Vector, numbers, vectors};

/// A law whose controllers the engine only calls.
pub trait ForeignLaw: Debug + Send + Sync {
    /// Number of its gains.
    fn gains(&self) -> usize;

    /// A controller of these gains, at the start of a run.
    fn start(&self, gains: &[f64]) -> Box<dyn ForeignController>;
}

/// One controller of such a law, with its own memory.
pub trait ForeignController: Send {
    /// Back to the start of a run.
    fn reset(&mut self);

    /// Writes the command (n_u) for a state and a target (n_x); to be called once a period.
    fn command(&mut self, state: &[f64], target: &[f64], command: &mut [f64]);

    /// The same in the midst of the same run, with a memory of its own.
    fn copied(&self) -> Box<dyn ForeignController>;
}

/// A controller for each lane.
#[inline(never)]
pub(super) fn start<V: Vector>(law: &dyn ForeignLaw, gains: &[V]) -> Vec<Box<dyn ForeignController>> {
    let gains = numbers(gains);
    (0..V::LANES).map(|l| law.start(&lane(&gains, l, V::LANES))).collect()
}

/// Asks the controller of each lane for its command, and clips it to the bounds.
#[inline(never)]
pub(super) fn ask<V: Vector>(
    controllers: &mut [Box<dyn ForeignController>],
    bounds: &[(f64, f64)],
    state: &[V],
    target: &[V],
    command: &mut [V],
) {
    command.copy_from_slice(&vectors(&asked(controllers, bounds, &numbers(state), &numbers(target))));
}

/// The same of interleaved numbers: of code that is only called there is one copy.
fn asked(
    controllers: &mut [Box<dyn ForeignController>],
    bounds: &[(f64, f64)],
    state: &[f64],
    target: &[f64],
) -> Vec<f64> {
    let lanes = controllers.len();
    let mut commands = vec![f64::NAN; bounds.len() * lanes];
    let mut own = vec![f64::NAN; bounds.len()];
    for (l, controller) in controllers.iter_mut().enumerate() {
        let state = lane(state, l, lanes);
        own.fill(f64::NAN);
        // A lane that has diverged runs on without anybody looking: it asks no more.
        if state.iter().all(|x| x.is_finite()) {
            controller.command(&state, &lane(target, l, lanes), &mut own);
        }
        for (j, (&command, &(low, high))) in own.iter().zip(bounds).enumerate() {
            commands[j * lanes + l] = command.clamp(low, high);
        }
    }
    commands
}

/// Numbers of one of several lanes.
fn lane(interleaved: &[f64], l: usize, lanes: usize) -> Vec<f64> {
    interleaved.iter().skip(l).step_by(lanes).copied().collect()
}
