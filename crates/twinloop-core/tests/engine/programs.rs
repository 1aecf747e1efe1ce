//! Programs: what they compute, and what of them does not matter.

use proptest::prelude::*;
use twinloop_core::{
    Code, Instruction, Operand, Operation, Page, Program, Scalar, Shape, Vector, Width, run_rows,
};

use crate::oracle::{all_same, evaluate};
use crate::worlds::any_program;

fn outputs(program: &Program, inputs: &[f64]) -> Vec<f64> {
    run_rows(&Code::new(program), &[inputs], Width::Baseline)
}

/// Numbers of every kind, infinities and NaN among them.
fn inputs() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(prop_oneof![4 => -3.0..3.0, 1 => any::<f64>()], 4)
}

/// A program that differs from another by what `edit` does to the list of its instructions.
fn edited(program: &Program, edit: impl FnOnce(&mut Vec<Instruction>)) -> Program {
    let mut instructions = program.instructions().copied().collect();
    edit(&mut instructions);
    Program::new(program.shape(), vec![Page(instructions)]).unwrap()
}

fn instruction(operation: Operation, destination: u16, first: u16, second: Operand) -> Instruction {
    Instruction { operation, destination, first, second: (!operation.is_unary()).then_some(second) }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2048))]

    #[test]
    fn code_computes_what_the_instructions_say(program in any_program(), inputs in inputs()) {
        let inputs = &inputs[..program.shape().inputs];
        let (found, expected) = (outputs(&program, inputs), evaluate(&program, inputs));
        prop_assert!(all_same(&found, &expected), "{found:?} {expected:?}\n{program}");
    }

    #[test]
    fn removing_introns_never_changes_an_output(program in any_program(), inputs in inputs()) {
        let (inputs, effective) = (&inputs[..program.shape().inputs], program.effective());
        prop_assert!(all_same(&evaluate(&effective, inputs), &evaluate(&program, inputs)));
        prop_assert_eq!(Code::new(&effective), Code::new(&program));
        prop_assert_eq!(effective.len(), Code::new(&program).len());
        prop_assert_eq!(effective.pages().len(), program.pages().len());
        let share = 1.0 - effective.len() as f64 / program.len().max(1) as f64;
        prop_assert!(program.is_empty() || (program.intron_share() - share).abs() < 1e-12);
    }

    #[test]
    fn the_effective_part_of_an_effective_part_is_all_of_it(program in any_program()) {
        let effective = program.effective();
        prop_assert_eq!(effective.effective(), effective.clone());
        prop_assert_eq!(effective.intron_share(), 0.0);
    }

    /// An independent definition: an instruction is effective if and only if its value flows, from the instruction
    /// that wrote a register last to those that read it next, into an output.
    #[test]
    fn an_instruction_is_kept_if_and_only_if_its_value_flows_into_an_output(program in any_program()) {
        let instructions: Vec<Instruction> = program.instructions().copied().collect();
        let last_writer = |register: u16, before: usize| {
            (0..before).rev().find(|&i| instructions[i].destination == register)
        };
        let mut to_visit: Vec<usize> = program
            .shape()
            .output_registers()
            .filter_map(|output| last_writer(output as u16, instructions.len()))
            .collect();
        let mut flows = vec![false; instructions.len()];
        while let Some(i) = to_visit.pop() {
            if !std::mem::replace(&mut flows[i], true) {
                to_visit.extend(instructions[i].reads().filter_map(|register| last_writer(register, i)));
            }
        }
        let kept: Vec<Instruction> =
            instructions.iter().zip(&flows).filter(|(_, flows)| **flows).map(|(one, _)| *one).collect();
        prop_assert_eq!(program.effective().instructions().copied().collect::<Vec<_>>(), kept);
    }

    #[test]
    fn programs_with_equal_code_are_equal_functions(
        program in any_program(),
        place in any::<prop::sample::Index>(),
        other in any::<(prop::sample::Index, u16)>(),
        inputs in inputs(),
    ) {
        prop_assume!(!program.is_empty());
        let shape = program.shape();
        let inputs = &inputs[..shape.inputs];
        let neighbour = edited(&program, |instructions| {
            let operation = *other.0.get(&Operation::ALL);
            let register = other.1 % shape.registers as u16;
            *place.get_mut(instructions) = instruction(operation, register, 0, Operand::Register(register));
        });
        if Code::new(&neighbour) == Code::new(&program) {
            prop_assert!(all_same(&evaluate(&neighbour, inputs), &evaluate(&program, inputs)));
        } else {
            // Nothing else than an effective instruction that differs can make code differ.
            let kept = |program: &Program| program.effective().instructions().copied().collect::<Vec<_>>();
            prop_assert_ne!(kept(&neighbour), kept(&program));
        }
    }

    #[test]
    fn a_bank_can_be_used_again(program in any_program(), rows in prop::collection::vec(inputs(), 1..5)) {
        let (code, inputs) = (Code::new(&program), program.shape().inputs);
        let mut bank = code.bank::<Scalar>();
        for row in rows {
            let row = &row[..inputs];
            let lanes: Vec<_> = row.iter().map(|&x| Scalar::splat(x)).collect();
            let found: Vec<f64> = code.run(&mut bank, &lanes).iter().map(|lane| lane.lane(0)).collect();
            prop_assert!(all_same(&found, &evaluate(&program, row)));
        }
    }
}

#[test]
fn a_deleted_effective_instruction_is_missed() {
    // r2 = ((r0 + 1) · 3 − r1), where nothing cancels: without any one of the three the output is another.
    let shape = Shape::new(2, 1, 1).unwrap();
    let chain = [
        instruction(Operation::Add, 3, 0, Operand::Constant(1.0)),
        instruction(Operation::Mul, 3, 3, Operand::Constant(3.0)),
        instruction(Operation::Sub, 2, 3, Operand::Register(1)),
    ];
    let program = Program::new(shape, vec![Page(chain.to_vec())]).unwrap();
    assert_eq!(outputs(&program, &[2.0, 5.0]), [4.0]);
    for i in 0..chain.len() {
        let shorter = edited(&program, |instructions| {
            instructions.remove(i);
        });
        assert_ne!(outputs(&shorter, &[2.0, 5.0]), [4.0]);
    }
}

#[test]
fn zero_and_minus_zero_are_different_code() {
    let shape = Shape::new(1, 1, 0).unwrap();
    let multiplied_by = |constant| {
        let product = instruction(Operation::Mul, 1, 0, Operand::Constant(constant));
        Code::new(&Program::new(shape, vec![Page(vec![product])]).unwrap())
    };
    assert_ne!(multiplied_by(0.0), multiplied_by(-0.0));
    assert_eq!(multiplied_by(0.0), multiplied_by(0.0));
}

#[test]
fn a_divisor_near_zero_leaves_the_dividend() {
    let shape = Shape::new(2, 1, 0).unwrap();
    let quotient = instruction(Operation::Div, 2, 0, Operand::Register(1));
    let program = Program::new(shape, vec![Page(vec![quotient])]).unwrap();
    let table =
        [(1e-6, 3.0), (-1e-6, 3.0), (0.0, 3.0), (f64::NAN, 3.0), (1.5e-6, 3.0 / 1.5e-6), (-2.0, -1.5)];
    for (divisor, expected) in table {
        assert_eq!(outputs(&program, &[3.0, divisor]), [expected], "3 / {divisor}");
    }
}

#[test]
fn a_program_without_instructions_gives_zeros() {
    let program = Program::new(Shape::new(2, 3, 1).unwrap(), vec![]).unwrap();
    assert!(program.is_empty() && Code::new(&program).is_empty());
    assert_eq!(outputs(&program, &[1.0, 2.0]), [0.0; 3]);
    assert_eq!(program.intron_share(), 0.0);
}

#[test]
fn shapes_without_inputs_or_outputs_or_with_too_many_registers_are_refused() {
    assert!(Shape::new(1, 1, Shape::MOST_REGISTERS - 2).is_ok());
    let bad = [(0, 1, 1), (1, 0, 1), (1, 1, Shape::MOST_REGISTERS - 1), (usize::MAX, usize::MAX, 1)];
    for (inputs, outputs, spare) in bad {
        let error = Shape::new(inputs, outputs, spare).unwrap_err().to_string();
        assert!(error.contains("4096") && error.contains(&format!("{inputs} inputs")), "{error}");
    }
}

#[test]
fn programs_that_cannot_run_are_refused() {
    let shape = Shape::new(1, 1, 1).unwrap();
    let (register, constant) = (Operand::Register, Operand::Constant);
    let unary = |second| Instruction { operation: Operation::Sin, destination: 1, first: 0, second };
    let table = [
        (instruction(Operation::Add, 3, 0, register(0)), "found r3"),
        (instruction(Operation::Add, 0, 4, register(0)), "found r4"),
        (instruction(Operation::Add, 0, 0, register(5)), "found r5"),
        (instruction(Operation::Add, 0, 0, constant(f64::NAN)), "finite constant, found NaN"),
        (instruction(Operation::Add, 0, 0, constant(f64::INFINITY)), "finite constant, found inf"),
        (unary(Some(constant(1.0))), "one operand of sin, found two"),
        (unary(Some(register(1))), "one operand of sin, found two"),
        (Instruction { operation: Operation::Max, ..unary(None) }, "two operands of max, found one"),
    ];
    for (bad, expected) in table {
        let error = Program::new(shape, vec![Page(vec![unary(None), bad])]).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
    let long = |length| Program::new(shape, vec![Page(vec![unary(None); length])]);
    assert!(long(Program::MOST_INSTRUCTIONS).is_ok());
    assert!(long(Program::MOST_INSTRUCTIONS + 1).unwrap_err().to_string().contains("at most 32768"));
}

#[test]
fn the_longest_program_over_the_most_registers_runs() {
    // Constants are numbered behind the registers: the numbers must not wrap.
    let shape = Shape::new(1, 1, Shape::MOST_REGISTERS - 2).unwrap();
    let add = |i: usize| instruction(Operation::Add, 1, 1, Operand::Constant(i as f64));
    let page = Page((0..Program::MOST_INSTRUCTIONS).map(add).collect());
    let program = Program::new(shape, vec![page]).unwrap();
    let n = Program::MOST_INSTRUCTIONS as f64;
    assert_eq!(outputs(&program, &[0.0]), [n * (n - 1.0) / 2.0]);
}
