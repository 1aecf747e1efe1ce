//! The one error of the core: misuse, said as what was expected, what was found and what to do.

/// Misuse of the core by its caller. A numerical failure is never an error, it is a value.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// An argument that cannot be used, with the sentence that says why.
    #[error("{0}")]
    Invalid(String),
    /// A program text that does not parse.
    #[error("line {line}: {message}")]
    Parse {
        /// Line of the text, counted from 1.
        line: usize,
        /// What was expected there and what was found.
        message: String,
    },
}

/// Shorthand for results of the core.
pub type Result<T> = std::result::Result<T, Error>;

/// An [`Error::Invalid`] with this sentence.
pub fn invalid<T>(sentence: impl Into<String>) -> Result<T> {
    Err(Error::Invalid(sentence.into()))
}
