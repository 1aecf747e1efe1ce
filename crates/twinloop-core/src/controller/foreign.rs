//! A law outside of the engine, such as one written in Python: one controller at a time, on the thread that asked.

use std::fmt::Debug;

use crate::lanes::Vector;

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
}

/// A controller for each lane.
#[inline(never)]
pub(super) fn start<V: Vector>(law: &dyn ForeignLaw, gains: &[V]) -> Vec<Box<dyn ForeignController>> {
    let of_lane = |l: usize| gains.iter().map(|gain| gain.lane(l)).collect::<Vec<_>>();
    (0..V::LANES).map(|l| law.start(&of_lane(l))).collect()
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
    let of_lane = |values: &[V], l: usize| values.iter().map(|value| value.lane(l)).collect::<Vec<_>>();
    let mut commands = vec![f64::NAN; bounds.len() * V::LANES];
    for (l, (controller, command)) in
        controllers.iter_mut().zip(commands.chunks_mut(bounds.len())).enumerate()
    {
        let state = of_lane(state, l);
        // A lane that has diverged runs on without anybody looking: it asks no more.
        if state.iter().all(|x| x.is_finite()) {
            controller.command(&state, &of_lane(target, l), command);
        }
        for (command, &(low, high)) in command.iter_mut().zip(bounds) {
            *command = command.clamp(low, high);
        }
    }
    for (j, command) in command.iter_mut().enumerate() {
        *command = V::load(&commands.iter().skip(j).step_by(bounds.len()).copied().collect::<Vec<_>>());
    }
}
