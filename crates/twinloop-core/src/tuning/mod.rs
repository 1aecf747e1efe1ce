//! Tuning: fits a model's constants, and the times of its actuation, so that its prediction errors are white noise.
//!
//! A prediction-error method with an observer of fixed gains (Ljung 1999, chapter 7). With little process noise the
//! gains fade and it is an output-error fit over whole runs; with much of it they stay and it is one of single steps.
//! The variants of a model that finite differences need are lanes of one run.

mod draws;
mod levenberg;
mod observer;
mod slopes;
mod variant;

pub use observer::Predictions;

use crate::error::{Result, invalid};
use crate::lgp::Code;
use crate::model::Frame;
use crate::regression::{Chain, Noise};
use crate::setting::Limits;

/// One chain of states with the noise of its sensors and of its motion.
#[derive(Clone, Debug)]
pub struct Observed {
    /// The states, the driven one first, then its integral, and so on.
    pub states: Vec<usize>,
    /// Their motion without the model.
    pub chain: Chain,
    /// Variances.
    pub noise: Noise,
}

/// What was recorded of one run.
#[derive(Clone, Debug)]
pub struct Recorded {
    /// Readings (n + 1) × n_x.
    pub states: Vec<f64>,
    /// 1 for a reading that counts, 0 for one to be ignored, (n + 1) × n_x.
    pub weights: Vec<f64>,
    /// Commands n × n_u.
    pub commands: Vec<f64>,
}

/// What is tuned, and on what.
pub struct Tuning<'a> {
    /// The program.
    pub code: &'a Code,
    /// What makes it dynamics.
    pub frame: &'a Frame,
    /// Every state belongs to one of them.
    pub observer: &'a [Observed],
    /// The runs.
    pub records: &'a [Recorded],
    /// Within which a variant has not diverged.
    pub limits: &'a Limits,
    /// Constants of the code that may move.
    pub free: &'a [usize],
    /// Groups of lags, and of times of hidden states, that are one number which may move: commands by number, then
    /// hidden states.
    pub lags: &'a [Vec<usize>],
}

/// A tuned model.
#[derive(Clone, Debug, PartialEq)]
pub struct Tuned {
    /// All constants of the code.
    pub constants: Vec<f64>,
    /// Lag of every command, then time of every hidden state, s.
    pub lags: Vec<f64>,
    /// Sum of squares of the whitened prediction errors, χ²; infinite if the model diverges on the runs.
    pub chi_squared: f64,
    /// Readings that counted.
    pub readings: usize,
    /// Covariance of the free constants, then of the free lags, with a prior of standard deviation |value| on each; empty
    /// where a small change makes the model diverge.
    pub covariance: Vec<f64>,
}

impl Tuning<'_> {
    /// Readings that count.
    fn readings(&self) -> usize {
        self.records.iter().map(|record| record.weights.iter().filter(|&&w| w > 0.0).count()).sum()
    }

    /// Refuses parts that do not fit each other.
    pub fn check(&self) -> Result<()> {
        let states = self.limits.signals().states();
        let mut seen: Vec<usize> =
            self.observer.iter().flat_map(|observed| observed.states.clone()).collect();
        seen.sort_unstable();
        let commands = self.frame.commands();
        let fits = seen == (0..states).collect::<Vec<_>>()
            && self.observer.iter().all(|observed| {
                observed.states.len() == observed.chain.states
                    && observed.noise.sensors.len() == observed.chain.states
            })
            && self.free.iter().all(|&c| c < self.code.constants().len())
            && self.lags.iter().all(|group| !group.is_empty())
            && self.lags.iter().flatten().all(|&place| place < self.frame.actuation().times().len())
            && !self.records.is_empty()
            && self.records.iter().all(|record| {
                let steps = record.commands.len() / commands;
                record.commands.len() == steps * commands
                    && record.states.len() == (steps + 1) * states
                    && record.weights.len() == record.states.len()
            });
        if fits {
            Ok(())
        } else {
            invalid(
                "tuning: expected at least one record, and chains, records, constants and groups of lags that fit the \
                 model",
            )
        }
    }
}
