//! Non-dominated sorting with prefix bitsets.
//!
//! The points that are no worse than a point in one objective are a prefix of that objective's order, so the points
//! that are no worse in all of them are an intersection of prefixes: one `and` for each objective.

use super::objectives::Objectives;
use super::sorted::SortedColumns;
use crate::lanes::{Isa, Kernel, Width, dispatch};

/// Front of each row, (rows): 0 for those that nothing dominates, 1 for those that only front 0 dominates, and so on.
///
/// Equal rows share a front. Takes rows² / 8 bytes while it runs, and no less than 64 for each row.
///
/// Fast non-dominated sorting as defined by Deb et al., A fast and elitist multiobjective genetic algorithm: NSGA-II,
/// IEEE Transactions on Evolutionary Computation 6(2), 2002, section III-A.
pub fn ranks(objectives: &Objectives) -> Vec<u32> {
    ranks_of_sorted(objectives, &SortedColumns::new(objectives))
}

/// [`ranks`] of a matrix whose columns are sorted already.
pub(super) fn ranks_of_sorted(objectives: &Objectives, sorted: &SortedColumns) -> Vec<u32> {
    if objectives.is_empty() {
        return Vec::new();
    }
    let points = DistinctPoints::new(objectives, sorted);
    let fronts = peel(&Dominators::new(objectives.columns(), sorted, &points));
    points.places.iter().map(|&place| fronts[place]).collect()
}

/// The distinct rows in lexicographic order: what dominates a point has a place before it.
struct DistinctPoints {
    count: usize,
    /// Place of each row among the distinct ones; equal rows have the same. (rows)
    places: Vec<usize>,
}

impl DistinctPoints {
    fn new(objectives: &Objectives, sorted: &SortedColumns) -> Self {
        let mut places = vec![0; objectives.len()];
        let mut count = 0;
        let mut rows = Vec::new();
        // The order of the first objective is lexicographic already, but for its ties.
        for ties in sorted.ties(0) {
            rows.clear();
            rows.extend(ties);
            let values = |row: usize| objectives.row(row);
            rows.sort_unstable_by(|&a, &b| values(a).partial_cmp(values(b)).expect("objectives are finite"));
            for equal in rows.chunk_by(|&a, &b| values(a) == values(b)) {
                for &row in equal {
                    places[row] = count;
                }
                count += 1;
            }
        }
        Self { count, places }
    }
}

/// Membership of 512 places: as many words as the widest vector holds.
type Block = [u64; 8];
const PLACES: usize = 512;

/// For each distinct point, by its place, the set of the places that dominate it.
struct Dominators {
    /// Blocks to a set.
    blocks: usize,
    /// (points, blocks)
    sets: Vec<Block>,
}

impl Dominators {
    fn new(columns: usize, sorted: &SortedColumns, points: &DistinctPoints) -> Self {
        let blocks = points.count.div_ceil(PLACES);
        let mut sets = vec![[0; 8]; points.count * blocks];
        // In the first objective, exactly those with a place before it can dominate a point; and as it is not among
        // them itself, nor is any equal to it, what is no worse than the point in the other objectives dominates it.
        let mut before = vec![[0; 8]; blocks];
        for (place, set) in sets.chunks_exact_mut(blocks).enumerate() {
            set.copy_from_slice(&before);
            insert(&mut before, place);
        }
        let prefix = before;
        dispatch(Width::widest(), Narrow { columns, sorted, points, prefix, sets: &mut sets });
        Self { blocks, sets }
    }
}

/// Takes out of each set what is worse than its point in an objective other than the first.
struct Narrow<'a> {
    columns: usize,
    sorted: &'a SortedColumns,
    points: &'a DistinctPoints,
    /// Room for one set.
    prefix: Vec<Block>,
    sets: &'a mut [Block],
}

impl Kernel for Narrow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<W: Isa>(mut self) {
        let blocks = self.prefix.len();
        for column in 1..self.columns {
            self.prefix.fill([0; 8]);
            for ties in self.sorted.ties(column) {
                for &row in ties {
                    insert(&mut self.prefix, self.points.places[row]);
                }
                for &row in ties {
                    let place = self.points.places[row];
                    intersect(&mut self.sets[place * blocks..][..=place / PLACES], &self.prefix);
                }
            }
        }
    }
}

/// Front of each distinct point, by its place.
fn peel(dominators: &Dominators) -> Vec<u32> {
    let mut fronts: Vec<Vec<Block>> = Vec::new();
    let mut front_of = Vec::with_capacity(dominators.sets.len() / dominators.blocks);
    for (place, set) in dominators.sets.chunks_exact(dominators.blocks).enumerate() {
        let set = &set[..=place / PLACES];
        // A point dominated by a member of a front is dominated by members of all the fronts before it too, so the
        // first front without such a member is found by bisection.
        let front = fronts.partition_point(|members| meet(members, set));
        if front == fronts.len() {
            fronts.push(vec![[0; 8]; dominators.blocks]);
        }
        insert(&mut fronts[front], place);
        front_of.push(front as u32);
    }
    front_of
}

#[inline(always)]
fn insert(set: &mut [Block], place: usize) {
    let (at, bit) = (place % PLACES / 64, 1 << (place % 64));
    // All the words of the block are written, as they are soon read as whole vectors: a vector of which a part was
    // written last is slow to read back.
    for (i, word) in set[place / PLACES].iter_mut().enumerate() {
        *word |= if i == at { bit } else { 0 };
    }
}

#[inline(always)]
fn intersect(set: &mut [Block], other: &[Block]) {
    for (set, other) in set.iter_mut().zip(other) {
        // A copy cannot overlap with the other, so that its words are taken all at once.
        let mut block = *set;
        for (word, other) in block.iter_mut().zip(other) {
            *word &= other;
        }
        *set = block;
    }
}

fn meet(a: &[Block], b: &[Block]) -> bool {
    let meets = |(a, b): (&Block, &Block)| a.iter().zip(b).fold(0, |met, (a, b)| met | a & b) != 0;
    a.iter().zip(b).any(meets)
}

#[cfg(test)]
mod tests {
    use super::super::dominance::dominates;
    use super::super::examples::{any_objectives, objectives};
    use super::*;
    use proptest::prelude::*;

    /// The definition: take away what nothing that is left dominates, again and again.
    fn ranks_by_the_definition(objectives: &Objectives) -> Vec<u32> {
        let rows: Vec<&[f64]> = objectives.rows().collect();
        let mut ranks = vec![0; rows.len()];
        let mut left: Vec<usize> = (0..rows.len()).collect();
        let mut rank = 0;
        while !left.is_empty() {
            let beaten = |&a: &usize| left.iter().any(|&b| dominates(rows[b], rows[a]));
            let (behind, front): (Vec<usize>, Vec<usize>) = left.iter().copied().partition(beaten);
            assert!(!front.is_empty(), "dominance has a cycle");
            for row in front {
                ranks[row] = rank;
            }
            left = behind;
            rank += 1;
        }
        ranks
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(512))]

        #[test]
        fn ranks_are_those_of_the_definition(objectives in any_objectives(0..200)) {
            prop_assert_eq!(ranks(&objectives), ranks_by_the_definition(&objectives));
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn ranks_are_those_of_the_definition_in_large_populations(objectives in any_objectives(200..1301)) {
            prop_assert_eq!(ranks(&objectives), ranks_by_the_definition(&objectives));
        }
    }

    #[test]
    fn ranks_are_right_where_the_words_of_a_set_end() {
        for rows in [1, 2, 63, 64, 65, 127, 128, 129, 511, 512, 513, 1024, 1025] {
            let objectives = objectives(rows, 3, 40, 7);
            assert_eq!(ranks(&objectives), ranks_by_the_definition(&objectives), "{rows} rows");
        }
    }

    #[test]
    fn a_single_objective_ranks_by_its_distinct_values() {
        let objectives = Objectives::new(1, vec![3.0, -0.0, 5.0, 0.0, 3.0]).unwrap();
        assert_eq!(ranks(&objectives), [1, 0, 2, 0, 1]);
    }

    #[test]
    fn a_chain_has_a_front_for_each_point() {
        let values = (0..700).rev().flat_map(|i| [f64::from(i), f64::from(i)]).collect();
        let expected: Vec<u32> = (0..700).rev().collect();
        assert_eq!(ranks(&Objectives::new(2, values).unwrap()), expected);
    }
}
