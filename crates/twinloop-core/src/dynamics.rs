//! Dynamics: what maps a state and a held command to the next state; a model and a plant are the same to a roll-out.

use crate::lanes::{Apart, Scalar, Vector, scalars};
use crate::levels::Levels;

/// A discrete-time system, stepped on several lanes at once.
pub trait Dynamics {
    /// Scratch of a run, and the memory of the dynamics from step to step.
    type Workspace<V: Vector>;

    /// A workspace as it is at the start of a run.
    fn workspace<V: Vector>(&self) -> Self::Workspace<V>;

    /// Moves the memory of commands on by a period of one (n_u lanes); it does not depend on the states. After all
    /// commands of a run so far, in order, a workspace is where the run is.
    fn remember<V: Vector>(&self, workspace: &mut Self::Workspace<V>, command: &[V]);

    /// Replaces the state (n_x lanes) by the one a period later, under the command (n_u lanes) held for that period.
    fn step<V: Vector>(&self, workspace: &mut Self::Workspace<V>, state: &mut [V], command: &[V]);

    /// The levels in which commands of controllers are sent; none where they are sent as they are.
    #[inline(always)]
    fn levels(&self) -> Option<&Levels> {
        None
    }

    /// Whether sensors read every state as it is.
    #[inline(always)]
    fn in_time(&self) -> bool {
        true
    }

    /// Puts what sensors without noise read (n_x lanes) at the state that the run has come to; to be asked at each state in
    /// turn, the first one included.
    #[inline(always)]
    fn read<V: Vector>(&self, _workspace: &mut Self::Workspace<V>, state: &[V], reading: &mut [V]) {
        reading.copy_from_slice(state);
    }

    /// The state whose reading (n_x lanes) this is, at the start of a run.
    #[inline(always)]
    fn state_of<V: Vector>(&self, reading: &[V]) -> Vec<V> {
        reading.to_vec()
    }
}

/// The state whose reading (n_x) this is, at the start of a run.
pub fn state_of<D: Dynamics>(dynamics: &D, reading: &[f64]) -> Vec<f64> {
    dynamics.state_of::<Scalar>(&scalars(reading)).iter().map(|value| value.lane(0)).collect()
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

/// A reading as a function of its own, for the same reason.
struct Read<'a, D: Dynamics, V: Vector> {
    dynamics: &'a D,
    workspace: &'a mut D::Workspace<V>,
    state: &'a [V],
    reading: &'a mut [V],
}

impl<D: Dynamics, V: Vector> Apart for Read<'_, D, V> {
    #[inline(always)]
    fn run(self) {
        self.dynamics.read(self.workspace, self.state, self.reading);
    }
}

/// Reads the state by a call.
#[inline(always)]
pub(crate) fn read_apart<D: Dynamics, V: Vector>(
    dynamics: &D,
    workspace: &mut D::Workspace<V>,
    state: &[V],
    reading: &mut [V],
) {
    V::apart(Read { dynamics, workspace, state, reading });
}
