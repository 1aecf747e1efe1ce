//! The envelope: what of its room each state uses up.

use crate::difference::Periods;
use crate::error::{Result, invalid};
use crate::lanes::{Vector, scalars};
use crate::signals::Signals;

/// Bounds that states may safely move in.
#[derive(Clone, Debug, PartialEq)]
pub struct Envelope {
    states: usize,
    bands: Vec<Band>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Band {
    state: usize,
    middle: f64,
    half_width: f64,
}

impl Envelope {
    /// Smallest and largest safe value of each state; none where any will do.
    pub fn new(bounds: &[Option<(f64, f64)>]) -> Result<Self> {
        let mut bands = Vec::new();
        for (state, bounds) in bounds.iter().enumerate() {
            let Some((low, high)) = *bounds else { continue };
            if !(low.is_finite() && high.is_finite() && low < high) {
                return invalid(format!(
                    "envelope of state {state}: expected finite low < high, found {low} and {high}; widen it"
                ));
            }
            bands.push(Band { state, middle: 0.5 * (low + high), half_width: 0.5 * (high - low) });
        }
        Ok(Self { states: bounds.len(), bands })
    }

    /// Number of states, with an envelope or without.
    pub fn states(&self) -> usize {
        self.states
    }

    /// The largest share of an envelope that each of some states (rows × n_x) uses.
    pub fn usages(&self, signals: &Signals, states: &[f64]) -> Result<Vec<f64>> {
        let n_x = signals.states();
        if self.states != n_x || !states.len().is_multiple_of(n_x) {
            return invalid(format!(
                "envelope: expected one of {n_x} states and rows of as many, found {} and {} numbers",
                self.states,
                states.len()
            ));
        }
        let usage = |state: &[f64]| self.reach(&signals.periods, &scalars(state)).usage().lane(0);
        Ok(states.chunks_exact(n_x).map(usage).collect())
    }

    /// How far flights got that start at a state (n_x).
    #[inline(always)]
    pub(super) fn reach<'a, V: Vector>(&'a self, periods: &'a Periods, initial: &[V]) -> Reach<'a, V> {
        let mut reach =
            Reach { periods, bands: &self.bands, farthest: vec![V::splat(0.0); self.bands.len()] };
        reach.see(initial);
        reach
    }
}

/// How far from the middle of its envelope each state that has one ever was.
pub(super) struct Reach<'a, V> {
    periods: &'a Periods,
    bands: &'a [Band],
    farthest: Vec<V>,
}

impl<V: Vector> Reach<'_, V> {
    /// Looks at a state (n_x).
    #[inline(always)]
    pub(super) fn see(&mut self, state: &[V]) {
        for (farthest, band) in self.farthest.iter_mut().zip(self.bands) {
            let middle = V::splat(band.middle);
            let distance = self.periods.difference(band.state, state[band.state], middle).abs();
            *farthest = farthest.select_less(distance, distance, *farthest);
        }
    }

    /// The largest share of an envelope that was used: 0 in the middle, 1 at a bound.
    #[inline(always)]
    pub(super) fn usage(&self) -> V {
        let mut most = V::splat(0.0);
        for (farthest, band) in self.farthest.iter().zip(self.bands) {
            let used = *farthest / band.half_width;
            most = most.select_less(used, used, most);
        }
        most
    }
}
