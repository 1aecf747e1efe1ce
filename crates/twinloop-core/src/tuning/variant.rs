//! Variants of a model: the same code with other constants and times.

use super::Tuning;

/// Constants and lags of one variant.
#[derive(Clone, Debug)]
pub(super) struct Variant {
    pub constants: Vec<f64>,
    pub lags: Vec<f64>,
}

impl Tuning<'_> {
    /// The model as it is.
    pub(super) fn start(&self) -> Variant {
        Variant { constants: self.code.constants().to_vec(), lags: self.frame.actuation().times() }
    }

    /// How much is free to move.
    pub(super) fn size(&self) -> usize {
        self.free.len() + self.lags.len()
    }

    /// What is free to move, as it is in a variant.
    pub(super) fn values(&self, variant: &Variant) -> Vec<f64> {
        let constants = self.free.iter().map(|&constant| variant.constants[constant]);
        constants.chain(self.lags.iter().map(|group| variant.lags[group[0]])).collect()
    }

    /// A variant with what is free moved by a step.
    pub(super) fn moved(&self, from: &Variant, step: &[f64]) -> Variant {
        let mut to = from.clone();
        for (&c, step) in self.free.iter().zip(step) {
            to.constants[c] += step;
        }
        for (group, step) in self.lags.iter().zip(&step[self.free.len()..]) {
            for &command in group {
                // A lag stays one.
                to.lags[command] = (to.lags[command] + step).max(0.2 * from.lags[command]);
            }
        }
        to
    }
}
