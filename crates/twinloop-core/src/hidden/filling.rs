//! What commands fill, in the course of a run: exact, because they are held over each period.

use super::{Hidden, Source};
use crate::lanes::Vector;

/// A hidden state that commands fill.
#[derive(Clone)]
pub(crate) struct Filling<V> {
    commands: Vec<usize>,
    squared: bool,
    /// Its decay over half a period, a factor.
    decay: V,
    /// What half a period adds to it for each unit of input.
    gain: V,
    /// None: that of the first period, which is still to come.
    rest: Option<V>,
    now: V,
}

impl<V: Vector> Filling<V> {
    /// An empty one; none where states fill it. Half a period multiplies it by `decay`, and adds `gain` for each unit of
    /// input.
    pub fn new(hidden: &Hidden, decay: V, gain: V) -> Option<Self> {
        let Source::Commands { commands, rest } = &hidden.source else { return None };
        let (commands, rest, now) = (commands.clone(), rest.map(V::splat), V::splat(0.0));
        Some(Self { commands, squared: hidden.squared, decay, gain, rest, now })
    }

    /// Its values at the start, the middle and the end of a period with these commands, in units of 1 / `factors`.
    #[inline(always)]
    pub fn pass(&mut self, command: &[V], factors: &[f64]) -> [V; 3] {
        let mut level = V::splat(0.0);
        for &i in &self.commands {
            let given = command[i] * factors[i];
            level = level + if self.squared { given * given } else { given };
        }
        level = level * (1.0 / self.commands.len() as f64);
        let rest = *self.rest.get_or_insert(level);
        let added = (level - rest) * self.gain;
        let start = self.now;
        let middle = start * self.decay + added;
        self.now = middle * self.decay + added;
        [start, middle, self.now]
    }
}
