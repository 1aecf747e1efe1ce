//! Eigenvalues and eigenvectors of a small symmetric matrix, by Jacobi's rotations in a fixed order.

use super::ascending;
use crate::error::{Result, invalid};

/// Rounds over all pairs at most; each one squares what is left, so that ten are many.
const ROUNDS: usize = 64;
/// A correlation whose square is no more than this is rounding.
const NOTHING: f64 = 0.25 * f64::EPSILON * f64::EPSILON;

/// A = Σ_i λ_i v_i v_iᵀ with λ ascending and v orthonormal.
#[derive(Clone, Debug, PartialEq)]
pub struct Eigen {
    /// λ (order).
    pub values: Vec<f64>,
    /// v, a row each (order × order).
    pub vectors: Vec<f64>,
}

impl Eigen {
    /// Of a symmetric matrix (order × order), by the cyclic method (G. H. Golub, C. F. Van Loan, *Matrix
    /// Computations*, section 8.5; the updates are those of H. Rutishauser, 1966).
    pub fn new(matrix: &[f64], order: usize) -> Self {
        let mut a = matrix[..order * order].to_vec();
        let mut v = vec![0.0; order * order];
        (0..order).for_each(|i| v[i * order + i] = 1.0);
        for _ in 0..ROUNDS {
            let mut turned = false;
            for p in 0..order {
                for q in p + 1..order {
                    turned |= turn(&mut a, &mut v, order, p, q);
                }
            }
            if !turned {
                break;
            }
        }
        let diagonal: Vec<f64> = (0..order).map(|i| a[i * order + i]).collect();
        let places = ascending(&diagonal);
        Self {
            values: places.iter().map(|&i| a[i * order + i]).collect(),
            vectors: places.iter().flat_map(|&i| v[i * order..][..order].to_vec()).collect(),
        }
    }

    /// The same of what may be no such matrix (rows × columns), which is refused.
    pub fn checked(matrix: &[f64], [rows, columns]: [usize; 2]) -> Result<Self> {
        let fits = rows == columns && rows > 0 && matrix.len() == rows * columns;
        if !fits || !matrix.iter().all(|x| x.is_finite()) {
            return invalid(format!(
                "eigen: expected a square matrix of finite numbers, at least one, found {rows} × {columns}, or NaN or \
                 an infinite one in it"
            ));
        }
        Ok(Self::new(matrix, rows))
    }

    /// v_i.
    pub fn vector(&self, i: usize) -> &[f64] {
        &self.vectors[i * self.values.len()..][..self.values.len()]
    }
}

/// Makes a_pq zero by a rotation, unless it is nothing beside a_pp and a_qq; whether it was one.
fn turn(a: &mut [f64], v: &mut [f64], order: usize, p: usize, q: usize) -> bool {
    let at = |i: usize, j: usize| i.min(j) * order + i.max(j);
    let (pp, pq, qq) = (a[at(p, p)], a[at(p, q)], a[at(q, q)]);
    // a_pq² beside a_pp a_qq, in quotients: no unit of the matrix can make them overflow.
    let correlated = (pq / pp * (pq / qq)).abs() > NOTHING;
    if !correlated {
        return false;
    }
    let ratio = (qq - pp) / (2.0 * pq);
    let tangent = f64::copysign(1.0, ratio) / (ratio.abs() + (ratio * ratio + 1.0).sqrt());
    let cosine = 1.0 / (tangent * tangent + 1.0).sqrt();
    let sine = tangent * cosine;
    a[at(p, p)] = pp - tangent * pq;
    a[at(q, q)] = qq + tangent * pq;
    a[at(p, q)] = 0.0;
    let rotated = |x: f64, y: f64| (cosine * x - sine * y, sine * x + cosine * y);
    for k in (0..order).filter(|&k| k != p && k != q) {
        (a[at(k, p)], a[at(k, q)]) = rotated(a[at(k, p)], a[at(k, q)]);
    }
    for k in 0..order {
        let (i, j) = (p * order + k, q * order + k);
        (v[i], v[j]) = rotated(v[i], v[j]);
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ORDER: usize = 5;

    /// A symmetric matrix from entries of its upper triangle.
    fn symmetric(entries: &[f64]) -> Vec<f64> {
        let mut matrix = vec![0.0; ORDER * ORDER];
        let mut entry = entries.iter();
        for i in 0..ORDER {
            for j in i..ORDER {
                let value = *entry.next().expect("an entry for each pair");
                (matrix[i * ORDER + j], matrix[j * ORDER + i]) = (value, value);
            }
        }
        matrix
    }

    fn product(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| a * b).sum()
    }

    proptest! {
        #[test]
        fn vectors_are_orthonormal_and_are_only_stretched(entries in prop::collection::vec(-3.0..3.0_f64, 15)) {
            let matrix = symmetric(&entries);
            let found = Eigen::new(&matrix, ORDER);
            prop_assert!(found.values.is_sorted());
            for i in 0..ORDER {
                for j in 0..ORDER {
                    let identity = if i == j { 1.0 } else { 0.0 };
                    prop_assert!((product(found.vector(i), found.vector(j)) - identity).abs() < 1e-13);
                }
                for (row, x) in matrix.chunks_exact(ORDER).zip(found.vector(i)) {
                    prop_assert!((product(row, found.vector(i)) - found.values[i] * x).abs() < 1e-12);
                }
            }
        }

        #[test]
        fn a_power_of_two_on_the_matrix_is_one_on_the_values(entries in prop::collection::vec(-3.0..3.0_f64, 15), power in -40_i32..40) {
            let matrix = symmetric(&entries);
            let factor = libm::ldexp(1.0, power);
            let scaled: Vec<f64> = matrix.iter().map(|x| factor * x).collect();
            let (one, other) = (Eigen::new(&matrix, ORDER), Eigen::new(&scaled, ORDER));
            prop_assert_eq!(&one.vectors, &other.vectors);
            prop_assert_eq!(one.values.iter().map(|x| factor * x).collect::<Vec<_>>(), other.values);
        }
    }

    #[test]
    fn values_of_known_matrices_are_found() {
        let found = Eigen::new(&[2.0, 1.0, 1.0, 2.0], 2);
        assert!((found.values[0] - 1.0).abs() < 1e-15 && (found.values[1] - 3.0).abs() < 1e-15);
        // Second differences: 2 − 2 cos(k π / (n + 1)).
        let order = 12;
        let mut matrix = vec![0.0; order * order];
        for i in 0..order {
            matrix[i * order + i] = 2.0;
            if i > 0 {
                (matrix[i * order + i - 1], matrix[(i - 1) * order + i]) = (-1.0, -1.0);
            }
        }
        for (k, value) in Eigen::new(&matrix, order).values.iter().enumerate() {
            let expected = 2.0 - 2.0 * libm::cos((k + 1) as f64 * std::f64::consts::PI / (order + 1) as f64);
            assert!((value - expected).abs() < 1e-14, "{k}: {value} instead of {expected}");
        }
    }

    #[test]
    fn small_values_beside_large_ones_keep_their_digits() {
        // Graded, positive definite: Jacobi's method finds each value to its own precision (Demmel and Veselić 1992).
        let scales = [1.0, 1e-5, 1e-10];
        let matrix: Vec<f64> = (0..9)
            .map(|at| scales[at / 3] * scales[at % 3] * if at / 3 == at % 3 { 1.0 } else { 0.1 })
            .collect();
        let found = Eigen::new(&matrix, 3);
        let determinant = 1e-30 * (1.0 - 3.0 * 0.01 + 2.0 * 0.001);
        let product: f64 = found.values.iter().product();
        assert!((product / determinant - 1.0).abs() < 1e-13, "{:?}", found.values);
    }
}
