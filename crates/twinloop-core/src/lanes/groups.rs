//! Groups: how tests and rows are shared out over lanes.

use std::ops::Range;

use super::piece::Apart;
use super::vector::{Scalar, Vector};

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

/// Calls a method with the vector of a width that has the fewest lanes for a group of rows: [`lanes_for`] in types.
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

/// The same for a group of tests, which are 32 at most: each copy of a roll-out takes its time to compile.
macro_rules! with_test_lanes {
    ($width:ident, $count:expr, $this:ident.$method:ident($($argument:expr),*)) => {
        match $count {
            0..=1 => $this.$method::<$width::Of1>($($argument),*),
            2..=4 => $this.$method::<$width::Of4>($($argument),*),
            5..=8 => $this.$method::<$width::Of8>($($argument),*),
            count => {
                assert!(count <= 32, "a group has 32 tests at most, found {count}");
                $this.$method::<$width::Of32>($($argument),*)
            }
        }
    };
}
pub(crate) use with_test_lanes;

/// Lanes of the vector that [`with_flight_lanes!`] takes for a group.
pub(crate) fn flight_lanes(count: usize) -> usize {
    match count {
        0..=1 => 1,
        2..=8 => 8,
        _ => 32,
    }
}

/// The same for flights and variants, of which there are seldom from 2 to 4: a copy less of long code.
macro_rules! with_flight_lanes {
    ($width:ident, $count:expr, $this:ident.$method:ident($($argument:expr),*)) => {
        match $count {
            0..=1 => $this.$method::<$width::Of1>($($argument),*),
            2..=8 => $this.$method::<$width::Of8>($($argument),*),
            count => {
                assert!(count <= 32, "a group has 32 flights at most, found {count}");
                $this.$method::<$width::Of32>($($argument),*)
            }
        }
    };
}
pub(crate) use with_flight_lanes;

/// Rows of equal length side by side: number j of row l goes to place `j * lanes + l`. The last row fills what is left.
pub(crate) fn interleave<R: AsRef<[f64]>>(rows: &[R], lanes: usize) -> Vec<f64> {
    let Some(last) = rows.last() else { return vec![] };
    let row = |l: usize| rows.get(l).unwrap_or(last).as_ref();
    (0..last.as_ref().len()).flat_map(|j| (0..lanes).map(move |l| row(l)[j])).collect()
}

/// Interleaved numbers as vectors. By a call, as what follows: a copy for each vector, and not for each place.
#[inline(never)]
pub(crate) fn vectors<V: Vector>(interleaved: &[f64]) -> Vec<V> {
    let mut vectors = vec![];
    if !interleaved.is_empty() {
        V::apart(Loads { interleaved, vectors: &mut vectors });
    }
    vectors
}

struct Loads<'a, V> {
    interleaved: &'a [f64],
    vectors: &'a mut Vec<V>,
}

impl<V: Vector> Apart for Loads<'_, V> {
    #[inline(always)]
    fn run(self) {
        self.vectors.reserve_exact(self.interleaved.len() / V::LANES);
        for values in self.interleaved.chunks_exact(V::LANES) {
            self.vectors.push(V::load(values));
        }
    }
}

/// So many zeros, and behind them numbers, each the same in all lanes.
#[inline(never)]
pub(crate) fn filled<V: Vector>(zeros: usize, values: &[f64]) -> Vec<V> {
    let mut vectors = vec![];
    if zeros + values.len() > 0 {
        V::apart(Fill { zeros, values, vectors: &mut vectors });
    }
    vectors
}

struct Fill<'a, V> {
    zeros: usize,
    values: &'a [f64],
    vectors: &'a mut Vec<V>,
}

impl<V: Vector> Apart for Fill<'_, V> {
    #[inline(always)]
    fn run(self) {
        self.vectors.reserve_exact(self.zeros + self.values.len());
        self.vectors.resize(self.zeros, V::splat(0.0));
        for &value in self.values {
            self.vectors.push(V::splat(value));
        }
    }
}

/// Numbers, each the same in all lanes.
#[inline(never)]
pub(crate) fn splats<V: Vector>(values: &[f64]) -> Vec<V> {
    filled(0, values)
}

/// So many zeros.
#[inline(never)]
pub(crate) fn zeros<V: Vector>(count: usize) -> Vec<V> {
    filled(count, &[])
}

/// Vectors as interleaved numbers.
#[inline(never)]
pub(crate) fn numbers<V: Vector>(vectors: &[V]) -> Vec<f64> {
    let mut numbers = vec![0.0; vectors.len() * V::LANES];
    for (vector, values) in vectors.iter().zip(numbers.chunks_exact_mut(V::LANES)) {
        vector.store(values);
    }
    numbers
}

/// Numbers, each in a vector of one lane.
pub(crate) fn scalars(values: &[f64]) -> Vec<Scalar> {
    splats(values)
}

/// Rows of equal length, one a lane.
#[inline(never)]
pub(crate) fn pack<V: Vector>(rows: &[&[f64]]) -> Vec<V> {
    vectors(&interleave(rows, V::LANES))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::{Isa, Kernel, Width, dispatch};
    use proptest::prelude::*;

    /// The lanes that [`with_lanes!`], [`with_test_lanes!`] and [`with_flight_lanes!`] take for a group.
    struct Lanes(usize);

    impl Kernel for Lanes {
        type Output = [usize; 3];
        #[inline(always)]
        fn run<W: Isa>(self) -> [usize; 3] {
            let tests = self.0.min(32);
            [
                with_lanes!(W, self.0, self.of()),
                with_test_lanes!(W, tests, self.of()),
                with_flight_lanes!(W, tests, self.of()),
            ]
        }
    }

    impl Lanes {
        #[inline(always)]
        fn of<V: Vector>(&self) -> usize {
            V::LANES
        }
    }

    #[test]
    fn every_group_gets_a_vector_with_a_lane_for_each_of_its_rows() {
        for size in 1..=64 {
            let tests = size.min(32);
            let expected = [lanes_for(size), lanes_for(tests), flight_lanes(tests)];
            assert!(expected[0] >= size && expected[2] >= tests);
            for width in Width::available() {
                assert_eq!(dispatch(width, Lanes(size)), expected, "{size} rows, {width:?}");
            }
        }
    }

    #[test]
    fn a_vector_is_as_wide_as_its_name_says() {
        struct Sizes;
        impl Kernel for Sizes {
            type Output = [usize; 5];
            #[inline(always)]
            fn run<W: Isa>(self) -> [usize; 5] {
                [W::Of1::LANES, W::Of4::LANES, W::Of8::LANES, W::Of32::LANES, W::Of64::LANES]
            }
        }
        for width in Width::available() {
            assert_eq!(dispatch(width, Sizes), [1, 4, 8, 32, 64]);
        }
    }

    proptest! {
        #[test]
        fn groups_are_all_tests_in_their_order(count in 0..300_usize) {
            let groups = groups(count);
            prop_assert_eq!(groups.iter().cloned().flatten().collect::<Vec<_>>(), (0..count).collect::<Vec<_>>());
            prop_assert!(groups.iter().all(|group| !group.is_empty() && group.len() <= 32));
            // Lanes are wasted in the last group only.
            for group in groups.iter().rev().skip(1) {
                prop_assert_eq!(lanes_for(group.len()), group.len());
            }
        }

        #[test]
        fn interleaved_rows_stand_side_by_side_and_the_last_fills_up(
            rows in prop::collection::vec(prop::array::uniform3(any::<f64>()), 1..9),
            spare in 0..4_usize,
        ) {
            let lanes = rows.len() + spare;
            let interleaved = interleave(&rows, lanes);
            prop_assert_eq!(interleaved.len(), 3 * lanes);
            for l in 0..lanes {
                for j in 0..3 {
                    let expected = rows[l.min(rows.len() - 1)][j];
                    prop_assert_eq!(interleaved[j * lanes + l].to_bits(), expected.to_bits());
                }
            }
        }
    }

    #[test]
    fn no_rows_are_no_numbers() {
        assert!(interleave::<&[f64]>(&[], 8).is_empty());
    }
}
