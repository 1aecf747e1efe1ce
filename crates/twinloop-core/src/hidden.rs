//! Hidden states that commands fill and that fade: what many periods of thrust, heat or current leave in a machine and
//! no sensor reads.

use crate::error::{Result, invalid};
use crate::lanes::Vector;

/// A hidden state h of a model: dh/dt = mean over commands of what each gives − the same at rest − h / time.
///
/// A command gives itself, or its square, in units of its scale; h is 0 at the start of a run, and an input of the
/// model's program after the commands.
#[derive(Clone, Debug, PartialEq)]
pub struct Hidden {
    /// Commands that fill it.
    pub commands: Vec<usize>,
    /// Whether they do so with their squares.
    pub squared: bool,
    /// The mean at which it neither fills nor empties; none: that of the first period.
    pub rest: Option<f64>,
    /// Its time constant, s.
    pub time: f64,
}

impl Hidden {
    /// Refuses what is no such state of so many commands.
    pub fn validated(self, commands: usize) -> Result<Self> {
        let fits = !self.commands.is_empty()
            && self.commands.iter().all(|&command| command < commands)
            && self.rest.is_none_or(f64::is_finite)
            && self.time.is_finite()
            && self.time > 0.0;
        if fits {
            Ok(self)
        } else {
            invalid(format!(
                "hidden state: expected some of {commands} commands, a finite rest and a time above 0 s, found {self:?}"
            ))
        }
    }
}

/// A hidden state in the course of a run.
#[derive(Clone)]
pub(crate) struct Filling<V> {
    hidden: Hidden,
    /// Its decay over half a period, a factor.
    decay: V,
    /// What half a period adds to it for each unit of input.
    gain: V,
    rest: Option<V>,
    now: V,
}

impl<V: Vector> Filling<V> {
    /// An empty one. Half a period multiplies it by `decay`, and adds `gain` for each unit of input.
    pub fn new(hidden: &Hidden, decay: V, gain: V) -> Self {
        let rest = hidden.rest.map(V::splat);
        Self { hidden: hidden.clone(), decay, gain, rest, now: V::splat(0.0) }
    }

    /// Its values at the start, the middle and the end of a period with these commands, in units of 1 / `factors`.
    #[inline(always)]
    pub fn pass(&mut self, command: &[V], factors: &[f64]) -> [V; 3] {
        let mut level = V::splat(0.0);
        for &i in &self.hidden.commands {
            let given = command[i] * factors[i];
            level = level + if self.hidden.squared { given * given } else { given };
        }
        level = level * (1.0 / self.hidden.commands.len() as f64);
        let rest = *self.rest.get_or_insert(level);
        let added = (level - rest) * self.gain;
        let start = self.now;
        let middle = start * self.decay + added;
        self.now = middle * self.decay + added;
        [start, middle, self.now]
    }
}
