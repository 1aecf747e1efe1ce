//! Structural introns: instructions that cannot reach an output (Brameier and Banzhaf, algorithm 3.1).

use super::program::{Page, Program};

/// What one backward pass over a program finds.
pub(super) struct Effect {
    /// Whether each instruction can reach an output.
    pub effective: Vec<bool>,
    /// Whether the value that each register holds at the start can reach an output.
    pub live_at_start: Vec<bool>,
}

impl Program {
    /// One backward pass, exact because the code has no branches.
    pub(super) fn effect(&self) -> Effect {
        let mut live = vec![false; self.shape().registers];
        live[self.shape().output_registers()].fill(true);
        let mut effective = vec![false; self.len()];
        for (instruction, effective) in self.instructions().rev().zip(effective.iter_mut().rev()) {
            if live[usize::from(instruction.destination)] {
                *effective = true;
                live[usize::from(instruction.destination)] = false;
                instruction.reads().for_each(|register| live[usize::from(register)] = true);
            }
        }
        Effect { effective, live_at_start: live }
    }

    /// The same function without its structural introns; the pages stay, some of them shorter or empty.
    pub fn effective(&self) -> Self {
        let mut effective = self.effect().effective.into_iter();
        let pages = self.pages().iter().map(|page| {
            let kept = page.0.iter().filter(|_| effective.next().unwrap_or(false));
            Page(kept.copied().collect())
        });
        Self::new(self.shape(), pages.collect()).expect("a part of a valid program is valid")
    }

    /// Share of the instructions that are introns, 0 to 1.
    pub fn intron_share(&self) -> f64 {
        let effective = self.effect().effective;
        let introns = effective.iter().filter(|effective| !**effective).count();
        introns as f64 / effective.len().max(1) as f64
    }
}
