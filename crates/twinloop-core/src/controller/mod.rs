//! Controllers: families with a bounded parameter vector, one implementation for the search and for the real run.

mod mixer;
mod parameters;
mod pid;
mod single;
mod state_feedback;

pub use mixer::Mixer;
pub use parameters::Parameters;
pub use pid::{Axis, Pid};
pub use single::Controller;
pub use state_feedback::StateFeedback;

use crate::error::{Result, invalid};
use crate::lanes::Vector;
use crate::signals::Signals;

/// A control law. Parameters, memory and signals are lanes: several controllers of the family at once.
pub trait Law {
    /// Lanes of memory that a controller carries from step to step, zero at the start of a run.
    fn memory(&self) -> usize;

    /// Writes the command (n_u) for a state (n_x) and a target (n_x), and moves the memory on by one period.
    fn command<V: Vector>(
        &self,
        parameters: &[V],
        memory: &mut [V],
        state: &[V],
        target: &[V],
        command: &mut [V],
    );
}

/// The families there are. A new one is a file here and a line in each match.
#[derive(Clone, Debug, PartialEq)]
enum AnyLaw {
    Pid(Pid),
    StateFeedback(StateFeedback),
}

/// A law, the box of its parameters, and the states and commands that it is for.
#[derive(Clone, Debug, PartialEq)]
pub struct Family {
    law: AnyLaw,
    parameters: Parameters,
    states: usize,
    bounds: Vec<(f64, f64)>,
}

impl Family {
    /// The family of the controllers of one [`Pid`].
    pub fn pid(pid: Pid, parameters: Parameters, states: usize) -> Result<Self> {
        let expected = 3 * pid.axes.len();
        if parameters.len() != expected {
            return invalid(format!(
                "controller: expected bounds for {expected} gains (K_P, K_I, K_D of each axis), found {}",
                parameters.len()
            ));
        }
        pid.check(states)?;
        let bounds = pid.output.bounds().to_vec();
        Ok(Self { law: AnyLaw::Pid(pid), parameters, states, bounds })
    }

    /// The family of the controllers of one [`StateFeedback`].
    pub fn state_feedback(feedback: StateFeedback, parameters: Parameters, states: usize) -> Result<Self> {
        feedback.check(states)?;
        let expected = feedback.gains();
        if parameters.len() != expected {
            return invalid(format!(
                "controller: expected bounds for {expected} gains (each output's states and integrals), found {}",
                parameters.len()
            ));
        }
        let bounds = feedback.output.bounds().to_vec();
        Ok(Self { law: AnyLaw::StateFeedback(feedback), parameters, states, bounds })
    }

    /// The box of the parameters.
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

    /// Adds an excitation (n_u) to what the law commanded (n_u), and clips the sum to the bounds of the commands.
    #[inline(always)]
    pub fn excite<V: Vector>(&self, command: &mut [V], excitation: &[V]) {
        for ((command, excitation), &(low, high)) in command.iter_mut().zip(excitation).zip(&self.bounds) {
            *command = (*command + *excitation).clamp(low, high);
        }
    }

    /// Refuses signals of another number of states or commands.
    pub(crate) fn check(&self, signals: &Signals) -> Result<()> {
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
        Ok(())
    }
}

impl Law for Family {
    fn memory(&self) -> usize {
        match &self.law {
            AnyLaw::Pid(pid) => pid.memory(),
            AnyLaw::StateFeedback(feedback) => feedback.memory(),
        }
    }

    #[inline(always)]
    fn command<V: Vector>(
        &self,
        parameters: &[V],
        memory: &mut [V],
        state: &[V],
        target: &[V],
        command: &mut [V],
    ) {
        match &self.law {
            AnyLaw::Pid(pid) => pid.command(parameters, memory, state, target, command),
            AnyLaw::StateFeedback(feedback) => feedback.command(parameters, memory, state, target, command),
        }
    }
}
