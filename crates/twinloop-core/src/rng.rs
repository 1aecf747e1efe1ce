//! Random numbers: one counter-based stream for each unit of work, so that no result depends on who did it first.

use std::str::FromStr;

use rand_chacha::ChaCha8Rng;
use rand_core::{RngCore, SeedableRng};

use crate::error::{Error, Result, invalid};

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
    /// Constants of a committee's members.
    Members = 7,
    /// The same walks, on terms of a hidden state that is tried.
    HiddenSubsets = 8,
    /// New terms.
    Terms = 9,
    /// Structures of a committee's members.
    Structures = 10,
    /// Gains that are tuned on the best model.
    Gains = 11,
    /// Gains that are tuned on the committee, from there on.
    FineGains = 12,
    /// Gains that a tuning begins with beside the known ones.
    Starts = 13,
    /// What sensors add to the flights that candidates are judged by.
    Sensors = 14,
    /// How far from where they were asked to such flights begin.
    OffStart = 15,
    /// Candidates for the next test, and their excitation.
    Candidates = 16,
    /// Where candidates start and lead.
    Ends = 17,
    /// The excitation of a test with gains of the user's own.
    Excitation = 18,
    /// Tests that no committee chose.
    Baseline = 19,
    /// Runs that the band of a twin is made of.
    Band = 20,
    /// Repeats of a flight that a report predicts.
    Repeats = 21,
    /// Draws of an exam.
    Exam = 22,
}

impl Purpose {
    /// All of them, by the names that [`FromStr`] reads.
    pub const ALL: [(&'static str, Self); 23] = [
        ("single", Self::Single),
        ("first_models", Self::FirstModels),
        ("models", Self::Models),
        ("first_tests", Self::FirstTests),
        ("tests", Self::Tests),
        ("mutants", Self::Mutants),
        ("subsets", Self::Subsets),
        ("members", Self::Members),
        ("hidden_subsets", Self::HiddenSubsets),
        ("terms", Self::Terms),
        ("structures", Self::Structures),
        ("gains", Self::Gains),
        ("fine_gains", Self::FineGains),
        ("starts", Self::Starts),
        ("sensors", Self::Sensors),
        ("off_start", Self::OffStart),
        ("candidates", Self::Candidates),
        ("ends", Self::Ends),
        ("excitation", Self::Excitation),
        ("baseline", Self::Baseline),
        ("band", Self::Band),
        ("repeats", Self::Repeats),
        ("exam", Self::Exam),
    ];
}

impl FromStr for Purpose {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        match Self::ALL.iter().find(|(known, _)| *known == name) {
            Some((_, purpose)) => Ok(*purpose),
            None => {
                let names: Vec<_> = Self::ALL.iter().map(|(name, _)| *name).collect();
                invalid(format!("random numbers: expected a purpose of {}, found {name}", names.join(", ")))
            }
        }
    }
}

/// A unit of work that draws numbers nobody else does: a seed, a purpose, and the numbers that lead to it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unit {
    seed: u64,
    purpose: Purpose,
    /// Each one above what it stands for; 0 where there is none.
    path: [u32; Self::DEEPEST],
}

impl Unit {
    /// Numbers of a path at most.
    pub const DEEPEST: usize = 5;

    /// The unit at the end of a path; paths of other lengths are other units.
    pub fn new(seed: u64, purpose: Purpose, path: &[u64]) -> Result<Self> {
        if path.is_empty() || path.len() > Self::DEEPEST || path.iter().any(|&n| n >= u64::from(u32::MAX)) {
            return invalid(format!(
                "random numbers: expected 1 to {} numbers below 2^32 - 1 that lead to a unit of work, found {path:?}",
                Self::DEEPEST
            ));
        }
        let mut places = [0; Self::DEEPEST];
        places.iter_mut().zip(path).for_each(|(place, number)| *place = *number as u32 + 1);
        Ok(Self { seed, purpose, path: places })
    }

    /// One of its streams; an unnamed number tells them apart, such as that of a draw or of a generation.
    pub fn stream(&self, number: u64) -> Stream {
        let pair = |low: u32, high: u32| u64::from(low) | u64::from(high) << 32;
        let [a, b, c, d, e] = self.path;
        // Streams of `Stream::new` have no number beside their purpose: the two never meet.
        Stream::keyed([self.seed, pair(self.purpose as u32, a), pair(b, c), pair(d, e)], number)
    }
}

/// A stream of random numbers.
pub struct Stream(ChaCha8Rng);

impl Stream {
    /// The stream of one unit of work: the `unit`-th of a generation of an iteration of a campaign's seed.
    pub fn new(seed: u64, purpose: Purpose, iteration: u64, generation: u64, unit: u64) -> Self {
        Self::keyed([seed, purpose as u64, iteration, generation], unit)
    }

    fn keyed(words: [u64; 4], number: u64) -> Self {
        let mut key = [0; 32];
        for (slot, word) in key.chunks_exact_mut(8).zip(words) {
            slot.copy_from_slice(&word.to_le_bytes());
        }
        let mut generator = ChaCha8Rng::from_seed(key);
        generator.set_stream(number);
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
        let mut first = Vec::new();
        for seed in [0, 1, u64::MAX] {
            for (_, purpose) in Purpose::ALL {
                for iteration in [0, 1, 2] {
                    for generation in [0, 1, 1 << 40] {
                        for unit in [0, 1, 2] {
                            first.push(Stream::new(seed, purpose, iteration, generation, unit).uniform());
                        }
                    }
                }
            }
        }
        for (_, purpose) in Purpose::ALL {
            let deep: &[&[u64]] =
                &[&[0], &[1], &[0, 0], &[0, 1], &[1, 0], &[0, 0, 0], &[0, 0, 0, 0], &[0, 0, 0, 0, 0]];
            for path in deep {
                let unit = Unit::new(0, purpose, path).expect("a unit");
                first.extend([0, 1, 1 << 40].map(|number| unit.stream(number).uniform()));
            }
        }
        let streams = first.len();
        first.sort_by(f64::total_cmp);
        first.dedup();
        assert_eq!(first.len(), streams);
    }

    #[test]
    fn paths_that_are_too_long_or_too_far_are_refused() {
        for path in [&[][..], &[0; 6], &[u64::from(u32::MAX)]] {
            assert!(Unit::new(0, Purpose::Gains, path).is_err(), "{path:?}");
        }
        assert_eq!("gains".parse(), Ok(Purpose::Gains));
        assert!("luck".parse::<Purpose>().is_err());
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
