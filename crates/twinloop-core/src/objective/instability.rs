//! Instability: how much small changes of the gains change where the run ends (paper, section IV.C).

/// Variance of the mutants' final distances of one test. A mutant at the cap, which has diverged or as good as that,
/// counts as cap² instead: if all of them did, their variance would be zero and the test look perfectly stable.
pub fn instability(distances: impl Iterator<Item = f64> + Clone, cap: f64) -> f64 {
    let stable = distances.clone().filter(|&distance| distance < cap);
    let (count, stable_count) = (distances.count() as f64, stable.clone().count() as f64);
    let mean = stable.clone().sum::<f64>() / stable_count.max(1.0);
    let spread = stable.map(|distance| (distance - mean) * (distance - mean)).sum::<f64>();
    (spread + (count - stable_count) * cap * cap) / count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_the_variance_where_nothing_diverges() {
        assert!((instability([1.0, 2.0, 3.0, 6.0].into_iter(), 100.0) - 3.5).abs() < 1e-12);
    }

    #[test]
    fn mutants_that_all_diverge_are_not_stable() {
        assert_eq!(instability([f64::INFINITY; 4].into_iter(), 3.0), 9.0);
    }

    #[test]
    fn one_mutant_at_the_cap_counts_as_its_square() {
        assert_eq!(instability([1.0, 1.0, 1.0, 3.0].into_iter(), 3.0), 9.0 / 4.0);
    }
}
