//! Discrimination: the test on which the models disagree most is the best (paper, section IV.C).

/// Keeps 1 / Var finite where all models agree.
const GUARD: f64 = 1e-9;

/// 1 / variance of the models' final distances of one test, each capped: a model that diverges is one far model, not a
/// proof that the test discriminates.
pub fn discrimination(distances: impl Iterator<Item = f64> + Clone, cap: f64) -> f64 {
    let capped = distances.map(|distance| distance.min(cap));
    let count = capped.clone().count() as f64;
    let mean = capped.clone().sum::<f64>() / count;
    let variance = capped.map(|distance| (distance - mean) * (distance - mean)).sum::<f64>() / count;
    1.0 / (variance + GUARD)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_the_inverse_of_the_variance() {
        let value = discrimination([1.0, 2.0, 3.0, 6.0].into_iter(), 100.0);
        assert!((value - 1.0 / 3.5).abs() < 1e-9, "{value}");
    }

    #[test]
    fn a_model_that_diverges_counts_as_the_cap() {
        let diverged = discrimination([1.0, f64::INFINITY].into_iter(), 3.0);
        assert_eq!(diverged, discrimination([1.0, 3.0].into_iter(), 3.0));
    }

    #[test]
    fn models_that_agree_give_a_large_finite_number() {
        assert!((discrimination([0.7; 5].into_iter(), 3.0) - 1e9).abs() < 1.0);
    }
}
