//! Groups: how tests and rows are shared out over lanes.

use std::ops::Range;

use super::vector::Vector;

/// Splits `count` tests into groups that fill lanes well: 32 as long as there are as many, then 8, then what is left.
pub(crate) fn groups(count: usize) -> Vec<Range<usize>> {
    let mut groups = Vec::new();
    let mut start = 0;
    while start < count {
        let left = count - start;
        let size = if left >= 32 { 32 } else { left.min(8) };
        groups.push(start..start + size);
        start += size;
    }
    groups
}

/// Lanes of the vector that [`with_lanes!`] takes for a group.
pub(crate) fn lanes_for(count: usize) -> usize {
    match count {
        0..=1 => 1,
        2..=4 => 4,
        5..=8 => 8,
        9..=32 => 32,
        _ => 64,
    }
}

/// Calls a method with the vector of a width that has the fewest lanes for a group: [`lanes_for`] in types.
macro_rules! with_lanes {
    ($width:ident, $count:expr, $this:ident.$method:ident($($argument:expr),*)) => {
        match $count {
            0..=1 => $this.$method::<$width::Of1>($($argument),*),
            2..=4 => $this.$method::<$width::Of4>($($argument),*),
            5..=8 => $this.$method::<$width::Of8>($($argument),*),
            9..=32 => $this.$method::<$width::Of32>($($argument),*),
            _ => $this.$method::<$width::Of64>($($argument),*),
        }
    };
}
pub(crate) use with_lanes;

/// Rows of equal length side by side: number j of row l goes to place `j * lanes + l`. The last row fills what is left.
pub(crate) fn interleave<R: AsRef<[f64]>>(rows: &[R], lanes: usize) -> Vec<f64> {
    let Some(last) = rows.last() else { return vec![] };
    let row = |l: usize| rows.get(l).unwrap_or(last).as_ref();
    (0..last.as_ref().len()).flat_map(|j| (0..lanes).map(move |l| row(l)[j])).collect()
}

/// Interleaved numbers as vectors.
#[inline(always)]
pub(crate) fn vectors<V: Vector>(interleaved: &[f64]) -> Vec<V> {
    let mut vectors = vec![V::splat(0.0); interleaved.len() / V::LANES];
    fill(&mut vectors, interleaved);
    vectors
}

/// Overwrites vectors by interleaved numbers.
#[inline(always)]
pub(crate) fn fill<V: Vector>(vectors: &mut [V], interleaved: &[f64]) {
    for (vector, values) in vectors.iter_mut().zip(interleaved.chunks_exact(V::LANES)) {
        *vector = V::load(values);
    }
}

/// Rows of equal length, one a lane.
#[inline(always)]
pub(crate) fn pack<V: Vector, R: AsRef<[f64]>>(rows: &[R]) -> Vec<V> {
    vectors(&interleave(rows, V::LANES))
}
