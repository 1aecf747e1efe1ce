//! Regression: which sums of features explain what the sensors saw, with sensor noise separated from process noise.

mod chain;
mod gram;
mod likelihood;
mod linear;
mod noise;
mod problem;
mod subset;
mod whitening;

pub use chain::Chain;
pub use gram::{Gram, Record, Solution};
pub use likelihood::{likelihood, most_likely_noise};
pub use noise::Noise;
pub use problem::{Leftover, Regression, most_likely_noises};
pub use subset::{Annealing, Choices, Found, search, search_all};

pub(crate) use chain::LONGEST;
pub(crate) use whitening::Whitening;
