//! Excitation: what a test adds to its controller's commands, and what holds it back while it flies.

use crate::controller::Family;
use crate::error::{Result, invalid};
use crate::lanes::Vector;

/// What is added to the commands before they are clipped.
#[derive(Clone, Copy)]
pub struct Excitation<'a, V> {
    /// A row for each step, n × n_u; empty for nothing.
    pub rows: &'a [V],
    /// Lines of a [`HoldBack`], of each lane; empty where nothing holds it back.
    pub hold_back: &'a [V],
}

impl<'a, V: Vector> Excitation<'a, V> {
    /// Nothing is added.
    pub const NONE: Self = Self { rows: &[], hold_back: &[] };

    /// Adds the row of a step, held back by what was read (n_x), to what the law commanded (n_u). Nothing after the
    /// last row.
    #[inline(always)]
    pub(crate) fn add(&self, family: &Family, step: usize, reading: &[V], command: &mut [V]) {
        let width = command.len();
        let Some(row) = self.rows.get(step * width..(step + 1) * width) else { return };
        // All of it where nothing holds it back: times 1, which changes no bit.
        let share = share(self.hold_back, reading);
        family.excite(command, row.iter().map(|&added| added * share));
    }
}

/// Numbers of a state's lines: an intercept and a slope at its lower end, and at its upper one.
const LINES: usize = 4;

/// What holds an excitation back: all of it is sent while every state is within its inner range, nothing once one is at
/// the end of its outer range, and in between in proportion to the room that is left; the state with the least decides.
#[derive(Clone, Debug, PartialEq)]
pub struct HoldBack {
    lines: Vec<f64>,
}

impl HoldBack {
    /// Inner and outer range of each state. An end of a state that holds nothing back is infinite in both.
    pub fn new(full: &[(f64, f64)], none: &[(f64, f64)]) -> Result<Self> {
        let mut lines = Vec::with_capacity(LINES * full.len());
        for (state, (&(low, high), &(least, most))) in full.iter().zip(none).enumerate() {
            // At the lower end the state is mirrored.
            for (inner, outer, sign) in [(-low, -least, -1.0), (high, most, 1.0)] {
                let free = inner == f64::INFINITY && outer == f64::INFINITY;
                let slope = if free { 0.0 } else { 1.0 / (outer - inner) };
                let intercept = if free { 1.0 } else { outer * slope };
                let sloped = slope > 0.0 && slope.is_finite() && intercept.is_finite();
                if !((free || sloped) && low <= high) {
                    return invalid(format!(
                        "hold-back, state {state}: expected an inner range within an outer one, found {low} to {high} \
                         within {least} to {most}; use -inf and inf in both where nothing holds it back"
                    ));
                }
                lines.extend([intercept, -sign * slope]);
            }
        }
        if full.len() != none.len() {
            return invalid(format!(
                "hold-back: expected an inner and an outer range for each state, found {} and {}",
                full.len(),
                none.len()
            ));
        }
        Ok(Self { lines })
    }

    /// Number of states.
    pub fn states(&self) -> usize {
        self.lines.len() / LINES
    }

    /// Intercept and slope of the share that is left, at the lower and at the upper end of each state.
    pub fn lines(&self) -> &[f64] {
        &self.lines
    }

    /// Refuses one of other states.
    pub fn check(&self, states: usize) -> Result<()> {
        if self.states() == states {
            return Ok(());
        }
        invalid(format!("hold-back: expected ranges of {states} states, found {}", self.states()))
    }
}

/// Lines of each of several tests side by side, those of a test without any such that they change no bit; none if none
/// has any.
pub(crate) fn side_by_side<'a>(
    tests: impl Iterator<Item = Option<&'a HoldBack>> + Clone,
    states: usize,
) -> Option<Vec<Vec<f64>>> {
    tests.clone().any(|hold_back| hold_back.is_some()).then(|| {
        let free = || [1.0, 0.0].repeat(LINES / 2 * states);
        tests.map(|hold_back| hold_back.map_or_else(free, |found| found.lines.clone())).collect()
    })
}

/// The share of an excitation that is sent at a reading (n_x).
#[inline(always)]
fn share<V: Vector>(lines: &[V], reading: &[V]) -> V {
    let mut share = V::splat(1.0);
    for (ends, &value) in lines.chunks_exact(LINES).zip(reading) {
        for line in ends.chunks_exact(2) {
            let left = line[0] + line[1] * value;
            share = left.select_less(share, left, share);
        }
    }
    V::splat(0.0).select_less(share, share, V::splat(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::Scalar;

    fn at(hold_back: &HoldBack, reading: &[f64]) -> f64 {
        let lanes = |values: &[f64]| values.iter().map(|&value| Scalar::splat(value)).collect::<Vec<_>>();
        share(&lanes(hold_back.lines()), &lanes(reading)).lane(0)
    }

    #[test]
    fn the_state_with_the_least_room_decides() {
        let infinite = (f64::NEG_INFINITY, f64::INFINITY);
        let hold_back =
            HoldBack::new(&[(-1.0, 2.0), infinite, (0.0, 0.5)], &[(-3.0, 6.0), infinite, (-0.5, 1.0)])
                .unwrap();
        assert_eq!(at(&hold_back, &[0.0, 1e300, 0.25]), 1.0);
        assert_eq!(at(&hold_back, &[4.0, 0.0, 0.25]), 0.5);
        assert_eq!(at(&hold_back, &[4.0, 0.0, 0.875]), 0.25);
        assert_eq!(at(&hold_back, &[-1.5, 0.0, -0.125]), 0.75);
        assert_eq!(at(&hold_back, &[-3.0, 0.0, 0.25]), 0.0);
        assert_eq!(at(&hold_back, &[9.0, 0.0, 0.25]), 0.0);
    }

    #[test]
    fn ranges_that_are_none_are_refused() {
        for (full, none) in [
            ((0.0, 1.0), (0.0, 2.0)),
            ((0.0, 1.0), (-1.0, 1.0)),
            ((1.0, 0.0), (-1.0, 2.0)),
            ((0.0, f64::INFINITY), (-1.0, 2.0)),
            ((0.0, f64::NAN), (-1.0, 2.0)),
            ((0.0, 1.0), (-1.0, f64::INFINITY)),
        ] {
            assert!(HoldBack::new(&[full], &[none]).is_err(), "{full:?} within {none:?}");
        }
        assert!(HoldBack::new(&[(0.0, 1.0)], &[]).is_err());
    }
}
