//! Regression on whitened features, and the search over their subsets.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use twinloop_core::{
    Annealing, Chain, Found, Gram, Leftover, Noise, Record, Regression, Solution, search_all,
};

use crate::arrays::{Matrix, Vector, finite, row_after_row, to_matrix, to_vector, vector};
use crate::error::{Result, given, misuse};
use crate::rng::Name;
use crate::workers::{PyWorkers, or_default};

/// Process variance, gust variance, correlation time in s.
type Motion = (f64, f64, f64);
/// Readings, weights, and the features at the start, the middle and the end of each period.
type RecordArrays<'py> = (Matrix<'py>, Matrix<'py>, Matrix<'py>, Matrix<'py>, Matrix<'py>);

/// Subsets with their energies, best first.
type Walked = Vec<(Vec<usize>, f64)>;

/// Records of one chain of states with the features that may drive it.
#[pyclass(frozen, name = "Regression", module = "twinloop._core")]
pub struct PyRegression(Regression);

#[pymethods]
impl PyRegression {
    #[new]
    fn new(
        py: Python<'_>,
        #[pyo3(from_py_with = given)] states: usize,
        #[pyo3(from_py_with = given)] dt: f64,
        form: &str,
        #[pyo3(from_py_with = given)] records: Vec<RecordArrays<'_>>,
    ) -> Result<Self> {
        let chain = Chain { states, dt, form: form.parse()? }.validated()?;
        let features = records.first().map_or(0, |(_, _, start, _, _)| start.as_array().ncols());
        let numbers = |(measured, weights, start, middle, end): &RecordArrays<'_>| {
            let flat = |matrix: &Matrix<'_>, columns| row_after_row("record", matrix, columns);
            let [start, middle, end] = [start, middle, end].map(|values| flat(values, features));
            Ok([flat(measured, states)?, flat(weights, states)?, start?, middle?, end?])
        };
        let records = records.iter().map(numbers).collect::<Result<Vec<_>>>()?;
        py.detach(|| {
            let record = |numbers: [Vec<f64>; 5]| {
                numbers.iter().try_for_each(|each| finite("record", each))?;
                let [measured, weights, start, middle, end] = numbers;
                Ok(Record::new(&chain, features, measured, weights, [&start, &middle, &end])?)
            };
            let records = records.into_iter().map(record).collect::<Result<_>>()?;
            Ok(Self(Regression::new(chain, features, records)?))
        })
    }

    /// Readings less what the coefficients explain, a matrix for each record.
    fn residuals<'py>(
        &self,
        py: Python<'py>,
        coefficients: Vector<'py>,
    ) -> Result<Vec<Bound<'py, PyArray2<f64>>>> {
        let residuals = self.0.residuals(&vector(&coefficients))?;
        Ok(residuals.into_iter().map(|residual| to_matrix(py, self.0.chain().states, residual)).collect())
    }

    fn likelihood(
        &self,
        coefficients: Vector<'_>,
        sensors: Vector<'_>,
        #[pyo3(from_py_with = given)] motion: Motion,
    ) -> Result<f64> {
        Ok(self.0.likelihood(&vector(&coefficients), &self.noise(&sensors, motion)?)?)
    }

    fn log_determinant(
        &self,
        sensors: Vector<'_>,
        #[pyo3(from_py_with = given)] motion: Motion,
    ) -> Result<f64> {
        Ok(self.0.log_determinant(&self.noise(&sensors, motion)?))
    }

    #[pyo3(signature = (sensors, motion, workers = None))]
    fn gram(
        &self,
        py: Python<'_>,
        sensors: Vector<'_>,
        #[pyo3(from_py_with = given)] motion: Motion,
        workers: Option<&PyWorkers>,
    ) -> Result<PyGram> {
        let workers = or_default(workers)?;
        let noise = self.noise(&sensors, motion)?;
        Ok(PyGram(Arc::new(py.detach(|| self.0.gram(&noise, &workers)))))
    }
}

impl PyRegression {
    fn noise(&self, sensors: &Vector<'_>, (process, gust, correlation_time): Motion) -> Result<Noise> {
        Ok(Noise { sensors: vector(sensors), process, gust, correlation_time }
            .validated(self.0.chain().states)?)
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
    #[pyo3(from_py_with = given)] problems: Vec<Left<'py>>,
    workers: Option<&PyWorkers>,
) -> Result<Vec<(Bound<'py, PyArray1<f64>>, Motion, f64)>> {
    let workers = or_default(workers)?;
    let mut leftovers = Vec::with_capacity(problems.len());
    for (regression, coefficients, sensors, motion, least_sensors, least_motion) in &problems {
        let own = regression.get();
        leftovers.push(Leftover {
            regression: &own.0,
            coefficients: vector(coefficients),
            start: own.noise(sensors, *motion)?,
            smallest: own.noise(least_sensors, *least_motion)?,
        });
    }
    let found = py.detach(|| twinloop_core::most_likely_noises(&leftovers, &workers))?;
    let converted = |(noise, score): (Noise, f64)| {
        (to_vector(py, noise.sensors), (noise.process, noise.gust, noise.correlation_time), score)
    };
    Ok(found.into_iter().map(converted).collect())
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

    /// Of some of the features.
    fn part(&self, #[pyo3(from_py_with = given)] features: Vec<usize>) -> Result<Self> {
        Ok(Self(Arc::new(self.0.part(&features)?)))
    }

    /// With more rows: features, and a reading at the end.
    fn with_rows(&self, rows: Matrix<'_>) -> Result<Self> {
        let flat = row_after_row("rows", &rows, self.0.features + 1)?;
        finite("rows", &flat)?;
        Ok(Self(Arc::new(Gram::clone(&self.0).with_rows(&flat))))
    }

    /// With a normal prior about 0 on every coefficient, of given precisions.
    fn with_prior(&self, precisions: Vector<'_>) -> Result<Self> {
        let given = vector(&precisions);
        finite("precisions", &given)?;
        if given.len() != self.0.features || given.iter().any(|&precision| precision < 0.0) {
            return Err(misuse(format!(
                "precisions: expected {} numbers of at least 0, one a feature, found {given:?}",
                self.0.features
            )));
        }
        Ok(Self(Arc::new(Gram::clone(&self.0).with_prior(&given))))
    }

    /// Coefficients, their covariance and χ²; none if the features are collinear.
    #[pyo3(signature = (subset, ridge = 0.0))]
    #[expect(clippy::type_complexity, reason = "coefficients, covariance, χ²")]
    fn solve<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = given)] subset: Vec<usize>,
        #[pyo3(from_py_with = given)] ridge: f64,
    ) -> Result<Option<(Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>, f64)>> {
        let solved = |found: Solution| {
            let covariance = to_matrix(py, subset.len(), found.covariance());
            (to_vector(py, found.coefficients), covariance, found.chi_squared)
        };
        Ok(self.0.checked_solve(&subset, ridge)?.map(solved))
    }

    /// Coefficients and χ², for which the covariance need not be computed; none if the features are collinear.
    #[pyo3(signature = (subset, ridge = 0.0))]
    fn least_squares<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = given)] subset: Vec<usize>,
        #[pyo3(from_py_with = given)] ridge: f64,
    ) -> Result<Option<(Bound<'py, PyArray1<f64>>, f64)>> {
        let solved = |found: Solution| (to_vector(py, found.coefficients), found.chi_squared);
        Ok(self.0.checked_solve(&subset, ridge)?.map(solved))
    }
}

/// For each of the problems, subsets with their energies, best first: annealed `starts` times from different streams.
#[pyfunction]
#[pyo3(signature = (grams, prices, *, moves, largest, starts, unit, coldest = 2.0, workers = None))]
#[expect(clippy::too_many_arguments, reason = "the settings of a search, named by keyword in Python")]
pub fn search_subsets(
    py: Python<'_>,
    grams: Vec<Bound<'_, PyGram>>,
    #[pyo3(from_py_with = given)] prices: Vec<Vector<'_>>,
    #[pyo3(from_py_with = given)] moves: usize,
    #[pyo3(from_py_with = given)] largest: usize,
    #[pyo3(from_py_with = given)] starts: usize,
    #[pyo3(from_py_with = given)] unit: Name,
    #[pyo3(from_py_with = given)] coldest: f64,
    workers: Option<&PyWorkers>,
) -> Result<Vec<Walked>> {
    let workers = or_default(workers)?;
    let grams: Vec<_> = grams.iter().map(|gram| gram.get().0.clone()).collect();
    if prices.len() != grams.len() {
        let (expected, found) = (grams.len(), prices.len());
        return Err(misuse(format!(
            "search_subsets: expected prices for {expected} problems, found {found}"
        )));
    }
    let problems: Vec<_> = grams.into_iter().zip(prices.iter().map(vector)).collect();
    let annealing = Annealing { moves, largest, coldest }.validated()?;
    let unit = unit.unit()?;
    let found = py.detach(|| search_all(&problems, &annealing, starts, &unit, &workers))?;
    let walked = |found: Vec<Found>| found.into_iter().map(|one| (one.subset, one.energy)).collect();
    Ok(found.into_iter().map(walked).collect())
}
