//! A chain: a state that a sum of features drives, its integral, the integral of that; and the filter that turns what
//! their sensors read into white numbers.
//!
//! Summing features over time keeps sensor noise white, taking differences keeps process noise white. With both at
//! once neither is right; the innovations of a Kalman filter are white for any share of the two, and because the filter
//! is linear it can be run over each feature's own response as well as over the readings (Harvey 1989, chapter 3).

use crate::error::{Result, invalid};

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
    /// Of a disturbance that lasts, as gusts do, in the features' own unit squared; 0 for none.
    pub gust: f64,
    /// Time after which such a disturbance is forgotten to 1/e, s.
    pub memory: f64,
}

impl Noise {
    /// Refuses what is no noise of so many sensors.
    pub fn validated(self, sensors: usize) -> Result<Self> {
        let positive = |x: f64| x.is_finite() && x > 0.0;
        let motion = [self.process, self.gust, self.memory].iter().all(|x| x.is_finite() && *x >= 0.0);
        if self.sensors.len() != sensors
            || !self.sensors.iter().all(|&x| positive(x))
            || !motion
            || self.memory == 0.0
        {
            return invalid(format!(
                "noise: expected {sensors} sensor variances above 0 and (process variance, gust variance, memory), found \
                 {self:?}"
            ));
        }
        Ok(self)
    }

    /// States of the filter beside those of the chain.
    pub(crate) fn hidden(&self) -> usize {
        usize::from(self.gust > 0.0)
    }

    /// Share of a lasting disturbance that is left after a period.
    pub(crate) fn kept(&self, dt: f64) -> f64 {
        libm::exp(-dt / self.memory.max(1e-3 * dt))
    }
}

impl Chain {
    /// Refuses what is no chain.
    pub fn validated(self) -> Result<Self> {
        if !((1..=LONGEST).contains(&self.states) && self.dt.is_finite() && self.dt > 0.0) {
            return invalid(format!(
                "chain: expected 1 to {LONGEST} states and a period above 0, found {} and {}",
                self.states, self.dt
            ));
        }
        Ok(self)
    }

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

    /// Moves states by a period in which nothing drives them but the lasting disturbance behind them, if there is one,
    /// of which a share is `kept`.
    #[inline(always)]
    pub fn coast(&self, states: &mut [f64], kept: f64) {
        let hidden = states.get(self.states).copied();
        if self.integrated {
            for i in (1..self.states).rev() {
                let mut power = 1.0;
                for m in 1..=i {
                    power *= self.dt / m as f64;
                    states[i] += power * states[i - m];
                }
            }
        }
        if let Some(gust) = hidden {
            for (state, reach) in states[..self.states].iter_mut().zip(self.reach()) {
                *state += reach * gust;
            }
            states[self.states] = kept * gust;
        }
    }

    /// How far each state is moved in a period by a disturbance of 1 that is held.
    pub(crate) fn reach(&self) -> [f64; LONGEST] {
        let mut reach = [0.0; LONGEST];
        let mut power = 1.0;
        for (i, reach) in reach.iter_mut().enumerate() {
            power *= self.dt / (i + 1) as f64;
            *reach = if self.integrated { power } else { f64::from(u8::from(i == 0)) };
        }
        reach
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
                let power = a + b + 1;
                // Not `powi`: how that rounds is the compiler's choice.
                let lasting: f64 = (0..power).map(|_| self.dt).product();
                q[a * d + b] = process * lasting / (factorial(a) * factorial(b) * power as f64);
            }
        }
        q
    }
}

/// Gains and whitening matrices of each reading of a record.
#[derive(Clone, Debug)]
pub(crate) struct Whitening {
    states: usize,
    /// States of the filter: those of the chain, and the lasting disturbance.
    pub inner: usize,
    /// Share of the lasting disturbance that is left after a period.
    pub kept: f64,
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
/// A small matrix.
type Small<const R: usize, const C: usize = R> = [[f64; C]; R];

impl Whitening {
    /// For a record of which each reading has a weight: 1, or 0 to ignore it. `spread` is the sd of each first state.
    pub fn new(chain: &Chain, noise: &Noise, weights: &[f64], spread: &[f64]) -> Self {
        // Loops of a known length are several times faster.
        let of_size = match (chain.states, noise.hidden()) {
            (1, 0) => Self::of_size::<1, 1>,
            (1, _) => Self::of_size::<1, 2>,
            (2, 0) => Self::of_size::<2, 2>,
            (2, _) => Self::of_size::<2, 3>,
            (3, 0) => Self::of_size::<3, 3>,
            (3, _) => Self::of_size::<3, 4>,
            (LONGEST, 0) => Self::of_size::<LONGEST, LONGEST>,
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
        let kept = noise.kept(chain.dt);
        let disturbance = chain.disturbance(noise.process);
        let mut transition: Small<I> = [[0.0; I]; I];
        for j in 0..I {
            let mut column = [0.0; I];
            column[j] = 1.0;
            chain.coast(&mut column, kept);
            (0..I).for_each(|i| transition[i][j] = column[i]);
        }
        let mut covariance: Small<I> = [[0.0; I]; I];
        for i in 0..I {
            covariance[i][i] = if i < D { spread[i] * spread[i] } else { noise.gust };
        }
        let (weights, _) = weights.as_chunks::<D>();
        let mut whitening = Self {
            states: D,
            inner: I,
            kept,
            gains: Vec::with_capacity(weights.len() * I * D),
            roots: Vec::with_capacity(weights.len() * D * D),
            log_determinant: 0.0,
            readings: weights.as_flattened().iter().filter(|&&w| w > 0.0).count(),
        };
        for weights in weights {
            whitening.update::<D, I>(&mut covariance, &noise.sensors, weights);
            covariance = moved(&covariance, &transition);
            for i in 0..D {
                for j in 0..D {
                    covariance[i][j] += disturbance[i * D + j];
                }
            }
            for (i, row) in covariance.iter_mut().enumerate().skip(D) {
                row[i] += noise.gust * (1.0 - kept * kept);
            }
        }
        whitening
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
        let root = whitened(&innovation);
        // W = P Hᵀ L⁻ᵀ: the gain K is W L⁻¹.
        let mut told: Small<I, D> = [[0.0; D]; I];
        for i in 0..I {
            for j in 0..D {
                told[i][j] = (0..D).map(|k| covariance[i][k] * root[j][k]).sum();
            }
        }
        let mut gain: Small<I, D> = [[0.0; D]; I];
        for (gain, told) in gain.iter_mut().zip(&told) {
            *gain = std::array::from_fn(|j| (0..D).map(|k| told[k] * root[k][j]).sum());
            self.gains.extend(gain.iter());
        }
        *covariance = unknown(covariance, &gain, &noise);
        for i in 0..D {
            // A reading that is ignored adds nothing to the sum of squares.
            let counts = weights[i] > 0.0;
            self.roots.extend(root[i].map(|value| if counts { value } else { 0.0 }));
            if counts {
                self.log_determinant -= 2.0 * libm::log(root[i][i]);
            }
        }
    }

    /// Gain of a reading (inner × states).
    pub fn gain(&self, k: usize) -> &[f64] {
        &self.gains[k * self.inner * self.states..][..self.inner * self.states]
    }

    /// Whitening matrix of a reading (states × states, lower triangular).
    pub fn root(&self, k: usize) -> &[f64] {
        &self.roots[k * self.states * self.states..][..self.states * self.states]
    }
}

/// L⁻¹ with L Lᵀ the covariance of an innovation; of its diagonal alone where rounding has left no such L.
fn whitened<const D: usize>(innovation: &Small<D>) -> Small<D> {
    let mut root: Small<D> = [[0.0; D]; D];
    let mut lower: Small<D> = [[0.0; D]; D];
    for i in 0..D {
        for j in 0..=i {
            let sum = innovation[i][j] - (0..j).map(|k| lower[i][k] * lower[j][k]).sum::<f64>();
            if i > j {
                lower[i][j] = sum / lower[j][j];
            } else if sum > 0.0 {
                lower[i][i] = sum.sqrt();
            } else {
                root = [[0.0; D]; D];
                for k in 0..D {
                    root[k][k] = 1.0 / (innovation[k][k].abs() + f64::MIN_POSITIVE).sqrt();
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

/// What is not known yet once a reading was used, (1 − K H) P (1 − K H)ᵀ + K R Kᵀ (Joseph 1968): P − W Wᵀ loses what
/// rounding leaves of P, which is more than a sensor leaves that is better than 1e-8 of its readings.
fn unknown<const D: usize, const I: usize>(
    covariance: &Small<I>,
    gain: &Small<I, D>,
    noise: &[f64; D],
) -> Small<I> {
    let mut left: Small<I> = [[0.0; I]; I];
    for (i, row) in left.iter_mut().enumerate() {
        row[i] = 1.0;
        row.iter_mut().zip(&gain[i]).for_each(|(left, gain)| *left -= gain);
    }
    let mut next = moved(covariance, &left);
    for i in 0..I {
        for j in 0..=i {
            next[i][j] += (0..D).map(|k| gain[i][k] * noise[k] * gain[j][k]).sum::<f64>();
            next[j][i] = next[i][j];
        }
    }
    next
}

/// Φ P Φᵀ, symmetric to the last bit.
fn moved<const I: usize>(covariance: &Small<I>, transition: &Small<I>) -> Small<I> {
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
