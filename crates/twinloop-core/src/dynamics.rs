//! Dynamics: what maps a state and a held command to the next state; a model and a plant are the same to a roll-out.

use crate::lanes::Vector;

/// A discrete-time system, stepped on several lanes at once.
pub trait Dynamics {
    /// Scratch of a run, and whatever the dynamics remember from step to step.
    type Workspace<V: Vector>;

    /// A workspace as it is at the start of a run.
    fn workspace<V: Vector>(&self) -> Self::Workspace<V>;

    /// Replaces the state (n_x lanes) by the one a period later, under the command (n_u lanes) held for that period.
    fn step<V: Vector>(&self, workspace: &mut Self::Workspace<V>, state: &mut [V], command: &[V]);
}
