//! The text form of a program, which a person can read and which parses back to the same program.
//!
//! ```text
//! program inputs=2 outputs=1 registers=4
//! page 1
//!   r3 = r0 * 0.5
//!   r2 = sin(r3)
//! page 2
//!   r2 = min(r2, r1)
//! ```

use std::fmt;
use std::str::FromStr;

use super::instruction::{Instruction, Operand};
use super::operation::Operation;
use super::program::{Page, Program, Shape, check};
use crate::error::{Error, Result};

impl fmt::Display for Operand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Register(register) => write!(f, "r{register}"),
            Self::Constant(constant) => write!(f, "{constant:?}"),
        }
    }
}

impl fmt::Display for Instruction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { operation, destination, first, second } = self;
        let name = operation.name();
        match (second, operation) {
            (None, _) => write!(f, "r{destination} = {name}(r{first})"),
            (Some(second), Operation::Min | Operation::Max) => {
                write!(f, "r{destination} = {name}(r{first}, {second})")
            }
            (Some(second), _) => write!(f, "r{destination} = r{first} {name} {second}"),
        }
    }
}

impl fmt::Display for Program {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Shape { inputs, outputs, registers } = self.shape();
        writeln!(f, "program inputs={inputs} outputs={outputs} registers={registers}")?;
        for (number, page) in self.pages().iter().enumerate() {
            writeln!(f, "page {}", number + 1)?;
            for instruction in &page.0 {
                writeln!(f, "  {instruction}")?;
            }
        }
        Ok(())
    }
}

impl FromStr for Program {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let mut lines = text
            .lines()
            .enumerate()
            .map(|(i, line)| (i + 1, line.trim()))
            .filter(|(_, line)| !line.is_empty());
        let (line, header) = lines.next().unwrap_or((1, ""));
        let shape = parse_header(header).map_err(|message| Error::Parse { line, message })?;
        let mut pages: Vec<Page> = Vec::new();
        let mut count = 0;
        for (line, content) in lines {
            let parse_error = |message| Error::Parse { line, message };
            if let Some(number) = content.strip_prefix("page ") {
                if number.trim().parse() != Ok(pages.len() + 1) {
                    let expected = pages.len() + 1;
                    return Err(parse_error(format!("expected \"page {expected}\", found {content:?}")));
                }
                pages.push(Page::default());
                continue;
            }
            let Some(page) = pages.last_mut() else {
                return Err(parse_error(format!("expected \"page 1\", found {content:?}")));
            };
            count += 1;
            if count > Self::MOST_INSTRUCTIONS {
                return Err(parse_error(format!(
                    "expected at most {} instructions",
                    Self::MOST_INSTRUCTIONS
                )));
            }
            let instruction = parse_instruction(content).map_err(parse_error)?;
            check(&shape, &instruction).map_err(|error| parse_error(error.to_string()))?;
            page.0.push(instruction);
        }
        Self::new(shape, pages)
    }
}

/// `program inputs=2 outputs=1 registers=4`
fn parse_header(line: &str) -> std::result::Result<Shape, String> {
    let expected = || {
        let example = "program inputs=10 outputs=6 registers=20";
        format!("expected a header like {example:?}, found {:?}", excerpt(line))
    };
    let words: Vec<&str> = line.split_whitespace().collect();
    let [first, inputs, outputs, registers] = words[..] else {
        return Err(expected());
    };
    let number = |word: &str, name: &str| -> std::result::Result<usize, String> {
        let value = word.strip_prefix(name).and_then(|rest| rest.strip_prefix('='));
        value.and_then(|value| value.parse().ok()).ok_or_else(expected)
    };
    let (inputs, outputs, registers) =
        (number(inputs, "inputs")?, number(outputs, "outputs")?, number(registers, "registers")?);
    if first != "program" {
        return Err(expected());
    }
    let Some(spare) = registers.checked_sub(inputs.saturating_add(outputs)) else {
        return Err(format!(
            "expected registers for {inputs} inputs and {outputs} outputs, found {registers}"
        ));
    };
    Shape::new(inputs, outputs, spare).map_err(|error| error.to_string())
}

/// `r3 = r0 * 0.5`, `r2 = sin(r3)` or `r2 = min(r2, r1)`
fn parse_instruction(line: &str) -> std::result::Result<Instruction, String> {
    let expected = || {
        let found = excerpt(line);
        format!("expected an instruction like \"r3 = r0 * 0.5\" or \"r2 = sin(r3)\", found {found:?}")
    };
    let (destination, expression) = line.split_once('=').ok_or_else(expected)?;
    let destination = parse_register(destination)?;
    let expression = expression.trim();
    if let Some((name, arguments)) = expression.split_once('(') {
        let operation = Operation::from_str(name.trim()).map_err(|error| error.to_string())?;
        let arguments = arguments.strip_suffix(')').ok_or_else(expected)?;
        let (first, second) = match arguments.split_once(',') {
            Some((first, second)) => (first, Some(parse_operand(second)?)),
            None => (arguments, None),
        };
        return Ok(Instruction { operation, destination, first: parse_register(first)?, second });
    }
    let words: Vec<&str> = expression.split_whitespace().collect();
    let [first, operation, second] = words[..] else {
        return Err(expected());
    };
    Ok(Instruction {
        operation: Operation::from_str(operation).map_err(|error| error.to_string())?,
        destination,
        first: parse_register(first)?,
        second: Some(parse_operand(second)?),
    })
}

fn parse_register(word: &str) -> std::result::Result<u16, String> {
    let number = word.trim().strip_prefix('r').and_then(|number| number.parse().ok());
    number.ok_or_else(|| format!("expected a register like \"r3\", found {:?}", excerpt(word.trim())))
}

fn parse_operand(word: &str) -> std::result::Result<Operand, String> {
    let word = word.trim();
    match word.parse() {
        Ok(constant) => Ok(Operand::Constant(constant)),
        Err(_) if word.starts_with('r') => parse_register(word).map(Operand::Register),
        Err(_) => Err(format!("expected a register or a number, found {:?}", excerpt(word))),
    }
}

/// The start of a text from elsewhere, short enough for a message.
fn excerpt(text: &str) -> String {
    text.chars().take(60).collect()
}
