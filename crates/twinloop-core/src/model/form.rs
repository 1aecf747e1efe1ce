//! Forms: what the outputs of a program mean (paper, section IV.A; specification, section 4).

use std::str::FromStr;

use crate::error::{Error, Result, invalid};
use crate::signals::Signals;

/// What the outputs of a program mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// The next state.
    Absolute,
    /// What is added to the state.
    Increment,
    /// The derivative of each state whose motion no other states are declared to give, integrated by RK4.
    Acceleration,
}

impl Form {
    /// Every form.
    pub const ALL: [Self; 3] = [Self::Absolute, Self::Increment, Self::Acceleration];

    /// The name that [`FromStr`] reads.
    pub fn name(self) -> &'static str {
        match self {
            Self::Absolute => "absolute",
            Self::Increment => "increment",
            Self::Acceleration => "acceleration",
        }
    }

    /// Inputs (states, then commands) and outputs that a program must have where nothing is hidden.
    pub fn shape(self, signals: &Signals) -> (usize, usize) {
        let outputs = match self {
            Self::Absolute | Self::Increment => signals.states(),
            Self::Acceleration => (0..signals.states()).filter(|&state| !signals.is_given(state)).count(),
        };
        (signals.states() + signals.commands(), outputs)
    }
}

impl FromStr for Form {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        match Self::ALL.into_iter().find(|form| form.name() == name) {
            Some(form) => Ok(form),
            None => invalid(format!(
                "form: expected one of {}, found {name:?}",
                Self::ALL.map(Self::name).join(", ")
            )),
        }
    }
}
