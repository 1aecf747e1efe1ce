//! Regression: which sums of features explain what the sensors saw, with sensor noise and process noise told apart.

mod blocks;
mod chain;
mod gram;
mod inverse;
mod likelihood;
mod subset;

pub use chain::{Chain, Noise};
pub use gram::{Gram, Record, Solution};
pub use likelihood::{likelihood, most_likely_noise};
pub use subset::{Annealing, Choices, Found, search};

pub(crate) use chain::Whitening;
