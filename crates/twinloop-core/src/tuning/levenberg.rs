//! Levenberg's and Marquardt's method: damped steps until χ² gains no more.

use super::variant::Variant;
use super::{Tuned, Tuning};
use crate::linear_algebra::{covariance, damped_step};
use crate::workers::Workers;

/// Dampings that are tried at once, as multiples of the last that worked.
const DAMPINGS: [f64; 8] = [1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3, 1e4, 1e6];

impl Tuning<'_> {
    /// The model with constants and times that leave least, after at most `iterations` steps.
    pub fn tune(&self, iterations: usize, workers: &Workers) -> Tuned {
        let whitenings = self.whitenings();
        let mut best = self.start();
        let mut damping = 1e-3;
        let mut left = self.costs(&whitenings, std::slice::from_ref(&best), workers)[0];
        let mut open = vec![];
        for _ in 0..iterations {
            if !left.is_finite() {
                break;
            }
            let Some((gradient, curvature)) = self.normal(&whitenings, &best, workers) else { break };
            let tried: Vec<(f64, Variant)> = DAMPINGS
                .iter()
                .filter_map(|factor| {
                    let damping = (damping * factor).clamp(1e-12, 1e12);
                    Some((damping, self.moved(&best, &damped_step(&gradient, &curvature, damping)?)))
                })
                .collect();
            let variants: Vec<_> = tried.iter().map(|(_, variant)| variant.clone()).collect();
            let costs = self.costs(&whitenings, &variants, workers);
            let found = (0..costs.len()).min_by(|&a, &b| costs[a].total_cmp(&costs[b]));
            let Some(found) = found.filter(|&found| costs[found] < left) else { break };
            let gained = left - costs[found];
            (damping, best) = tried[found].clone();
            left = costs[found];
            if gained < 1e-3 {
                break;
            }
        }
        if left.is_finite()
            && let Some((_, curvature)) = self.normal(&whitenings, &best, workers)
        {
            open = covariance(&curvature, &self.values(&best)).unwrap_or_default();
        }
        let readings =
            self.records.iter().map(|record| record.weights.iter().filter(|&&w| w > 0.0).count()).sum();
        Tuned { constants: best.constants, lags: best.lags, left, readings, covariance: open }
    }
}
