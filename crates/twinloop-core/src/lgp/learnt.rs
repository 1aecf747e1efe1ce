//! A program that was learnt: what is varied, and what is run.

use super::code::Code;
use super::program::Program;

/// A program and its effective part, found once.
#[derive(Debug)]
pub struct Learnt {
    /// What is varied.
    pub program: Program,
    /// What is run.
    pub code: Code,
}

impl Learnt {
    /// A program with its introns found.
    pub fn new(program: Program) -> Self {
        let code = Code::new(&program);
        Self { program, code }
    }
}
