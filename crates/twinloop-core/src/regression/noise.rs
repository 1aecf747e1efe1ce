//! The noise of a chain: of its sensors, and of the disturbances that drive it beside the law.

use crate::error::{Result, invalid};

/// The variances that whitening needs (Harvey 1989, chapter 3).
#[derive(Clone, Debug, PartialEq)]
pub struct Noise {
    /// Of each state's sensor.
    pub sensors: Vec<f64>,
    /// Of the white disturbance that drives the first state, per second (per period where features are increments).
    pub process: f64,
    /// Of a correlated disturbance, such as gusts, in the features' own unit squared; 0 for none.
    pub gust: f64,
    /// Correlation time of that disturbance, s.
    pub correlation_time: f64,
}

impl Noise {
    /// The same, once it is noise of so many sensors.
    pub fn validated(self, sensors: usize) -> Result<Self> {
        let positive = |x: f64| x.is_finite() && x > 0.0;
        let motion =
            [self.process, self.gust, self.correlation_time].iter().all(|x| x.is_finite() && *x >= 0.0);
        if self.sensors.len() != sensors
            || !self.sensors.iter().all(|&x| positive(x))
            || !motion
            || self.correlation_time == 0.0
        {
            return invalid(format!(
                "noise: expected {sensors} sensor variances above 0 and (process variance, gust variance, correlation time), found \
                 {self:?}"
            ));
        }
        Ok(self)
    }

    /// States of the filter beside those of the chain.
    pub(crate) fn hidden(&self) -> usize {
        usize::from(self.gust > 0.0)
    }

    /// Correlation of the disturbance with itself one period later.
    pub(crate) fn correlation(&self, dt: f64) -> f64 {
        libm::exp(-dt / self.correlation_time.max(1e-3 * dt))
    }
}
