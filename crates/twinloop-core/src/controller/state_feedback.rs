//! Feedback of the states: every output of the law may answer the error of every state, and some errors' integrals.

use super::Law;
use super::mixer::Mixer;
use crate::difference::Periods;
use crate::error::{Result, invalid};
use crate::lanes::Vector;

/// u = K (target − x) + K_I ∫(target − x) and an output map; gains: a row of (K, K_I) for the first output, then
/// the second, … The integrals count before they are used, as a PID's do; there is no anti-windup.
#[derive(Clone, Debug, PartialEq)]
pub struct StateFeedback {
    /// The states that are fed back.
    pub states: Vec<usize>,
    /// The states whose error is integrated and fed back too.
    pub integrals: Vec<usize>,
    /// Number of outputs of the law, the axes of the map.
    pub outputs: usize,
    /// From the law's outputs to commands.
    pub output: Mixer,
    /// Period of the commands, s.
    pub dt: f64,
}

impl StateFeedback {
    /// Gains of one output.
    fn row(&self) -> usize {
        self.states.len() + self.integrals.len()
    }
}

impl Law for StateFeedback {
    fn gains(&self) -> usize {
        self.outputs * self.row()
    }

    fn memory(&self) -> usize {
        self.integrals.len() + self.outputs
    }

    fn output(&self) -> &Mixer {
        &self.output
    }

    fn check(&self, states: usize) -> Result<()> {
        let missing = self.states.iter().chain(&self.integrals).find(|&&state| state >= states);
        if let Some(state) = missing {
            return invalid(format!("controller: expected states 0 to {}, found {state}", states - 1));
        }
        if self.gains() == 0 {
            return invalid(
                "controller: expected at least one state and one output, found none; feed something back",
            );
        }
        Ok(())
    }

    #[inline(always)]
    fn command<V: Vector>(
        &self,
        periods: &Periods,
        gains: &[V],
        memory: &mut [V],
        state: &[V],
        target: &[V],
        command: &mut [V],
    ) {
        let (integrals, outputs) = memory.split_at_mut(self.integrals.len());
        for (integral, &i) in integrals.iter_mut().zip(&self.integrals) {
            *integral = *integral + periods.difference(i, target[i], state[i]) * self.dt;
        }
        for (output, gains) in outputs.iter_mut().zip(gains.chunks_exact(self.row())) {
            let (of_states, of_integrals) = gains.split_at(self.states.len());
            let mut u = V::splat(0.0);
            for (&gain, &i) in of_states.iter().zip(&self.states) {
                u = u + gain * periods.difference(i, target[i], state[i]);
            }
            for (&gain, &integral) in of_integrals.iter().zip(integrals.iter()) {
                u = u + gain * integral;
            }
            *output = u;
        }
        self.output.apply(outputs, 1, command);
    }
}
