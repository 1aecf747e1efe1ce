//! Whitening: the filter that turns what the sensors of a chain read into white numbers.
//!
//! Summing features over time keeps sensor noise white, taking differences keeps process noise white. With both at
//! once neither is right; the innovations of a Kalman filter are white for any share of the two, and because the filter
//! is linear it can be run over each feature's own response as well as over the readings (Harvey 1989, chapter 3).

use super::chain::{Chain, LONGEST};
use super::linear::{Linear, product};
use super::noise::Noise;
use crate::linear_algebra::{Small, congruent, inverse_root};

/// Gains and whitening matrices of each reading of a record.
#[derive(Clone, Debug)]
pub(crate) struct Whitening {
    /// States of the filter: those of the chain, and the correlated disturbance.
    pub inner: usize,
    /// Correlation of that disturbance with itself one period later.
    pub correlation: f64,
    /// K of each reading (inner × states).
    gains: Vec<f64>,
    /// L⁻¹ of each reading with L Lᵀ the covariance of its innovation (states × states).
    roots: Vec<f64>,
    /// Sum of log det of those covariances.
    pub log_determinant: f64,
    /// Readings that counted.
    pub readings: usize,
}

/// Variance of a reading that is to be ignored, in variances of its innovation.
const IGNORED: f64 = 1e12;

impl Whitening {
    /// For a record of which each reading has a weight: 1, or 0 to ignore it. `spread` is the sd of each first state.
    pub fn new(chain: &Chain, noise: &Noise, weights: &[f64], spread: &[f64]) -> Self {
        // Loops of a known length are several times faster.
        let of_size = match (chain.states, noise.hidden()) {
            (1, 0) => Self::of_size::<1, 1>,
            (1, _) => Self::of_size::<1, 2>,
            (2, 0) => Self::of_size::<2, 2>,
            (2, _) => Self::of_size::<2, 3>,
            // So long chains are rare: one that has no correlated disturbance has one of 0, and the code is there once.
            (3, _) => Self::of_size::<3, 4>,
            (LONGEST, _) => Self::of_size::<LONGEST, { LONGEST + 1 }>,
            (states, _) => unreachable!("a chain of {states} states"),
        };
        of_size(chain, noise, weights, spread)
    }

    /// For D states of a chain, and I of the filter.
    fn of_size<const D: usize, const I: usize>(
        chain: &Chain,
        noise: &Noise,
        weights: &[f64],
        spread: &[f64],
    ) -> Self {
        let correlation = noise.correlation(chain.dt);
        let disturbance = chain.disturbance(noise.process);
        let motion = chain.motion();
        let mut transition: Small<I> = [[0.0; I]; I];
        for j in 0..I {
            let mut column = [0.0; I];
            column[j] = 1.0;
            motion.predict(&mut column, correlation);
            (0..I).for_each(|i| transition[i][j] = column[i]);
        }
        let mut covariance: Small<I> = [[0.0; I]; I];
        for i in 0..I {
            covariance[i][i] = if i < D { spread[i] * spread[i] } else { noise.gust };
        }
        let (weights, _) = weights.as_chunks::<D>();
        let mut whitening = Self {
            inner: I,
            correlation,
            gains: Vec::with_capacity(weights.len() * I * D),
            roots: Vec::with_capacity(weights.len() * D * D),
            log_determinant: 0.0,
            readings: weights.as_flattened().iter().filter(|&&w| w > 0.0).count(),
        };
        // What is known of the states settles: from there on each reading is taken in as the one before it.
        let (mut settled, mut logs) = (None, [0.0; D]);
        for weights in weights {
            if settled == Some(weights) {
                whitening.repeat(D);
                logs.iter().for_each(|log| whitening.log_determinant -= log);
                continue;
            }
            let before = covariance;
            whitening.update::<D, I>(&mut covariance, &noise.sensors, weights);
            logs = whitening.determinant(weights);
            logs.iter().for_each(|log| whitening.log_determinant -= log);
            covariance = congruent(&covariance, &transition);
            for i in 0..D {
                for j in 0..D {
                    covariance[i][j] += disturbance[i * D + j];
                }
            }
            for (i, row) in covariance.iter_mut().enumerate().skip(D) {
                row[i] += noise.gust * (1.0 - correlation * correlation);
            }
            settled = (covariance == before).then_some(weights);
        }
        whitening
    }

    /// Takes in a reading with the gain and the whitening matrix of the one before.
    #[inline(never)]
    fn repeat(&mut self, states: usize) {
        self.gains.extend_from_within(self.gains.len() - self.inner * states..);
        self.roots.extend_from_within(self.roots.len() - states * states..);
    }

    /// What a reading has of the determinant: that of its whitening matrix, the last one, where its entries count.
    #[inline(never)]
    fn determinant<const D: usize>(&self, weights: &[f64; D]) -> [f64; D] {
        let root = &self.roots[self.roots.len() - D * D..];
        std::array::from_fn(|i| if weights[i] > 0.0 { 2.0 * libm::log(root[i * D + i]) } else { 0.0 })
    }

    /// Takes in a reading: keeps its gain and its whitening matrix, and leaves what is not known yet once it is used.
    fn update<const D: usize, const I: usize>(
        &mut self,
        covariance: &mut Small<I>,
        sensors: &[f64],
        weights: &[f64; D],
    ) {
        let noise: [f64; D] = std::array::from_fn(|i| {
            if weights[i] > 0.0 { sensors[i] } else { IGNORED * (sensors[i] + covariance[i][i]) }
        });
        let mut innovation: Small<D> = [[0.0; D]; D];
        for i in 0..D {
            innovation[i].copy_from_slice(&covariance[i][..D]);
            innovation[i][i] += noise[i];
        }
        let root = inverse_root(&innovation);
        // W = P Hᵀ L⁻ᵀ: the gain K is W L⁻¹.
        let mut projected: Small<I, D> = [[0.0; D]; I];
        for i in 0..I {
            for j in 0..D {
                projected[i][j] = (0..D).map(|k| covariance[i][k] * root[j][k]).sum();
            }
        }
        let mut gain: Small<I, D> = [[0.0; D]; I];
        for (gain, projected) in gain.iter_mut().zip(&projected) {
            *gain = std::array::from_fn(|j| (0..D).map(|k| projected[k] * root[k][j]).sum());
            self.gains.extend(gain.iter());
        }
        *covariance = updated(covariance, &gain, &noise);
        for i in 0..D {
            // A reading that is ignored adds nothing to the sum of squares.
            let counts = weights[i] > 0.0;
            self.roots.extend(root[i].map(|value| if counts { value } else { 0.0 }));
        }
    }

    /// The k-th reading, to be observed.
    #[inline(always)]
    pub fn reading(&self, k: usize, states: usize) -> Reading<'_> {
        let (root, gain) = (states * states, self.inner * states);
        Reading { root: &self.roots[k * root..][..root], gain: &self.gains[k * gain..][..gain] }
    }
}

/// What the filter makes of a reading.
pub(crate) struct Reading<'a> {
    root: &'a [f64],
    gain: &'a [f64],
}

impl Reading<'_> {
    /// From an innovation (states): the same, white and of variance 1 (states), and what it adds to the filter's states
    /// (inner). It is the one step of every observer that runs the filter, be it over a feature's own response, over
    /// residuals, or over the predictions of a model.
    #[inline(always)]
    pub fn observe<T: Linear>(&self, innovation: &[T], white: &mut [T], correction: &mut [T]) {
        let d = innovation.len();
        for (white, row) in white.iter_mut().zip(self.root.chunks_exact(d)) {
            *white = product(row, innovation);
        }
        for (correction, row) in correction.iter_mut().zip(self.gain.chunks_exact(d)) {
            *correction = product(row, innovation);
        }
    }
}

/// The covariance after a reading, (1 − K H) P (1 − K H)ᵀ + K R Kᵀ (Joseph 1968). The shorter P − W Wᵀ loses P to rounding
/// if a sensor is better than 1e-8 of its readings.
fn updated<const D: usize, const I: usize>(
    covariance: &Small<I>,
    gain: &Small<I, D>,
    noise: &[f64; D],
) -> Small<I> {
    // K H has the columns of the readings alone, so beyond those 1 − K H is the unit matrix.
    let mut reduction: Small<I, D> = [[0.0; D]; I];
    let mut half = *covariance;
    for i in 0..I {
        reduction[i] = std::array::from_fn(|k| if i == k { 1.0 - gain[i][k] } else { 0.0 - gain[i][k] });
        for j in 0..I {
            let read: f64 = (0..D).map(|k| reduction[i][k] * covariance[k][j]).sum();
            half[i][j] = if i < D { read } else { read + covariance[i][j] };
        }
    }
    let mut next: Small<I> = [[0.0; I]; I];
    for i in 0..I {
        for j in 0..=i {
            let read: f64 = (0..D).map(|k| half[i][k] * reduction[j][k]).sum();
            let noisy: f64 = (0..D).map(|k| gain[i][k] * noise[k] * gain[j][k]).sum();
            next[i][j] = if j < D { read } else { read + half[i][j] } + noisy;
            next[j][i] = next[i][j];
        }
    }
    next
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_filter_that_has_settled_has_the_gain_that_solves_riccati_s_equation() {
        // P⁻ = P⁻ − P⁻² / (P⁻ + r) + q, of a level that wanders by q and is read with r.
        let (q, r, readings) = (0.01_f64, 0.25_f64, 2000);
        let chain = Chain { states: 1, dt: 1.0, form: crate::model::Form::Increment };
        let noise = Noise { sensors: vec![r], process: q, gust: 0.0, correlation_time: 1.0 };
        let whitening = Whitening::new(&chain, &noise, &vec![1.0; readings], &[1.0]);
        let before = 0.5 * (q + (q * q + 4.0 * q * r).sqrt());
        let last = whitening.reading(readings - 1, 1);
        assert!((last.gain[0] - before / (before + r)).abs() < 1e-12);
        assert!((last.root[0] - (before + r).sqrt().recip()).abs() < 1e-12);
    }
}
