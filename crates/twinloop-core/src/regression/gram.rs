//! Whitened features and readings of all records, as inner products; and least squares on any subset of them.

use std::sync::Arc;

use super::chain::{Chain, LONGEST, Motion};
use super::noise::Noise;
use super::whitening::Whitening;
use crate::error::{Result, invalid};
use crate::linear_algebra::Cholesky;
use crate::workers::Workers;

/// A record of one chain.
#[derive(Clone, Debug)]
pub struct Record {
    /// Readings, (n + 1) × states of the chain.
    pub measured: Vec<f64>,
    /// 1 for a reading that counts, 0 for one to be ignored, (n + 1) × states.
    pub weights: Vec<f64>,
    /// What each feature adds to each state in each period, n × features × states.
    pub increments: Vec<f64>,
}

impl Record {
    /// Readings and the features' values at the start, the middle and the end of each period (n × features each).
    pub fn new(
        chain: &Chain,
        measured: Vec<f64>,
        weights: Vec<f64>,
        start: &[f64],
        middle: &[f64],
        end: &[f64],
    ) -> Result<Self> {
        if middle.len() != start.len() || end.len() != start.len() {
            return invalid(
                "record: expected as many rows of features at the start, the middle and the end of periods",
            );
        }
        let mut increments = Vec::with_capacity(start.len() * chain.states);
        for ((&start, &middle), &end) in start.iter().zip(middle).zip(end) {
            increments.extend_from_slice(&chain.increments(start, middle, end)[..chain.states]);
        }
        Ok(Self { measured, weights, increments })
    }

    /// Periods.
    pub fn steps(&self, chain: &Chain) -> usize {
        self.measured.len() / chain.states - 1
    }

    /// How far each state may be from 0 before the first reading.
    pub(crate) fn spread(&self, chain: &Chain) -> Vec<f64> {
        let largest = |i: usize| {
            self.measured.iter().skip(i).step_by(chain.states).fold(0.0_f64, |a, b| a.max(b.abs()))
        };
        (0..chain.states).map(|i| largest(i) + f64::MIN_POSITIVE.sqrt()).collect()
    }

    /// Filters of records; those that count the same readings share one, for all begin with the largest spread.
    pub(crate) fn whitenings(chain: &Chain, records: &[Self], noise: &Noise) -> Vec<Arc<Whitening>> {
        let mut spread = vec![0.0_f64; chain.states];
        for record in records {
            spread.iter_mut().zip(record.spread(chain)).for_each(|(a, b)| *a = a.max(b));
        }
        let mut found: Vec<Arc<Whitening>> = Vec::with_capacity(records.len());
        for (r, record) in records.iter().enumerate() {
            let whitening = match records[..r].iter().position(|other| other.weights == record.weights) {
                Some(twin) => found[twin].clone(),
                None => Arc::new(Whitening::new(chain, noise, &record.weights, &spread)),
            };
            found.push(whitening);
        }
        found
    }

    /// Readings less what given coefficients (features) explain of them, (n + 1) × states.
    pub fn residual(&self, chain: &Chain, coefficients: &[f64]) -> Vec<f64> {
        // Loops of a known length are faster.
        match chain.states {
            1 => self.residual_of::<1>(chain, coefficients),
            2 => self.residual_of::<2>(chain, coefficients),
            3 => self.residual_of::<3>(chain, coefficients),
            _ => self.residual_of::<LONGEST>(chain, coefficients),
        }
    }

    fn residual_of<const D: usize>(&self, chain: &Chain, coefficients: &[f64]) -> Vec<f64> {
        let motion = Motion { states: D, ..chain.motion() };
        let (increments, _) = self.increments.as_chunks::<D>();
        let mut residual = self.measured.clone();
        let mut state = [0.0; D];
        for (k, reading) in residual.as_chunks_mut::<D>().0.iter_mut().skip(1).enumerate() {
            motion.predict(&mut state, 1.0);
            for (c, increment) in coefficients.iter().zip(&increments[k * coefficients.len()..]) {
                state.iter_mut().zip(increment).for_each(|(state, by)| *state += c * by);
            }
            reading.iter_mut().zip(state).for_each(|(reading, state)| *reading -= state);
        }
        residual
    }
}

/// Inner products of p features and the readings, whitened.
#[derive(Clone, Debug)]
pub struct Gram {
    /// Number of features.
    pub features: usize,
    /// (p + 1) × (p + 1), the readings last; symmetric.
    products: Vec<f64>,
    /// Whitened readings.
    pub readings: usize,
}

/// Least squares on a subset of features.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// Of the subset's features, in its order.
    pub coefficients: Vec<f64>,
    /// Their covariance under the noise of the whitening (k × k).
    pub covariance: Vec<f64>,
    /// Residual sum of squares, χ².
    pub chi_squared: f64,
}

/// Rows that are multiplied into the products at once.
const BLOCK: usize = 8;

impl Gram {
    /// Of columns whose inner products are known: with each other (features × features), with what they are to explain,
    /// and of that with itself.
    pub(crate) fn of(products: &[f64], targets: &[f64], total: f64, readings: usize) -> Self {
        let features = targets.len();
        let rows = targets.iter().enumerate();
        let mut all: Vec<f64> = rows
            .flat_map(|(j, target)| {
                products[j * features..][..features].iter().chain(std::iter::once(target))
            })
            .copied()
            .collect();
        all.extend_from_slice(targets);
        all.push(total);
        Self { features, products: all, readings }
    }

    /// Of all records.
    pub fn new(chain: &Chain, records: &[Record], features: usize, noise: &Noise, workers: &Workers) -> Self {
        let whitenings = Record::whitenings(chain, records, noise);
        // Loops of a known length are faster.
        let of_record = match chain.states {
            1 => Self::of_record::<1>,
            2 => Self::of_record::<2>,
            3 => Self::of_record::<3>,
            _ => Self::of_record::<LONGEST>,
        };
        let parts = workers.map(records.len(), |i| of_record(chain, &records[i], features, &whitenings[i]));
        let width = features + 1;
        let mut sum = Self { features, products: vec![0.0; width * width], readings: 0 };
        for part in parts {
            sum.products.iter_mut().zip(&part.products).for_each(|(a, b)| *a += b);
            sum.readings += part.readings;
        }
        sum
    }

    fn of_record<const D: usize>(
        chain: &Chain,
        record: &Record,
        features: usize,
        whitening: &Whitening,
    ) -> Self {
        let (d, p) = (D, features);
        let motion = Motion { states: D, ..chain.motion() };
        let width = p + 1;
        let mut products = vec![0.0; width * width];
        let inner = whitening.inner;
        // The filter's state for each column: the response to each feature, then the prediction of the readings.
        let mut state = vec![0.0; inner * width];
        let mut rows: Vec<f64> = Vec::with_capacity(BLOCK * width);
        let steps = record.steps(chain);
        for k in 0..=steps {
            let reading = whitening.reading(k, D);
            let first = rows.len();
            rows.resize(first + d * width, 0.0);
            for j in 0..width {
                let column = &mut state[j * inner..][..inner];
                // A feature's own response, or the readings less their prediction.
                let mut innovation = [0.0; D];
                for i in 0..d {
                    innovation[i] = if j < p { column[i] } else { record.measured[k * d + i] - column[i] };
                }
                let sign = if j < p { -1.0 } else { 1.0 };
                let (mut white, mut correction) = ([0.0; D], [0.0; LONGEST + 1]);
                reading.observe(&innovation, &mut white, &mut correction[..inner]);
                for i in 0..d {
                    rows[first + i * width + j] = white[i];
                }
                column.iter_mut().zip(&correction).for_each(|(state, by)| *state += sign * by);
                motion.predict(column, whitening.correlation);
                if j < p && k < steps {
                    let increments = &record.increments[(k * p + j) * d..][..d];
                    column.iter_mut().zip(increments).for_each(|(a, b)| *a += b);
                }
            }
            if rows.len() >= BLOCK * width || k == steps {
                multiply(&rows, width, &mut products);
                rows.clear();
            }
        }
        let mut gram = Self { features, products, readings: whitening.readings };
        gram.mirror();
        gram
    }

    /// With more rows, whitened already: p features and a reading each.
    pub fn with_rows(mut self, rows: &[f64]) -> Self {
        let width = self.features + 1;
        multiply(rows, width, &mut self.products);
        self.mirror();
        self.readings += rows.len() / width;
        self
    }

    /// With a normal prior about 0 on every coefficient, of given precisions (inverse variances): what it costs is in χ².
    pub fn with_prior(mut self, precisions: &[f64]) -> Self {
        let width = self.features + 1;
        precisions.iter().enumerate().for_each(|(j, precision)| self.products[j * width + j] += precision);
        self
    }

    /// Copies the upper triangle of the products to the lower one.
    fn mirror(&mut self) {
        let width = self.features + 1;
        for i in 0..width {
            for j in 0..i {
                self.products[i * width + j] = self.products[j * width + i];
            }
        }
    }

    /// ⟨feature i, feature j⟩; i or j may be `features` for the readings.
    #[inline(always)]
    pub fn product(&self, i: usize, j: usize) -> f64 {
        self.products[i * (self.features + 1) + j]
    }

    /// Sum of squares of the whitened readings.
    pub fn total(&self) -> f64 {
        self.product(self.features, self.features)
    }

    /// Least squares on a subset, on columns of unit length; `ridge` is added to their diagonal.
    pub fn solve(&self, subset: &[usize], ridge: f64) -> Option<Solution> {
        let k = subset.len();
        let lengths: Vec<f64> = subset.iter().map(|&j| self.product(j, j).sqrt()).collect();
        if lengths.iter().any(|&length| !(length.is_finite() && length > 0.0)) {
            return None;
        }
        let mut matrix = vec![0.0; k * k];
        for (a, &i) in subset.iter().enumerate() {
            for (b, &j) in subset.iter().enumerate() {
                matrix[a * k + b] = self.product(i, j) / (lengths[a] * lengths[b]);
            }
            matrix[a * k + a] += ridge;
        }
        let right: Vec<f64> =
            subset.iter().zip(&lengths).map(|(&j, length)| self.product(j, self.features) / length).collect();
        let factor = Cholesky::new(&matrix, k, 1e-13)?;
        let scaled = factor.solve(&right);
        let explained: f64 = {
            // With a ridge the plain product would not be what is explained.
            let mut sum = 0.0;
            for a in 0..k {
                let row: f64 =
                    (0..k).map(|b| (matrix[a * k + b] - if a == b { ridge } else { 0.0 }) * scaled[b]).sum();
                sum += scaled[a] * (2.0 * right[a] - row);
            }
            sum
        };
        let inverse = factor.inverse();
        Some(Solution {
            coefficients: scaled.iter().zip(&lengths).map(|(c, length)| c / length).collect(),
            covariance: (0..k * k).map(|ab| inverse[ab] / (lengths[ab / k] * lengths[ab % k])).collect(),
            chi_squared: (self.total() - explained).max(0.0),
        })
    }

    /// The same of a subset, with a ridge, that may be none; those are refused.
    pub fn checked_solve(&self, subset: &[usize], ridge: f64) -> Result<Option<Solution>> {
        if subset.iter().any(|&j| j >= self.features) || !(ridge.is_finite() && ridge >= 0.0) {
            return invalid(format!(
                "subset: expected features below {} and a ridge of at least 0, found {subset:?} and {ridge}",
                self.features
            ));
        }
        Ok(self.solve(subset, ridge))
    }
}

/// Adds the products of rows (each of `width`) to the upper triangle.
fn multiply(rows: &[f64], width: usize, products: &mut [f64]) {
    for i in 0..width {
        let target = &mut products[i * width + i..(i + 1) * width];
        for row in rows.chunks_exact(width) {
            let factor = row[i];
            if factor != 0.0 {
                target.iter_mut().zip(&row[i..]).for_each(|(t, &r)| *t += factor * r);
            }
        }
    }
}
