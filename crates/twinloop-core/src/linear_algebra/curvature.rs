//! Steps and covariances from the gradient and the curvature (Gauss and Newton) of half of χ², on parameters scaled by
//! their curvature.

use super::Cholesky;

/// The damped step, on parameters scaled by their curvature.
pub(crate) fn damped_step(gradient: &[f64], curvature: &[f64], damping: f64) -> Option<Vec<f64>> {
    let size = gradient.len();
    let scales = scales(curvature, size);
    let mut matrix = vec![0.0; size * size];
    for i in 0..size {
        for j in 0..size {
            matrix[i * size + j] = curvature[i * size + j] * scales[i] * scales[j];
        }
        matrix[i * size + i] += damping + 1e-12;
    }
    let right: Vec<f64> = gradient.iter().zip(&scales).map(|(g, s)| -g * s).collect();
    let scaled = Cholesky::new(&matrix, size, 0.0)?.solve(&right);
    Some(scaled.iter().zip(&scales).map(|(x, s)| x * s).collect())
}

/// Covariance of values from the curvature and a prior, a normal distribution with |value| as its standard deviation: if
/// two values do the same, no data separate them.
pub(crate) fn covariance(curvature: &[f64], values: &[f64]) -> Option<Vec<f64>> {
    let size = values.len();
    let scales = scales(curvature, size);
    let mut matrix = vec![0.0; size * size];
    for i in 0..size {
        for j in 0..size {
            matrix[i * size + j] = curvature[i * size + j] * scales[i] * scales[j];
        }
        let prior = scales[i] / values[i].abs().max(f64::MIN_POSITIVE.sqrt());
        matrix[i * size + i] += 1e-9 + (prior * prior).min(1e280);
    }
    let inverse = Cholesky::new(&matrix, size, 0.0)?.inverse();
    Some((0..size * size).map(|ij| inverse[ij] * scales[ij / size] * scales[ij % size]).collect())
}

fn scales(curvature: &[f64], size: usize) -> Vec<f64> {
    (0..size).map(|i| 1.0 / curvature[i * size + i].max(f64::MIN_POSITIVE.sqrt()).sqrt()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_that_is_not_damped_goes_to_the_minimum_of_a_parabola_and_a_damped_one_along_the_gradient() {
        // ½ xᵀ C x − bᵀ x at x = 0, with parameters a million times apart in size.
        let curvature = [4.0, 1e6, 1e6, 1e12];
        let gradient = [-1.0, -2e6];
        let step = damped_step(&gradient, &curvature, 0.0).expect("positive definite");
        // By Cramer's rule.
        let determinant = 4.0 * 1e12 - 1e12;
        let expected = [(1e12 - 2e12) / determinant, (4.0 * 2e6 - 1e6) / determinant];
        for (found, expected) in step.iter().zip(expected) {
            assert!((found / expected - 1.0).abs() < 1e-9, "{found} instead of {expected}");
        }
        let short = damped_step(&gradient, &curvature, 1e9).expect("positive definite");
        for ((found, gradient), curvature) in short.iter().zip(gradient).zip([4.0, 1e12]) {
            assert!((found / (-gradient / curvature / 1e9) - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn a_covariance_is_the_inverse_of_what_data_and_size_tell() {
        let (curvature, values) = ([4.0, 1.0, 1.0, 9.0], [2.0, 0.5]);
        let found = covariance(&curvature, &values).expect("positive definite");
        // Curvature and 1 / value² on its diagonal.
        let (a, b, c) = (4.0 + 0.25, 1.0, 9.0 + 4.0);
        let determinant = a * c - b * b;
        for (found, expected) in found.iter().zip([c, -b, -b, a].map(|entry| entry / determinant)) {
            assert!((found - expected).abs() < 1e-8, "{found} instead of {expected}");
        }
        // Two that do the same: their sum is known, their difference only as their sizes are.
        let alike = covariance(&[1e8; 4], &[1.0, 1.0]).expect("positive definite");
        let of = |signs: [f64; 2]| {
            signs[0] * signs[0] * alike[0] + 2.0 * signs[0] * signs[1] * alike[1] + alike[3]
        };
        assert!(of([1.0, 1.0]) < 1e-7 && (of([1.0, -1.0]) - 2.0).abs() < 0.5, "{alike:?}");
        // One that no reading answers to is as unsure as it is large.
        let dead = covariance(&[4.0, 0.0, 0.0, 0.0], &[2.0, 0.1]).expect("positive definite");
        assert!((dead[0] - 1.0 / 4.25).abs() < 1e-8 && (dead[3] - 0.01).abs() < 1e-8, "{dead:?}");
    }
}
