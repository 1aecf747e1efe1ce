//! Reports: what logs and controllers are given of readings. A slow sensor repeats its last one, and a rate without a
//! sensor of its own is computed of another state's readings. All of it is linear: what noise adds passes in the same way.

use std::collections::VecDeque;

use crate::error::{Result, invalid};
use crate::lanes::Scalar;

/// What is given in the place of a state's reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Report {
    /// A new reading at the start of a run, in period `first`, and in each `every`-th after it; in between the last one.
    Held {
        /// Periods from one new reading to the next.
        every: usize,
        /// Period of the first one after the start, 1 to `every`.
        first: usize,
        /// Periods that a reading is old when it is given.
        age: usize,
    },
    /// A filtered difference, `kept` times the last one and `share` times what the readings of another state changed by.
    Computed {
        /// The other state.
        of: usize,
        /// From 0 up to, not including, 1.
        kept: f64,
        /// Above 0, in the state's unit over the other's.
        share: f64,
    },
}

/// The reports of a system, of the states that are not given as they are read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reports(Vec<(usize, Report)>);

impl Reports {
    /// Readings are held for at most so many periods, and are at most as old when they are given.
    pub const LONGEST: usize = 1000;

    /// Those of so many states, each with its number.
    pub fn new(mut reports: Vec<(usize, Report)>, states: usize) -> Result<Self> {
        let computed = |state: usize| {
            reports.iter().any(|&(i, one)| i == state && matches!(one, Report::Computed { .. }))
        };
        let fits = |&(state, report): &(usize, Report)| {
            let of_it = match report {
                Report::Held { every, first, age } => {
                    let held = (1..=Self::LONGEST).contains(&every) && (1..=every).contains(&first);
                    held && age <= Self::LONGEST
                }
                Report::Computed { of, kept, share } => {
                    let real = (0.0..1.0).contains(&kept) && share.is_finite() && share > 0.0;
                    real && of < states && of != state && !computed(of)
                }
            };
            of_it && state < states && reports.iter().filter(|(other, _)| *other == state).count() == 1
        };
        if !reports.iter().all(fits) {
            return invalid(format!(
                "reports: expected at most one for each of {states} states, held for 1 to {} periods and no older, or computed of \
                 readings of another state that are not computed, with a share above 0 of which less than 1 is kept, \
                 found {reports:?}",
                Self::LONGEST
            ));
        }
        // A rate that is computed of a slow sensor's readings is computed of what it repeats.
        reports.sort_by_key(|&(state, report)| (matches!(report, Report::Computed { .. }), state));
        Ok(Self(reports))
    }

    /// Whether every state is given as it is read.
    #[inline(always)]
    pub fn is_none(&self) -> bool {
        self.0.is_empty()
    }

    /// Each with the number of its state, those that are held first.
    pub fn each(&self) -> &[(usize, Report)] {
        &self.0
    }

    /// Replaces readings (n_x) by what is given in their place.
    ///
    /// `memory` is that of a run whose readings so far were given in turn.
    pub(crate) fn give(&self, memory: &mut Memory, readings: &mut [Scalar]) {
        if self.is_none() {
            return;
        }
        let Memory { read, last, at } = memory;
        read.push_back(readings.to_vec());
        if read.len() > self.oldest() + 1 {
            read.pop_front();
        }
        if *at > 0 {
            for &(state, report) in &self.0 {
                readings[state] = match report {
                    Report::Held { every, first, .. } if *at < first || (*at - first) % every != 0 => {
                        last[state]
                    }
                    // Before a run nothing moved.
                    Report::Held { age, .. } => read[read.len().saturating_sub(age + 1)][state],
                    Report::Computed { of, kept, share } => {
                        last[state] * kept + (readings[of] - last[of]) * share
                    }
                };
            }
        }
        last.clear();
        last.extend_from_slice(readings);
        *at += 1;
    }

    /// Periods that the oldest reading is old which is given.
    fn oldest(&self) -> usize {
        let ages = self.0.iter().map(|&(_, report)| match report {
            Report::Held { age, .. } => age,
            Report::Computed { .. } => 0,
        });
        ages.max().unwrap_or(0)
    }
}

/// What a run remembers of its readings.
#[derive(Clone, Default)]
pub(crate) struct Memory {
    /// The last ones (n_x), the newest at the end.
    read: VecDeque<Vec<Scalar>>,
    /// What was given last (n_x).
    last: Vec<Scalar>,
    /// How many were given.
    at: usize,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::Vector;

    fn given(reports: &Reports, readings: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let mut memory = Memory::default();
        let rows = readings.iter().map(|row| {
            let mut row = row.map(Scalar::splat);
            reports.give(&mut memory, &mut row);
            row.map(|value| value.lane(0))
        });
        rows.collect()
    }

    #[test]
    fn a_slow_sensor_repeats_its_last_reading() {
        let readings: Vec<_> = (1..9).map(|k| [f64::from(k); 2]).collect();
        for (age, expected) in
            [(0, [1.0, 1.0, 3.0, 3.0, 3.0, 6.0, 6.0, 6.0]), (4, [1.0, 1.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0])]
        {
            let reports = Reports::new(vec![(1, Report::Held { every: 3, first: 2, age })], 2).unwrap();
            let held: Vec<_> = given(&reports, &readings).iter().map(|row| row[1]).collect();
            assert_eq!(held, expected);
            assert!(
                given(&reports, &readings).iter().zip(&readings).all(|(given, read)| given[0] == read[0])
            );
        }
    }

    #[test]
    fn a_computed_rate_is_the_filtered_difference_of_what_is_given_of_the_other() {
        let (kept, share) = (0.75, 2.0);
        let computed = (0, Report::Computed { of: 1, kept, share });
        let reports =
            Reports::new(vec![computed, (1, Report::Held { every: 2, first: 2, age: 0 })], 2).unwrap();
        let found = given(&reports, &[[9.0, 1.0], [0.0, 5.0], [0.0, 3.0], [0.0, 8.0]]);
        let first = kept * 9.0;
        let second = kept * first + share * 2.0;
        assert_eq!(found, [[9.0, 1.0], [first, 1.0], [second, 3.0], [kept * second, 3.0]]);
    }

    #[test]
    fn reports_that_no_machine_gives_are_refused() {
        let (held, fits) = (
            |every, first| Report::Held { every, first, age: 0 },
            |of, kept, share| Report::Computed { of, kept, share },
        );
        let wrong = [
            vec![(2, held(2, 1))],
            vec![(0, held(0, 1))],
            vec![(0, held(4, 0))],
            vec![(0, held(4, 5))],
            vec![(0, held(Reports::LONGEST + 1, 1))],
            vec![(0, held(2, 1)), (0, held(2, 1))],
            vec![(0, Report::Held { every: 2, first: 1, age: Reports::LONGEST + 1 })],
            vec![(0, fits(0, 0.5, 1.0))],
            vec![(0, fits(2, 0.5, 1.0))],
            vec![(0, fits(1, 1.0, 1.0))],
            vec![(0, fits(1, -0.1, 1.0))],
            vec![(0, fits(1, 0.5, 0.0))],
            vec![(0, fits(1, 0.5, f64::NAN))],
            vec![(0, fits(1, 0.5, 1.0)), (1, fits(0, 0.5, 1.0))],
        ];
        assert!(wrong.into_iter().all(|reports| Reports::new(reports, 2).is_err()));
        assert!(Reports::new(vec![], 2).unwrap().is_none());
    }
}
