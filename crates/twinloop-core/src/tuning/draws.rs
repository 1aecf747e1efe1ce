//! Draws: models with other constants and times, from the uncertainty that the runs leave.

use super::variant::Variant;
use super::{Tuned, Tuning};
use crate::error::{Result, invalid};
use crate::linear_algebra::Cholesky;
use crate::rng::Unit;
use crate::workers::Workers;

/// More models at once than this are refused.
const MOST_DRAWS: usize = 1_000_000;
/// Lengths at which a draw is tried: the whole step, then halves of it.
const HALVES: usize = 16;

impl Tuning<'_> {
    /// Tuned models with free values drawn from a normal distribution of the tuned covariance, each from its own stream.
    ///
    /// The covariance describes χ² only where it is a parabola. So a draw is halved until its χ² agrees with the runs.
    pub fn drawn(
        &self,
        tuned: &Tuned,
        unit: &Unit,
        draws: usize,
        workers: &Workers,
    ) -> Result<Vec<(Vec<f64>, Vec<f64>)>> {
        if draws > MOST_DRAWS {
            return invalid(format!("tune: expected at most {MOST_DRAWS} draws, found {draws}"));
        }
        if draws == 0 {
            // Most tunings draw nothing: no filter has to be run for them.
            return Ok(vec![]);
        }
        let start = Variant { constants: tuned.constants.clone(), lags: tuned.lags.clone() };
        let size = self.size();
        let factor =
            (!tuned.covariance.is_empty()).then(|| Cholesky::new(&tuned.covariance, size, 0.0)).flatten();
        let tries: Vec<Variant> = (0..draws)
            .flat_map(|draw| {
                let mut stream = unit.stream(draw as u64);
                let normal: Vec<f64> = (0..size).map(|_| stream.gaussian()).collect();
                let step = factor.as_ref().map_or_else(|| vec![0.0; size], |factor| factor.times(&normal));
                let shares = std::iter::successors(Some(1.0), |share| Some(0.5 * share)).take(HALVES);
                let taken = |share: f64| {
                    let step: Vec<f64> = step.iter().map(|s| share * s).collect();
                    self.moved(&start, &step)
                };
                shares.map(taken).collect::<Vec<_>>()
            })
            .collect();
        let costs = self.costs(&self.whitenings(), &tries, workers);
        let bearable = tuned.chi_squared + size as f64 + 3.0 * (2.0 * size as f64).sqrt();
        let borne = |(tries, costs): (&[Variant], &[f64])| {
            let found = tries.iter().zip(costs).find(|(_, cost)| **cost <= bearable);
            let one = found.map_or(&start, |(one, _)| one);
            (one.constants.clone(), one.lags.clone())
        };
        Ok(tries.chunks_exact(HALVES).zip(costs.chunks_exact(HALVES)).map(borne).collect())
    }
}
