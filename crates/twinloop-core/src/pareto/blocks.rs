//! Points in blocks of eight, so that a candidate meets eight of them at once.

use crate::lanes::{Isa, Kernel, Vector, Width, dispatch};

/// Points to a block.
pub(super) const BLOCK: usize = 8;

/// One objective of a block. Aligned, so that no vector crosses the border of a cache line.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
struct Lanes([f64; BLOCK]);

/// Points of `columns` objectives: in each block of eight points, one lane group for each objective. Lanes without a
/// point are infinite, so they dominate nothing.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Blocks {
    columns: usize,
    len: usize,
    /// (blocks, columns)
    lanes: Vec<Lanes>,
}

/// What the points say to a candidate.
#[derive(Debug, PartialEq)]
pub(super) enum Verdict {
    /// A point of this block is no worse in any objective.
    Dominated { block: usize },
    /// The candidate dominates these points, in ascending order, and none is as good as it.
    Free { beaten: Vec<usize> },
}

impl Blocks {
    pub(super) fn new(columns: usize) -> Self {
        Self { columns, len: 0, lanes: Vec::new() }
    }

    pub(super) fn columns(&self) -> usize {
        self.columns
    }

    /// Objective `column` of point `i`.
    pub(super) fn value(&self, i: usize, column: usize) -> f64 {
        self.lanes[i / BLOCK * self.columns + column].0[i % BLOCK]
    }

    pub(super) fn push(&mut self, point: &[f64]) {
        if self.len.is_multiple_of(BLOCK) {
            let blocks = self.len / BLOCK + 1;
            self.lanes.resize(blocks * self.columns, Lanes([f64::INFINITY; BLOCK]));
        }
        self.len += 1;
        self.set(self.len - 1, |_, column| point[column]);
    }

    /// Leaves the place of a point vacant: it dominates nothing any more, and nothing moves yet.
    pub(super) fn vacate(&mut self, i: usize) {
        self.set(i, |_, _| f64::INFINITY);
    }

    /// Whether a place was left vacant. Points are finite, so their first objective tells.
    pub(super) fn is_vacant(&self, i: usize) -> bool {
        self.value(i, 0) == f64::INFINITY
    }

    /// Removes the points at these places, given in ascending order; the others stay in theirs.
    pub(super) fn remove(&mut self, places: &[usize]) {
        let Some(&first) = places.first() else { return };
        let mut removed = places.iter().peekable();
        let mut kept = first;
        for i in first..self.len {
            if removed.next_if_eq(&&i).is_none() {
                self.copy(i, kept);
                kept += 1;
            }
        }
        for i in kept..self.len {
            self.set(i, |_, _| f64::INFINITY);
        }
        self.len = kept;
        self.lanes.truncate(kept.div_ceil(BLOCK) * self.columns);
    }

    fn copy(&mut self, from: usize, to: usize) {
        self.set(to, |points, column| points.value(from, column));
    }

    fn set(&mut self, i: usize, value: impl Fn(&Self, usize) -> f64) {
        for column in 0..self.columns {
            let value = value(self, column);
            self.lanes[i / BLOCK * self.columns + column].0[i % BLOCK] = value;
        }
    }

    /// What the points say to `candidate`, (columns). Asks the block `first` before the others: the verdict is the
    /// same, but sooner when a point of that block dominates the candidate.
    pub(super) fn confront(&self, candidate: &[f64], first: usize, width: Width) -> Verdict {
        dispatch(width, Confront { blocks: self, candidate, first })
    }
}

struct Confront<'a> {
    blocks: &'a Blocks,
    candidate: &'a [f64],
    first: usize,
}

impl Kernel for Confront<'_> {
    type Output = Verdict;

    #[inline(always)]
    fn run<W: Isa>(self) -> Verdict {
        let Self { blocks, candidate, first } = self;
        let columns = blocks.columns;
        if let Some(lanes) = blocks.lanes.get(first * columns..(first + 1) * columns)
            && Excess::<W::Compared8>::of(lanes, candidate).is_some_and(|excess| excess.dominates())
        {
            return Verdict::Dominated { block: first };
        }
        let mut beaten = Vec::new();
        for (block, lanes) in blocks.lanes.chunks_exact(columns).enumerate() {
            let Some(excess) = Excess::<W::Compared8>::of(lanes, candidate) else {
                continue;
            };
            if excess.dominates() {
                return Verdict::Dominated { block };
            }
            let places = (0..BLOCK).filter(|&lane| excess.least.lane(lane) >= 0.0);
            beaten.extend(
                places.map(|lane| block * BLOCK + lane).filter(|&i| i < blocks.len && !blocks.is_vacant(i)),
            );
        }
        Verdict::Free { beaten }
    }
}

/// How far each point of a block is above a candidate, in the objective where that is least and where it is most.
///
/// The sign of a difference is exact, even where its value is rounded or overflows, so this decides as comparisons do.
struct Excess<V> {
    least: V,
    most: V,
}

impl<V: Vector> Excess<V> {
    /// Of a block, (columns), above a candidate, (columns). None when it is settled that neither dominates the
    /// other, whatever the objectives not yet looked at.
    #[inline(always)]
    fn of(lanes: &[Lanes], candidate: &[f64]) -> Option<Self> {
        // To ask after each objective costs more, in branches foretold wrong, than to look at a few in vain.
        const AT_ONCE: usize = 6;
        let mut excess = Self { least: V::splat(f64::INFINITY), most: V::splat(f64::NEG_INFINITY) };
        let (lanes, last_lanes) = lanes.as_chunks::<AT_ONCE>();
        let (candidate, last_values) = candidate.as_chunks::<AT_ONCE>();
        for (lanes, values) in lanes.iter().zip(candidate) {
            for (lane, &value) in lanes.iter().zip(values) {
                excess.include(lane, value);
            }
            if excess.is_settled() {
                return None;
            }
        }
        for (lane, &value) in last_lanes.iter().zip(last_values) {
            excess.include(lane, value);
        }
        if excess.is_settled() { None } else { Some(excess) }
    }

    #[inline(always)]
    fn include(&mut self, lanes: &Lanes, value: f64) {
        let difference = V::load(&lanes.0) - V::splat(value);
        self.least = self.least.select_less(difference, self.least, difference);
        self.most = difference.select_less(self.most, self.most, difference);
    }

    /// Whether each point is below the candidate somewhere and above it somewhere else.
    #[inline(always)]
    fn is_settled(&self) -> bool {
        let zero = V::splat(0.0);
        !any_not_positive(self.least.select_less(zero, self.most, zero))
    }

    /// Whether a point is nowhere above the candidate.
    #[inline(always)]
    fn dominates(&self) -> bool {
        any_not_positive(self.most)
    }
}

#[inline(always)]
fn any_not_positive<V: Vector>(numbers: V) -> bool {
    // No number lies between zero and the smallest positive one.
    const SMALLEST: f64 = f64::from_bits(1);
    numbers.any_less(V::splat(SMALLEST))
}

#[cfg(test)]
mod tests {
    use super::super::examples::any_objectives;
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_verdict_is_that_of_one_comparison_after_another(
            points in any_objectives(1..60),
            candidate in 0..60_usize,
            nudge in -1..2_i32,
            first in 0..9_usize,
        ) {
            let mut blocks = Blocks::new(points.columns());
            points.rows().for_each(|row| blocks.push(row));
            let mut candidate = points.row(candidate % points.len()).to_vec();
            candidate[0] += f64::from(nudge);
            let no_worse = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| a <= b);
            let rejecting: Vec<usize> =
                (0..points.len()).filter(|&i| no_worse(points.row(i), &candidate)).collect();
            let beaten: Vec<usize> =
                (0..points.len()).filter(|&i| no_worse(&candidate, points.row(i))).collect();
            for width in Width::available() {
                match blocks.confront(&candidate, first, width) {
                    Verdict::Free { beaten: found } => {
                        prop_assert_eq!(&rejecting, &[]);
                        prop_assert_eq!(&found, &beaten);
                    }
                    Verdict::Dominated { block } => {
                        prop_assert!(rejecting.iter().any(|i| i / BLOCK == block));
                    }
                }
            }
        }

        #[test]
        fn removal_leaves_the_others_in_their_order(
            points in any_objectives(0..60),
            removed in prop::collection::btree_set(0..60_usize, 0..60),
        ) {
            let removed: Vec<usize> = removed.into_iter().filter(|&i| i < points.len()).collect();
            let mut blocks = Blocks::new(points.columns());
            points.rows().for_each(|row| blocks.push(row));
            blocks.remove(&removed);
            let mut expected = Blocks::new(points.columns());
            let kept = (0..points.len()).filter(|i| !removed.contains(i));
            kept.for_each(|i| expected.push(points.row(i)));
            prop_assert_eq!(blocks, expected);
        }
    }

    #[test]
    fn the_smallest_and_the_largest_differences_count() {
        let tiny = f64::from_bits(1);
        let mut blocks = Blocks::new(1);
        blocks.push(&[f64::MAX]);
        for width in Width::available() {
            let verdict = blocks.confront(&[-f64::MAX], 0, width);
            assert_eq!(verdict, Verdict::Free { beaten: vec![0] });
        }
        let mut blocks = Blocks::new(2);
        blocks.push(&[f64::MIN_POSITIVE, -tiny]);
        for width in Width::available() {
            let verdict = blocks.confront(&[f64::MIN_POSITIVE - tiny, 0.0], 0, width);
            assert_eq!(verdict, Verdict::Free { beaten: vec![] });
        }
    }
}
