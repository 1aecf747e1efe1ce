//! Slopes: gradient and curvature of χ², by differences between variants that run side by side.

use super::Tuning;
use super::observer::{LANES, Part};
use super::variant::Variant;
use crate::lanes::dispatch;
use crate::regression::{Gram, Whitening};
use crate::workers::Workers;

/// Relative step of a finite difference.
const STEP: f64 = 1e-6;

impl Tuning<'_> {
    /// Prediction errors to the first order of what is free: a regression on their slopes of what these have to make up
    /// for. None if a variant diverges.
    pub fn linearised(&self, workers: &Workers) -> Option<Gram> {
        let (whitenings, at) = (self.whitenings(), self.start());
        let total = self.costs(&whitenings, std::slice::from_ref(&at), workers)[0];
        let (gradient, curvature) = self.normal(&whitenings, &at, workers)?;
        let missing: Vec<f64> = gradient.iter().map(|slope| -slope).collect();
        Some(Gram::of(&curvature, &missing, total, self.readings()))
    }

    /// Gradient and curvature (Gauss and Newton) of half of χ²; none if a variant diverges.
    pub(super) fn normal(
        &self,
        whitenings: &[Vec<Whitening>],
        at: &Variant,
        workers: &Workers,
    ) -> Option<(Vec<f64>, Vec<f64>)> {
        let size = self.size();
        let mut steps = Vec::with_capacity(size);
        let mut variants = Vec::with_capacity(size);
        for (p, value) in self.values(at).into_iter().enumerate() {
            let mut step = vec![0.0; size];
            // A constant of 0 has no size; what is linear in it has the same slope for any step.
            let size = value.abs();
            step[p] = STEP * if size > f64::MIN_POSITIVE.sqrt() { size } else { STEP };
            steps.push(step[p]);
            variants.push(self.moved(at, &step));
        }
        let groups: Vec<Vec<Variant>> = variants
            .chunks(LANES - 1)
            .map(|chunk| std::iter::once(at.clone()).chain(chunk.iter().cloned()).collect())
            .collect();
        let parts = workers.map(self.records.len(), |r| {
            let mut gradient = vec![0.0; size];
            let mut curvature = vec![0.0; size * size];
            let mut base: Vec<f64> = vec![];
            let mut slopes: Vec<Vec<f64>> = Vec::with_capacity(size);
            for group in &groups {
                let part =
                    Part { tuning: self, record: r, whitenings: &whitenings[r], variants: group, keep: true };
                let run = dispatch(workers.width(), part);
                if run.diverged.iter().any(|&gone| gone) {
                    return None;
                }
                for varied in &run.errors[1..] {
                    let step = steps[slopes.len()];
                    slopes.push(varied.iter().zip(&run.errors[0]).map(|(a, b)| (a - b) / step).collect());
                }
                base = run.errors.into_iter().next().expect("the model itself");
            }
            for i in 0..size {
                gradient[i] = slopes[i].iter().zip(&base).map(|(s, e)| s * e).sum();
                for j in 0..=i {
                    let product: f64 = slopes[i].iter().zip(&slopes[j]).map(|(a, b)| a * b).sum();
                    curvature[i * size + j] = product;
                    curvature[j * size + i] = product;
                }
            }
            Some((gradient, curvature))
        });
        let (mut gradient, mut curvature) = (vec![0.0; size], vec![0.0; size * size]);
        for part in parts {
            let (g, c) = part?;
            gradient.iter_mut().zip(g).for_each(|(a, b)| *a += b);
            curvature.iter_mut().zip(c).for_each(|(a, b)| *a += b);
        }
        Some((gradient, curvature))
    }
}
