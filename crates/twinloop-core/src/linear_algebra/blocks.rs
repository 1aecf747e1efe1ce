//! A small square matrix, laid out for sums over its rows.

use std::marker::PhantomData;
use std::ops::Range;
use std::slice::ChunksExact;

use crate::lanes::Vector;

/// Columns side by side, as many as a vector has lanes, row after row.
pub(super) struct Blocks<V> {
    numbers: Vec<f64>,
    rows: usize,
    lanes: PhantomData<V>,
}

impl<V: Vector> Blocks<V> {
    /// So many rows and columns.
    pub fn new(rows: usize) -> Self {
        let numbers = vec![0.0; rows.div_ceil(V::LANES) * rows * V::LANES];
        Self { numbers, rows, lanes: PhantomData }
    }

    #[inline(always)]
    fn place(&self, row: usize, column: usize) -> usize {
        (column / V::LANES * self.rows + row) * V::LANES + column % V::LANES
    }

    /// An entry.
    #[inline(always)]
    pub fn get(&self, row: usize, column: usize) -> f64 {
        self.numbers[self.place(row, column)]
    }

    /// Sets an entry.
    #[inline(always)]
    pub fn set(&mut self, row: usize, column: usize, value: f64) {
        let place = self.place(row, column);
        self.numbers[place] = value;
    }

    /// Sets a row's entries from the first column of a block on.
    #[inline(always)]
    pub fn set_vector(&mut self, row: usize, column: usize, value: V) {
        let place = self.place(row, column);
        value.store(&mut self.numbers[place..]);
    }

    /// A vector less the sum over some rows of theirs from the first column of a block on, times another matrix's
    /// entries of one column.
    #[inline(always)]
    pub fn less(&self, start: V, column: usize, factors: &Self, factor: usize, rows: Range<usize>) -> V {
        let lane = factor % V::LANES;
        let mut left = start;
        for (row, factors) in self.block(column, rows.clone()).zip(factors.block(factor, rows)) {
            left = left - V::load(row) * factors[lane];
        }
        left
    }

    /// Some rows of the block that holds a column.
    #[inline(always)]
    fn block(&self, column: usize, rows: Range<usize>) -> ChunksExact<'_, f64> {
        let first = column / V::LANES * self.rows;
        self.numbers[(first + rows.start) * V::LANES..(first + rows.end) * V::LANES].chunks_exact(V::LANES)
    }
}
