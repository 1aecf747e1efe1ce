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
    /// The same derivatives, in one explicit Euler step a period: every state goes on by what it changed by at its start.
    ExplicitEuler,
    /// The same in one semi-implicit step: a state goes on by its derivative at the end of the period where that is
    /// another state (E. Hairer, C. Lubich, G. Wanner, *Geometric Numerical Integration*, 2nd edition, 2006, section I.1.2).
    SemiImplicitEuler,
}

impl Form {
    /// Every form.
    pub const ALL: [Self; 5] =
        [Self::Absolute, Self::Increment, Self::Acceleration, Self::ExplicitEuler, Self::SemiImplicitEuler];

    /// The name that [`FromStr`] reads.
    pub fn name(self) -> &'static str {
        match self {
            Self::Absolute => "absolute",
            Self::Increment => "increment",
            Self::Acceleration => "acceleration",
            Self::ExplicitEuler => "explicit-euler",
            Self::SemiImplicitEuler => "semi-implicit-euler",
        }
    }

    /// Whether outputs are derivatives of the states that no others give.
    pub fn gives_derivatives(self) -> bool {
        !matches!(self, Self::Absolute | Self::Increment)
    }

    /// Inputs (states, then commands) and outputs that a program must have where nothing is hidden.
    pub fn shape(self, signals: &Signals) -> (usize, usize) {
        let given = |state| self.gives_derivatives() && signals.is_given(state);
        let outputs = (0..signals.states()).filter(|&state| !given(state)).count();
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
