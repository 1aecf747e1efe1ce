//! Errors of free runs of some steps from every recorded state, under the recorded commands.
//!
//! A test is walked through in the order of time: actuators and hidden states move on by each recorded command (what
//! motion fills, by each recorded state), and so every run starts with the memory that the system had there (Ljung 1999,
//! section 3.2).

use std::collections::VecDeque;

use crate::dynamics::{Dynamics, state_of};
use crate::lanes::{Scalar, Vector, scalars};
use crate::model::Model;
use crate::selected::{Experiment, SelectedTests};

/// Mean squared error, over runs and states, of free runs of `horizon` steps from every recorded state of each test that
/// has so many steps after it (N); infinite where a prediction is not finite. A horizon of 1 is the one-step error.
pub(super) fn after_steps(model: Model<'_>, selected: &SelectedTests, horizon: usize) -> Vec<f64> {
    let (n_x, n_u) = (selected.signals().states(), selected.signals().commands());
    let periods = &selected.signals().periods;
    let of_test = |experiment: &Experiment| {
        // Where readings are late, of the states that they are of.
        let read = experiment.states.chunks_exact(n_x);
        let recorded: Vec<Vec<f64>> = read.map(|read| state_of(&model, read)).collect();
        let mut workspace = model.workspace::<Scalar>();
        // Runs on their way, the one that began first in front.
        let mut running = VecDeque::with_capacity(horizon);
        let (mut squares, mut count) = (0.0, 0);
        for (states, command) in recorded.windows(2).zip(experiment.commands.chunks_exact(n_u)) {
            let command = scalars(command);
            running.push_back((scalars(&states[0]), workspace));
            for (state, workspace) in &mut running {
                model.step(workspace, state, &command);
            }
            // The last one began where the test is.
            workspace = running[running.len() - 1].1.clone();
            if running.len() == horizon {
                let last = running.pop_front().map(|(state, _)| state).unwrap_or_default();
                for (i, (&predicted, &read)) in last.iter().zip(&states[1]).enumerate() {
                    let error = periods.difference(i, predicted, Scalar::splat(read)).lane(0);
                    squares += error * error;
                }
                count += n_x;
            }
        }
        let mean = squares / count as f64;
        if mean.is_finite() { mean } else { f64::INFINITY }
    };
    selected.experiments().map(of_test).collect()
}
