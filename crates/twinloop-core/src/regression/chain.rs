//! A chain: a state that a sum of features drives, its integral, the integral of that; and the filter that turns what
//! their sensors read into white numbers.
//!
//! Summing features over time keeps sensor noise white, taking differences keeps process noise white. With both at
//! once neither is right; the innovations of a Kalman filter are white for any share of the two, and because the filter
//! is linear it can be run over each feature's own response as well as over the readings (Harvey 1989, chapter 3).

use super::cholesky::Cholesky;

/// States of a chain at most: position, speed, acceleration, jerk.
pub const LONGEST: usize = 4;

/// How a sum of features moves the states of a chain, the driven one first, then its integral, and so on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chain {
    /// Number of states, 1 to [`LONGEST`].
    pub states: usize,
    /// Period, s.
    pub dt: f64,
    /// Whether features are derivatives to be integrated over a period, or increments of a period.
    pub integrated: bool,
}

/// Variances that whitening needs.
#[derive(Clone, Debug, PartialEq)]
pub struct Noise {
    /// Of each state's sensor.
    pub sensors: Vec<f64>,
    /// Of the white disturbance that drives the first state, per second (per period where features are increments).
    pub process: f64,
}

impl Chain {
    /// What a period adds to each state where the features' values at its start, middle and end are known.
    pub fn increments(&self, start: f64, middle: f64, end: f64) -> [f64; LONGEST] {
        if !self.integrated {
            return [start, 0.0, 0.0, 0.0];
        }
        // Simpson's rule on ∫ (dt − s)^m / m! f(s) ds.
        let mut out = [0.0; LONGEST];
        let (mut factorial, mut whole, mut half) = (1.0, 1.0, 1.0);
        for (m, out) in out.iter_mut().enumerate() {
            if m > 0 {
                factorial *= m as f64;
                whole *= self.dt;
                half *= 0.5 * self.dt;
            }
            let end = if m == 0 { end } else { 0.0 };
            *out = self.dt / 6.0 * (whole * start + 4.0 * half * middle + end) / factorial;
        }
        out
    }

    /// Moves states by a period in which nothing drives them.
    #[inline(always)]
    pub fn coast(&self, states: &mut [f64]) {
        if !self.integrated {
            return;
        }
        for i in (1..self.states).rev() {
            let mut power = 1.0;
            for m in 1..=i {
                power *= self.dt / m as f64;
                states[i] += power * states[i - m];
            }
        }
    }

    /// Covariance that a period of the disturbance adds (states × states).
    fn disturbance(&self, process: f64) -> Vec<f64> {
        let d = self.states;
        let mut q = vec![0.0; d * d];
        if !self.integrated {
            q[0] = process;
            return q;
        }
        let factorial = |n: usize| (1..=n).map(|i| i as f64).product::<f64>();
        for a in 0..d {
            for b in 0..d {
                let power = (a + b + 1) as i32;
                q[a * d + b] =
                    process * self.dt.powi(power) / (factorial(a) * factorial(b) * f64::from(power));
            }
        }
        q
    }
}

/// Gains and whitening matrices of each reading of a record.
#[derive(Clone, Debug)]
pub(crate) struct Whitening {
    states: usize,
    /// K of each reading (states × states).
    gains: Vec<f64>,
    /// L⁻¹ of each reading with L Lᵀ the covariance of its innovation (states × states).
    roots: Vec<f64>,
    /// Sum of log det of those covariances.
    pub log_determinant: f64,
    /// Readings that counted.
    pub readings: usize,
}

/// Variance, in sensor variances, of a reading that is to be ignored.
const IGNORED: f64 = 1e12;

impl Whitening {
    /// For a record of which each reading has a weight: 1, or 0 to ignore it. `spread` is the sd of each first state.
    pub fn new(chain: &Chain, noise: &Noise, weights: &[f64], spread: &[f64]) -> Self {
        let d = chain.states;
        let readings = weights.len() / d;
        let disturbance = chain.disturbance(noise.process);
        let mut covariance = vec![0.0; d * d];
        for i in 0..d {
            covariance[i * d + i] = spread[i] * spread[i];
        }
        let mut whitening = Self {
            states: d,
            gains: Vec::with_capacity(readings * d * d),
            roots: Vec::with_capacity(readings * d * d),
            log_determinant: 0.0,
            readings: weights.iter().filter(|&&w| w > 0.0).count(),
        };
        for k in 0..readings {
            let mut innovation = covariance.clone();
            for i in 0..d {
                let ignored = if weights[k * d + i] > 0.0 { 1.0 } else { IGNORED };
                innovation[i * d + i] += noise.sensors[i] * ignored;
            }
            let factor = Cholesky::new(&innovation, d, 0.0).unwrap_or_else(|| {
                let diagonal: Vec<f64> = (0..d * d)
                    .map(|ij| if ij / d == ij % d { innovation[ij].abs() + f64::MIN_POSITIVE } else { 0.0 })
                    .collect();
                Cholesky::new(&diagonal, d, 0.0).expect("a positive diagonal")
            });
            let inverse = factor.inverse();
            let mut gain = vec![0.0; d * d];
            for i in 0..d {
                for j in 0..d {
                    gain[i * d + j] = (0..d).map(|l| covariance[i * d + l] * inverse[l * d + j]).sum();
                }
            }
            let mut root = vec![0.0; d * d];
            let mut unit = vec![0.0; d];
            for j in 0..d {
                unit.fill(0.0);
                unit[j] = 1.0;
                for (i, value) in factor.forward(&unit).into_iter().enumerate() {
                    // A reading that is ignored adds nothing to the sum of squares.
                    root[i * d + j] = if weights[k * d + i] > 0.0 { value } else { 0.0 };
                }
                if weights[k * d + j] > 0.0 {
                    let mut pivot = factor.forward(&unit)[j];
                    pivot = -2.0 * libm::log(pivot);
                    whitening.log_determinant += pivot;
                }
            }
            // P ← Φ (P − K P) Φᵀ + Q, kept symmetric.
            let mut posterior = covariance.clone();
            for i in 0..d {
                for j in 0..d {
                    posterior[i * d + j] -=
                        (0..d).map(|l| gain[i * d + l] * covariance[l * d + j]).sum::<f64>();
                }
            }
            for _ in 0..2 {
                // Φ on the columns, then, transposed, on the rows.
                for j in 0..d {
                    let mut column: Vec<f64> = (0..d).map(|i| posterior[i * d + j]).collect();
                    chain.coast(&mut column);
                    (0..d).for_each(|i| posterior[i * d + j] = column[i]);
                }
                posterior = (0..d * d).map(|ij| posterior[(ij % d) * d + ij / d]).collect();
            }
            for i in 0..d {
                for j in 0..d {
                    let symmetric = 0.5 * (posterior[i * d + j] + posterior[j * d + i]);
                    covariance[i * d + j] = symmetric + disturbance[i * d + j];
                }
            }
            whitening.gains.extend(gain);
            whitening.roots.extend(root);
        }
        whitening
    }

    /// Gain of a reading (states × states).
    pub fn gain(&self, k: usize) -> &[f64] {
        &self.gains[k * self.states * self.states..][..self.states * self.states]
    }

    /// Whitening matrix of a reading (states × states, lower triangular).
    pub fn root(&self, k: usize) -> &[f64] {
        &self.roots[k * self.states * self.states..][..self.states * self.states]
    }
}
