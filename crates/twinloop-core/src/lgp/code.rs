//! Code: a program without its introns, ready to run on lanes by an interpreter.

use super::instruction::Operand;
use super::interpreter::{Step, interpret};
use super::program::Program;
use crate::lanes::{Vector, filled};

/// The effective part of a program. Two programs with equal code are the same function, bit for bit.
#[derive(Clone, Debug)]
pub struct Code {
    steps: Vec<Step>,
    constants: Vec<f64>,
    registers: usize,
    /// Registers that must be set to 0 before a run.
    zeroed: Vec<u16>,
    /// Inputs that the outputs depend on.
    inputs: Vec<u16>,
    outputs: std::ops::Range<usize>,
}

impl PartialEq for Code {
    fn eq(&self, other: &Self) -> bool {
        // Bits, not values: 0.0 and -0.0 are different functions.
        let bits = |code: &Self| code.constants.iter().map(|c| c.to_bits()).collect::<Vec<_>>();
        self.steps == other.steps
            && self.outputs == other.outputs
            && self.zeroed == other.zeroed
            && self.inputs == other.inputs
            && bits(self) == bits(other)
    }
}

/// The registers of a run, as wide as a vector, constants behind them.
#[derive(Clone)]
pub struct Bank<V>(Vec<V>);

/// Where inputs come from. A trait and not a closure, because only a named function can be made to be inlined.
pub trait Inputs<V> {
    /// The `i`-th input.
    fn input(&self, i: usize) -> V;
}

impl<V: Vector> Inputs<V> for Vec<V> {
    #[inline(always)]
    fn input(&self, i: usize) -> V {
        self[i]
    }
}

impl Code {
    /// The effective part of a program.
    pub fn new(program: &Program) -> Self {
        let shape = program.shape();
        let effect = program.effect();
        let mut constants = Vec::new();
        let mut steps: Vec<Step> = Vec::with_capacity(program.len());
        let effective = program.instructions().zip(&effect.effective).filter(|(_, effective)| **effective);
        for (instruction, _) in effective {
            let second = match instruction.second {
                None => instruction.first,
                Some(Operand::Register(register)) => register,
                Some(Operand::Constant(constant)) => {
                    constants.push(constant);
                    (shape.registers + constants.len() - 1) as u16
                }
            };
            let operands = [instruction.first, second];
            steps.push(Step::new(instruction.operation, instruction.destination, operands, steps.last()));
        }
        let live = |range: std::ops::Range<usize>| {
            range.filter(|&register| effect.live_at_start[register]).map(|register| register as u16).collect()
        };
        Self {
            steps,
            constants,
            registers: shape.registers,
            zeroed: live(shape.inputs..shape.registers),
            inputs: live(0..shape.inputs),
            outputs: shape.output_registers(),
        }
    }

    /// Number of instructions that are left.
    pub fn len(&self) -> usize {
        self.steps.len()
    }

    /// Whether nothing is computed at all.
    pub fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }

    /// Registers for the rows of a vector, to be used with this code only.
    pub fn bank<V: Vector>(&self) -> Bank<V> {
        Bank(filled(self.registers, &self.constants))
    }

    /// The same with constants of each lane's own, in the order of [`Code::constants`].
    pub fn bank_of<V: Vector>(&self, constants: &[V]) -> Bank<V> {
        let mut bank = self.bank();
        bank.0[self.registers..].copy_from_slice(constants);
        bank
    }

    /// Constants, in the order of the instructions that hold them.
    pub fn constants(&self) -> &[f64] {
        &self.constants
    }

    /// Runs the code on inputs that are asked for only where they matter, and returns the outputs.
    #[inline(always)]
    #[allow(unsafe_code)]
    pub fn run<'b, V: Vector>(&self, bank: &'b mut Bank<V>, inputs: &impl Inputs<V>) -> &'b [V] {
        // A slice: what is written to it cannot change where it lies.
        let registers = &mut bank.0[..];
        for &register in &self.zeroed {
            registers[usize::from(register)] = V::splat(0.0);
        }
        for &register in &self.inputs {
            registers[usize::from(register)] = inputs.input(usize::from(register));
        }
        assert_eq!(registers.len(), self.registers + self.constants.len(), "a bank belongs to one code");
        // SAFETY: a program's registers are checked when it is made, the constants are numbered behind them by
        // `Code::new`, and the bank has as many registers as both.
        unsafe { interpret(&self.steps, registers) };
        &registers[self.outputs.clone()]
    }
}
