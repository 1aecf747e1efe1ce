//! What chains and their filters are linear in: a number, or one in each of several lanes.

use std::ops::{Add, Mul};

/// Numbers that are added, and multiplied by factors.
pub(crate) trait Linear: Copy + Add<Output = Self> + Mul<f64, Output = Self> {}
impl<T: Copy + Add<Output = T> + Mul<f64, Output = T>> Linear for T {}

/// Sum of a row times a column, first entry first.
#[inline(always)]
pub(crate) fn product<T: Linear>(row: &[f64], column: &[T]) -> T {
    let row = &row[..column.len()];
    let mut sum = column[0] * row[0];
    for l in 1..column.len() {
        sum = sum + column[l] * row[l];
    }
    sum
}
