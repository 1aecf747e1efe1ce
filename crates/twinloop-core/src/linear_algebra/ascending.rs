//! The order of numbers.

/// Places of numbers, that of the smallest first; of equal ones those that come first.
pub(crate) fn ascending(numbers: &[f64]) -> Vec<usize> {
    let mut places: Vec<usize> = (0..numbers.len()).collect();
    places.sort_by(|&i, &j| numbers[i].total_cmp(&numbers[j]));
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_numbers_keep_their_order() {
        assert_eq!(ascending(&[2.0, f64::INFINITY, -1.0, 2.0, -0.0, 0.0]), [2, 4, 5, 0, 3, 1]);
        assert!(ascending(&[]).is_empty());
    }
}
