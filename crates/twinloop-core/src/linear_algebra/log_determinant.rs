//! log det(I + G) of a Gram matrix, by Cholesky in a fixed order, one matrix a lane.

use crate::lanes::Vector;

/// Place of the entry of a row and a column up to it, where the lower triangle lies row after row.
#[inline(always)]
pub(crate) fn place(row: usize, column: usize) -> usize {
    row * (row + 1) / 2 + column
}

/// log det(I + G). `gram` is the lower triangle of G, positive semidefinite, and is overwritten.
#[inline(always)]
pub(crate) fn log_determinant<V: Vector>(gram: &mut [V], size: usize) -> V {
    let mut total = V::splat(0.0);
    for row in 0..size {
        for column in 0..=row {
            let mut entry = gram[place(row, column)];
            for k in 0..column {
                entry = entry - gram[place(row, k)] * gram[place(column, k)];
            }
            gram[place(row, column)] = if column < row {
                entry / gram[place(column, column)]
            } else {
                // No pivot of I + G is below 1; rounding alone could put one there.
                let pivot = (entry + V::splat(1.0)).clamp(1.0, f64::MAX);
                total = total + pivot.map(libm::log);
                pivot.sqrt()
            };
        }
    }
    total
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::Scalar;
    use proptest::prelude::*;

    /// det(I + G) by Laplace's expansion.
    fn determinant(matrix: &[Vec<f64>]) -> f64 {
        let Some((first, rest)) = matrix.split_first() else { return 1.0 };
        let minor = |skip: usize| -> Vec<Vec<f64>> {
            rest.iter().map(|row| [&row[..skip], &row[skip + 1..]].concat()).collect()
        };
        let term = |(j, x): (usize, &f64)| x * determinant(&minor(j)) * if j % 2 == 0 { 1.0 } else { -1.0 };
        first.iter().enumerate().map(term).sum()
    }

    proptest! {
        #[test]
        fn is_the_logarithm_of_the_determinant(
            rows in prop::collection::vec(prop::collection::vec(-3.0..3.0, 7), 1..6),
        ) {
            let size = rows.len();
            let entry = |a: usize, b: usize| rows[a].iter().zip(&rows[b]).map(|(x, y)| x * y).sum::<f64>();
            let mut gram: Vec<Scalar> =
                (0..size).flat_map(|a| (0..=a).map(move |b| (a, b))).map(|(a, b)| Scalar::splat(entry(a, b))).collect();
            let full: Vec<Vec<f64>> = (0..size)
                .map(|a| (0..size).map(|b| entry(a, b) + f64::from(u8::from(a == b))).collect())
                .collect();
            let found = log_determinant(&mut gram, size).lane(0);
            prop_assert!((found - determinant(&full).ln()).abs() < 1e-8, "{found}");
        }
    }

    #[test]
    fn rows_that_are_alike_and_long_still_give_a_finite_number() {
        let found = |squared: f64| log_determinant(&mut [Scalar::splat(squared); 6], 3).lane(0);
        assert!((found(1e8) - (1.0 + 3e8_f64).ln()).abs() < 1e-6, "{}", found(1e8));
        // What is left of these after rounding is no number to trust, but a number.
        for squared in [1e16, 1e20, 1e300] {
            assert!(found(squared).is_finite() && found(squared) >= squared.ln(), "{}", found(squared));
        }
    }
}
