//! A chain: a state that a sum of features drives, its integral, the integral of that; and the filter that turns what
//! their sensors read into white numbers.
//!
//! Summing features over time keeps sensor noise white, taking differences keeps process noise white. With both at
//! once neither is right; the innovations of a Kalman filter are white for any share of the two, and because the filter
//! is linear it can be run over each feature's own response as well as over the readings (Harvey 1989, chapter 3).

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

/// Variance, in sensor variances, of a reading that is to be ignored.
const IGNORED: f64 = 1e12;
/// States of a filter at most.
const MOST: usize = LONGEST + 1;
/// A small matrix; only the first rows and columns of it are in use.
type Small = [[f64; MOST]; MOST];

impl Whitening {
    /// For a record of which each reading has a weight: 1, or 0 to ignore it. `spread` is the sd of each first state.
    pub fn new(chain: &Chain, noise: &Noise, weights: &[f64], spread: &[f64]) -> Self {
        let d = chain.states;
        let inner = d + noise.hidden();
        let kept = noise.kept(chain.dt);
        let disturbance = chain.disturbance(noise.process);
        let mut transition: Small = [[0.0; MOST]; MOST];
        for j in 0..inner {
            let mut column = [0.0; MOST];
            column[j] = 1.0;
            chain.coast(&mut column[..inner], kept);
            (0..inner).for_each(|i| transition[i][j] = column[i]);
        }
        let mut covariance: Small = [[0.0; MOST]; MOST];
        for i in 0..inner {
            covariance[i][i] = if i < d { spread[i] * spread[i] } else { noise.gust };
        }
        let readings = weights.len() / d;
        let mut whitening = Self {
            states: d,
            inner,
            kept,
            gains: Vec::with_capacity(readings * inner * d),
            roots: Vec::with_capacity(readings * d * d),
            log_determinant: 0.0,
            readings: weights.iter().filter(|&&w| w > 0.0).count(),
        };
        for weights in weights.chunks_exact(d) {
            whitening.update(&mut covariance, &noise.sensors, weights);
            covariance = moved(&covariance, &transition, inner);
            for i in 0..d {
                for j in 0..d {
                    covariance[i][j] += disturbance[i * d + j];
                }
            }
            for (i, row) in covariance.iter_mut().enumerate().take(inner).skip(d) {
                row[i] += noise.gust * (1.0 - kept * kept);
            }
        }
        whitening
    }

    /// Takes in a reading: keeps its gain and its whitening matrix, and leaves what is not known yet once it is used.
    fn update(&mut self, covariance: &mut Small, sensors: &[f64], weights: &[f64]) {
        let (d, inner) = (self.states, self.inner);
        let mut innovation = *covariance;
        for i in 0..d {
            innovation[i][i] += sensors[i] * if weights[i] > 0.0 { 1.0 } else { IGNORED };
        }
        let root = whitened(&innovation, d);
        // W = P Hᵀ L⁻ᵀ: the gain is W L⁻¹, and W Wᵀ is what the reading tells.
        let mut told: Small = [[0.0; MOST]; MOST];
        for i in 0..inner {
            for (told, root) in told[i].iter_mut().zip(&root).take(d) {
                *told = covariance[i].iter().zip(root).take(d).map(|(p, r)| p * r).sum();
            }
        }
        for row in told.iter().take(inner) {
            let column = |j: usize| row.iter().zip(&root).take(d).map(|(told, root)| told * root[j]).sum();
            self.gains.extend((0..d).map::<f64, _>(column));
        }
        for i in 0..inner {
            for j in 0..inner {
                covariance[i][j] -= (0..d).map(|l| told[i][l] * told[j][l]).sum::<f64>();
            }
        }
        for (i, row) in root.iter().enumerate().take(d) {
            // A reading that is ignored adds nothing to the sum of squares.
            let counts = weights[i] > 0.0;
            self.roots.extend(row[..d].iter().map(|&value| if counts { value } else { 0.0 }));
            if counts {
                self.log_determinant -= 2.0 * libm::log(row[i]);
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
fn whitened(innovation: &Small, d: usize) -> Small {
    let mut root: Small = [[0.0; MOST]; MOST];
    let mut lower: Small = [[0.0; MOST]; MOST];
    for i in 0..d {
        for j in 0..=i {
            let sum = innovation[i][j] - (0..j).map(|k| lower[i][k] * lower[j][k]).sum::<f64>();
            if i > j {
                lower[i][j] = sum / lower[j][j];
            } else if sum > 0.0 {
                lower[i][i] = sum.sqrt();
            } else {
                for (k, row) in root.iter_mut().enumerate().take(d) {
                    row[k] = 1.0 / (innovation[k][k].abs() + f64::MIN_POSITIVE).sqrt();
                    row[..k].fill(0.0);
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
fn moved(covariance: &Small, transition: &Small, inner: usize) -> Small {
    let mut half: Small = [[0.0; MOST]; MOST];
    let mut next: Small = [[0.0; MOST]; MOST];
    for i in 0..inner {
        for j in 0..inner {
            half[i][j] = (0..inner).map(|k| transition[i][k] * covariance[k][j]).sum();
        }
    }
    for i in 0..inner {
        for j in 0..=i {
            next[i][j] = (0..inner).map(|k| half[i][k] * transition[j][k]).sum();
            next[j][i] = next[i][j];
        }
    }
    next
}
