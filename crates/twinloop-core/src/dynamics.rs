//! Dynamics: what maps a state and a held command to the next state; a model and a plant are the same to a roll-out.

use crate::lanes::{Apart, Vector};

/// A discrete-time system, stepped on several lanes at once.
pub trait Dynamics {
    /// Scratch of a run, and whatever the dynamics remember from step to step.
    type Workspace<V: Vector>;

    /// A workspace as it is at the start of a run.
    fn workspace<V: Vector>(&self) -> Self::Workspace<V>;

    /// Moves what is remembered of commands on by a period of one (n_u lanes), whatever the states were. To be told all
    /// that was sent since a run began puts a workspace where the run is.
    fn remember<V: Vector>(&self, workspace: &mut Self::Workspace<V>, command: &[V]);

    /// Replaces the state (n_x lanes) by the one a period later, under the command (n_u lanes) held for that period.
    fn step<V: Vector>(&self, workspace: &mut Self::Workspace<V>, state: &mut [V], command: &[V]);
}

/// A step as a function of its own: it is compiled once for each vector, and not once more in every loop that steps.
struct Step<'a, D: Dynamics, V: Vector> {
    dynamics: &'a D,
    workspace: &'a mut D::Workspace<V>,
    state: &'a mut [V],
    command: &'a [V],
}

impl<D: Dynamics, V: Vector> Apart for Step<'_, D, V> {
    #[inline(always)]
    fn run(self) {
        self.dynamics.step(self.workspace, self.state, self.command);
    }
}

/// Steps the dynamics by a call.
#[inline(always)]
pub(crate) fn step_apart<D: Dynamics, V: Vector>(
    dynamics: &D,
    workspace: &mut D::Workspace<V>,
    state: &mut [V],
    command: &[V],
) {
    V::apart(Step { dynamics, workspace, state, command });
}
