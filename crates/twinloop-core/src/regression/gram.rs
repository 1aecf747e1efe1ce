//! Whitened features and readings of all records, as inner products; and least squares on any subset of them.

use std::sync::Arc;

use super::chain::{Chain, LONGEST, Motion};
use super::noise::Noise;
use super::whitening::Whitening;
use crate::error::{Result, invalid};
use crate::lanes::{Isa, Kernel, Vector, dispatch};
use crate::linear_algebra::Cholesky;
use crate::workers::Workers;

/// A record of one chain.
#[derive(Clone, Debug)]
pub struct Record {
    /// Readings, (n + 1) × states of the chain.
    pub measured: Vec<f64>,
    /// 1 for a reading that counts, 0 for one to be ignored, (n + 1) × states.
    pub weights: Vec<f64>,
    /// What each feature adds to each state in each period, n × states × [`stride`] of the features; 0 beyond those.
    pub increments: Vec<f64>,
}

/// Columns that stand in one vector.
const LANES: usize = 8;

/// Features and the readings behind them, as columns that fill whole vectors.
pub(crate) fn stride(features: usize) -> usize {
    (features + 1).next_multiple_of(LANES)
}

impl Record {
    /// Readings and the values of so many features at the start, the middle and the end of each period (n × features each).
    pub fn new(
        chain: &Chain,
        features: usize,
        measured: Vec<f64>,
        weights: Vec<f64>,
        [start, middle, end]: [&[f64]; 3],
    ) -> Result<Self> {
        let (d, stride) = (chain.states, stride(features));
        let steps = (measured.len() / d).saturating_sub(1);
        if [start, middle, end].iter().any(|values| values.len() != steps * features) {
            return invalid(format!(
                "record: expected {steps} rows of {features} features at the start, the middle and the end of periods"
            ));
        }
        let mut increments = vec![0.0; steps * d * stride];
        for at in 0..start.len() {
            let (k, j) = (at / features, at % features);
            for (i, by) in chain.increments(start[at], middle[at], end[at]).into_iter().take(d).enumerate() {
                increments[(k * d + i) * stride + j] = by;
            }
        }
        Ok(Self { measured, weights, increments })
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
        let (d, motion, stride) = (chain.states, chain.motion(), stride(coefficients.len()));
        let weighing: Vec<_> = coefficients.iter().copied().enumerate().filter(|&(_, c)| c != 0.0).collect();
        let mut residual = self.measured.clone();
        let mut state = [0.0; LONGEST];
        let periods = self.increments.chunks_exact(d * stride);
        for (reading, increments) in residual.chunks_exact_mut(d).skip(1).zip(periods) {
            motion.predict(&mut state[..d], 1.0);
            for &(j, c) in &weighing {
                for (i, state) in state[..d].iter_mut().enumerate() {
                    *state += c * increments[i * stride + j];
                }
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
#[derive(Clone, Debug)]
pub struct Solution {
    /// Of the subset's features, in its order.
    pub coefficients: Vec<f64>,
    /// Residual sum of squares, χ².
    pub chi_squared: f64,
    /// Of the inner products of columns of unit length.
    factor: Cholesky,
    /// Lengths of the columns.
    lengths: Vec<f64>,
}

impl Solution {
    /// The covariance of the coefficients under the noise of the whitening (k × k).
    pub fn covariance(&self) -> Vec<f64> {
        let (k, lengths, inverse) = (self.lengths.len(), &self.lengths, self.factor.inverse());
        (0..k * k).map(|ab| inverse[ab] / (lengths[ab / k] * lengths[ab % k])).collect()
    }
}

/// Rows that are multiplied into the products at once.
const BLOCK: usize = 16;

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
        let parts = workers.map(records.len(), |i| {
            let of_record =
                OfRecord { motion: chain.motion(), record: &records[i], features, whitening: &whitenings[i] };
            dispatch(workers.width(), of_record)
        });
        let width = features + 1;
        let mut sum = Self { features, products: vec![0.0; width * width], readings: 0 };
        for (part, whitening) in parts.iter().zip(&whitenings) {
            let rows = part.chunks_exact(stride(features)).flat_map(|row| &row[..width]);
            sum.products.iter_mut().zip(rows).for_each(|(a, b)| *a += b);
            sum.readings += whitening.readings;
        }
        sum.mirror();
        sum
    }

    /// With more rows, whitened already: p features and a reading each.
    pub fn with_rows(mut self, rows: &[f64]) -> Self {
        let width = self.features + 1;
        for row in rows.chunks_exact(width) {
            for (i, &factor) in row.iter().enumerate() {
                let products = &mut self.products[i * width + i..(i + 1) * width];
                products.iter_mut().zip(&row[i..]).for_each(|(sum, &r)| *sum += factor * r);
            }
        }
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

    /// Of some of the features, in the order given.
    pub fn part(&self, features: &[usize]) -> Result<Self> {
        if let Some(other) = features.iter().find(|&&j| j >= self.features) {
            return invalid(format!("part: expected features below {}, found {other}", self.features));
        }
        let all: Vec<usize> = features.iter().copied().chain([self.features]).collect();
        let mut products = Vec::with_capacity(all.len() * all.len());
        for &i in &all {
            for &j in &all {
                products.push(self.product(i, j));
            }
        }
        Ok(Self { features: features.len(), products, readings: self.readings })
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
        Some(Solution {
            coefficients: scaled.iter().zip(&lengths).map(|(c, length)| c / length).collect(),
            chi_squared: (self.total() - explained).max(0.0),
            factor,
            lengths,
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

/// The upper triangle of the products of a record's whitened columns, rows of [`stride`] numbers.
struct OfRecord<'a> {
    motion: Motion,
    record: &'a Record,
    features: usize,
    whitening: &'a Whitening,
}

impl Kernel for OfRecord<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run<W: Isa>(self) -> Vec<f64> {
        let Self { motion, record, features, whitening } = self;
        let (d, inner, stride) = (motion.states, whitening.inner, stride(features));
        let steps = record.measured.len() / d - 1;
        let mut products = vec![0.0; (features + 1) * stride];
        // The filter's state for each column: the response to each feature, then the prediction of the readings, of the
        // other sign. So its innovation is the state for each, but for the readings, which are added to theirs.
        let mut state = vec![0.0; inner * stride];
        let mut measured = vec![0.0; d * stride];
        let mut rows: Vec<f64> = Vec::with_capacity((BLOCK + d) * stride);
        for k in 0..=steps {
            let reading = whitening.reading(k, d);
            let first = rows.len();
            rows.resize(first + d * stride, 0.0);
            for i in 0..d {
                measured[i * stride + features] = record.measured[k * d + i];
            }
            for j in (0..stride).step_by(LANES) {
                let nothing = W::Of8::splat(0.0);
                let (mut column, mut correction) = ([nothing; LONGEST + 1], [nothing; LONGEST + 1]);
                let (mut innovation, mut white) = ([nothing; LONGEST], [nothing; LONGEST]);
                for m in 0..inner {
                    column[m] = W::Of8::load(&state[m * stride + j..]);
                }
                for i in 0..d {
                    innovation[i] = column[i] + W::Of8::load(&measured[i * stride + j..]);
                }
                reading.observe(&innovation[..d], &mut white[..d], &mut correction[..inner]);
                for i in 0..d {
                    white[i].store(&mut rows[first + i * stride + j..]);
                }
                for m in 0..inner {
                    column[m] = column[m] - correction[m];
                }
                motion.predict(&mut column[..inner], whitening.correlation);
                if k < steps {
                    let moved =
                        column[..d].iter_mut().zip(record.increments[k * d * stride..].chunks(stride));
                    for (state, increments) in moved {
                        *state = *state + W::Of8::load(&increments[j..]);
                    }
                }
                for m in 0..inner {
                    column[m].store(&mut state[m * stride + j..]);
                }
            }
            if rows.len() >= BLOCK * stride || k == steps {
                for i in 0..=features {
                    let mut j = i - i % LANES;
                    while j < stride {
                        if stride - j >= W::Of32::LANES {
                            add::<W::Of32>(&rows, stride, i, j, &mut products);
                            j += W::Of32::LANES;
                        } else {
                            add::<W::Of8>(&rows, stride, i, j, &mut products);
                            j += LANES;
                        }
                    }
                }
                rows.clear();
            }
        }
        products
    }
}

/// Adds the products of column `i` with those from `j` on, row by row.
#[inline(always)]
fn add<V: Vector>(rows: &[f64], stride: usize, i: usize, j: usize, products: &mut [f64]) {
    let target = &mut products[i * stride + j..][..V::LANES];
    let mut sum = V::load(target);
    for row in rows.chunks_exact(stride) {
        sum = sum + V::load(&row[j..]) * row[i];
    }
    sum.store(target);
}
