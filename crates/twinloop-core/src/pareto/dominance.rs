//! Dominance: no worse in every objective and better in one.

/// Whether the point `a`, (columns), dominates the point `b`, (columns): a_j ≤ b_j for every j and a_j < b_j for some j.
///
/// Equal points do not dominate each other.
#[inline]
pub fn dominates(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).all(|(a, b)| a <= b) && a.iter().zip(b).any(|(a, b)| a < b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Three points on so coarse a grid that dominance and ties are common.
    fn three_points() -> impl Strategy<Value = [Vec<f64>; 3]> {
        (1..5_usize).prop_flat_map(|columns| {
            let point = prop::collection::vec((-1..2_i32).prop_map(f64::from), columns);
            [point.clone(), point.clone(), point]
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4096))]

        #[test]
        fn dominance_is_a_strict_order([a, b, c] in three_points()) {
            prop_assert!(!dominates(&a, &a), "irreflexive");
            prop_assert!(!(dominates(&a, &b) && dominates(&b, &a)), "asymmetric");
            prop_assert!(!(dominates(&a, &b) && dominates(&b, &c)) || dominates(&a, &c), "transitive");
        }

        #[test]
        fn a_point_dominates_whatever_it_is_nowhere_above_and_different_from([a, b, _] in three_points()) {
            let nowhere_above = (0..a.len()).filter(|&j| a[j] > b[j]).count() == 0;
            prop_assert_eq!(dominates(&a, &b), nowhere_above && a != b);
        }
    }

    #[test]
    fn one_better_objective_is_enough_and_one_worse_is_too_many() {
        assert!(dominates(&[1.0, 2.0], &[1.0, 3.0]));
        assert!(!dominates(&[1.0, 3.0], &[2.0, 2.0]));
        assert!(!dominates(&[0.0], &[-0.0]) && !dominates(&[-0.0], &[0.0]));
    }
}
