//! Regression on whitened features, and the search over their subsets.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use twinloop_core::{Annealing, Chain, Choices, Gram, Noise, Record, likelihood, most_likely_noise, search};

use crate::arrays::{Matrix, Vector, rows, to_matrix, to_vector, vector};
use crate::error::{Result, misuse};
use crate::rng::Name;
use crate::workers::{PyWorkers, or_default};

/// Process variance, gust variance, memory in s.
type Motion = (f64, f64, f64);
/// Readings, weights, and the features at the start, the middle and the end of each period.
type RecordArrays<'py> = (Matrix<'py>, Matrix<'py>, Matrix<'py>, Matrix<'py>, Matrix<'py>);

/// Subsets with their energies, best first.
type Walked = Vec<(Vec<usize>, f64)>;

/// Records of one chain of states with the features that may drive it.
#[pyclass(frozen, name = "Regression", module = "twinloop._core")]
pub struct PyRegression {
    chain: Chain,
    records: Vec<Record>,
    features: usize,
}

#[pymethods]
impl PyRegression {
    #[new]
    fn new(states: usize, dt: f64, integrated: bool, records: Vec<RecordArrays<'_>>) -> Result<Self> {
        let chain = Chain { states, dt, integrated }.validated()?;
        let mut features = None;
        let mut built = Vec::with_capacity(records.len());
        for (measured, weights, start, middle, end) in &records {
            let p = *features.get_or_insert(start.as_array().ncols());
            let steps = start.as_array().nrows();
            let shapes = [middle, end].iter().all(|m| m.as_array().dim() == (steps, p))
                && start.as_array().dim() == (steps, p)
                && [measured, weights].iter().all(|m| m.as_array().dim() == (steps + 1, states));
            if !shapes {
                return Err(misuse(format!(
                    "record: expected n rows of {p} features three times and n + 1 rows of {states} readings and weights"
                )));
            }
            let flat = |m: &Matrix<'_>, columns| rows("record", m, columns).map(|rows| rows.concat());
            let record = Record::new(
                &chain,
                flat(measured, states)?,
                flat(weights, states)?,
                &flat(start, p)?,
                &flat(middle, p)?,
                &flat(end, p)?,
            );
            let numbers = record.increments.iter().chain(&record.measured).chain(&record.weights);
            if !numbers.copied().all(f64::is_finite) {
                return Err(misuse("record: expected finite numbers, found NaN or an infinite one".into()));
            }
            built.push(record);
        }
        Ok(Self { chain, records: built, features: features.unwrap_or(0) })
    }

    /// Readings less what the coefficients explain, a matrix for each record.
    fn residuals<'py>(
        &self,
        py: Python<'py>,
        coefficients: Vector<'py>,
    ) -> Result<Vec<Bound<'py, PyArray2<f64>>>> {
        let coefficients = self.coefficients(&coefficients)?;
        Ok(self
            .records
            .iter()
            .map(|record| to_matrix(py, self.chain.states, record.residual(&self.chain, &coefficients)))
            .collect())
    }

    fn likelihood(&self, coefficients: Vector<'_>, sensors: Vector<'_>, motion: Motion) -> Result<f64> {
        let residuals = self.leftovers(&coefficients)?;
        Ok(likelihood(&self.chain, &self.records, &residuals, &self.noise(&sensors, motion)?))
    }

    #[pyo3(signature = (sensors, motion, workers = None))]
    fn gram(
        &self,
        py: Python<'_>,
        sensors: Vector<'_>,
        motion: Motion,
        workers: Option<&PyWorkers>,
    ) -> Result<PyGram> {
        let workers = or_default(workers)?;
        let noise = self.noise(&sensors, motion)?;
        let gram = py.detach(|| Gram::new(&self.chain, &self.records, self.features, &noise, &workers));
        Ok(PyGram(Arc::new(gram)))
    }
}

impl PyRegression {
    fn coefficients(&self, coefficients: &Vector<'_>) -> Result<Vec<f64>> {
        let coefficients = vector(coefficients);
        if coefficients.len() != self.features || !coefficients.iter().all(|c| c.is_finite()) {
            return Err(misuse(format!(
                "expected {} finite coefficients, found {coefficients:?}",
                self.features
            )));
        }
        Ok(coefficients)
    }

    fn leftovers(&self, coefficients: &Vector<'_>) -> Result<Vec<Vec<f64>>> {
        let coefficients = self.coefficients(coefficients)?;
        Ok(self.records.iter().map(|record| record.residual(&self.chain, &coefficients)).collect())
    }

    fn noise(&self, sensors: &Vector<'_>, (process, gust, memory): Motion) -> Result<Noise> {
        Ok(Noise { sensors: vector(sensors), process, gust, memory }.validated(self.chain.states)?)
    }
}

/// A regression with coefficients, the sensors' variances and the motion to start from, and the least of both.
type Left<'py> = (Bound<'py, PyRegression>, Vector<'py>, Vector<'py>, Motion, Vector<'py>, Motion);

/// For each of the problems the noise under which what its coefficients leave is most likely, and −2 log of that.
#[pyfunction]
#[pyo3(signature = (problems, workers = None))]
#[expect(clippy::type_complexity, reason = "sensors' variances, motion, −2 log of the likelihood")]
pub fn most_likely_noises<'py>(
    py: Python<'py>,
    problems: Vec<Left<'py>>,
    workers: Option<&PyWorkers>,
) -> Result<Vec<(Bound<'py, PyArray1<f64>>, Motion, f64)>> {
    let workers = or_default(workers)?;
    let mut posed = Vec::with_capacity(problems.len());
    for (regression, coefficients, sensors, motion, smallest_sensors, smallest_motion) in &problems {
        let regression = regression.get();
        let residuals = regression.leftovers(coefficients)?;
        let start = regression.noise(sensors, *motion)?;
        posed.push((regression, residuals, start, regression.noise(smallest_sensors, *smallest_motion)?));
    }
    let found = py.detach(|| {
        workers.map(posed.len(), |i| {
            let (regression, residuals, start, smallest) = &posed[i];
            most_likely_noise(&regression.chain, &regression.records, residuals, start, smallest)
        })
    });
    let told = |(noise, score): (Noise, f64)| {
        (to_vector(py, noise.sensors), (noise.process, noise.gust, noise.memory), score)
    };
    Ok(found.into_iter().map(told).collect())
}

/// Inner products of whitened features and readings.
#[pyclass(frozen, name = "Gram", module = "twinloop._core")]
pub struct PyGram(pub Arc<Gram>);

#[pymethods]
impl PyGram {
    #[getter]
    fn features(&self) -> usize {
        self.0.features
    }

    #[getter]
    fn readings(&self) -> usize {
        self.0.readings
    }

    #[getter]
    fn total(&self) -> f64 {
        self.0.total()
    }

    /// With more rows: features, and a reading at the end.
    fn with_rows(&self, rows: Matrix<'_>) -> Result<Self> {
        let flat = crate::arrays::rows("rows", &rows, self.0.features + 1)?.concat();
        if !flat.iter().all(|x| x.is_finite()) {
            return Err(misuse("rows: expected finite numbers, found NaN or an infinite one".into()));
        }
        Ok(Self(Arc::new(Gram::clone(&self.0).with_rows(&flat))))
    }

    /// Coefficients, their covariance and what is left; none where the features are collinear.
    #[pyo3(signature = (subset, ridge = 0.0))]
    #[expect(clippy::type_complexity, reason = "coefficients, covariance, χ²")]
    fn solve<'py>(
        &self,
        py: Python<'py>,
        subset: Vec<usize>,
        ridge: f64,
    ) -> Result<Option<(Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>, f64)>> {
        if subset.iter().any(|&j| j >= self.0.features) || !(ridge.is_finite() && ridge >= 0.0) {
            return Err(misuse(format!(
                "subset: expected features below {} and a ridge of at least 0, found {subset:?} and {ridge}",
                self.0.features
            )));
        }
        let k = subset.len();
        Ok(self.0.solve(&subset, ridge).map(|solution| {
            (to_vector(py, solution.coefficients), to_matrix(py, k, solution.covariance), solution.left)
        }))
    }
}

/// More walks of a problem than this are refused.
const MOST_STARTS: usize = 1_000_000;

/// For each of the problems, subsets with their energies, best first: annealed `starts` times from different streams.
#[pyfunction]
#[pyo3(signature = (grams, prices, *, moves, largest, starts, unit, coldest = 2.0, workers = None))]
#[expect(clippy::too_many_arguments, reason = "the settings of a search, named by keyword in Python")]
pub fn search_subsets(
    py: Python<'_>,
    grams: Vec<Bound<'_, PyGram>>,
    prices: Vec<Vector<'_>>,
    moves: usize,
    largest: usize,
    starts: usize,
    unit: Name,
    coldest: f64,
    workers: Option<&PyWorkers>,
) -> Result<Vec<Walked>> {
    let workers = or_default(workers)?;
    let grams: Vec<_> = grams.iter().map(|gram| gram.get().0.clone()).collect();
    if prices.len() != grams.len() || !(1..=MOST_STARTS).contains(&starts) {
        return Err(misuse(format!(
            "search_subsets: expected prices for each problem and 1 to {MOST_STARTS} starts, found {} for {} and {starts}",
            prices.len(),
            grams.len()
        )));
    }
    let prices: Vec<_> = prices.iter().map(vector).collect();
    let fits = |(prices, gram): (&Vec<f64>, &Arc<Gram>)| {
        prices.len() == gram.features && !prices.iter().any(|price| price.is_nan())
    };
    if !prices.iter().zip(&grams).all(fits) {
        return Err(misuse(
            "search_subsets: expected a price for each feature, infinite if it may not be used".into(),
        ));
    }
    let annealing = Annealing { moves, largest, coldest }.validated()?;
    let unit = unit.unit()?;
    let walks = py.detach(|| {
        let choices = workers.map(grams.len(), |i| Choices::new(&grams[i], &prices[i]));
        workers.map(grams.len() * starts, |walk| {
            let problem = walk / starts;
            let mut stream = unit.stream(walk as u64);
            search(&choices[problem], &annealing, &mut stream, workers.width())
        })
    });
    let merged = walks.chunks(starts).map(|walks| {
        let mut all: Vec<_> = walks.concat();
        all.sort_by(|a, b| a.energy.total_cmp(&b.energy).then_with(|| a.subset.cmp(&b.subset)));
        all.dedup_by(|a, b| a.subset == b.subset);
        all.into_iter().map(|found| (found.subset, found.energy)).collect()
    });
    Ok(merged.collect())
}
