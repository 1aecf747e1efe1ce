//! The setting of runs: the signals, the limits that states may not leave, and the family that closes the loop. It is
//! checked once, when it is made.

use std::sync::Arc;

use crate::controller::Family;
use crate::error::{Result, invalid};
use crate::signals::Signals;

/// Signals, and where a run of theirs counts as diverged.
#[derive(Clone, Debug, PartialEq)]
pub struct Limits {
    signals: Arc<Signals>,
    magnitudes: Vec<f64>,
}

impl Limits {
    /// A run has diverged when a state reaches `divergence_factor`, above 0, times its scale; a periodic state may turn
    /// as often as it likes.
    pub fn new(signals: Arc<Signals>, divergence_factor: f64) -> Result<Self> {
        if !(divergence_factor.is_finite() && divergence_factor > 0.0) {
            return invalid(format!(
                "divergence factor: expected a number above 0, found {divergence_factor}"
            ));
        }
        let limit = |(state, scale): (usize, &f64)| match signals.periods.of(state) {
            None => scale * divergence_factor,
            Some(_) => f64::INFINITY,
        };
        let magnitudes = signals.state_scales.iter().enumerate().map(limit).collect();
        Ok(Self { signals, magnitudes })
    }

    /// The signals of the system.
    pub fn signals(&self) -> &Arc<Signals> {
        &self.signals
    }

    /// Magnitude of each state at which a run has diverged (n_x).
    pub fn magnitudes(&self) -> &[f64] {
        &self.magnitudes
    }
}

/// Limits, and the family of the controllers that runs within them are flown by.
#[derive(Clone, Debug)]
pub struct Setting {
    limits: Limits,
    family: Arc<Family>,
}

impl Setting {
    /// Refuses controllers that are for other signals.
    pub fn new(limits: Limits, family: Arc<Family>) -> Result<Self> {
        family.check(&limits.signals)?;
        Ok(Self { limits, family })
    }

    /// The signals of the system.
    pub fn signals(&self) -> &Arc<Signals> {
        &self.limits.signals
    }

    /// The family of the controllers.
    pub fn family(&self) -> &Arc<Family> {
        &self.family
    }

    /// Magnitude of each state at which a run has diverged (n_x).
    pub fn limits(&self) -> &[f64] {
        &self.limits.magnitudes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::difference::Periods;

    fn signals() -> Arc<Signals> {
        let signals = Signals {
            dt: 0.1,
            state_scales: vec![0.5, 2.0],
            command_bounds: vec![(-1.0, 1.0)],
            command_scales: vec![1.0],
            derivative_of: vec![None, None],
            kinematics: None,
            periods: Periods::new(vec![None, Some(6.0)]).unwrap(),
        };
        Arc::new(signals.validated().unwrap())
    }

    #[test]
    fn limits_are_multiples_of_the_scales_except_for_states_that_turn() {
        assert_eq!(Limits::new(signals(), 4.0).unwrap().magnitudes(), [2.0, f64::INFINITY]);
    }

    #[test]
    fn a_divergence_factor_that_is_no_positive_number_is_refused() {
        for factor in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let refusal = Limits::new(signals(), factor).unwrap_err().to_string();
            assert!(refusal.contains("above 0"), "{refusal}");
        }
    }
}
