//! Random numbers: one counter-based stream for each unit of work, so that no result depends on who did it first.

use rand_chacha::ChaCha8Rng;
use rand_core::{RngCore, SeedableRng};

/// What a stream is for; streams of different purposes never meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Single draws asked for by a caller.
    Single = 0,
    /// The first population of the model loop.
    FirstModels = 1,
    /// Offspring of the model loop.
    Models = 2,
    /// The first population of a test loop.
    FirstTests = 3,
    /// Offspring of a test loop.
    Tests = 4,
    /// The mutants that a generation of the test loop judges instability with.
    Mutants = 5,
    /// Walks over subsets of features.
    Subsets = 6,
    /// Members of a committee.
    Members = 7,
}

/// A stream of random numbers.
pub struct Stream(ChaCha8Rng);

impl Stream {
    /// The stream of one unit of work: the `unit`-th of a generation of an iteration of a campaign's seed.
    pub fn new(seed: u64, purpose: Purpose, iteration: u64, generation: u64, unit: u64) -> Self {
        let mut key = [0; 32];
        for (slot, word) in key.chunks_exact_mut(8).zip([seed, purpose as u64, iteration, generation]) {
            slot.copy_from_slice(&word.to_le_bytes());
        }
        let mut generator = ChaCha8Rng::from_seed(key);
        generator.set_stream(unit);
        Self(generator)
    }

    /// Uniform in [0, 1), on a grid of 2⁻⁵³.
    pub fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Uniform in {0, …, n − 1}.
    pub fn below(&mut self, n: usize) -> usize {
        ((u128::from(self.0.next_u64()) * n as u128) >> 64) as usize
    }

    /// True with probability `p`.
    pub fn chance(&mut self, p: f64) -> bool {
        self.uniform() < p
    }

    /// Standard normal, by Box and Muller.
    pub fn gaussian(&mut self) -> f64 {
        let radius = (-2.0 * libm::log(1.0 - self.uniform())).sqrt();
        radius * libm::cos(std::f64::consts::TAU * self.uniform())
    }

    /// Log-uniform between two positive numbers.
    pub fn log_uniform(&mut self, low: f64, high: f64) -> f64 {
        let (low, high) = (libm::log(low), libm::log(high));
        libm::exp(low + (high - low) * self.uniform())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stream(unit: u64) -> Stream {
        Stream::new(7, Purpose::Single, 0, 0, unit)
    }

    #[test]
    fn gaussian_numbers_have_the_moments_of_the_standard_normal() {
        let mut stream = stream(0);
        let draws: Vec<f64> = (0..200_000).map(|_| stream.gaussian()).collect();
        let moment = |k: i32| draws.iter().map(|x| x.powi(k)).sum::<f64>() / draws.len() as f64;
        for (k, expected) in [(1, 0.0), (2, 1.0), (3, 0.0), (4, 3.0)] {
            assert!((moment(k) - expected).abs() < 0.06, "moment {k}: {}", moment(k));
        }
    }

    #[test]
    fn whole_numbers_are_uniform() {
        let mut stream = stream(1);
        let mut counts = [0; 7];
        for _ in 0..70_000 {
            counts[stream.below(7)] += 1;
        }
        assert!(counts.iter().all(|&c: &i32| (c - 10_000).abs() < 500), "{counts:?}");
    }

    #[test]
    fn units_of_work_have_streams_of_their_own() {
        let first: Vec<f64> = (0..8).map(|unit| stream(unit).uniform()).collect();
        for (i, a) in first.iter().enumerate() {
            assert!(first[..i].iter().all(|b| a != b));
        }
        assert_eq!(stream(3).uniform(), first[3]);
    }

    #[test]
    fn every_part_of_a_key_makes_another_stream() {
        let purposes = [
            Purpose::Single,
            Purpose::FirstModels,
            Purpose::Models,
            Purpose::FirstTests,
            Purpose::Tests,
            Purpose::Mutants,
            Purpose::Subsets,
            Purpose::Members,
        ];
        let mut first = Vec::new();
        for seed in [0, 1, u64::MAX] {
            for purpose in purposes {
                for iteration in [0, 1, 2] {
                    for generation in [0, 1, 1 << 40] {
                        for unit in [0, 1, 2] {
                            first.push(Stream::new(seed, purpose, iteration, generation, unit).uniform());
                        }
                    }
                }
            }
        }
        let streams = first.len();
        first.sort_by(f64::total_cmp);
        first.dedup();
        assert_eq!(first.len(), streams);
    }

    #[test]
    fn draws_stay_within_their_bounds() {
        let mut stream = stream(2);
        for n in [1, 2, 3, 1 << 20] {
            assert!((0..1000).all(|_| stream.below(n) < n));
        }
        assert!((0..1000).all(|_| (0.0..1.0).contains(&stream.uniform())));
        assert!((0..1000).all(|_| stream.gaussian().is_finite()));
        assert!((0..1000).all(|_| (0.999e-3..=10.001).contains(&stream.log_uniform(1e-3, 10.0))));
        assert!((0..1000).all(|_| stream.chance(1.0) && !stream.chance(0.0)));
    }
}
