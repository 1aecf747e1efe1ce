//! Matrices of a size that is known when the engine is compiled: loops of a known length are several times faster.

/// Row after row.
pub(crate) type Small<const R: usize, const C: usize = R> = [[f64; C]; R];

/// L⁻¹ with L Lᵀ a covariance, by Cholesky; of its diagonal alone where rounding has left no such L.
pub(crate) fn inverse_root<const D: usize>(covariance: &Small<D>) -> Small<D> {
    let mut root: Small<D> = [[0.0; D]; D];
    let mut lower: Small<D> = [[0.0; D]; D];
    for i in 0..D {
        for j in 0..=i {
            let sum = covariance[i][j] - (0..j).map(|k| lower[i][k] * lower[j][k]).sum::<f64>();
            if i > j {
                lower[i][j] = sum / lower[j][j];
            } else if sum > 0.0 {
                lower[i][i] = sum.sqrt();
            } else {
                root = [[0.0; D]; D];
                for k in 0..D {
                    root[k][k] = 1.0 / (covariance[k][k].abs() + f64::MIN_POSITIVE).sqrt();
                }
                return root;
            }
        }
        root[i][i] = 1.0 / lower[i][i];
        for j in 0..i {
            root[i][j] = -(j..i).map(|k| lower[i][k] * root[k][j]).sum::<f64>() * root[i][i];
        }
    }
    root
}

/// Φ P Φᵀ, symmetric to the last bit.
pub(crate) fn congruent<const I: usize>(covariance: &Small<I>, transition: &Small<I>) -> Small<I> {
    let mut half: Small<I> = [[0.0; I]; I];
    let mut next: Small<I> = [[0.0; I]; I];
    for i in 0..I {
        for j in 0..I {
            half[i][j] = (0..I).map(|k| transition[i][k] * covariance[k][j]).sum();
        }
    }
    for i in 0..I {
        for j in 0..=i {
            next[i][j] = (0..I).map(|k| half[i][k] * transition[j][k]).sum();
            next[j][i] = next[i][j];
        }
    }
    next
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear_algebra::Cholesky;
    use proptest::prelude::*;

    const ORDER: usize = 4;

    /// Σ r rᵀ over rows, and some of the identity.
    fn covariance(rows: &[[f64; ORDER]]) -> Small<ORDER> {
        let entry = |i: usize, j: usize| {
            rows.iter().map(|row| row[i] * row[j]).sum::<f64>() + if i == j { 0.1 } else { 0.0 }
        };
        std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
    }

    proptest! {
        #[test]
        fn an_inverse_root_makes_a_covariance_the_identity(
            rows in prop::collection::vec(prop::array::uniform4(-2.0..2.0_f64), 6),
        ) {
            let covariance = covariance(&rows);
            let root = inverse_root(&covariance);
            let whitened = congruent(&covariance, &root);
            // L⁻ᵀ L⁻¹ is the inverse that the factor of matrices of any size gives.
            let inverse = Cholesky::new(covariance.as_flattened(), ORDER, 0.0).expect("positive definite").inverse();
            for i in 0..ORDER {
                for j in 0..ORDER {
                    let identity = if i == j { 1.0 } else { 0.0 };
                    prop_assert!((whitened[i][j] - identity).abs() < 1e-10);
                    prop_assert_eq!(whitened[i][j].to_bits(), whitened[j][i].to_bits());
                    let product: f64 = (0..ORDER).map(|k| root[k][i] * root[k][j]).sum();
                    prop_assert!((product - inverse[i * ORDER + j]).abs() < 1e-9 * (1.0 + product.abs()));
                }
            }
        }
    }

    #[test]
    fn where_rounding_has_left_no_root_the_diagonal_gives_one() {
        assert_eq!(inverse_root(&[[4.0, 4.0], [4.0, 4.0]]), [[0.5, 0.0], [0.0, 0.5]]);
    }
}
