//! The outcome of a run: an error, or how long it lasted. Divergence is a value and no large number.

/// How a free run of a model went beside the recorded one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// It lasted as long as the record: its mean squared error over steps and states.
    Followed(f64),
    /// It left the limits of a state, or stopped being finite.
    Diverged {
        /// Steps before that.
        lasted: usize,
        /// Steps of the record.
        of: usize,
    },
}

impl Outcome {
    /// The error; infinite for a run that diverged.
    pub fn error(self) -> f64 {
        match self {
            Self::Followed(error) => error,
            Self::Diverged { .. } => f64::INFINITY,
        }
    }

    /// Steps that the run lasted, beside a record of `steps` steps.
    pub fn lasted(self, steps: usize) -> usize {
        match self {
            Self::Followed(_) => steps,
            Self::Diverged { lasted, .. } => lasted,
        }
    }

    /// The number that the ranking of the paper's model loop sees: a run that diverges after t of n steps is worth
    /// 1e6 (2 − t / n), finite and ordered by the time it lasted (specification, section 3).
    pub(super) fn ranked(self) -> f64 {
        match self {
            Self::Followed(error) if error.is_finite() => error,
            Self::Followed(_) => Self::AT_ONCE.ranked(),
            Self::Diverged { lasted, of } => 1e6 * (2.0 - lasted as f64 / of as f64),
        }
    }

    /// A run that diverges in its first step.
    pub(super) const AT_ONCE: Self = Self::Diverged { lasted: 0, of: 1 };
}
