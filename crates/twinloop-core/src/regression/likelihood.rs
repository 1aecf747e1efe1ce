//! How likely residuals are under given noise, and the noise under which they are most likely.

use super::chain::{Chain, LONGEST, Motion};
use super::gram::Record;
use super::noise::Noise;
use super::whitening::Whitening;

/// −2 log of the likelihood, up to a constant, of the records' residuals ((n + 1) × states each) if only noise made them.
pub fn likelihood(chain: &Chain, records: &[Record], residuals: &[Vec<f64>], noise: &Noise) -> f64 {
    // Loops of a known length are faster.
    let squares = match chain.states {
        1 => squares::<1>,
        2 => squares::<2>,
        3 => squares::<3>,
        _ => squares::<LONGEST>,
    };
    let mut total = 0.0;
    for (whitening, residual) in Record::whitenings(chain, records, noise).iter().zip(residuals) {
        total = squares(chain, whitening, residual, total + whitening.log_determinant);
    }
    total
}

/// A sum and the squares of a record's whitened residuals.
fn squares<const D: usize>(chain: &Chain, whitening: &Whitening, residual: &[f64], start: f64) -> f64 {
    let mut total = start;
    let motion = Motion { states: D, ..chain.motion() };
    let mut state = vec![0.0; whitening.inner];
    for (k, residual) in residual.as_chunks::<D>().0.iter().enumerate() {
        let mut innovation = [0.0; D];
        for i in 0..D {
            innovation[i] = residual[i] - state[i];
        }
        let (mut white, mut correction) = ([0.0; D], [0.0; LONGEST + 1]);
        whitening.reading(k, D).observe(&innovation, &mut white, &mut correction[..whitening.inner]);
        for white in white {
            total += white * white;
        }
        state.iter_mut().zip(correction).for_each(|(state, by)| *state += by);
        motion.predict(&mut state, whitening.correlation);
    }
    total
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
