//! Open loop: the one-step-ahead prediction error over the recorded transitions (paper, section IV.B).

use crate::dynamics::Dynamics;
use crate::lanes::{Isa, Kernel, Vector, lanes_for, with_lanes};
use crate::model::Model;
use crate::selected::{Block, SelectedTests};

/// Mean squared error of the next state over the steps and components of each test (N), for a model that remembers
/// nothing: its transitions are rows that know nothing of each other. Infinite where a prediction is not finite.
pub(super) struct OpenLoop<'a> {
    pub model: Model<'a>,
    pub selected: &'a SelectedTests,
}

impl Kernel for OpenLoop<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run<W: Isa>(self) -> Vec<f64> {
        let blocks = self.selected.blocks();
        let mut errors = Vec::with_capacity(64 * blocks.len());
        // Neighbours of one width share a workspace.
        for alike in blocks.chunk_by(|a, b| lanes_for(a.rows) == lanes_for(b.rows)) {
            with_lanes!(W, alike[0].rows, self.of_blocks(alike, &mut errors));
        }
        self.selected.rows().iter().map(|rows| self.mean(&errors[rows.clone()])).collect()
    }
}

impl OpenLoop<'_> {
    /// Appends the squared error of each transition, summed over components.
    #[inline(always)]
    fn of_blocks<V: Vector>(&self, blocks: &[Block], errors: &mut Vec<f64>) {
        let mut workspace = self.model.workspace::<V>();
        let periods = &self.selected.signals().periods;
        for block in blocks {
            let state = self.model.predict(&mut workspace, &block.state, &block.command);
            let mut sum = V::splat(0.0);
            for (i, (predicted, next)) in state.iter().zip(block.next.chunks_exact(V::LANES)).enumerate() {
                let error = periods.difference(i, *predicted, V::load(next));
                sum = sum + error * error;
            }
            let end = errors.len();
            errors.resize(end + V::LANES, 0.0);
            sum.store(&mut errors[end..]);
            errors.truncate(end + block.rows);
        }
    }

    fn mean(&self, errors: &[f64]) -> f64 {
        let mean = errors.iter().sum::<f64>() / (errors.len() * self.selected.signals().states()) as f64;
        if mean.is_finite() { mean } else { f64::INFINITY }
    }
}
