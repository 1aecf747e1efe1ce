//! Trajectories: what runs leave behind when every step is kept.

use crate::controller::Family;
use crate::dynamics::Dynamics;
use crate::lanes::{Isa, Kernel, Vector, Width, dispatch, groups, pack, with_lanes};
use crate::rollout::{Seen, Start, Watch, rollout};
use crate::task::Task;

/// One run, step by step. After the step that it lasted to, nothing in it means anything.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    /// True states, (n + 1) × n_x.
    pub states: Vec<f64>,
    /// What the controller read, (n + 1) × n_x.
    pub measured: Vec<f64>,
    /// Commands, n × n_u.
    pub commands: Vec<f64>,
    /// Steps before the run diverged; n if it did not.
    pub lasted: usize,
}

/// Runs the controller of each parameter vector on the dynamics. `noise`, empty or (n + 1) × n_x for each run, is
/// what its sensors add to the state.
pub fn record<D: Dynamics>(
    dynamics: &D,
    family: &Family,
    parameters: &[&[f64]],
    task: &Task,
    limits: &[f64],
    noise: &[&[f64]],
    width: Width,
) -> Vec<Trajectory> {
    let runs = groups(parameters.len()).into_iter().flat_map(|group| {
        let noise = if noise.is_empty() { noise } else { &noise[group.clone()] };
        let parameters = &parameters[group];
        dispatch(width, Record { dynamics, family, parameters, task, limits, noise })
    });
    runs.collect()
}

struct Record<'a, D> {
    dynamics: &'a D,
    family: &'a Family,
    parameters: &'a [&'a [f64]],
    task: &'a Task,
    limits: &'a [f64],
    noise: &'a [&'a [f64]],
}

impl<D: Dynamics> Kernel for Record<'_, D> {
    type Output = Vec<Trajectory>;

    #[inline(always)]
    fn run<W: Isa>(self) -> Vec<Trajectory> {
        with_lanes!(W, self.parameters.len(), self.lanes())
    }
}

impl<D: Dynamics> Record<'_, D> {
    #[inline(always)]
    fn lanes<V: Vector>(&self) -> Vec<Trajectory> {
        let Task { initial, target, steps } = self.task;
        let noise: Vec<V> = pack(self.noise);
        let start = Start {
            family: self.family,
            parameters: &pack::<V, _>(self.parameters),
            initial: &pack::<V, _>(&[initial]),
            target: &pack::<V, _>(&[target]),
            steps: *steps,
            limits: self.limits,
            noise: &noise,
        };
        let empty = || Trajectory { states: initial.clone(), measured: vec![], commands: vec![], lasted: 0 };
        let mut runs: Vec<_> = self.parameters.iter().map(|_| empty()).collect();
        let lasted = rollout(self.dynamics, &start, &mut Recorder(&mut runs));
        for (l, run) in runs.iter_mut().enumerate() {
            let (states, seen) = (initial.len(), run.measured.len());
            for j in 0..states {
                let noise = noise.get(seen + j).map_or(0.0, |noise| noise.lane(l));
                run.measured.push(run.states[seen + j] + noise);
            }
            run.lasted = lasted[l];
        }
        runs
    }
}

/// Keeps every step of the lanes that a run is wanted of.
struct Recorder<'a>(&'a mut [Trajectory]);

impl<V: Vector> Watch<V> for Recorder<'_> {
    #[inline(always)]
    fn see(&mut self, seen: Seen<'_, V>) {
        for (l, run) in self.0.iter_mut().enumerate() {
            run.measured.extend(seen.reading.iter().map(|value| value.lane(l)));
            run.commands.extend(seen.command.iter().map(|value| value.lane(l)));
            run.states.extend(seen.next.iter().map(|value| value.lane(l)));
        }
    }
}
