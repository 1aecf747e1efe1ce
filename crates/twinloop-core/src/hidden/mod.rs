//! Hidden states that commands or motion fill and that fade: what many periods of thrust, heat, current or speed leave in
//! a machine and no sensor reads.

mod filling;
mod masses;
mod storage;

pub(crate) use filling::Filling;
pub use masses::{Mass, Pressed};
pub(crate) use storage::Storage;

use crate::error::{Result, invalid};

/// A hidden state h of a model: dh/dt = mean over its sources of what each gives − the same at rest − h / time.
///
/// Each source gives itself, or its square, in units of its scale; h is an input of the model's program after the commands.
#[derive(Clone, Debug, PartialEq)]
pub struct Hidden {
    /// What fills it.
    pub source: Source,
    /// Whether the source does so with squares.
    pub squared: bool,
    /// Its time constant, s.
    pub time: f64,
}

/// What fills a hidden state, and what it is at the start of a run.
#[derive(Clone, Debug, PartialEq)]
pub enum Source {
    /// Some of the commands; it is 0 at the start of a run.
    Commands {
        /// Which, by number.
        commands: Vec<usize>,
        /// The mean at which it neither fills nor empties; none: that of the first period.
        rest: Option<f64>,
    },
    /// Some of the states, or, of two that turn into each other, some of the commands.
    ///
    /// Two neighbours may turn into each other, as the place and the speed of a mass on a spring do: then −h₂ / turns is
    /// added to the first one's slope, and h₁ / turns to the second one's.
    States {
        /// Which, by number; none where commands fill it.
        states: Vec<usize>,
        /// Commands that fill it, by number; none where states do.
        commands: Vec<usize>,
        /// The mean at which it neither fills nor empties.
        rest: f64,
        /// Whether a run begins with it settled at what fills it then, and not empty.
        settled: bool,
        /// In which it and its partner turn by one radian, s; none: it has no partner.
        turns: Option<f64>,
        /// The gap between two that turn, such as backlash before a load; none: they turn everywhere.
        play: Option<Play>,
    },
}

/// A gap, on both sides of which a mass is pressed: by a spring and a damper that never pull.
///
/// Then the first of two hidden states is their twist, s' = mean of what fills it − h₂, and the second one the rate of the
/// mass: h₂' = press(s, s') / turns² − h₂ / time, in units of what fills them. A program sees the press in the twist's place.
/// At the start of a run the mass moves along, in the middle of the gap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Play {
    /// Half of the gap, in units of what fills the twist times s.
    pub half: f64,
    /// Damping over stiffness of what presses, s.
    pub damping: f64,
}

/// By how much what presses stiffens where it just touches, so that nothing jumps.
pub(crate) const FIRM: f64 = 100.0;

impl Play {
    /// What presses at a twist that changes at a rate.
    pub(crate) fn press(self, twist: f64, rate: f64) -> f64 {
        let side = if twist < 0.0 { -1.0 } else { 1.0 };
        let beyond = side * twist - self.half;
        side * (FIRM * beyond).min(beyond + side * self.damping * rate).max(0.0)
    }
}

impl Hidden {
    /// Refuses what is no such state of so many commands and states.
    pub fn validated(self, commands: usize, states: usize) -> Result<Self> {
        let positive = |time: f64| time.is_finite() && time > 0.0;
        let some_of =
            |places: &[usize], count| !places.is_empty() && places.iter().all(|&place| place < count);
        let fits = match &self.source {
            Source::Commands { commands: filling, rest } => {
                some_of(filling, commands) && rest.is_none_or(f64::is_finite)
            }
            Source::States { states: filling, commands: swinging, rest, turns, play, settled } => {
                let played = |Play { half, damping }: Play| {
                    positive(half) && positive(damping) && turns.is_some() && !settled && !self.squared
                };
                let by_states = swinging.is_empty() && some_of(filling, states);
                let by_commands = filling.is_empty() && some_of(swinging, commands);
                let turning = turns.is_some() && play.is_none() && !settled;
                (by_states || by_commands && turning)
                    && rest.is_finite()
                    && turns.is_none_or(positive)
                    && play.is_none_or(played)
            }
        };
        if fits && positive(self.time) {
            return Ok(self);
        }
        invalid(format!(
            "hidden state: expected some of {commands} commands or of {states} states, a finite rest, times above 0 s, and \
             a gap above 0 only between two that turn and begin empty, found {self:?}"
        ))
    }

    /// Whether it is integrated with the states: where they fill it, or it turns.
    pub(crate) fn moves(&self) -> bool {
        matches!(self.source, Source::States { .. })
    }

    /// In which it and its partner turn by one radian, s; none where it has no partner.
    pub(crate) fn turns(&self) -> Option<f64> {
        match self.source {
            Source::Commands { .. } => None,
            Source::States { turns, .. } => turns,
        }
    }

    /// Whether it is known within a period only in steps of Runge and Kutta: where it jumps, or commands do.
    pub(crate) fn is_fine(&self) -> bool {
        matches!(&self.source, Source::States { commands, play, .. } if play.is_some() || !commands.is_empty())
    }

    /// The gap between it and its partner; none where there is none.
    pub(crate) fn play(&self) -> Option<Play> {
        match self.source {
            Source::Commands { .. } => None,
            Source::States { play, .. } => play,
        }
    }

    /// The same, to be changed.
    pub(crate) fn play_mut(&mut self) -> Option<&mut Play> {
        match &mut self.source {
            Source::Commands { .. } => None,
            Source::States { play, .. } => play.as_mut(),
        }
    }

    /// The same, to be changed.
    pub(crate) fn turns_mut(&mut self) -> Option<&mut f64> {
        match &mut self.source {
            Source::Commands { .. } => None,
            Source::States { turns, .. } => turns.as_mut(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(source: Source) -> Hidden {
        Hidden { source, squared: true, time: 0.3 }
    }

    fn of_commands(commands: Vec<usize>, rest: Option<f64>) -> Hidden {
        of(Source::Commands { commands, rest })
    }

    fn of_states(states: Vec<usize>, rest: f64, turns: Option<f64>) -> Hidden {
        of(Source::States { states, commands: vec![], rest, settled: true, turns, play: None })
    }

    fn turning(commands: Vec<usize>, states: Vec<usize>, settled: bool, turns: Option<f64>) -> Hidden {
        of(Source::States { states, commands, rest: 0.25, settled, turns, play: None })
    }

    fn behind_a_gap(half: f64, damping: f64, turns: Option<f64>) -> Hidden {
        let play = Some(Play { half, damping });
        let source =
            Source::States { states: vec![1], commands: vec![], rest: 0.0, settled: false, turns, play };
        Hidden { source, squared: false, time: 0.3 }
    }

    #[test]
    fn what_fits_the_commands_and_states_of_a_model_is_accepted() {
        for right in [
            of_commands(vec![0], None),
            of_commands(vec![0], Some(0.25)),
            of_states(vec![0, 1], 0.25, None),
            of_states(vec![1], 0.25, Some(0.04)),
            behind_a_gap(0.01, 0.002, Some(0.04)),
            turning(vec![0], vec![], false, Some(0.04)),
        ] {
            assert_eq!(right.clone().validated(1, 2), Ok(right));
        }
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        for wrong in [
            of_commands(vec![], None),
            of_commands(vec![1], None),
            of_commands(vec![0], Some(f64::NAN)),
            of_states(vec![], 0.25, None),
            of_states(vec![2], 0.25, None),
            of_states(vec![1], f64::INFINITY, None),
            of_states(vec![1], 0.25, Some(0.0)),
            of_states(vec![1], 0.25, Some(f64::NAN)),
            turning(vec![0], vec![], false, None),
            turning(vec![0], vec![], true, Some(0.04)),
            turning(vec![1], vec![], false, Some(0.04)),
            turning(vec![0], vec![1], false, Some(0.04)),
            behind_a_gap(0.0, 0.002, Some(0.04)),
            behind_a_gap(0.01, f64::NAN, Some(0.04)),
            behind_a_gap(0.01, 0.002, None),
            Hidden { squared: true, ..behind_a_gap(0.01, 0.002, Some(0.04)) },
            Hidden { time: 0.0, ..of_states(vec![1], 0.25, None) },
            Hidden { time: f64::INFINITY, ..of_commands(vec![0], None) },
        ] {
            assert!(wrong.clone().validated(1, 2).is_err(), "{wrong:?}");
        }
    }
}
