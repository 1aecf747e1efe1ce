//! A program: a fixed sequence of pages of instructions over a bank of registers.

use super::instruction::{Instruction, Operand};
use crate::error::{Result, invalid};

/// How the registers of a program are shared out: inputs first, then outputs, then spare ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Registers that hold an input at the start.
    pub inputs: usize,
    /// Registers that are read at the end; 0 at the start.
    pub outputs: usize,
    /// All registers. The spare ones hold 0 at the start.
    pub registers: usize,
}

impl Shape {
    /// More registers than this are refused: a text from elsewhere must not choose how much memory is taken.
    pub const MOST_REGISTERS: usize = 1 << 12;

    /// The shape with `spare` registers beside inputs and outputs.
    pub fn new(inputs: usize, outputs: usize, spare: usize) -> Result<Self> {
        let registers = inputs.saturating_add(outputs).saturating_add(spare);
        if inputs == 0 || outputs == 0 || registers > Self::MOST_REGISTERS {
            return invalid(format!(
                "registers: expected at least one input, one output and at most {} in all, found {inputs} inputs, \
                 {outputs} outputs and {spare} spare",
                Self::MOST_REGISTERS
            ));
        }
        Ok(Self { inputs, outputs, registers })
    }

    /// The registers that are read at the end.
    pub fn output_registers(&self) -> std::ops::Range<usize> {
        self.inputs..self.inputs + self.outputs
    }
}

/// The unit of crossover.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Page(pub Vec<Instruction>);

/// Pages of instructions, run from first to last.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    shape: Shape,
    pages: Vec<Page>,
}

impl Program {
    /// More instructions than this are refused.
    pub const MOST_INSTRUCTIONS: usize = 1 << 15;

    /// A program of these pages; every register that they name must exist, every constant be finite.
    pub fn new(shape: Shape, pages: Vec<Page>) -> Result<Self> {
        let program = Self { shape, pages };
        if program.len() > Self::MOST_INSTRUCTIONS {
            return invalid(format!(
                "program: expected at most {} instructions, found {}",
                Self::MOST_INSTRUCTIONS,
                program.len()
            ));
        }
        program.instructions().try_for_each(|instruction| check(&shape, instruction))?;
        Ok(program)
    }

    /// The registers.
    pub fn shape(&self) -> Shape {
        self.shape
    }

    /// The pages, first to last.
    pub fn pages(&self) -> &[Page] {
        &self.pages
    }

    /// The pages, to be varied by the grammar, which keeps them valid.
    pub(super) fn pages_mut(&mut self) -> &mut [Page] {
        &mut self.pages
    }

    /// The instructions of all pages in the order in which they run.
    pub fn instructions(&self) -> impl DoubleEndedIterator<Item = &Instruction> {
        self.pages.iter().flat_map(|page| page.0.iter())
    }

    /// The same program with other constants, in the order of the instructions that hold one.
    pub fn with_constants(&self, constants: &[f64]) -> Result<Self> {
        let mut values = constants.iter();
        let mut pages = self.pages.clone();
        for instruction in pages.iter_mut().flat_map(|page| &mut page.0) {
            if let Some(Operand::Constant(constant)) = &mut instruction.second {
                let Some(&value) = values.next() else {
                    return invalid(
                        "constants: expected one for each instruction that holds one, found fewer",
                    );
                };
                *constant = value;
            }
        }
        if values.next().is_some() {
            return invalid("constants: expected one for each instruction that holds one, found more");
        }
        Self::new(self.shape, pages)
    }

    /// Number of instructions.
    pub fn len(&self) -> usize {
        self.pages.iter().map(|page| page.0.len()).sum()
    }

    /// Whether there is no instruction at all.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Refuses an instruction that names a register that is not there, or a constant that is not finite.
pub(super) fn check(shape: &Shape, instruction: &Instruction) -> Result<()> {
    let registers = shape.registers;
    let named = instruction.reads().chain([instruction.destination]);
    if let Some(register) = named.into_iter().find(|&r| usize::from(r) >= registers) {
        return invalid(format!("expected registers r0 to r{}, found r{register}", registers - 1));
    }
    match instruction.second {
        Some(Operand::Constant(c)) if !c.is_finite() => {
            invalid(format!("expected a finite constant, found {c}"))
        }
        Some(_) if instruction.operation.is_unary() => {
            invalid(format!("expected one operand of {}, found two", instruction.operation.name()))
        }
        None if !instruction.operation.is_unary() => {
            invalid(format!("expected two operands of {}, found one", instruction.operation.name()))
        }
        _ => Ok(()),
    }
}
