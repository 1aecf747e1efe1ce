//! The one difference of states: plain, or the short way round where a state is periodic.

use crate::error::{Result, invalid};
use crate::lanes::{Apart, Vector};

/// The period of each state that has one: 2π of an angle in radians that wraps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Periods(Vec<Option<f64>>);

impl Periods {
    /// One entry for each state.
    pub fn new(periods: Vec<Option<f64>>) -> Result<Self> {
        if let Some(period) = periods.iter().flatten().find(|period| !(period.is_finite() && **period > 0.0))
        {
            return invalid(format!("periods: expected finite numbers above 0, found {period}"));
        }
        // Empty where there is none, so that to ask costs nothing.
        Ok(Self(if periods.iter().any(Option::is_some) { periods } else { vec![] }))
    }

    /// Whether any state is periodic.
    #[inline(always)]
    pub fn any(&self) -> bool {
        !self.0.is_empty()
    }

    /// The period of a state.
    #[inline(always)]
    pub fn of(&self, state: usize) -> Option<f64> {
        self.0.get(state).copied().flatten()
    }

    /// Whether the periods are for so many states.
    pub(crate) fn fit(&self, states: usize) -> bool {
        self.0.is_empty() || self.0.len() == states
    }

    /// `a - b` of a state: at most half a period in either direction where it has one.
    #[inline(always)]
    pub fn difference<V: Vector>(&self, state: usize, a: V, b: V) -> V {
        let difference = a - b;
        match self.of(state) {
            None => difference,
            Some(period) => {
                // In a place of its own: one that a call may write is kept out of registers on every path.
                let mut shortest = difference;
                V::apart(Shortest { difference: &mut shortest, period });
                shortest
            }
        }
    }

    /// Brings every periodic state (n_x) within half a period of 0.
    #[inline(always)]
    pub fn wrap<V: Vector>(&self, state: &mut [V]) {
        for (i, value) in state.iter_mut().enumerate() {
            if self.of(i).is_some() {
                *value = self.difference(i, *value, V::splat(0.0));
            }
        }
    }

    /// Rows of states (rows × n_x) that go on from row to row by the short way, from the first as it is.
    pub fn continued(&self, states: &[f64], n_x: usize) -> Vec<f64> {
        let mut continued = states.to_vec();
        if self.any() {
            for place in n_x..states.len() {
                if let Some(period) = self.of(place % n_x) {
                    let step = states[place] - continued[place - n_x];
                    continued[place] = states[place] - libm::rint(step / period) * period;
                }
            }
        }
        continued
    }

    /// Euclidean distance of two states (n_x).
    pub fn distance(&self, a: &[f64], b: &[f64]) -> f64 {
        let mut sum = 0.0;
        for (i, (a, b)) in a.iter().zip(b).enumerate() {
            let difference = match self.of(i) {
                None => a - b,
                Some(period) => a - b - libm::rint((a - b) / period) * period,
            };
            sum += difference * difference;
        }
        sum.sqrt()
    }
}

/// The short way, as a function of its own: few states are periodic, and every loop takes differences.
struct Shortest<'a, V> {
    difference: &'a mut V,
    period: f64,
}

impl<V: Vector> Apart for Shortest<'_, V> {
    #[inline(always)]
    fn run(self) {
        let Self { difference, period } = self;
        *difference = *difference - (*difference / period).map(libm::rint) * period;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::Scalar;
    use proptest::prelude::*;

    fn periods() -> Periods {
        Periods::new(vec![None, Some(8.0)]).unwrap()
    }

    fn difference(state: usize, a: f64, b: f64) -> f64 {
        periods().difference(state, Scalar::splat(a), Scalar::splat(b)).lane(0)
    }

    proptest! {
        #[test]
        fn the_short_way_is_at_most_half_a_period_and_ends_where_the_long_one_does(
            a in -50.0..50.0_f64, b in -50.0..50.0_f64,
        ) {
            let found = difference(1, a, b);
            prop_assert!(found.abs() <= 4.0);
            let turns = (a - b - found) / 8.0;
            prop_assert!((turns - turns.round()).abs() < 1e-12);
            prop_assert_eq!(difference(0, a, b).to_bits(), (a - b).to_bits());
        }

        #[test]
        fn whole_turns_of_a_reading_change_no_bit(
            // On a grid, where the turns are exact.
            a in -400..400_i32, b in -400..400_i32, turns in -9..9_i32,
        ) {
            let (a, b) = (f64::from(a) / 64.0, f64::from(b) / 64.0);
            let shifted = a + 8.0 * f64::from(turns);
            // Half a period may go either way.
            prop_assume!(difference(1, a, b).abs() < 4.0);
            prop_assert_eq!(difference(1, shifted, b), difference(1, a, b));
            prop_assert_eq!(difference(1, b, shifted), difference(1, b, a));
            prop_assert_eq!(periods().distance(&[1.0, shifted], &[2.0, b]), periods().distance(&[1.0, a], &[2.0, b]));
        }

        #[test]
        fn a_continued_record_is_the_one_before_it_was_wrapped(
            steps in prop::collection::vec(-255..255_i32, 1..40), wraps in prop::collection::vec(-3..4_i32, 40),
        ) {
            let (mut angle, mut truth, mut wrapped) = (0.0, vec![5.0, 0.0], vec![5.0, 0.0]);
            for (step, turns) in steps.iter().zip(wraps) {
                angle += f64::from(*step) / 64.0;
                truth.extend([angle, angle]);
                wrapped.extend([angle, angle + 8.0 * f64::from(turns)]);
            }
            prop_assert_eq!(periods().continued(&wrapped, 2), truth);
        }
    }

    #[test]
    fn without_a_period_nothing_is_changed() {
        let none = Periods::new(vec![None; 2]).unwrap();
        assert!(!none.any() && none.fit(7) && none == Periods::default());
        assert_eq!(none.continued(&[1.0, 2.0, 30.0, -40.0], 2), [1.0, 2.0, 30.0, -40.0]);
        assert_eq!(none.distance(&[1.0, 2.0], &[4.0, -2.0]), 5.0);
    }

    #[test]
    fn what_is_no_period_is_refused() {
        for period in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let refusal = Periods::new(vec![None, Some(period)]).unwrap_err().to_string();
            assert!(refusal.contains("above 0"), "{refusal}");
        }
    }
}
