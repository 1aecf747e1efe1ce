//! A family: a law, which of its gains are parameters and which are fixed numbers, and what it is for.

use std::sync::Arc;

use super::foreign::{self, ForeignController, ForeignLaw};
use super::parameters::{Gain, Parameters};
use super::{AnyLaw, Law};
use crate::difference::Periods;
use crate::error::{Result, invalid};
use crate::lanes::{Vector, zeros};
use crate::signals::Signals;

/// A law, the box of its parameters, and the states and commands that it is for.
#[derive(Clone, Debug)]
pub struct Family {
    law: Source,
    gains: Vec<Gain>,
    parameters: Parameters,
    states: usize,
    periods: Periods,
    bounds: Vec<(f64, f64)>,
}

/// Where a law is written.
#[derive(Clone, Debug)]
enum Source {
    Engine(AnyLaw),
    Foreign(Arc<dyn ForeignLaw>),
}

/// Controllers of a family with their memory, one a lane.
pub struct Controllers<V> {
    /// All gains of the law, the fixed ones too.
    gains: Vec<V>,
    memory: Vec<V>,
    /// Those of a foreign law, which have a memory of their own.
    foreign: Vec<Box<dyn ForeignController>>,
}

impl<V: Vector> Controllers<V> {
    /// The same with the same memory, to be run ahead of them; none of a foreign law, whose memory is its own.
    pub fn ahead(&self) -> Option<Self> {
        let own = self.foreign.is_empty();
        own.then(|| Self { gains: self.gains.clone(), memory: self.memory.clone(), foreign: vec![] })
    }

    /// The same in the midst of the same run, with a memory of their own.
    pub fn copied(&self) -> Self {
        let foreign = self.foreign.iter().map(|controller| controller.copied()).collect();
        Self { gains: self.gains.clone(), memory: self.memory.clone(), foreign }
    }

    /// Back to the start of a run.
    pub fn reset(&mut self) {
        self.memory.fill(V::splat(0.0));
        self.foreign.iter_mut().for_each(|controller| controller.reset());
    }
}

impl Family {
    /// The controllers of a law that differ by the gains that are free.
    pub fn new(law: impl Into<AnyLaw>, gains: Vec<Gain>, states: usize) -> Result<Self> {
        let law = law.into();
        law.check(states)?;
        let (expected, bounds) = (law.gains(), law.output().bounds().to_vec());
        Self::of(Source::Engine(law), expected, gains, states, bounds)
    }

    /// The controllers of a law outside of the engine, for so many states and for commands of these bounds.
    pub fn foreign(
        law: Arc<dyn ForeignLaw>,
        gains: Vec<Gain>,
        states: usize,
        bounds: Vec<(f64, f64)>,
    ) -> Result<Self> {
        let expected = law.gains();
        Self::of(Source::Foreign(law), expected, gains, states, bounds)
    }

    fn of(
        law: Source,
        expected: usize,
        gains: Vec<Gain>,
        states: usize,
        bounds: Vec<(f64, f64)>,
    ) -> Result<Self> {
        if gains.len() != expected {
            return invalid(format!(
                "controller: expected bounds or numbers for {expected} gains, found {}",
                gains.len()
            ));
        }
        let (mut low, mut high, mut logarithmic) = (vec![], vec![], vec![]);
        for gain in &gains {
            match *gain {
                Gain::Fixed(value) if value.is_finite() => {}
                Gain::Fixed(value) => {
                    return invalid(format!("controller: expected finite gains, found {value}"));
                }
                Gain::Free { low: least, high: most, logarithmic: decades } => {
                    low.push(least);
                    high.push(most);
                    logarithmic.push(decades);
                }
            }
        }
        if low.is_empty() {
            return invalid(
                "controller: expected at least one gain with bounds, found numbers for all of them; there would be \
                 nothing to tune",
            );
        }
        let parameters = Parameters::new(&low, &high, &logarithmic)?;
        Ok(Self { law, gains, parameters, states, periods: Periods::default(), bounds })
    }

    /// The same for states of which some are periodic: errors take the short way.
    pub fn with_periods(self, periods: Periods) -> Self {
        Self { periods, ..self }
    }

    /// Which states are periodic.
    pub fn periods(&self) -> &Periods {
        &self.periods
    }

    /// The box of the parameters: the gains that are free.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// Number of states that the law reads, n_x.
    pub fn states(&self) -> usize {
        self.states
    }

    /// Number of commands that the law writes, n_u.
    pub fn commands(&self) -> usize {
        self.bounds.len()
    }

    /// Whether the law is outside of the engine, and so may only be called on the thread that asked for the work.
    pub fn is_foreign(&self) -> bool {
        matches!(self.law, Source::Foreign(_))
    }

    /// Controllers of these parameters (size) at the start of a run. By a call: each loop would have a copy of it.
    #[inline(never)]
    pub fn start<V: Vector>(&self, parameters: &[V]) -> Controllers<V> {
        let mut parameters = parameters.iter();
        let mut gains = Vec::with_capacity(self.gains.len());
        for gain in &self.gains {
            gains.push(match gain {
                Gain::Fixed(value) => V::splat(*value),
                Gain::Free { .. } => *parameters.next().expect("a number for each free gain"),
            });
        }
        let (memory, foreign) = match &self.law {
            Source::Engine(law) => (zeros(law.memory()), vec![]),
            Source::Foreign(law) => (vec![], foreign::start(&**law, &gains)),
        };
        Controllers { gains, memory, foreign }
    }

    /// Writes the command (n_u) for a state (n_x) and a target (n_x), and moves the controllers on by one period.
    #[inline(always)]
    pub fn command<V: Vector>(
        &self,
        controllers: &mut Controllers<V>,
        state: &[V],
        target: &[V],
        command: &mut [V],
    ) {
        let Controllers { gains, memory, foreign } = controllers;
        match &self.law {
            Source::Engine(law) => law.command(&self.periods, gains, memory, state, target, command),
            Source::Foreign(_) => foreign::ask(foreign, &self.bounds, state, target, command),
        }
    }

    /// Adds as many numbers to what the law commanded (n_u), and clips the sum to the bounds of the commands.
    #[inline(always)]
    pub fn excite<V: Vector>(&self, command: &mut [V], added: impl Iterator<Item = V>) {
        for ((command, added), &(low, high)) in command.iter_mut().zip(added).zip(&self.bounds) {
            *command = (*command + added).clamp(low, high);
        }
    }

    /// Refuses signals of another number of states, other bounds of the commands or another period of theirs, or with
    /// other periods of the states.
    pub fn check(&self, signals: &Signals) -> Result<()> {
        if (self.states, self.commands()) != (signals.states(), signals.commands()) {
            return invalid(format!(
                "controllers: expected controllers of {} states and {} commands, found {} and {}; make the family for \
                 these signals",
                signals.states(),
                signals.commands(),
                self.states,
                self.commands()
            ));
        }
        let dt = match &self.law {
            Source::Engine(law) => law.dt(),
            Source::Foreign(_) => signals.dt,
        };
        if self.bounds != signals.command_bounds || dt != signals.dt {
            return invalid(format!(
                "controllers: expected a period of {} s and commands within {:?}, found {dt} s and {:?}; make the family \
                 for these signals",
                signals.dt, signals.command_bounds, self.bounds
            ));
        }
        if self.periods != signals.periods {
            return invalid(format!(
                "controllers: expected the periods {:?} of the states, found {:?}; make the family for these signals",
                signals.periods, self.periods
            ));
        }
        Ok(())
    }
}
