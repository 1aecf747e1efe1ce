//! The roll-out: dynamics under the commands of a controller that reads them, or of a record. There is no second one.

use crate::any_dynamics::{AnyDynamics, AnyWorkspace};
use crate::controller::{Controllers, Family};
use crate::dynamics::{Dynamics, read_apart};
use crate::excitation::Excitation;
use crate::lanes::{Apart, Vector, zeros};
use crate::levels::Levels;
use crate::task::target_at;

/// What runs start from, one a lane.
pub struct Start<'a, V> {
    /// Where their commands come from.
    pub commands: Commands<'a, V>,
    /// First state (n_x).
    pub initial: &'a [V],
    /// Steps to run, n.
    pub steps: usize,
    /// Magnitude of each state at which a lane has diverged (n_x).
    pub limits: &'a [f64],
    /// What the sensors add to the reading of the state, (n + 1) × n_x; empty for sensors without noise.
    pub noise: &'a [V],
    /// What is added to the true state after each step, n × n_x: process noise, gusts; empty for nothing.
    pub disturbance: &'a [V],
}

/// The two sources of commands, laws and records. Both are in the same loop, for each copy of it takes its time to compile.
#[derive(Clone, Copy)]
pub enum Commands<'a, V> {
    /// Controllers that answer what they read.
    Law {
        /// The family of the controllers.
        family: &'a Family,
        /// Parameters of each lane's controller (size).
        parameters: &'a [V],
        /// State that the controllers lead to: constant (n_x), or a row for each state ((n + 1) × n_x).
        target: &'a [V],
        /// What is added to the commands before they are clipped to their bounds.
        excitation: Excitation<'a, V>,
    },
    /// Records, n × n_u, one a lane, sent as they are.
    Records(&'a [V]),
    /// One record, n × n_u, sent to all lanes.
    Record(&'a [f64]),
}

/// One step of the loops, as it is shown to a watcher.
pub struct Seen<'a, V> {
    /// Number of the step, 0 to n − 1.
    pub step: usize,
    /// What the controllers read before it (n_x).
    pub reading: &'a [V],
    /// What was sent (n_u): what they commanded and the excitation, within the bounds.
    pub command: &'a [V],
    /// The true state after it (n_x).
    pub next: &'a [V],
    /// What sensors without noise read of that (n_x).
    pub read: &'a [V],
}

/// What looks on. A trait and not a closure, because only a named function can be made to be inlined.
pub trait Watch<V> {
    /// May correct the states (n_x) that a run has come to, by what was read of them: an observer does. It is asked at each
    /// of the n + 1 states in turn, before anything is sent.
    #[inline(always)]
    fn correct(&mut self, _at: usize, _state: &mut [V]) {}

    /// Is shown each step in turn.
    fn see(&mut self, seen: Seen<'_, V>);
}

/// Runs the loops and shows each step to `watch`. Returns the steps that each lane lasted: n, unless its state stopped
/// being finite or left the limits; what is shown of a lane after that means nothing.
#[inline(always)]
pub fn rollout<V: Vector>(
    dynamics: AnyDynamics<'_>,
    start: &Start<'_, V>,
    watch: &mut impl Watch<V>,
) -> Vec<usize> {
    let mut lasted = vec![];
    V::apart(Run { dynamics, midway: None, start, watch, lasted: &mut lasted });
    lasted
}

/// What a run carries from step to step beside its state.
pub(crate) struct Midway<W, V> {
    /// Workspace of the dynamics.
    pub workspace: W,
    /// Of a law; none of a record.
    pub controllers: Option<Controllers<V>>,
}

/// The same with a workspace of one's own, such as one in the midst of a run; targets and excitation are those from there on.
#[inline(always)]
pub(crate) fn resumed<'a, V: Vector>(
    dynamics: AnyDynamics<'a>,
    midway: Midway<AnyWorkspace<'a, V>, V>,
    start: &Start<'_, V>,
    watch: &mut impl Watch<V>,
) -> Vec<usize> {
    let mut lasted = vec![];
    V::apart(Run { dynamics, midway: Some(midway), start, watch, lasted: &mut lasted });
    lasted
}

/// The roll-out as a function of its own, for each vector and what looks on.
struct Run<'a, 'd, V: Vector, W> {
    dynamics: AnyDynamics<'d>,
    /// Where the run is; none at its beginning.
    midway: Option<Midway<AnyWorkspace<'d, V>, V>>,
    start: &'a Start<'a, V>,
    watch: &'a mut W,
    lasted: &'a mut Vec<usize>,
}

impl<V: Vector, W: Watch<V>> Apart for Run<'_, '_, V, W> {
    #[inline(always)]
    fn run(self) {
        *self.lasted = looped(&self.dynamics, self.midway, self.start, self.watch);
    }
}

/// The same for dynamics of any kind, such as a function that is not the engine's.
#[inline(always)]
pub(crate) fn closed<D: Dynamics, V: Vector>(
    dynamics: &D,
    start: &Start<'_, V>,
    watch: &mut impl Watch<V>,
) -> Vec<usize> {
    looped(dynamics, None, start, watch)
}

#[inline(always)]
fn looped<D: Dynamics, V: Vector>(
    dynamics: &D,
    midway: Option<Midway<D::Workspace<V>, V>>,
    start: &Start<'_, V>,
    watch: &mut impl Watch<V>,
) -> Vec<usize> {
    let Start { commands, initial, steps, limits, noise, disturbance } = *start;
    let states = initial.len();
    let width = match commands {
        Commands::Law { family, .. } => family.commands(),
        Commands::Records(rows) => rows.len() / steps,
        Commands::Record(rows) => rows.len() / steps,
    };
    let Midway { mut workspace, mut controllers } = match (midway, commands) {
        (Some(midway), _) => midway,
        (None, Commands::Law { family, parameters, .. }) => {
            Midway { workspace: dynamics.workspace(), controllers: Some(family.start(parameters)) }
        }
        (None, _) => Midway { workspace: dynamics.workspace(), controllers: None },
    };
    let mut state = initial.to_vec();
    let mut reading = initial.to_vec();
    // What sensors read where that is not the state itself.
    let mut late = if dynamics.in_time() { vec![] } else { initial.to_vec() };
    if !late.is_empty() {
        read_apart(dynamics, &mut workspace, &state, &mut late);
    }
    let mut command = zeros(width);
    let mut alive = V::splat(1.0);
    let mut lasted = vec![steps; V::LANES];
    for step in 0..steps {
        watch.correct(step, &mut state);
        reading.copy_from_slice(if late.is_empty() { &state } else { &late });
        if !noise.is_empty() {
            add(&mut reading, &noise[step * states..]);
        }
        V::apart(Send {
            commands,
            controllers: controllers.as_mut(),
            step,
            levels: dynamics.levels(),
            reading: &reading,
            command: &mut command,
        });
        dynamics.step(&mut workspace, &mut state, &command);
        if !disturbance.is_empty() {
            add(&mut state, &disturbance[step * states..]);
        }
        if !late.is_empty() {
            read_apart(dynamics, &mut workspace, &state, &mut late);
        }
        let read = if late.is_empty() { &state } else { &late };
        watch.see(Seen { step, reading: &reading, command: &command, next: &state, read });
        let before = alive;
        for (state, &limit) in state.iter().zip(limits) {
            // A NaN is not less than the limit, and so counts as gone.
            alive = state.abs().select_less(V::splat(limit), alive, V::splat(0.0));
        }
        if alive.any_less(before) {
            for (l, lasted) in lasted.iter_mut().enumerate() {
                if alive.lane(l) < before.lane(l) {
                    *lasted = step;
                }
            }
            if !V::splat(0.0).any_less(alive) {
                return lasted;
            }
        }
    }
    watch.correct(steps, &mut state);
    lasted
}

/// What is sent in a period, as a function of its own: it is compiled once for each vector, not in every loop.
struct Send<'a, V> {
    commands: Commands<'a, V>,
    /// Of a law.
    controllers: Option<&'a mut Controllers<V>>,
    step: usize,
    /// In which commands of a law are sent; a record is of what was sent.
    levels: Option<&'a Levels>,
    reading: &'a [V],
    command: &'a mut [V],
}

impl<V: Vector> Apart for Send<'_, V> {
    #[inline(always)]
    fn run(self) {
        match (self.commands, self.controllers) {
            (Commands::Law { family, target, excitation, .. }, Some(controllers)) => {
                let target = target_at(target, self.reading.len(), self.step);
                family.command(controllers, self.reading, target, self.command);
                excitation.add(family, self.step, self.reading, self.command);
                if let Some(levels) = self.levels {
                    levels.send(self.command);
                }
            }
            (Commands::Records(rows), _) => {
                let width = self.command.len();
                self.command.copy_from_slice(&rows[self.step * width..][..width]);
            }
            (Commands::Record(rows), _) => {
                let sent = &rows[self.step * self.command.len()..];
                for (command, &sent) in self.command.iter_mut().zip(sent) {
                    *command = V::splat(sent);
                }
            }
            (Commands::Law { .. }, None) => unreachable!("a law has its controllers"),
        }
    }
}

/// Adds the first terms to as many sums.
#[inline(always)]
fn add<V: Vector>(sums: &mut [V], terms: &[V]) {
    for (sum, term) in sums.iter_mut().zip(terms) {
        *sum = *sum + *term;
    }
}
