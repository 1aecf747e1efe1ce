//! Crowding distance: how much room a row has within its front.

use super::fronts::Fronts;
use super::objectives::Objectives;
use super::sorted::SortedColumns;

/// Crowding distance of each row, (rows), given the front of each row, (rows).
///
/// In each objective, a row gets the gap between its two neighbours in its front, as a share of the range of that
/// front; the two edges of the front are infinitely far from the rest. Rows with the same value stand in the order of
/// their index, so the result is determined. An objective in which the whole front is equal says nothing of it: it
/// adds no distance and has no edges. In a front of one or two rows, all are infinitely far.
///
/// `ranks` only says which rows share a front, with any numbers; rows beyond its end share one more front.
///
/// Deb et al., NSGA-II, IEEE Transactions on Evolutionary Computation 6(2), 2002, section III-B.
pub fn crowding_distances(objectives: &Objectives, ranks: &[u32]) -> Vec<f64> {
    crowding_of_sorted(objectives, ranks, &SortedColumns::new(objectives))
}

/// [`crowding_distances`] of a matrix whose columns are sorted already.
pub(super) fn crowding_of_sorted(objectives: &Objectives, ranks: &[u32], sorted: &SortedColumns) -> Vec<f64> {
    let fronts = Fronts::new(objectives.len(), ranks);
    let mut distances = vec![0.0; objectives.len()];
    let mut rows = vec![0; objectives.len()];
    let mut values = vec![0.0; objectives.len()];
    for column in 0..objectives.columns() {
        fronts.deal(sorted.order(column), &mut rows);
        for (value, &row) in values.iter_mut().zip(&rows) {
            *value = objectives.row(row)[column];
        }
        for front in fronts.ranges() {
            add_gaps(&rows[front.clone()], &values[front], &mut distances);
        }
    }
    distances
}

/// Adds the share of one column to the distances of one front, whose rows and values come in ascending order.
fn add_gaps(rows: &[usize], values: &[f64], distances: &mut [f64]) {
    let (Some(lowest), Some(highest)) = (values.first(), values.last()) else {
        return;
    };
    if lowest == highest && rows.len() > 2 {
        return;
    }
    distances[rows[0]] = f64::INFINITY;
    distances[rows[rows.len() - 1]] = f64::INFINITY;
    // The range of the largest numbers overflows, that of their halves does not.
    let scale = if (highest - lowest).is_finite() { 1.0 } else { 0.5 };
    let range = highest * scale - lowest * scale;
    for (neighbours, &row) in values.windows(3).zip(&rows[1..]) {
        distances[row] += (neighbours[2] * scale - neighbours[0] * scale) / range;
    }
}

#[cfg(test)]
mod tests {
    use super::super::examples::any_objectives;
    use super::super::ranks::ranks;
    use super::*;
    use proptest::prelude::*;

    /// The definition, row by row: look through the whole front for the nearest on either side.
    fn crowding_by_the_definition(objectives: &Objectives, ranks: &[u32]) -> Vec<f64> {
        let distance = |row: usize| -> f64 {
            let front: Vec<usize> = (0..ranks.len()).filter(|&i| ranks[i] == ranks[row]).collect();
            if front.len() <= 2 {
                return f64::INFINITY;
            }
            let mut sum = 0.0;
            for column in 0..objectives.columns() {
                let place = |i: usize| (objectives.row(i)[column], i);
                let by_place = |a: &(f64, usize), b: &(f64, usize)| a.partial_cmp(b).unwrap();
                let places = || front.iter().map(|&i| place(i));
                let lowest = places().min_by(by_place).unwrap().0;
                let highest = places().max_by(by_place).unwrap().0;
                if lowest == highest {
                    continue;
                }
                let below = places().filter(|&other| other < place(row)).max_by(by_place);
                let above = places().filter(|&other| other > place(row)).min_by(by_place);
                sum += match (below, above) {
                    (Some(below), Some(above)) => (above.0 - below.0) / (highest - lowest),
                    _ => f64::INFINITY,
                };
            }
            sum
        };
        (0..ranks.len()).map(distance).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(256))]

        #[test]
        fn distances_are_those_of_the_definition(objectives in any_objectives(0..90)) {
            let ranks = ranks(&objectives);
            let expected = crowding_by_the_definition(&objectives, &ranks);
            prop_assert_eq!(crowding_distances(&objectives, &ranks), expected);
        }

        #[test]
        fn only_who_shares_a_front_matters_not_its_number(objectives in any_objectives(0..40)) {
            let ranks = ranks(&objectives);
            let others: Vec<u32> = ranks.iter().map(|rank| u32::MAX - 7 * rank).collect();
            prop_assert_eq!(
                crowding_distances(&objectives, &ranks),
                crowding_distances(&objectives, &others)
            );
        }
    }

    #[test]
    fn an_objective_in_which_all_are_equal_makes_nobody_an_edge() {
        let objectives = Objectives::new(2, vec![0.0, 5.0, 1.0, 5.0, 4.0, 5.0, 2.0, 5.0, 3.0, 5.0]).unwrap();
        let infinite = f64::INFINITY;
        assert_eq!(crowding_distances(&objectives, &[0; 5]), [infinite, 0.5, infinite, 0.5, 0.5]);
        let equal = Objectives::new(1, vec![5.0; 3]).unwrap();
        assert_eq!(crowding_distances(&equal, &[0; 3]), [0.0; 3]);
    }

    #[test]
    fn one_or_two_rows_are_infinitely_far_even_when_equal() {
        let objectives = Objectives::new(1, vec![5.0; 3]).unwrap();
        assert_eq!(crowding_distances(&objectives, &[0, 1, 1]), [f64::INFINITY; 3]);
    }

    #[test]
    fn a_range_beyond_the_largest_number_still_gives_shares() {
        let objectives = Objectives::new(1, vec![-f64::MAX, -f64::MAX, 0.0, f64::MAX]).unwrap();
        assert_eq!(crowding_distances(&objectives, &[0; 4]), [f64::INFINITY, 0.5, 1.0, f64::INFINITY]);
    }
}
