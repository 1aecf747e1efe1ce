//! Objectives: what models and tests are judged by, all minimised (specification, section 3).

mod closed_loop;
mod discrimination;
mod final_distance;
mod instability;
mod open_loop;

pub use discrimination::discrimination;
pub use final_distance::final_distances;
pub use instability::instability;

use closed_loop::ClosedLoop;
use open_loop::OpenLoop;

use crate::lanes::{Width, dispatch};
use crate::model::Model;
use crate::selected::SelectedTests;
use crate::workers::Workers;

/// What a run that diverges after `lasted` of `steps` steps is worth: large, finite, and ordered by the time it lasted.
pub fn divergence_penalty(lasted: usize, steps: usize) -> f64 {
    1e6 * (2.0 - lasted as f64 / steps as f64)
}

/// Both objectives of a model: open loop and closed loop of each selected test in turn (2 N).
pub fn of_model(model: Model<'_>, selected: &SelectedTests, width: Width) -> Vec<f64> {
    let open = dispatch(width, OpenLoop { model, selected });
    let closed = dispatch(width, ClosedLoop { dynamics: model, selected });
    open.into_iter().zip(closed).flat_map(|(open, closed)| [open, closed]).collect()
}

/// Open loop of each model on each selected test (models × N).
pub fn open_loops(models: &[Model<'_>], selected: &SelectedTests, workers: &Workers) -> Vec<Vec<f64>> {
    workers.map(models.len(), |i| dispatch(workers.width(), OpenLoop { model: models[i], selected }))
}

/// Closed loop of each model on each selected test (models × N).
pub fn closed_loops(models: &[Model<'_>], selected: &SelectedTests, workers: &Workers) -> Vec<Vec<f64>> {
    workers.map_flights(selected.family(), models.len(), |i| {
        dispatch(workers.width(), ClosedLoop { dynamics: models[i], selected })
    })
}
