//! How likely residuals are under given noise, and the noise under which they are most likely.

use std::ops::{Add, Mul};
use std::sync::Arc;

use super::chain::{Chain, LONGEST, Motion};
use super::gram::Record;
use super::linear::Linear;
use super::noise::Noise;
use super::whitening::Whitening;

/// −2 log of the likelihood, up to a constant, of the records' residuals ((n + 1) × states each) if only noise made them.
pub fn likelihood(chain: &Chain, records: &[Record], residuals: &[Vec<f64>], noise: &Noise) -> f64 {
    // Loops of a known length are faster; long chains are rare.
    let (several, one): (Squares, Squares) = match chain.states {
        1 => (squares::<1, Several>, squares::<1, f64>),
        2 => (squares::<2, Several>, squares::<2, f64>),
        3 => (squares::<3, Several>, squares::<3, Several>),
        _ => (squares::<LONGEST, Several>, squares::<LONGEST, Several>),
    };
    let whitenings = Record::whitenings(chain, records, noise);
    let (mut total, mut from) = (0.0, 0);
    while let Some(whitening) = whitenings.get(from) {
        // A step waits for the one before it, but not for those of other records.
        let alike = whitenings[from..].iter().take(AT_ONCE).take_while(|other| Arc::ptr_eq(whitening, other));
        let records = alike.count();
        total += records as f64 * whitening.log_determinant;
        total += if records == 1 { one } else { several }(chain, whitening, &residuals[from..][..records]);
        from += records;
    }
    total
}

/// Records that are whitened at once.
const AT_ONCE: usize = 4;

/// A number of each of several records.
#[derive(Clone, Copy)]
struct Several([f64; AT_ONCE]);

impl Add for Several {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] + other.0[i]))
    }
}

impl Mul<f64> for Several {
    type Output = Self;
    #[inline(always)]
    fn mul(self, factor: f64) -> Self {
        Self(self.0.map(|number| number * factor))
    }
}

/// Numbers of records, of one or of each of several.
trait Numbers: Linear {
    /// The numbers of records, in their order; 0 where there is none.
    fn of(numbers: impl Fn(usize) -> f64, records: usize) -> Self;
    /// Each with its square added to another's.
    fn with_square(self, of: Self) -> Self;
    /// Their sum.
    fn sum(self) -> f64;
}

impl Numbers for f64 {
    #[inline(always)]
    fn of(numbers: impl Fn(usize) -> f64, _: usize) -> Self {
        numbers(0)
    }
    #[inline(always)]
    fn with_square(self, of: Self) -> Self {
        self + of * of
    }
    fn sum(self) -> f64 {
        self
    }
}

impl Numbers for Several {
    #[inline(always)]
    fn of(numbers: impl Fn(usize) -> f64, records: usize) -> Self {
        Self(std::array::from_fn(|i| if i < records { numbers(i) } else { 0.0 }))
    }
    #[inline(always)]
    fn with_square(self, of: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] + of.0[i] * of.0[i]))
    }
    fn sum(self) -> f64 {
        self.0.iter().sum()
    }
}

/// [`squares`] of some size.
type Squares = fn(&Chain, &Whitening, &[Vec<f64>]) -> f64;

/// Sum of the squares of the whitened residuals of records that share a filter, as many as fit into the numbers at most.
fn squares<const D: usize, T: Numbers>(chain: &Chain, whitening: &Whitening, residuals: &[Vec<f64>]) -> f64 {
    let motion = Motion { states: D, ..chain.motion() };
    let nothing = T::of(|_| 0.0, residuals.len());
    let (mut total, mut state) = (nothing, [nothing; LONGEST + 1]);
    let state = &mut state[..whitening.inner];
    for k in 0..residuals[0].len() / D {
        let mut innovation = [nothing; D];
        for (i, innovation) in innovation.iter_mut().enumerate() {
            *innovation = T::of(|record| residuals[record][k * D + i], residuals.len()) + state[i] * -1.0;
        }
        let (mut white, mut correction) = ([nothing; D], [nothing; LONGEST + 1]);
        whitening.reading(k, D).observe(&innovation, &mut white, &mut correction[..whitening.inner]);
        for white in white {
            total = total.with_square(white);
        }
        state.iter_mut().zip(correction).for_each(|(state, by)| *state = *state + by);
        motion.predict(state, whitening.correlation);
    }
    total.sum()
}

/// Factors by which a variance is tried in turn, coarse to fine.
const STEPS: [f64; 5] = [100.0, 10.0, 3.0, 1.5, 1.15];
/// What a move must gain: where a variance makes no difference, what rounding takes depends on the readings' units.
const GAIN: f64 = 1e-6;
/// Times at most that all of them are gone through: where one variance began far too large, the others are small after
/// the first.
const LADDERS: usize = 3;
/// Factors from which on a move is so long that the others are gone through once more.
const LEAP: f64 = 10.0;

/// Periods between which a disturbance is said to be correlated: shorter than this it is white.
const BRIEFEST_MEMORY: f64 = 3.0;
/// Longer than this it is a constant.
const LONGEST_MEMORY: f64 = 300.0;
/// Times that it is forgotten within the longest record, at least: what is not, a record shows as a constant of its own.
const FORGOTTEN: f64 = 4.0;

/// The noise under which residuals are most likely, by coordinate search from `start`; never below `smallest`.
pub fn most_likely_noise(
    chain: &Chain,
    records: &[Record],
    residuals: &[Vec<f64>],
    start: &Noise,
    smallest: &Noise,
) -> (Noise, f64) {
    let d = chain.states;
    let periods = residuals.iter().map(|run| run.len() / d).max().unwrap_or(0) as f64;
    let longest =
        (chain.dt * periods / FORGOTTEN).clamp(BRIEFEST_MEMORY * chain.dt, LONGEST_MEMORY * chain.dt);
    let mut best = start.clone();
    best.correlation_time = best.correlation_time.min(longest);
    let mut score = likelihood(chain, records, residuals, &best);
    for _ in 0..LADDERS {
        let mut leapt = false;
        for step in STEPS {
            for _ in 0..8 {
                let mut moved = false;
                // Sensors, process, and where there are any the variance and the correlation time of gusts.
                for which in 0..=d + 2 * best.hidden() {
                    for factor in [step, 1.0 / step] {
                        let mut tried = best.clone();
                        if which < d {
                            tried.sensors[which] =
                                (tried.sensors[which] * factor).max(smallest.sensors[which]);
                        } else if which == d {
                            tried.process = (tried.process * factor).max(smallest.process);
                        } else if which == d + 1 {
                            tried.gust = (tried.gust * factor).max(smallest.gust);
                        } else {
                            tried.correlation_time =
                                (tried.correlation_time * factor).clamp(BRIEFEST_MEMORY * chain.dt, longest);
                        }
                        if tried == best {
                            continue;
                        }
                        let found = likelihood(chain, records, residuals, &tried);
                        if found < score - GAIN {
                            (best, score, moved) = (tried, found, true);
                            break;
                        }
                    }
                }
                if !moved {
                    break;
                }
                leapt |= step >= LEAP;
            }
        }
        if !leapt {
            break;
        }
    }
    (best, score)
}
