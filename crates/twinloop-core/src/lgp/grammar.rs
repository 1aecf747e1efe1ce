//! The grammar: random programs, mutation of instructions, crossover of pages (paper, section V.A).

use super::instruction::{Instruction, Operand};
use super::operation::Operation;
use super::program::{Page, Program, Shape};
use crate::error::{Result, invalid};
use crate::rng::Stream;

/// What programs may look like and how they vary.
#[derive(Clone, Debug, PartialEq)]
pub struct Grammar {
    /// Registers.
    pub shape: Shape,
    /// Pages of a random program.
    pub pages: usize,
    /// Instructions of a page of a random program.
    pub page_length: usize,
    /// The function set.
    pub operations: Vec<Operation>,
    /// Whether an input may be overwritten: "the same symbol can represent the input or a temporary".
    pub writable_inputs: bool,
    /// Probability that a second operand is a constant.
    pub constant_share: f64,
    /// Smallest and largest magnitude of a fresh constant.
    pub constant_magnitudes: (f64, f64),
    /// Standard deviation of a mutated constant, as a share of its magnitude.
    pub constant_step: f64,
    /// Probability that an instruction is mutated; at least one always is.
    pub mutation_rate: f64,
    /// Probability that a crossover exchanges pages of the same place.
    pub aligned_pages: f64,
}

impl Grammar {
    /// Refuses a grammar that makes no program.
    pub fn validated(self) -> Result<Self> {
        let share = |x: f64| (0.0..=1.0).contains(&x);
        let (low, high) = self.constant_magnitudes;
        let complaint = if self.pages == 0 || self.page_length == 0 {
            format!(
                "expected at least one page of one instruction, found {} × {}",
                self.pages, self.page_length
            )
        } else if self.pages.saturating_mul(self.page_length) > Program::MOST_INSTRUCTIONS {
            format!(
                "expected at most {} instructions, found {} pages of {}",
                Program::MOST_INSTRUCTIONS,
                self.pages,
                self.page_length
            )
        } else if self.operations.is_empty() {
            "expected at least one operation, found none".to_owned()
        } else if !(low > 0.0 && low <= high && high.is_finite()) {
            format!("expected constant magnitudes 0 < low ≤ high, found {low} and {high}")
        } else if !(self.constant_step >= 0.0 && self.constant_step.is_finite()) {
            format!("expected a constant step of 0 or more, found {}", self.constant_step)
        } else if !(share(self.constant_share) && share(self.mutation_rate) && share(self.aligned_pages)) {
            "expected shares and rates between 0 and 1".to_owned()
        } else {
            return Ok(self);
        };
        invalid(format!("grammar: {complaint}"))
    }

    /// Refuses a program of other registers than the grammar's.
    pub fn check(&self, program: &Program) -> Result<()> {
        if program.shape() != self.shape {
            return invalid(format!(
                "grammar: expected registers {:?}, found {:?}",
                self.shape,
                program.shape()
            ));
        }
        Ok(())
    }

    /// A random program.
    pub fn random(&self, stream: &mut Stream) -> Program {
        let mut page = || Page((0..self.page_length).map(|_| self.instruction(stream)).collect());
        let pages = (0..self.pages).map(|_| page()).collect();
        Program::new(self.shape, pages).expect("a grammar names only registers of its shape")
    }

    /// A copy in which each instruction has one field redrawn with the mutation rate, at least one instruction.
    ///
    /// # Panics
    /// When the program is not one that [`check`](Self::check) accepts.
    pub fn mutate(&self, program: &Program, stream: &mut Stream) -> Program {
        self.check(program).expect("a program of the grammar's registers");
        let mut child = program.clone();
        let length = child.len();
        if length == 0 {
            return child;
        }
        let mut instructions = child.pages_mut().iter_mut().flat_map(|page| page.0.iter_mut());
        let mut chosen: Vec<usize> = (0..length).filter(|_| stream.chance(self.mutation_rate)).collect();
        if chosen.is_empty() {
            chosen.push(stream.below(length));
        }
        let mut next = 0;
        for place in chosen {
            let instruction = instructions.nth(place - next).expect("a place within the program");
            next = place + 1;
            self.redraw_field(instruction, stream);
        }
        child
    }

    /// Both programs with one page exchanged; one that would have more than [`Program::MOST_INSTRUCTIONS`] stays as it
    /// is.
    ///
    /// # Panics
    /// When one of the programs is not one that [`check`](Self::check) accepts.
    pub fn crossover(&self, first: &Program, second: &Program, stream: &mut Stream) -> (Program, Program) {
        for program in [first, second] {
            self.check(program).expect("a program of the grammar's registers");
        }
        let (m, n) = (first.pages().len(), second.pages().len());
        if m == 0 || n == 0 {
            return (first.clone(), second.clone());
        }
        let aligned = stream.chance(self.aligned_pages);
        let i = stream.below(if aligned { m.min(n) } else { m });
        let j = if aligned { i } else { stream.below(n) };
        let child = |parent: &Program, place: usize, page: &Page| {
            let mut child = parent.clone();
            child.pages_mut()[place] = page.clone();
            if child.len() > Program::MOST_INSTRUCTIONS { parent.clone() } else { child }
        };
        (child(first, i, &second.pages()[j]), child(second, j, &first.pages()[i]))
    }

    fn instruction(&self, stream: &mut Stream) -> Instruction {
        let operation = self.operations[stream.below(self.operations.len())];
        Instruction {
            operation,
            destination: self.destination(stream),
            first: self.register(stream),
            second: (!operation.is_unary()).then(|| self.operand(stream)),
        }
    }

    /// Redraws one of destination, operation, first operand, second operand and, where there is one, constant.
    fn redraw_field(&self, instruction: &mut Instruction, stream: &mut Stream) {
        let fields = match instruction.second {
            None => 3,
            Some(Operand::Register(_)) => 4,
            Some(Operand::Constant(_)) => 5,
        };
        match stream.below(fields) {
            0 => instruction.destination = self.destination(stream),
            1 => {
                instruction.operation = self.operations[stream.below(self.operations.len())];
                if instruction.operation.is_unary() {
                    instruction.second = None;
                } else if instruction.second.is_none() {
                    instruction.second = Some(self.operand(stream));
                }
            }
            2 => instruction.first = self.register(stream),
            3 => instruction.second = Some(self.operand(stream)),
            _ => {
                if let Some(Operand::Constant(constant)) = &mut instruction.second {
                    let moved = *constant * (1.0 + self.constant_step * stream.gaussian());
                    // A constant that grew past what a number can hold stays where it was.
                    *constant = if moved.is_finite() { moved } else { *constant };
                }
            }
        }
    }

    fn register(&self, stream: &mut Stream) -> u16 {
        stream.below(self.shape.registers) as u16
    }

    fn destination(&self, stream: &mut Stream) -> u16 {
        let first = if self.writable_inputs { 0 } else { self.shape.inputs };
        (first + stream.below(self.shape.registers - first)) as u16
    }

    fn operand(&self, stream: &mut Stream) -> Operand {
        if !stream.chance(self.constant_share) {
            return Operand::Register(self.register(stream));
        }
        let sign = if stream.chance(0.5) { 1.0 } else { -1.0 };
        let (low, high) = self.constant_magnitudes;
        Operand::Constant(sign * stream.log_uniform(low, high))
    }
}
