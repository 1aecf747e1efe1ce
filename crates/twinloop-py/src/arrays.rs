//! Arrays in both directions: whatever NumPy can read as float64 comes in, float64 in C order goes out.

use numpy::ndarray::{Array1, Array2, Array3, ArrayView, Dimension, Ix1, Ix2, Ix3};
use numpy::{AllowTypeChange, Element, IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayLike};
use pyo3::prelude::*;

use crate::error::{Result, misuse, refused};

/// An argument that NumPy can read as numbers, with so many axes; refused else.
pub struct Numbers<'py, D: Dimension, T: Element = f64>(PyArrayLike<'py, T, D, AllowTypeChange>);

/// A vector argument.
pub type Vector<'py> = Numbers<'py, Ix1>;
/// A matrix argument.
pub type Matrix<'py> = Numbers<'py, Ix2>;
/// An argument of three axes.
pub type Cube<'py> = Numbers<'py, Ix3>;

impl<'a, 'py, D, T> FromPyObject<'a, 'py> for Numbers<'py, D, T>
where
    D: Dimension + 'py,
    T: Element + 'py,
    Vec<T>: FromPyObject<'a, 'py>,
{
    type Error = PyErr;

    fn extract(argument: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        argument.extract().map(Self).map_err(|error| {
            let kind = D::NDIM.map_or("an".into(), |axes| format!("a {axes}-dimensional"));
            refused(argument.py(), &format!("expected {kind} array of numbers: "), error)
        })
    }
}

impl<D: Dimension, T: Element> Numbers<'_, D, T> {
    /// The numbers where they lie.
    pub fn as_array(&self) -> ArrayView<'_, T, D> {
        self.0.as_array()
    }
}

/// All numbers of an array, in C order: at once where they lie so.
pub fn numbers<D: Dimension>(array: ArrayView<'_, f64, D>) -> Vec<f64> {
    array.as_slice().map_or_else(|| array.iter().copied().collect(), <[f64]>::to_vec)
}

/// Refuses NaN and infinite numbers.
pub fn finite<'a>(name: &str, numbers: impl IntoIterator<Item = &'a f64>) -> Result<()> {
    if numbers.into_iter().all(|x| x.is_finite()) {
        return Ok(());
    }
    Err(misuse(format!("{name}: expected finite numbers, found NaN or an infinite one")))
}

/// The numbers of a vector.
pub fn vector(array: &Vector<'_>) -> Vec<f64> {
    numbers(array.as_array())
}

/// A matrix that must have `columns` columns.
fn of_width<'a>(name: &str, array: &'a Matrix<'_>, columns: usize) -> Result<ArrayView<'a, f64, Ix2>> {
    let array = array.as_array();
    if array.ncols() != columns {
        return Err(misuse(format!(
            "{name}: expected {columns} columns, found an array of shape ({}, {})",
            array.nrows(),
            array.ncols()
        )));
    }
    Ok(array)
}

/// The rows of a matrix that must have `columns` columns.
pub fn rows(name: &str, array: &Matrix<'_>, columns: usize) -> Result<Vec<Vec<f64>>> {
    Ok(of_width(name, array, columns)?.outer_iter().map(numbers).collect())
}

/// The same, row after row.
pub fn row_after_row(name: &str, array: &Matrix<'_>, columns: usize) -> Result<Vec<f64>> {
    Ok(numbers(of_width(name, array, columns)?))
}

/// The rows of a matrix that may be left out; none then.
pub fn optional_rows(name: &str, array: Option<Matrix<'_>>, columns: usize) -> Result<Vec<Vec<f64>>> {
    array.map_or_else(|| Ok(vec![]), |array| rows(name, &array, columns))
}

/// The blocks of an array that may be left out, each as one row; none then.
pub fn optional_blocks(name: &str, array: Option<Cube<'_>>, expected: [usize; 3]) -> Result<Vec<Vec<f64>>> {
    let Some(array) = array else { return Ok(vec![]) };
    let array = array.as_array();
    if array.shape() != expected {
        return Err(misuse(format!("{name}: expected shape {expected:?}, found {:?}", array.shape())));
    }
    Ok(array.outer_iter().map(numbers).collect())
}

/// A vector, or rows of vectors.
#[derive(FromPyObject)]
pub enum VectorOrRows<'py> {
    One(Vector<'py>),
    Rows(Matrix<'py>),
}

impl VectorOrRows<'_> {
    /// All numbers, row after row.
    pub fn numbers(&self) -> Vec<f64> {
        match self {
            Self::One(vector) => numbers(vector.as_array()),
            Self::Rows(rows) => numbers(rows.as_array()),
        }
    }
}

/// A row for each of several, or a matrix for each.
#[derive(FromPyObject)]
pub enum RowsOrBlocks<'py> {
    Rows(Matrix<'py>),
    Blocks(Cube<'py>),
}

impl RowsOrBlocks<'_> {
    /// The numbers of each, row after row.
    pub fn each(&self) -> Vec<Vec<f64>> {
        match self {
            Self::Rows(rows) => rows.as_array().outer_iter().map(numbers).collect(),
            Self::Blocks(blocks) => blocks.as_array().outer_iter().map(numbers).collect(),
        }
    }
}

/// Views of rows.
pub fn views(rows: &[Vec<f64>]) -> Vec<&[f64]> {
    rows.iter().map(Vec::as_slice).collect()
}

/// A vector for Python.
pub fn to_vector<T: Element>(py: Python<'_>, values: Vec<T>) -> Bound<'_, PyArray1<T>> {
    Array1::from_vec(values).into_pyarray(py)
}

/// A matrix for Python from values in C order.
pub fn to_matrix(py: Python<'_>, columns: usize, values: Vec<f64>) -> Bound<'_, PyArray2<f64>> {
    to_rows(py, [values.len() / columns.max(1), columns], values)
}

/// A matrix for Python from values in C order, of which there may be none.
pub fn to_rows<T: Element>(py: Python<'_>, shape: [usize; 2], values: Vec<T>) -> Bound<'_, PyArray2<T>> {
    Array2::from_shape_vec(shape, values).expect("whole rows").into_pyarray(py)
}

/// An array of three axes for Python from values in C order.
pub fn to_cube(py: Python<'_>, shape: [usize; 3], values: Vec<f64>) -> Bound<'_, PyArray3<f64>> {
    Array3::from_shape_vec(shape, values).expect("whole blocks").into_pyarray(py)
}

/// Indices for Python.
pub fn to_integers(py: Python<'_>, values: impl IntoIterator<Item = usize>) -> Bound<'_, PyArray1<i64>> {
    to_vector(py, values.into_iter().map(|value| value as i64).collect())
}

/// Rows of indices for Python.
pub fn to_integer_rows<const N: usize>(py: Python<'_>, rows: Vec<[usize; N]>) -> Bound<'_, PyArray2<i64>> {
    let shape = (rows.len(), N);
    let values = rows.into_iter().flatten().map(|value| value as i64).collect();
    Array2::from_shape_vec(shape, values).expect("whole rows").into_pyarray(py)
}
