//! Objectives: what models and tests are judged by, all minimised (specification, section 3).

mod closed_loop;
mod discrimination;
mod final_distance;
mod horizon;
mod instability;
mod open_loop;
mod outcome;

pub use discrimination::discrimination;
pub use final_distance::final_distances;
pub use instability::instability;
pub use outcome::Outcome;

use closed_loop::ClosedLoop;
use horizon::after_steps;
use open_loop::OpenLoop;

use crate::error::{Result, invalid};
use crate::lanes::{Width, dispatch};
use crate::model::Model;
use crate::selected::SelectedTests;
use crate::workers::Workers;

/// Both objectives of a model: open loop and closed loop of each selected test in turn (2 N), as finite numbers. An open
/// loop that is worse than a run that diverges at once is worth such a run.
pub fn of_model(model: Model<'_>, selected: &SelectedTests, width: Width) -> Vec<f64> {
    let worst = Outcome::AT_ONCE.ranked();
    let open = open_loop(model, selected, width).into_iter();
    let open = open.map(|error| if error < worst { error } else { worst });
    let closed = dispatch(width, ClosedLoop { model, selected });
    open.zip(closed).flat_map(|(open, closed)| [open, closed.ranked()]).collect()
}

/// Open loop of a model on each selected test (N).
fn open_loop(model: Model<'_>, selected: &SelectedTests, width: Width) -> Vec<f64> {
    if model.frame.actuation().is_direct() && model.frame.sensors().in_time() {
        dispatch(width, OpenLoop { model, selected })
    } else {
        after_steps(model, selected, 1)
    }
}

/// Open loop of each model on each selected test (models × N); infinite where a prediction is not finite.
pub fn open_loops(models: &[Model<'_>], selected: &SelectedTests, workers: &Workers) -> Vec<Vec<f64>> {
    workers.map(models.len(), |i| open_loop(models[i], selected, workers.width()))
}

/// Error of each model, on each selected test, of free runs of `steps` steps from every recorded state under the recorded
/// commands (models × N); infinite where a prediction is not finite.
pub fn k_steps(
    models: &[Model<'_>],
    selected: &SelectedTests,
    steps: usize,
    workers: &Workers,
) -> Result<Vec<Vec<f64>>> {
    let shortest = selected.steps().min().unwrap_or(usize::MAX);
    if !(1..=shortest).contains(&steps) {
        return invalid(format!(
            "k-step error: expected 1 to {shortest} steps, as many as the shortest test has, found {steps}; ask for fewer"
        ));
    }
    Ok(workers.map(models.len(), |i| after_steps(models[i], selected, steps)))
}

/// Closed loop of each model on each selected test (models × N).
pub fn closed_loops(models: &[Model<'_>], selected: &SelectedTests, workers: &Workers) -> Vec<Vec<Outcome>> {
    workers.map_flights(selected.setting().family(), models.len(), |i| {
        dispatch(workers.width(), ClosedLoop { model: models[i], selected })
    })
}
