//! CMA-ES: searches the least value of a function, with a normal distribution that adapts to what it meets.
//!
//! N. Hansen, *The CMA Evolution Strategy: A Tutorial*, arXiv:1604.00772; numbers in parentheses are its equations, the
//! defaults those of its table 1. It is our own because no library has the same bits on every processor: they take
//! eigenvectors and sums from LAPACK and BLAS, which round differently from kernel to kernel, and one rounding sends a
//! search elsewhere. Here they are summed in one order.

use crate::error::{Result, invalid};
use crate::linear_algebra::{Eigen, ascending};
use crate::rng::Unit;

/// A range of values, beside the largest of them, below which nothing is left to be gained.
const FLAT: f64 = 1e-9;
/// A step, beside the first one, below which a search stands still.
const STILL: f64 = 1e-12;
/// A step, beside the first one, above which a search has run away.
const FAR: f64 = 1e4;
/// Added to a squared length, so that a point in the middle of the others has a weight.
const MIDDLE: f64 = 1e-8;
/// Condition of the covariance above which its axes are rounding.
const ILL: f64 = 1e14;

/// Weights and rates, by dimension and population (table 1).
#[derive(Clone, Debug, PartialEq)]
struct Strategy {
    /// w, the best point first; those of the worse half are negative.
    weights: Vec<f64>,
    /// μ.
    parents: usize,
    /// μ_eff.
    effective: f64,
    c_sigma: f64,
    d_sigma: f64,
    c_c: f64,
    c_1: f64,
    c_mu: f64,
    /// E‖N(0, I)‖.
    expected: f64,
    /// Generations over which values are compared.
    memory: usize,
}

impl Strategy {
    fn new(dimension: usize, population: usize) -> Self {
        let (n, parents) = (dimension as f64, population / 2);
        let raw: Vec<f64> = (1..=population)
            .map(|i| libm::log(0.5 * (population + 1) as f64) - libm::log(i as f64)) // (49)
            .collect();
        let mass = |w: &[f64]| {
            let (sum, squares) = (w.iter().sum::<f64>(), w.iter().map(|w| w * w).sum::<f64>());
            sum * sum / squares
        };
        let (effective, effective_minus) = (mass(&raw[..parents]), mass(&raw[parents..]));
        let c_sigma = (effective + 2.0) / (n + effective + 5.0); // (55)
        let d_sigma = 1.0 + 2.0 * (((effective - 1.0) / (n + 1.0)).sqrt() - 1.0).max(0.0) + c_sigma; // (55)
        let c_c = (4.0 + effective / n) / (n + 4.0 + 2.0 * effective / n); // (56)
        let c_1 = 2.0 / ((n + 1.3) * (n + 1.3) + effective); // (57)
        let c_mu = (2.0 * (effective - 2.0 + 1.0 / effective) / ((n + 2.0) * (n + 2.0) + effective)) // (58)
            .min(1.0 - c_1 - 1e-8);
        let smallest = (1.0 + c_1 / c_mu) // (50)
            .min(1.0 + 2.0 * effective_minus / (effective + 2.0)) // (51)
            .min((1.0 - c_1 - c_mu) / (n * c_mu)); // (52)
        let positive: f64 = raw.iter().filter(|w| **w > 0.0).sum();
        let negative: f64 = raw.iter().filter(|w| **w < 0.0).map(|w| -w).sum();
        let weights =
            raw.iter().map(|w| w * if *w >= 0.0 { 1.0 / positive } else { smallest / negative }).collect(); // (53)
        let expected = n.sqrt() * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n));
        let memory = 10 + (30 * dimension).div_ceil(population);
        Self { weights, parents, effective, c_sigma, d_sigma, c_c, c_1, c_mu, expected, memory }
    }
}

/// A search as a value: `ask` for points, judge them, and `tell` makes the search that knows them.
#[derive(Clone, Debug, PartialEq)]
pub struct CmaEs {
    strategy: Strategy,
    unit: Unit,
    generation: u64,
    first_step: f64,
    /// m.
    mean: Vec<f64>,
    /// σ.
    step: f64,
    /// C, row after row.
    covariance: Vec<f64>,
    /// Axes of C, and their lengths squared.
    axes: Eigen,
    /// p_c.
    path: Vec<f64>,
    /// p_σ.
    step_path: Vec<f64>,
    /// The best and the worst value of the last generations.
    extremes: Vec<(f64, f64)>,
}

impl CmaEs {
    /// More points of a generation than this are refused.
    pub const MOST_POINTS: usize = 1_000_000;

    /// A search around a point with standard deviations `step`; each generation has a stream of its unit.
    pub fn new(mean: &[f64], step: f64, population: usize, unit: Unit) -> Result<Self> {
        if mean.is_empty() || !mean.iter().all(|x| x.is_finite()) {
            return invalid(format!("CMA-ES, mean: expected at least one finite number, found {mean:?}"));
        }
        if !(step.is_finite() && step > 0.0 && (2..=Self::MOST_POINTS).contains(&population)) {
            return invalid(format!(
                "CMA-ES: expected a step above 0 and a population of 2 to {}, found {step} and {population}",
                Self::MOST_POINTS
            ));
        }
        let dimension = mean.len();
        let mut covariance = vec![0.0; dimension * dimension];
        (0..dimension).for_each(|i| covariance[i * dimension + i] = 1.0);
        Ok(Self {
            strategy: Strategy::new(dimension, population),
            unit,
            generation: 0,
            first_step: step,
            mean: mean.to_vec(),
            step,
            axes: Eigen::new(&covariance, dimension),
            covariance,
            path: vec![0.0; dimension],
            step_path: vec![0.0; dimension],
            extremes: vec![],
        })
    }

    /// Number of generations so far.
    pub fn generation(&self) -> u64 {
        self.generation
    }

    /// m, the middle of the distribution.
    pub fn mean(&self) -> &[f64] {
        &self.mean
    }

    /// σ, the factor on the square root of the covariance.
    pub fn step(&self) -> f64 {
        self.step
    }

    /// C, row after row.
    pub fn covariance(&self) -> &[f64] {
        &self.covariance
    }

    /// The points of this generation; asking again gives the same ones.
    pub fn ask(&self) -> Vec<Vec<f64>> {
        let mut stream = self.unit.stream(self.generation);
        let mut drawn = || {
            let z: Vec<f64> = self.mean.iter().map(|_| stream.gaussian()).collect(); // (38)
            let stretched = z.iter().enumerate().map(|(i, z)| z * self.length(i)).collect::<Vec<_>>();
            let y = self.back(&stretched); // (39)
            self.mean.iter().zip(&y).map(|(m, y)| m + self.step * y).collect() // (40)
        };
        self.strategy.weights.iter().map(|_| drawn()).collect()
    }

    /// The search that knows the values of a generation's points; only their order counts.
    pub fn tell(&self, points: &[Vec<f64>], values: &[f64]) -> Result<Self> {
        self.check(points, values)?;
        let order = ascending(values);
        let s = &self.strategy;
        let n = self.mean.len();
        let steps: Vec<Vec<f64>> = order
            .iter()
            .map(|&i| points[i].iter().zip(&self.mean).map(|(x, m)| (x - m) / self.step).collect())
            .collect();
        let mut next = self.clone();
        next.generation += 1;
        next.extremes.push((values[order[0]], values[order[order.len() - 1]]));
        if next.extremes.len() > s.memory {
            next.extremes.remove(0);
        }
        let mut y_w = vec![0.0; n]; // (41)
        for (y, w) in steps.iter().zip(&s.weights).take(s.parents) {
            add(&mut y_w, *w, y);
        }
        add(&mut next.mean, self.step, &y_w); // (42)
        scale_and_add(
            &mut next.step_path,
            1.0 - s.c_sigma,
            (s.c_sigma * (2.0 - s.c_sigma) * s.effective).sqrt(),
            &self.whitened(&y_w),
        ); // (43)
        let norm = square(&next.step_path).sqrt();
        next.step *= libm::exp(s.c_sigma / s.d_sigma * (norm / s.expected - 1.0)); // (44)
        let settled = 1.0 - libm::pow(1.0 - s.c_sigma, 2.0 * (next.generation + 1) as f64);
        let h = norm / settled.sqrt() < (1.4 + 2.0 / (n as f64 + 1.0)) * s.expected;
        let towards = if h { (s.c_c * (2.0 - s.c_c) * s.effective).sqrt() } else { 0.0 };
        scale_and_add(&mut next.path, 1.0 - s.c_c, towards, &y_w); // (45)
        let late = if h { 0.0 } else { s.c_c * (2.0 - s.c_c) };
        let kept = 1.0 + s.c_1 * late - s.c_1 - s.c_mu * s.weights.iter().sum::<f64>();
        next.covariance.iter_mut().for_each(|c| *c *= kept); // (47)
        add_outer(&mut next.covariance, s.c_1, &next.path);
        for (y, w) in steps.iter().zip(&s.weights) {
            let length = if *w >= 0.0 { 1.0 } else { n as f64 / (square(&self.whitened(y)) + MIDDLE) };
            add_outer(&mut next.covariance, s.c_mu * w * length, y); // (46), (47)
        }
        next.axes = Eigen::new(&next.covariance, n);
        Ok(next)
    }

    /// Whether nothing more is to be had from this search (section B.3).
    pub fn stopped(&self) -> bool {
        let n = self.mean.len();
        let deviation = |i: usize| self.step * self.covariance[i * n + i].sqrt();
        let moves = |i: usize, by: f64| self.mean[i] + by != self.mean[i];
        let least = STILL * self.first_step;
        let axis = self.generation as usize % n;
        let along = 0.1 * self.step * self.length(axis);
        let still = (0..n).all(|i| deviation(i) < least && self.step * self.path[i].abs() < least);
        let lost = (0..n).any(|i| !moves(i, 0.2 * deviation(i)))
            || self.axes.vector(axis).iter().enumerate().all(|(i, v)| !moves(i, along * v));
        let (shortest, longest) = (self.length(0), self.length(n - 1));
        let far = !self.step.is_finite() || self.step * longest > FAR * self.first_step;
        let ill = longest * longest > ILL * shortest * shortest;
        self.flat() || still || lost || far || ill
    }

    /// Whether the values of many generations are all the same but for rounding.
    fn flat(&self) -> bool {
        let best = self.extremes.iter().map(|e| e.0).fold(f64::INFINITY, f64::min);
        let worst = self.extremes.iter().map(|e| e.1).fold(f64::NEG_INFINITY, f64::max);
        let many = self.extremes.len() == self.strategy.memory;
        many && (worst == best || worst - best <= FLAT * worst.abs().max(best.abs()))
    }

    fn check(&self, points: &[Vec<f64>], values: &[f64]) -> Result<()> {
        let (population, n) = (self.strategy.weights.len(), self.mean.len());
        if points.len() != population || values.len() != population || points.iter().any(|x| x.len() != n) {
            return invalid(format!(
                "CMA-ES: expected {population} points of {n} numbers with a value each, found {} and {} values",
                points.len(),
                values.len()
            ));
        }
        if !points.iter().flatten().all(|x| x.is_finite()) || values.iter().any(|x| x.is_nan()) {
            return invalid(
                "CMA-ES: expected finite points and no NaN among values; give a failure a large value",
            );
        }
        Ok(())
    }

    /// Length of an axis of C, the shortest first; above 0 even where rounding left a negative square.
    fn length(&self, i: usize) -> f64 {
        let longest = self.axes.values[self.mean.len() - 1];
        self.axes.values[i].max(f64::EPSILON * longest).sqrt()
    }

    /// Coordinates along the axes, from those along the parameters.
    fn along(&self, y: &[f64]) -> Vec<f64> {
        (0..y.len()).map(|i| self.axes.vector(i).iter().zip(y).map(|(v, y)| v * y).sum()).collect()
    }

    /// Coordinates along the parameters, from those along the axes.
    fn back(&self, a: &[f64]) -> Vec<f64> {
        let mut y = vec![0.0; a.len()];
        a.iter().enumerate().for_each(|(i, a)| add(&mut y, *a, self.axes.vector(i)));
        y
    }

    /// C^(−1/2) y.
    fn whitened(&self, y: &[f64]) -> Vec<f64> {
        let along: Vec<f64> = self.along(y).iter().enumerate().map(|(i, a)| a / self.length(i)).collect();
        self.back(&along)
    }
}

/// x += factor · y.
fn add(x: &mut [f64], factor: f64, y: &[f64]) {
    x.iter_mut().zip(y).for_each(|(x, y)| *x += factor * y);
}

/// x = kept · x + factor · y.
fn scale_and_add(x: &mut [f64], kept: f64, factor: f64, y: &[f64]) {
    x.iter_mut().zip(y).for_each(|(x, y)| *x = kept * *x + factor * y);
}

/// A += factor · y yᵀ; symmetric to the bit.
fn add_outer(matrix: &mut [f64], factor: f64, y: &[f64]) {
    for (row, a) in matrix.chunks_exact_mut(y.len()).zip(y) {
        row.iter_mut().zip(y).for_each(|(c, b)| *c += factor * (a * b));
    }
}

fn square(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum()
}
