//! The ideal point and the row that comes nearest to it.

use super::objectives::Objectives;

/// How far two points are from each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Distance {
    /// Euclidean, in the units of the objectives.
    Raw,
    /// Euclidean, each objective as a share of its range over the rows. One without a range is left out.
    Normalised,
}

/// The best value of each objective, (columns); infinite when there are no rows.
pub fn ideal_point(objectives: &Objectives) -> Vec<f64> {
    let mut ideal = vec![f64::INFINITY; objectives.columns()];
    for row in objectives.rows() {
        for (ideal, &value) in ideal.iter_mut().zip(row) {
            // Not `f64::min`, which may choose either of two zeros.
            *ideal = if value < *ideal { value } else { *ideal };
        }
    }
    ideal
}

/// The row nearest to the ideal point, the first of them if there are several; none when there are no rows.
///
/// A row whose squared distance overflows counts as infinitely far.
pub fn best_tradeoff(objectives: &Objectives, distance: Distance) -> Option<usize> {
    let ideal = ideal_point(objectives);
    let units: Vec<Unit> = match distance {
        Distance::Raw => vec![Unit { scale: 1.0, range: 1.0 }; objectives.columns()],
        Distance::Normalised => {
            ideal.iter().zip(worst_point(objectives)).map(|(&lo, hi)| Unit::range(lo, hi)).collect()
        }
    };
    let squared_distance = |row: &[f64]| -> f64 {
        let columns = row.iter().zip(&ideal).zip(&units);
        columns.map(|((value, ideal), unit)| unit.of(*ideal, *value)).map(|d| d * d).sum()
    };
    let nearest = objectives.rows().map(squared_distance).enumerate();
    nearest.min_by(|(_, a), (_, b)| a.total_cmp(b)).map(|(row, _)| row)
}

fn worst_point(objectives: &Objectives) -> Vec<f64> {
    let mut worst = vec![f64::NEG_INFINITY; objectives.columns()];
    for row in objectives.rows() {
        for (worst, &value) in worst.iter_mut().zip(row) {
            *worst = if value > *worst { value } else { *worst };
        }
    }
    worst
}

/// What a difference in one column is measured in.
#[derive(Clone, Copy)]
struct Unit {
    scale: f64,
    range: f64,
}

impl Unit {
    fn range(lo: f64, hi: f64) -> Self {
        // The range of the largest numbers overflows, that of their halves does not.
        let scale = if (hi - lo).is_finite() { 1.0 } else { 0.5 };
        let range = hi * scale - lo * scale;
        // In a column without a range all differences are zero, and any divisor leaves them so.
        Self { scale, range: if range == 0.0 { 1.0 } else { range } }
    }

    fn of(self, lo: f64, value: f64) -> f64 {
        (value * self.scale - lo * self.scale) / self.range
    }
}

#[cfg(test)]
mod tests {
    use super::super::examples::any_objectives;
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_ideal_point_is_reached_in_each_objective_and_never_passed(objectives in any_objectives(1..50)) {
            for (column, &best) in ideal_point(&objectives).iter().enumerate() {
                prop_assert!(objectives.rows().all(|row| row[column] >= best));
                prop_assert!(objectives.rows().any(|row| row[column] == best));
            }
        }

        #[test]
        fn the_best_tradeoff_is_the_first_of_the_nearest(objectives in any_objectives(1..50)) {
            let ideal = ideal_point(&objectives);
            let squared = |row: usize| -> f64 {
                (0..ideal.len()).map(|j| (objectives.row(row)[j] - ideal[j]).powi(2)).sum()
            };
            let mut nearest = 0;
            for row in 1..objectives.len() {
                if squared(row) < squared(nearest) {
                    nearest = row;
                }
            }
            prop_assert_eq!(best_tradeoff(&objectives, Distance::Raw), Some(nearest));
        }

        #[test]
        fn units_do_not_change_the_normalised_tradeoff(objectives in any_objectives(1..50), column in 0..14_usize) {
            let columns = objectives.columns();
            let mut values: Vec<f64> = objectives.rows().flatten().copied().collect();
            // A power of two, so that not even a rounding differs.
            values.iter_mut().skip(column % columns).step_by(columns).for_each(|value| *value *= 4096.0);
            let rescaled = Objectives::new(columns, values).unwrap();
            prop_assert_eq!(
                best_tradeoff(&rescaled, Distance::Normalised),
                best_tradeoff(&objectives, Distance::Normalised)
            );
        }
    }

    #[test]
    fn normalising_can_change_the_tradeoff() {
        let objectives = Objectives::new(2, vec![0.0, 4.0, 2.0, 1.0, 100.0, 0.0]).unwrap();
        assert_eq!(best_tradeoff(&objectives, Distance::Raw), Some(1));
        let steep = Objectives::new(2, vec![0.0, 4.0, 60.0, 1.0, 100.0, 0.0, 9.0, 3.0]).unwrap();
        assert_eq!(best_tradeoff(&steep, Distance::Raw), Some(0));
        assert_eq!(best_tradeoff(&steep, Distance::Normalised), Some(1));
    }

    #[test]
    fn a_constant_column_is_ignored_and_the_largest_numbers_are_not_too_large() {
        let max = f64::MAX;
        let objectives = Objectives::new(3, vec![-max, 7.0, max, 0.0, 7.0, -max, max, 7.0, -max]).unwrap();
        assert_eq!(best_tradeoff(&objectives, Distance::Normalised), Some(1));
    }

    #[test]
    fn no_rows_have_no_tradeoff() {
        let none = Objectives::new(2, vec![]).unwrap();
        assert_eq!(best_tradeoff(&none, Distance::Raw), None);
        assert_eq!(ideal_point(&none), [f64::INFINITY; 2]);
    }
}
