//! Noise: of sensors, and of what drives a chain beside the law.

use crate::error::{Result, invalid};

/// Variances that whitening needs.
#[derive(Clone, Debug, PartialEq)]
pub struct Noise {
    /// Of each state's sensor.
    pub sensors: Vec<f64>,
    /// Of the white disturbance that drives the first state, per second (per period where features are increments).
    pub process: f64,
    /// Of a disturbance that lasts, as gusts do, in the features' own unit squared; 0 for none.
    pub gust: f64,
    /// Time after which such a disturbance is forgotten to 1/e, s.
    pub memory: f64,
}

impl Noise {
    /// Refuses what is no noise of so many sensors.
    pub fn validated(self, sensors: usize) -> Result<Self> {
        let positive = |x: f64| x.is_finite() && x > 0.0;
        let motion = [self.process, self.gust, self.memory].iter().all(|x| x.is_finite() && *x >= 0.0);
        if self.sensors.len() != sensors
            || !self.sensors.iter().all(|&x| positive(x))
            || !motion
            || self.memory == 0.0
        {
            return invalid(format!(
                "noise: expected {sensors} sensor variances above 0 and (process variance, gust variance, memory), found \
                 {self:?}"
            ));
        }
        Ok(self)
    }

    /// States of the filter beside those of the chain.
    pub(crate) fn hidden(&self) -> usize {
        usize::from(self.gust > 0.0)
    }

    /// Share of a lasting disturbance that is left after a period.
    pub(crate) fn kept(&self, dt: f64) -> f64 {
        libm::exp(-dt / self.memory.max(1e-3 * dt))
    }
}
