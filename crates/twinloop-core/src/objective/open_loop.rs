//! Open loop: the one-step-ahead prediction error over the recorded transitions (paper, section IV.B).

use super::divergence_penalty;
use crate::dynamics::Dynamics;
use crate::lanes::{Isa, Kernel, Vector, fill, vectors, with_lanes};
use crate::selected::{Block, SelectedTests};

/// Mean squared error of the next state over the steps and components of each test (N).
pub(super) struct OpenLoop<'a, D> {
    pub dynamics: D,
    pub selected: &'a SelectedTests,
}

impl<D: Dynamics> Kernel for OpenLoop<'_, D> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run<W: Isa>(self) -> Vec<f64> {
        let blocks = self.selected.blocks();
        let mut errors = Vec::with_capacity(64 * blocks.len());
        // Neighbours of one size share a workspace.
        for alike in blocks.chunk_by(|a, b| a.rows == b.rows) {
            with_lanes!(W, alike[0].rows, self.of_blocks(alike, &mut errors));
        }
        self.selected.rows().iter().map(|rows| self.mean(&errors[rows.clone()])).collect()
    }
}

impl<D: Dynamics> OpenLoop<'_, D> {
    /// Appends the squared error of each transition, summed over components.
    #[inline(always)]
    fn of_blocks<V: Vector>(&self, blocks: &[Block], errors: &mut Vec<f64>) {
        let mut workspace = self.dynamics.workspace::<V>();
        let mut state: Vec<V> = vectors(&blocks[0].state);
        let mut command: Vec<V> = vectors(&blocks[0].command);
        for block in blocks {
            fill(&mut state, &block.state);
            fill(&mut command, &block.command);
            self.dynamics.step(&mut workspace, &mut state, &command);
            let mut sum = V::splat(0.0);
            for (predicted, next) in state.iter().zip(block.next.chunks_exact(V::LANES)) {
                let error = *predicted - V::load(next);
                sum = sum + error * error;
            }
            let end = errors.len();
            errors.resize(end + V::LANES, 0.0);
            sum.store(&mut errors[end..]);
            errors.truncate(end + block.rows);
        }
    }

    /// A prediction that is not finite, or worse than a run that diverged at once, is worth such a run.
    fn mean(&self, errors: &[f64]) -> f64 {
        let mean = errors.iter().sum::<f64>() / (errors.len() * self.selected.signals().states()) as f64;
        let worst = divergence_penalty(0, 1);
        if mean < worst { mean } else { worst }
    }
}
