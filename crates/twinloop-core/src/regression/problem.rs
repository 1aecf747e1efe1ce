//! A regression: records of one chain and the features that may drive it, checked to fit each other.

use super::chain::Chain;
use super::gram::{Gram, Record, stride};
use super::likelihood::{likelihood, most_likely_noise};
use super::noise::Noise;
use crate::error::{Result, invalid};
use crate::workers::Workers;

/// What is regressed: sums of features on what the sensors of a chain read.
#[derive(Clone, Debug)]
pub struct Regression {
    chain: Chain,
    records: Vec<Record>,
    features: usize,
}

impl Regression {
    /// Refuses records of another number of features or states.
    pub fn new(chain: Chain, features: usize, records: Vec<Record>) -> Result<Self> {
        let chain = chain.validated()?;
        let fits = |record: &Record| {
            let rows = record.measured.len() / chain.states;
            rows > 0
                && record.measured.len() == rows * chain.states
                && record.weights.len() == record.measured.len()
                && record.increments.len() == (rows - 1) * stride(features) * chain.states
        };
        if !records.iter().all(fits) {
            return invalid(format!(
                "record: expected n rows of {features} features three times and n + 1 rows of {} readings and weights",
                chain.states
            ));
        }
        Ok(Self { chain, records, features })
    }

    /// What the records are of.
    pub fn chain(&self) -> &Chain {
        &self.chain
    }

    /// Readings less what coefficients (features) explain, (n + 1) × states for each record.
    pub fn residuals(&self, coefficients: &[f64]) -> Result<Vec<Vec<f64>>> {
        if coefficients.len() != self.features || !coefficients.iter().all(|c| c.is_finite()) {
            return invalid(format!(
                "expected {} finite coefficients, found {coefficients:?}",
                self.features
            ));
        }
        Ok(self.records.iter().map(|record| record.residual(&self.chain, coefficients)).collect())
    }

    /// −2 log of the likelihood of what coefficients leave, if only noise made it.
    pub fn likelihood(&self, coefficients: &[f64], noise: &Noise) -> Result<f64> {
        Ok(likelihood(&self.chain, &self.records, &self.residuals(coefficients)?, noise))
    }

    /// Of the readings' covariance under a noise, the part of −2 log of a likelihood that residuals have no share in.
    pub fn log_determinant(&self, noise: &Noise) -> f64 {
        let whitenings = Record::whitenings(&self.chain, &self.records, noise);
        whitenings.iter().map(|whitening| whitening.log_determinant).sum()
    }

    /// Inner products of all features and the readings, whitened for a noise.
    pub fn gram(&self, noise: &Noise, workers: &Workers) -> Gram {
        Gram::new(&self.chain, &self.records, self.features, noise, workers)
    }
}

/// What coefficients leave of a regression, and where the search for the noise that made it starts.
pub struct Leftover<'a> {
    /// The regression.
    pub regression: &'a Regression,
    /// Of its features.
    pub coefficients: Vec<f64>,
    /// The first guess.
    pub start: Noise,
    /// No variance goes below these.
    pub smallest: Noise,
}

/// For each of some leftovers the noise under which it is most likely, and −2 log of its likelihood then.
pub fn most_likely_noises(leftovers: &[Leftover<'_>], workers: &Workers) -> Result<Vec<(Noise, f64)>> {
    let residuals = leftovers.iter().map(|left| left.regression.residuals(&left.coefficients));
    let residuals: Vec<_> = residuals.collect::<Result<_>>()?;
    Ok(workers.map(leftovers.len(), |i| {
        let Leftover { regression: Regression { chain, records, .. }, start, smallest, .. } = &leftovers[i];
        most_likely_noise(chain, records, &residuals[i], start, smallest)
    }))
}
