//! Selection: the best rows first, and a draw that favours them.

use super::crowding::crowding_of_sorted;
use super::fronts::Fronts;
use super::objectives::Objectives;
use super::ranks::ranks_of_sorted;
use super::sorted::{SortedColumns, key, sort_into};
use crate::error::{Result, invalid};

/// Where each row of a matrix stands: its front, and its room within that. Sorts the objectives once for both.
#[derive(Clone, Debug, PartialEq)]
pub struct Ranking {
    /// Front of each row, 0 for the non-dominated, (rows).
    pub ranks: Vec<u32>,
    /// Crowding distance of each row, (rows).
    pub crowding: Vec<f64>,
}

impl Ranking {
    /// Of the rows of a matrix.
    pub fn new(objectives: &Objectives) -> Self {
        let sorted = SortedColumns::new(objectives);
        let ranks = ranks_of_sorted(objectives, &sorted);
        let crowding = crowding_of_sorted(objectives, &ranks, &sorted);
        Self { ranks, crowding }
    }

    /// The rows from best to worst, (rows).
    pub fn best_first(&self) -> Vec<usize> {
        order(&self.ranks, &self.crowding)
    }
}

/// Rows from best to worst, (rows): by rank, then by more crowding distance, then by index.
///
/// `ranks`, (rows), and `crowding`, (rows), are of the same rows; a row without both has no place in the order.
pub fn order(ranks: &[u32], crowding: &[f64]) -> Vec<usize> {
    let most_room_first: Vec<u64> = ranks.iter().zip(crowding).map(|(_, &distance)| !key(distance)).collect();
    let mut rows = Vec::with_capacity(most_room_first.len());
    sort_into(&most_room_first, &mut Vec::new(), &mut rows);
    let mut best_first = vec![0; rows.len()];
    Fronts::new(rows.len(), ranks).deal(&rows, &mut best_first);
    best_first
}

/// The best `count` rows, best first, (count): in the [`order`] of their ranks and crowding distances. All of them if
/// there are fewer.
pub fn select(objectives: &Objectives, count: usize) -> Vec<usize> {
    let mut best = Ranking::new(objectives).best_first();
    best.truncate(count);
    best
}

/// Linear ranking: the chance to be drawn falls linearly from the best position to the worst.
///
/// With pressure s, position i of n (0 is the best) has probability (s − (2s − 2) i / (n − 1)) / n.
///
/// Baker, Adaptive selection methods for genetic algorithms, ICGA 1985.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearRanking {
    count: usize,
    pressure: f64,
    /// How much the expected draws out of n fall over one position, halved: (s − 1) / (n − 1).
    slope: f64,
}

impl LinearRanking {
    /// A draw among `count` positions with a selection `pressure` from 1 (all alike) to 2: the expected number of times that the
    /// best is drawn in `count` draws.
    ///
    /// # Errors
    /// When there is no position to draw or the pressure is out of its range.
    pub fn new(count: usize, pressure: f64) -> Result<Self> {
        if count == 0 {
            return invalid("linear ranking: expected at least one position, found none; give a population");
        }
        if !(1.0..=2.0).contains(&pressure) {
            return invalid(format!(
                "linear ranking: expected a selection pressure from 1 to 2, found {pressure}; choose \
                 2 to favour the best most"
            ));
        }
        let slope = (pressure - 1.0) / (count.max(2) - 1) as f64;
        Ok(Self { count, pressure, slope })
    }

    /// The position that a `uniform` number in [0, 1) draws.
    pub fn draw(&self, uniform: f64) -> usize {
        // The cumulative sum is a parabola in the position; this is its inverse, free of cancellation.
        let linear = self.pressure + self.slope;
        let area = self.count as f64 * uniform;
        let root = (linear * linear - 4.0 * self.slope * area).max(0.0).sqrt();
        let guess = ((2.0 * area / (linear + root)) as usize).min(self.count - 1);
        // Rounding can miss the border between two positions by a hair.
        if guess > 0 && self.cumulative(guess) > uniform {
            guess - 1
        } else if guess + 1 < self.count && self.cumulative(guess + 1) <= uniform {
            guess + 1
        } else {
            guess
        }
    }

    /// Probability of all the positions before this one, which is not the only one.
    fn cumulative(&self, position: usize) -> f64 {
        let (i, n) = (position as f64, self.count as f64);
        // One division at the end, so that what should be 1 is 1.
        i * (self.pressure * (n - 1.0) - (self.pressure - 1.0) * (i - 1.0)) / (n * (n - 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::super::crowding::crowding_distances;
    use super::super::examples::any_objectives;
    use super::super::ranks::ranks;
    use super::*;
    use proptest::prelude::*;

    fn probability(position: usize, count: usize, pressure: f64) -> f64 {
        if count == 1 {
            return 1.0;
        }
        (pressure - (2.0 * pressure - 2.0) * position as f64 / (count - 1) as f64) / count as f64
    }

    proptest! {
        #[test]
        fn selection_takes_no_row_that_is_worse_than_one_left_out(
            objectives in any_objectives(0..120),
            count in 0..140_usize,
        ) {
            let ranks = ranks(&objectives);
            let crowding = crowding_distances(&objectives, &ranks);
            let selected = select(&objectives, count);
            prop_assert_eq!(selected.len(), count.min(objectives.len()));
            let better = |a: usize, b: usize| {
                ranks[a] < ranks[b]
                    || ranks[a] == ranks[b]
                        && (crowding[a] > crowding[b] || crowding[a] == crowding[b] && a < b)
            };
            prop_assert!(selected.windows(2).all(|pair| better(pair[0], pair[1])));
            if let Some(&worst) = selected.last() {
                let left_out = (0..objectives.len()).filter(|row| !selected.contains(row));
                prop_assert!(left_out.into_iter().all(|row| better(worst, row)));
            }
        }

        #[test]
        fn an_even_grid_of_draws_hits_each_position_as_often_as_it_should(
            count in 1..60_usize,
            pressure in prop_oneof![Just(1.0), 1.0..=2.0],
        ) {
            const DRAWS: usize = 20_000;
            let ranking = LinearRanking::new(count, pressure).unwrap();
            let mut hits = vec![0; count];
            for draw in 0..DRAWS {
                hits[ranking.draw((draw as f64 + 0.5) / DRAWS as f64)] += 1;
            }
            for (position, &hits) in hits.iter().enumerate() {
                let expected = probability(position, count, pressure) * DRAWS as f64;
                prop_assert!((f64::from(hits) - expected).abs() <= 1.5, "position {}", position);
            }
        }

        #[test]
        fn a_draw_is_the_inverse_of_the_summed_probabilities(
            count in 2..100_000_usize,
            pressure in prop_oneof![Just(1.0), 1.0..=2.0],
            uniform in 0.0..1.0_f64,
        ) {
            let position = LinearRanking::new(count, pressure).unwrap().draw(uniform);
            let before: f64 = (0..position).map(|i| probability(i, count, pressure)).sum();
            let with = before + probability(position, count, pressure);
            prop_assert!(before <= uniform + 1e-9 && uniform <= with + 1e-9);
        }
    }

    #[test]
    fn the_order_is_by_rank_then_room_then_index() {
        let crowding = [1.0, 2.0, f64::INFINITY, 2.0, 0.0];
        assert_eq!(order(&[1, 0, 1, 0, 0], &crowding), [1, 3, 4, 2, 0]);
    }

    #[test]
    fn full_pressure_never_draws_the_worst() {
        for count in 2..500 {
            let ranking = LinearRanking::new(count, 2.0).unwrap();
            assert_eq!(ranking.draw(0.0), 0);
            assert_eq!(ranking.draw(1.0_f64.next_down()), count - 2, "{count} positions");
        }
    }

    #[test]
    fn a_single_position_is_always_drawn() {
        let ranking = LinearRanking::new(1, 1.5).unwrap();
        assert!([0.0, 0.3, 0.999].iter().all(|&uniform| ranking.draw(uniform) == 0));
    }

    #[test]
    fn a_pressure_out_of_range_is_refused() {
        for pressure in [0.99, 2.1, 0.0, -1.0, f64::NAN, f64::INFINITY] {
            let sentence = LinearRanking::new(5, pressure).unwrap_err().to_string();
            assert!(sentence.contains(&format!("found {pressure}")), "{sentence}");
        }
        assert!(LinearRanking::new(0, 1.5).is_err());
    }
}
