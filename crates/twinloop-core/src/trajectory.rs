//! Trajectories: what runs leave behind when every step is kept.

use std::ops::Range;

use crate::any_dynamics::AnyDynamics;
use crate::controller::Family;
use crate::dynamics::Dynamics;
use crate::excitation::{Excitation, HoldBack};
use crate::lanes::{Isa, Kernel, Scalar, Vector, Width, dispatch, groups, pack, scalars, with_flight_lanes};
use crate::rollout::{Commands, Seen, Start, Watch, closed, rollout};
use crate::setting::{Limits, Setting};
use crate::task::Task;

/// One run, step by step. After the step that it lasted to, nothing in it means anything.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    /// True states, (n + 1) × n_x.
    pub states: Vec<f64>,
    /// What sensors without noise read of them, (n + 1) × n_x.
    pub read: Vec<f64>,
    /// What the controller read, (n + 1) × n_x.
    pub measured: Vec<f64>,
    /// Commands, n × n_u.
    pub commands: Vec<f64>,
    /// Steps before the run diverged; n if it did not.
    pub lasted: usize,
}

/// What acts on runs from outside; each empty, or a row for each run.
#[derive(Clone, Copy, Default)]
pub struct Influences<'a> {
    /// What the sensors add to the state, (n + 1) × n_x a run.
    pub noise: &'a [&'a [f64]],
    /// What is added to the commands before they are clipped, n × n_u a run.
    pub excitation: &'a [&'a [f64]],
    /// What holds that back, in all runs alike.
    pub hold_back: Option<&'a HoldBack>,
    /// What is added to the true state after each step, n × n_x a run.
    pub disturbance: &'a [&'a [f64]],
    /// True states from which a run goes on wherever one is given, (n + 1) × n_x a run; NaN where none is.
    pub anchors: &'a [&'a [f64]],
}

impl<'a> Influences<'a> {
    /// Those of some of the runs.
    pub fn of(&self, runs: &Range<usize>) -> Self {
        let part = |all: &'a [&'a [f64]]| if all.is_empty() { all } else { &all[runs.clone()] };
        Self {
            noise: part(self.noise),
            excitation: part(self.excitation),
            hold_back: self.hold_back,
            disturbance: part(self.disturbance),
            anchors: part(self.anchors),
        }
    }
}

/// Runs the controller of each parameter vector on the dynamics.
pub fn record(
    dynamics: AnyDynamics<'_>,
    setting: &Setting,
    parameters: &[&[f64]],
    task: &Task,
    influences: Influences<'_>,
    width: Width,
) -> Vec<Trajectory> {
    let runs = groups(parameters.len()).into_iter().flat_map(|group| {
        let influences = influences.of(&group);
        let parameters = &parameters[group];
        dispatch(width, OfGroup { dynamics, runs: Runs::of(setting, parameters, task, influences) })
    });
    runs.collect()
}

/// The same of one controller, one step after the other: for dynamics that have no lanes.
pub fn record_one<D: Dynamics>(
    dynamics: &D,
    setting: &Setting,
    parameters: &[f64],
    task: &Task,
    influences: Influences<'_>,
) -> Option<Trajectory> {
    let parameters = &[parameters];
    let runs = Runs::of(setting, parameters, task, influences);
    runs.recorded::<Scalar>(first_read(dynamics, &task.initial), |start, recorder| {
        closed(dynamics, start, recorder)
    })
    .pop()
}

/// Free runs from a state (n_x) under recorded commands (n × n_u, n at least 1), without a controller: as many as there
/// are rows of noise, disturbance or anchors, or one. Of an anchored state, what is kept is what the run came to before.
pub fn replay(
    dynamics: AnyDynamics<'_>,
    limits: &Limits,
    initial: &[f64],
    commands: &[f64],
    influences: Influences<'_>,
    width: Width,
) -> Vec<Trajectory> {
    let Influences { noise, disturbance, anchors, .. } = influences;
    let count = noise.len().max(disturbance.len()).max(anchors.len()).max(1);
    let steps = commands.len() / limits.signals().commands();
    let (source, limits) = (Source::Record(commands), limits.magnitudes());
    let runs = groups(count).into_iter().flat_map(|group| {
        let (count, influences) = (group.len(), influences.of(&group));
        let runs = Runs { source, initial, steps, limits, count, influences };
        dispatch(width, OfGroup { dynamics, runs })
    });
    runs.collect()
}

/// Where the commands of runs that are recorded come from.
#[derive(Clone, Copy)]
enum Source<'a> {
    /// Controllers of a family, one a run, and the target that they lead to.
    Law { family: &'a Family, parameters: &'a [&'a [f64]], target: &'a [f64] },
    /// The same commands for all (n × n_u).
    Record(&'a [f64]),
}

/// Runs side by side, as many as lanes.
struct Runs<'a> {
    source: Source<'a>,
    initial: &'a [f64],
    steps: usize,
    limits: &'a [f64],
    count: usize,
    influences: Influences<'a>,
}

struct OfGroup<'a> {
    dynamics: AnyDynamics<'a>,
    runs: Runs<'a>,
}

impl Kernel for OfGroup<'_> {
    type Output = Vec<Trajectory>;

    #[inline(always)]
    fn run<W: Isa>(self) -> Vec<Trajectory> {
        with_flight_lanes!(W, self.runs.count, self.lanes())
    }
}

impl OfGroup<'_> {
    #[inline(always)]
    fn lanes<V: Vector>(&self) -> Vec<Trajectory> {
        let read = first_read(&self.dynamics, self.runs.initial);
        self.runs.recorded::<V>(read, |start, recorder| rollout(self.dynamics, start, recorder))
    }
}

impl<'a> Runs<'a> {
    fn of(
        setting: &'a Setting,
        parameters: &'a [&'a [f64]],
        task: &'a Task,
        influences: Influences<'a>,
    ) -> Self {
        let Task { initial, target, steps } = task;
        let source = Source::Law { family: setting.family(), parameters, target };
        let (limits, count) = (setting.limits(), parameters.len());
        Self { source, initial, steps: *steps, limits, count, influences }
    }

    /// Every step of the runs, which `fly` flies; `read` of the first state.
    #[inline(always)]
    fn recorded<V: Vector>(
        &self,
        read: Vec<f64>,
        fly: impl FnOnce(&Start<'_, V>, &mut Recorder<'_>) -> Vec<usize>,
    ) -> Vec<Trajectory> {
        let (parameters, target): (&[&[f64]], &[f64]) = match self.source {
            Source::Law { parameters, target, .. } => (parameters, target),
            Source::Record(_) => (&[], &[]),
        };
        let (parameters, target) = (pack::<V>(parameters), pack::<V>(&[target]));
        let rows = pack::<V>(self.influences.excitation);
        let hold_back = self.influences.hold_back.map_or_else(Vec::new, |found| pack::<V>(&[found.lines()]));
        let excitation = Excitation { rows: &rows, hold_back: &hold_back };
        let commands = match self.source {
            Source::Law { family, .. } => {
                Commands::Law { family, parameters: &parameters, target: &target, excitation }
            }
            Source::Record(commands) => Commands::Record(commands),
        };
        let start = Start {
            commands,
            initial: &pack::<V>(&[self.initial]),
            steps: self.steps,
            limits: self.limits,
            noise: &pack::<V>(self.influences.noise),
            disturbance: &pack::<V>(self.influences.disturbance),
        };
        recorded(&start, self.initial, read, self.count, self.influences.anchors, fly)
    }
}

/// Every step of the first lanes of a roll-out.
#[inline(always)]
fn recorded<V: Vector>(
    start: &Start<'_, V>,
    initial: &[f64],
    read: Vec<f64>,
    count: usize,
    anchors: &[&[f64]],
    fly: impl FnOnce(&Start<'_, V>, &mut Recorder<'_>) -> Vec<usize>,
) -> Vec<Trajectory> {
    let empty = || Trajectory {
        states: initial.to_vec(),
        read: read.clone(),
        measured: vec![],
        commands: vec![],
        lasted: 0,
    };
    let mut runs: Vec<_> = (0..count).map(|_| empty()).collect();
    let lasted = fly(start, &mut Recorder { runs: &mut runs, anchors });
    for (l, run) in runs.iter_mut().enumerate() {
        let (states, seen) = (initial.len(), run.measured.len());
        for j in 0..states {
            let noise = start.noise.get(seen + j).map_or(0.0, |noise| noise.lane(l));
            run.measured.push(run.read[seen + j] + noise);
        }
        run.lasted = lasted[l];
    }
    runs
}

/// What sensors without noise read of a first state (n_x).
fn first_read<D: Dynamics>(dynamics: &D, initial: &[f64]) -> Vec<f64> {
    let mut read: Vec<Scalar> = scalars(initial);
    dynamics.read(&mut dynamics.workspace::<Scalar>(), &scalars(initial), &mut read);
    read.iter().map(|value| value.lane(0)).collect()
}

/// Keeps every step of the lanes that a run is wanted of.
struct Recorder<'a> {
    runs: &'a mut [Trajectory],
    /// Of each run, (n + 1) × n_x; NaN where it goes on as it is.
    anchors: &'a [&'a [f64]],
}

impl<V: Vector> Watch<V> for Recorder<'_> {
    #[inline(always)]
    fn correct(&mut self, at: usize, state: &mut [V]) {
        if self.anchors.is_empty() {
            return;
        }
        let (width, mut lanes) = (state.len(), [0.0; 64]);
        for (i, value) in state.iter_mut().enumerate() {
            value.store(&mut lanes);
            for (lane, anchors) in lanes.iter_mut().zip(self.anchors) {
                let anchor = anchors[at * width + i];
                *lane = if anchor.is_nan() { *lane } else { anchor };
            }
            *value = V::load(&lanes);
        }
    }

    #[inline(always)]
    fn see(&mut self, seen: Seen<'_, V>) {
        let runs = &mut *self.runs;
        let mut lanes = [0.0; 64];
        for value in seen.reading {
            value.store(&mut lanes);
            runs.iter_mut().zip(&lanes).for_each(|(run, &lane)| run.measured.push(lane));
        }
        for value in seen.command {
            value.store(&mut lanes);
            runs.iter_mut().zip(&lanes).for_each(|(run, &lane)| run.commands.push(lane));
        }
        for value in seen.next {
            value.store(&mut lanes);
            runs.iter_mut().zip(&lanes).for_each(|(run, &lane)| run.states.push(lane));
        }
        for value in seen.read {
            value.store(&mut lanes);
            runs.iter_mut().zip(&lanes).for_each(|(run, &lane)| run.read.push(lane));
        }
    }
}
