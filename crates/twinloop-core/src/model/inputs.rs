//! Inputs of a model's program, from the state and the commands.

use crate::lanes::Vector;
use crate::lgp::Inputs;

/// The inputs of a model's program: states, commands in units of their scale, then hidden states.
pub(super) struct StateAndCommand<'a, V> {
    pub state: &'a [V],
    pub command: &'a [V],
    pub factors: &'a [f64],
}

impl<V: Vector> Inputs<V> for StateAndCommand<'_, V> {
    #[inline(always)]
    fn input(&self, i: usize) -> V {
        match i.checked_sub(self.state.len()) {
            None => self.state[i],
            Some(j) => self.command[j] * self.factors[j],
        }
    }
}

/// The same inputs where they lie, as interleaved numbers.
pub(super) struct Interleaved<'a> {
    pub state: &'a [f64],
    pub command: &'a [f64],
    pub factors: &'a [f64],
}

impl<V: Vector> Inputs<V> for Interleaved<'_> {
    #[inline(always)]
    fn input(&self, i: usize) -> V {
        match (i * V::LANES).checked_sub(self.state.len()) {
            None => V::load(&self.state[i * V::LANES..]),
            Some(place) => V::load(&self.command[place..]) * self.factors[place / V::LANES],
        }
    }
}
