//! The matrix of objectives: the one door where numbers that cannot be ordered are refused.

use crate::error::{Result, invalid};

/// Objectives of a population, (rows, columns): a row for each individual, a column for each objective, all finite
/// and all minimised.
#[derive(Clone, Debug, PartialEq)]
pub struct Objectives {
    rows: usize,
    columns: usize,
    values: Vec<f64>,
}

impl Objectives {
    /// A matrix from its `values`, (rows × columns), row after row. There may be no rows.
    ///
    /// # Errors
    /// When there is no column, when the last row is not full, or when a value is NaN or infinite.
    pub fn new(columns: usize, values: Vec<f64>) -> Result<Self> {
        if columns == 0 {
            return invalid("objectives: expected at least one column, found none; name an objective");
        }
        if !values.len().is_multiple_of(columns) {
            return invalid(format!(
                "objectives: expected rows of {columns} values, found {} values in all; give every row a value \
                 for every objective",
                values.len()
            ));
        }
        if let Some(place) = values.iter().position(|value| !value.is_finite()) {
            return invalid(format!(
                "objectives: expected finite numbers, found {} at (row {}, column {}); give a failed evaluation a \
                 large finite value",
                values[place],
                place / columns,
                place % columns
            ));
        }
        Ok(Self { rows: values.len() / columns, columns, values })
    }

    /// A matrix from `values` that came out of another one.
    pub(super) fn from_checked(columns: usize, values: Vec<f64>) -> Self {
        debug_assert!(values.iter().all(|value| value.is_finite()));
        Self { rows: values.len().checked_div(columns).unwrap_or(0), columns, values }
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.rows
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.rows == 0
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Row `i`, (columns).
    ///
    /// # Panics
    /// When `i` is not below [`len`](Self::len), as indexing does.
    #[inline]
    pub fn row(&self, i: usize) -> &[f64] {
        &self.values[i * self.columns..][..self.columns]
    }

    /// The rows in order, each (columns).
    pub fn rows(&self) -> impl ExactSizeIterator<Item = &[f64]> + Clone {
        // An archive without columns has no rows either; `chunks_exact` wants a width all the same.
        self.values.chunks_exact(self.columns.max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(columns: usize, values: &[f64]) -> String {
        Objectives::new(columns, values.to_vec()).unwrap_err().to_string()
    }

    #[test]
    fn rows_come_back_as_they_were_given() {
        let objectives = Objectives::new(2, vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]).unwrap();
        assert_eq!((objectives.len(), objectives.columns(), objectives.is_empty()), (3, 2, false));
        assert_eq!(objectives.row(1), [3.0, 4.0]);
        assert_eq!(objectives.rows().last(), Some([5.0, 6.0].as_slice()));
    }

    #[test]
    fn no_rows_are_fine_and_no_columns_are_not() {
        assert!(Objectives::new(3, vec![]).unwrap().is_empty());
        assert!(refusal(0, &[]).contains("at least one column"));
    }

    #[test]
    fn a_number_that_cannot_be_ordered_is_refused_with_its_place() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let sentence = refusal(2, &[0.0, 1.0, 2.0, bad, 4.0, 5.0]);
            assert!(sentence.contains(&format!("found {bad} at (row 1, column 1)")), "{sentence}");
        }
    }

    #[test]
    fn a_row_that_is_not_full_is_refused() {
        assert!(refusal(2, &[0.0, 1.0, 2.0]).contains("found 3 values"));
    }
}
