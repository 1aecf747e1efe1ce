//! How likely residuals are under given noise, and the noise under which they are most likely.

use super::chain::{Chain, LONGEST, Noise};
use super::gram::Record;

/// −2 log of the likelihood, up to a constant, of the records' residuals ((n + 1) × states each) if only noise made them.
pub fn likelihood(chain: &Chain, records: &[Record], residuals: &[Vec<f64>], noise: &Noise) -> f64 {
    let d = chain.states;
    let mut total = 0.0;
    for (whitening, residual) in Record::whitenings(chain, records, noise).iter().zip(residuals) {
        total += whitening.log_determinant;
        let mut state = vec![0.0; whitening.inner];
        for k in 0..residual.len() / d {
            let (gain, root) = (whitening.gain(k), whitening.root(k));
            let mut innovation = [0.0; LONGEST];
            for i in 0..d {
                innovation[i] = residual[k * d + i] - state[i];
            }
            for i in 0..d {
                let white: f64 = (0..d).map(|l| root[i * d + l] * innovation[l]).sum();
                total += white * white;
            }
            for (i, state) in state.iter_mut().enumerate() {
                *state += (0..d).map(|l| gain[i * d + l] * innovation[l]).sum::<f64>();
            }
            chain.coast(&mut state, whitening.kept);
        }
    }
    total
}

/// Factors by which a variance is tried in turn, coarse to fine.
const STEPS: [f64; 5] = [100.0, 10.0, 3.0, 1.5, 1.15];
/// What a move must gain: where a variance makes no difference, what rounding takes depends on the readings' units.
const GAIN: f64 = 1e-6;
/// Times that all of them are gone through: where one variance began far too large, the others are small after the first.
const LADDERS: usize = 3;

/// The noise under which residuals are most likely, by coordinate search from `start`; never below `smallest`.
pub fn most_likely_noise(
    chain: &Chain,
    records: &[Record],
    residuals: &[Vec<f64>],
    start: &Noise,
    smallest: &Noise,
) -> (Noise, f64) {
    let d = chain.states;
    let mut best = start.clone();
    let mut score = likelihood(chain, records, residuals, &best);
    for _ in 0..LADDERS {
        let before = score;
        for step in STEPS {
            for _ in 0..8 {
                let mut moved = false;
                // Sensors, process, and where there are any the size and the memory of gusts.
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
                            // Shorter than a few periods it is white, longer than this it is a constant.
                            tried.memory = (tried.memory * factor).clamp(3.0 * chain.dt, 300.0 * chain.dt);
                        }
                        if tried == best {
                            continue;
                        }
                        let found = likelihood(chain, records, residuals, &tried);
                        if found < score - GAIN {
                            (best, score, moved) = (tried, found, true);
                        }
                    }
                }
                if !moved {
                    break;
                }
            }
        }
        if before - score < 0.1 {
            break;
        }
    }
    (best, score)
}
