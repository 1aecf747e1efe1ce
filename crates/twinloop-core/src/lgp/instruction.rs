//! One instruction: a destination register, an operation, a register and a register or constant.

use super::operation::Operation;

/// The second operand of an instruction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Operand {
    /// A register by its number.
    Register(u16),
    /// The instruction's own constant.
    Constant(f64),
}

/// `destination = first operation second`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instruction {
    /// What is computed.
    pub operation: Operation,
    /// The register that is written.
    pub destination: u16,
    /// The first operand.
    pub first: u16,
    /// The second operand; none under a unary operation.
    pub second: Option<Operand>,
}

impl Instruction {
    /// The registers that are read.
    pub fn reads(&self) -> impl Iterator<Item = u16> {
        let second = match self.second {
            Some(Operand::Register(register)) => Some(register),
            _ => None,
        };
        std::iter::once(self.first).chain(second)
    }
}
