//! Pruning: which rows leave when there are too many.

use super::crowding::crowding_distances;
use super::ideal::{Distance, best_tradeoff};
use super::objectives::Objectives;
use super::selection::order;

/// Rows to drop, in ascending order, so that `cap` are left of a front: those with the least crowding distance, but no
/// protected row. If more than `cap` are protected, they are what is left.
pub(super) fn rows_to_drop(objectives: &Objectives, cap: usize) -> Vec<usize> {
    let one_front = vec![0; objectives.len()];
    let most_room_first = order(&one_front, &crowding_distances(objectives, &one_front));
    let mut kept = vec![false; objectives.len()];
    let mut room = cap.min(objectives.len());
    for row in protected(objectives) {
        room = room.saturating_sub(usize::from(!kept[row]));
        kept[row] = true;
    }
    let unprotected: Vec<usize> = most_room_first.into_iter().filter(|&row| !kept[row]).collect();
    for &row in unprotected.iter().take(room) {
        kept[row] = true;
    }
    (0..objectives.len()).filter(|&row| !kept[row]).collect()
}

/// The best trade-offs and the first minimum of each objective; some may come twice.
fn protected(objectives: &Objectives) -> impl Iterator<Item = usize> {
    let tradeoffs = [Distance::Raw, Distance::Normalised];
    let tradeoffs = tradeoffs.into_iter().filter_map(|distance| best_tradeoff(objectives, distance));
    let minima = (0..objectives.columns()).filter_map(|column| {
        let values = objectives.rows().map(|row| row[column]).enumerate();
        values.reduce(|least, next| if next.1 < least.1 { next } else { least }).map(|(row, _)| row)
    });
    tradeoffs.chain(minima)
}

#[cfg(test)]
mod tests {
    use super::super::examples::any_objectives;
    use super::super::ideal::ideal_point;
    use super::*;
    use proptest::prelude::*;

    /// Matrices in which the raw and the normalised trade-off differ, as one objective has a long range.
    fn uneven_objectives() -> impl Strategy<Value = Objectives> {
        any_objectives(1..150).prop_map(|even| {
            let columns = even.columns();
            let mut values: Vec<f64> = even.rows().flatten().copied().collect();
            values.iter_mut().step_by(columns).for_each(|value| *value *= 50.0);
            Objectives::new(columns, values).unwrap()
        })
    }

    fn rows_kept(objectives: &Objectives, cap: usize) -> Vec<usize> {
        let dropped = rows_to_drop(objectives, cap);
        (0..objectives.len()).filter(|row| !dropped.contains(row)).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(512))]

        #[test]
        fn the_cap_is_met_and_the_protected_stay(
            objectives in uneven_objectives(),
            cap in 0..170_usize,
        ) {
            let kept = rows_kept(&objectives, cap);
            for distance in [Distance::Raw, Distance::Normalised] {
                prop_assert!(kept.contains(&best_tradeoff(&objectives, distance).unwrap()));
            }
            for (column, &best) in ideal_point(&objectives).iter().enumerate() {
                prop_assert!(kept.iter().any(|&row| objectives.row(row)[column] == best));
            }
            let most_protected = 2 + objectives.columns();
            prop_assert!(kept.len() >= cap.min(objectives.len()));
            prop_assert!(kept.len() <= cap.max(most_protected));
            prop_assert!(cap < most_protected || kept.len() == cap.min(objectives.len()));
        }

        #[test]
        fn no_row_that_leaves_has_more_room_than_one_that_stays_unprotected(
            objectives in any_objectives(1..150),
            cap in 0..100_usize,
        ) {
            let kept = rows_kept(&objectives, cap);
            let room = crowding_distances(&objectives, &vec![0; objectives.len()]);
            let safe: Vec<usize> = protected(&objectives).collect();
            let least = kept.iter().filter(|row| !safe.contains(row)).map(|&row| room[row]);
            let least = least.fold(f64::INFINITY, f64::min);
            prop_assert!(rows_to_drop(&objectives, cap).iter().all(|&row| room[row] <= least));
        }
    }

    #[test]
    fn the_most_crowded_leaves_first() {
        let line = [0.0, 4.0, 4.5, 5.0, 10.0].iter().flat_map(|&x| [x, 10.0 - x]).collect();
        let objectives = Objectives::new(2, line).unwrap();
        assert_eq!(rows_to_drop(&objectives, 4), [2]);
    }

    #[test]
    fn nothing_leaves_where_there_is_nothing() {
        let objectives = Objectives::new(2, vec![]).unwrap();
        assert_eq!(rows_to_drop(&objectives, 0), []);
    }
}
