//! The envelope: what of its room each state uses up.

use crate::error::{Result, invalid};
use crate::lanes::Vector;

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

    /// The larger of what was used so far and what a state (n_x) uses: 0 in the middle, 1 at a bound.
    #[inline(always)]
    pub(super) fn usage<V: Vector>(&self, so_far: V, state: &[V]) -> V {
        let mut most = so_far;
        for &Band { state: i, middle, half_width } in &self.bands {
            let used = (state[i] - V::splat(middle)).abs() / half_width;
            most = most.select_less(used, used, most);
        }
        most
    }
}
