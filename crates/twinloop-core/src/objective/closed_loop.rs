//! Closed loop: the free-run simulation error with the controller in the loop (paper, section IV.B); of a run that no
//! test asked for, under its recorded commands.

use super::Outcome;
use crate::difference::Periods;
use crate::dynamics::Dynamics;
use crate::excitation::Excitation;
use crate::lanes::{Isa, Kernel, Vector, vectors, with_test_lanes};
use crate::model::Model;
use crate::rollout::{Commands, Seen, Start, Watch, rollout};
use crate::selected::{Loops, SelectedTests};

/// Outcome of each test's run beside its record (N).
pub(super) struct ClosedLoop<'a> {
    pub model: Model<'a>,
    pub selected: &'a SelectedTests,
}

impl Kernel for ClosedLoop<'_> {
    type Output = Vec<Outcome>;

    #[inline(always)]
    fn run<W: Isa>(self) -> Vec<Outcome> {
        let mut outcomes = Vec::with_capacity(self.selected.len());
        for loops in self.selected.loops() {
            with_test_lanes!(W, loops.tests, self.of_group(loops, &mut outcomes));
        }
        outcomes
    }
}

impl ClosedLoop<'_> {
    #[inline(always)]
    fn of_group<V: Vector>(&self, loops: &Loops, outcomes: &mut Vec<Outcome>) {
        let states = self.selected.signals().states();
        let [parameters, target, rows, hold_back, sent] =
            [&loops.parameters, &loops.target, &loops.excitation, &loops.hold_back, &loops.commands]
                .map(|part| vectors::<V>(part));
        let law = Commands::Law {
            family: self.selected.setting().family(),
            parameters: &parameters,
            target: &target,
            excitation: Excitation { rows: &rows, hold_back: &hold_back },
        };
        let start = Start {
            commands: if sent.is_empty() { law } else { Commands::Records(&sent) },
            initial: &self.model.state_of(&vectors::<V>(&loops.initial)),
            steps: loops.steps.iter().copied().max().unwrap_or(0),
            limits: self.selected.setting().limits(),
            noise: &[],
            disturbance: &[],
        };
        let steps = (0..V::LANES).map(|l| loops.steps.get(l).map_or(0.0, |&steps| steps as f64));
        let steps = V::load(&steps.collect::<Vec<_>>());
        let periods = &self.selected.signals().periods;
        let mut error = SquaredError { periods, recorded: &loops.recorded, steps, sum: V::splat(0.0) };
        let lasted = rollout(self.model.into(), &start, &mut error);
        for (l, (&lasted, &steps)) in lasted.iter().zip(&loops.steps).enumerate() {
            outcomes.push(if lasted < steps {
                Outcome::Diverged { lasted, of: steps }
            } else {
                Outcome::Followed(error.sum.lane(l) / (steps * states) as f64)
            });
        }
    }
}

/// Squared difference to the recorded runs, summed over steps and components.
struct SquaredError<'a, V> {
    periods: &'a Periods,
    recorded: &'a [f64],
    steps: V,
    sum: V,
}

impl<V: Vector> Watch<V> for SquaredError<'_, V> {
    #[inline(always)]
    fn see(&mut self, seen: Seen<'_, V>) {
        let row = seen.read.len() * V::LANES;
        let recorded = &self.recorded[(seen.step + 1) * row..][..row];
        let mut sum = V::splat(0.0);
        for (i, (simulated, recorded)) in seen.read.iter().zip(recorded.chunks_exact(V::LANES)).enumerate() {
            let error = self.periods.difference(i, *simulated, V::load(recorded));
            sum = sum + error * error;
        }
        // A lane whose recording has ended adds nothing more.
        let time = V::splat(seen.step as f64);
        self.sum = self.sum + time.select_less(self.steps, sum, V::splat(0.0));
    }
}
