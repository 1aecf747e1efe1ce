//! Final distance: how far from its target a closed loop ends, δ = ‖η_n − η_d‖.

use crate::difference::Periods;
use crate::excitation::Excitation;
use crate::lanes::{Isa, Kernel, Vector, dispatch, groups, pack, with_test_lanes};
use crate::model::Model;
use crate::rollout::{Commands, Seen, Start, Watch, rollout};
use crate::setting::Setting;
use crate::task::{Task, target_at};
use crate::workers::Workers;

/// Final distances of each controller on each model (models × controllers); infinite where the run diverged.
pub fn final_distances(
    models: &[Model<'_>],
    setting: &Setting,
    parameters: &[&[f64]],
    task: &Task,
    workers: &Workers,
) -> Vec<Vec<f64>> {
    let groups = groups(parameters.len());
    let distances = workers.map_flights(setting.family(), models.len() * groups.len(), |unit| {
        let (model, group) = (&models[unit / groups.len()], groups[unit % groups.len()].clone());
        let parameters = &parameters[group];
        dispatch(workers.width(), OfGroup { model, setting, parameters, task })
    });
    distances.chunks(groups.len().max(1)).map(<[_]>::concat).collect()
}

struct OfGroup<'a> {
    model: &'a Model<'a>,
    setting: &'a Setting,
    parameters: &'a [&'a [f64]],
    task: &'a Task,
}

impl Kernel for OfGroup<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run<W: Isa>(self) -> Vec<f64> {
        with_test_lanes!(W, self.parameters.len(), self.lanes())
    }
}

impl OfGroup<'_> {
    #[inline(always)]
    fn lanes<V: Vector>(&self) -> Vec<f64> {
        let Task { initial, target, steps } = self.task;
        let target: Vec<V> = pack(&[target]);
        let start = Start {
            commands: Commands::Law {
                family: self.setting.family(),
                parameters: &pack::<V>(self.parameters),
                target: &target,
                excitation: Excitation::NONE,
            },
            initial: &pack::<V>(&[initial]),
            steps: *steps,
            limits: self.setting.limits(),
            noise: &[],
            disturbance: &[],
        };
        let periods = &self.setting.signals().periods;
        let target = target_at(&target, initial.len(), *steps);
        let mut last = LastStep { periods, steps: *steps, target, squared: V::splat(0.0) };
        let lasted = rollout((*self.model).into(), &start, &mut last);
        let of_lane = |l: usize| {
            if lasted[l] < *steps { f64::INFINITY } else { last.squared.lane(l).sqrt() }
        };
        (0..self.parameters.len()).map(of_lane).collect()
    }
}

/// Squared distance to the target after the last step.
struct LastStep<'a, V> {
    periods: &'a Periods,
    steps: usize,
    target: &'a [V],
    squared: V,
}

impl<V: Vector> Watch<V> for LastStep<'_, V> {
    #[inline(always)]
    fn see(&mut self, seen: Seen<'_, V>) {
        if seen.step + 1 == self.steps {
            for (i, (state, target)) in seen.next.iter().zip(self.target).enumerate() {
                let difference = self.periods.difference(i, *state, *target);
                self.squared = self.squared + difference * difference;
            }
        }
    }
}
