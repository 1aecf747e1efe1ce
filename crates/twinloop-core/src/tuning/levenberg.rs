//! The method of Levenberg and Marquardt: damped Gauss-Newton steps until χ² no longer falls (Marquardt 1963).

use super::variant::Variant;
use super::{Tuned, Tuning};
use crate::linear_algebra::{covariance, damped_step};
use crate::workers::Workers;

/// Dampings that are tried at once, as multiples of the last that worked.
const DAMPINGS: [f64; 8] = [1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3, 1e4, 1e6];

impl Tuning<'_> {
    /// The model with the constants and times of the smallest χ², after at most `iterations` steps.
    pub fn tune(&self, iterations: usize, workers: &Workers) -> Tuned {
        let whitenings = self.whitenings();
        let mut best = self.start();
        let mut damping = 1e-3;
        let mut chi_squared = self.costs(&whitenings, std::slice::from_ref(&best), workers)[0];
        let mut open = vec![];
        for _ in 0..iterations {
            if !chi_squared.is_finite() {
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
            let Some(found) = found.filter(|&found| costs[found] < chi_squared) else { break };
            let gained = chi_squared - costs[found];
            (damping, best) = tried[found].clone();
            chi_squared = costs[found];
            if gained < 1e-3 {
                break;
            }
        }
        if chi_squared.is_finite()
            && let Some((_, curvature)) = self.normal(&whitenings, &best, workers)
        {
            open = covariance(&curvature, &self.values(&best)).unwrap_or_default();
        }
        Tuned {
            constants: best.constants,
            lags: best.lags,
            chi_squared,
            readings: self.readings(),
            covariance: open,
        }
    }
}
