//! Cholesky's factor of a small symmetric matrix, with every sum in a fixed order so that all machines agree.

/// Lower triangular L with L Lᵀ = A, row after row.
#[derive(Clone, Debug)]
pub struct Cholesky {
    lower: Vec<f64>,
    order: usize,
}

impl Cholesky {
    /// The factor of a symmetric matrix (order × order); none if a pivot falls below `smallest` times its diagonal.
    pub fn new(matrix: &[f64], order: usize, smallest: f64) -> Option<Self> {
        // Row j of the transposed factor is subtracted from all rows below at once: sums in the same order as
        // entry by entry, along memory.
        let mut upper = matrix[..order * order].to_vec();
        for j in 0..order {
            let (row, below) = upper[j * order..].split_at_mut(order);
            let pivot = row[j];
            if !(pivot > smallest * matrix[j * order + j].abs() && pivot > 0.0) {
                return None;
            }
            let root = pivot.sqrt();
            row[j] = root;
            row[j + 1..].iter_mut().for_each(|value| *value /= root);
            for (i, other) in below.chunks_exact_mut(order).enumerate() {
                let i = i + j + 1;
                let factor = row[i];
                other[i..].iter_mut().zip(&row[i..]).for_each(|(o, r)| *o -= factor * r);
            }
        }
        let mut lower = vec![0.0; order * order];
        for i in 0..order {
            for j in 0..=i {
                lower[i * order + j] = upper[j * order + i];
            }
        }
        Some(Self { lower, order })
    }

    /// x with L x = b.
    fn forward(&self, b: &[f64]) -> Vec<f64> {
        let mut x = b.to_vec();
        for i in 0..self.order {
            for k in 0..i {
                x[i] -= self.lower[i * self.order + k] * x[k];
            }
            x[i] /= self.lower[i * self.order + i];
        }
        x
    }

    /// x with Lᵀ x = b.
    fn backward(&self, b: &[f64]) -> Vec<f64> {
        let mut x = b.to_vec();
        for i in (0..self.order).rev() {
            for k in i + 1..self.order {
                x[i] -= self.lower[k * self.order + i] * x[k];
            }
            x[i] /= self.lower[i * self.order + i];
        }
        x
    }

    /// L x.
    pub fn times(&self, x: &[f64]) -> Vec<f64> {
        let row = |i: usize| (0..=i).map(|k| self.lower[i * self.order + k] * x[k]).sum();
        (0..self.order).map(row).collect()
    }

    /// x with A x = b.
    pub fn solve(&self, b: &[f64]) -> Vec<f64> {
        self.backward(&self.forward(b))
    }

    /// A⁻¹ (order × order).
    pub fn inverse(&self) -> Vec<f64> {
        let order = self.order;
        // M = L⁻¹ row after row, and A⁻¹ = Mᵀ M.
        let mut rows = vec![0.0; order * order];
        let mut inverse = vec![0.0; order * order];
        for i in 0..order {
            let (above, row) = rows.split_at_mut(i * order);
            let row = &mut row[..=i];
            row[i] = 1.0;
            for (k, other) in above.chunks_exact(order).enumerate() {
                let factor = self.lower[i * order + k];
                row.iter_mut().zip(&other[..=k]).for_each(|(r, o)| *r -= factor * o);
            }
            let pivot = self.lower[i * order + i];
            row.iter_mut().for_each(|value| *value /= pivot);
            for (a, &factor) in row.iter().enumerate() {
                let target = &mut inverse[a * order..][..=i];
                target.iter_mut().zip(row.iter()).for_each(|(t, r)| *t += factor * r);
            }
        }
        inverse
    }

    /// log det A.
    pub fn log_determinant(&self) -> f64 {
        (0..self.order).map(|i| 2.0 * libm::log(self.lower[i * self.order + i])).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn solutions_solve(rows in prop::collection::vec(prop::array::uniform4(-2.0..2.0_f64), 6), b in prop::array::uniform4(-3.0..3.0_f64)) {
            let mut a = vec![0.0; 16];
            for row in &rows {
                for i in 0..4 {
                    for j in 0..4 {
                        a[i * 4 + j] += row[i] * row[j];
                    }
                }
            }
            for i in 0..4 {
                a[i * 4 + i] += 0.1;
            }
            let factor = Cholesky::new(&a, 4, 1e-12).expect("positive definite");
            let x = factor.solve(&b);
            let inverse = factor.inverse();
            for i in 0..4 {
                let product: f64 = (0..4).map(|j| a[i * 4 + j] * x[j]).sum();
                prop_assert!((product - b[i]).abs() < 1e-8);
                for k in 0..4 {
                    let product: f64 = (0..4).map(|j| a[i * 4 + j] * inverse[j * 4 + k]).sum();
                    let identity = if i == k { 1.0 } else { 0.0 };
                    prop_assert!((product - identity).abs() < 1e-8);
                }
            }
        }
    }

    #[test]
    fn the_determinant_of_a_known_matrix_is_found_and_a_singular_one_refused() {
        let factor = Cholesky::new(&[4.0, 2.0, 2.0, 3.0], 2, 1e-12).expect("positive definite");
        assert!((factor.log_determinant() - 8.0_f64.ln()).abs() < 1e-14);
        assert!(Cholesky::new(&[1.0, 1.0, 1.0, 1.0], 2, 1e-12).is_none());
    }
}
