//! Linear genetic programming: pages of instructions over registers (paper, section V.A).

mod code;
mod grammar;
mod instruction;
mod interpreter;
mod introns;
mod learnt;
mod operation;
mod program;
mod text;

pub use code::{Bank, Code, Inputs};
pub use grammar::Grammar;
pub use instruction::{Instruction, Operand};
pub use learnt::Learnt;
pub use operation::Operation;
pub use program::{Page, Program, Shape};
