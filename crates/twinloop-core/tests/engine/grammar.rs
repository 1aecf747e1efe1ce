//! Random programs and how they vary.

use proptest::prelude::*;
use twinloop_core::{Grammar, Instruction, Operand, Operation, Page, Program, Purpose, Shape, Stream};

use crate::worlds::{grammar, program_of};

/// Of one program, where it is counted how much children differ.
const CHILDREN: u64 = 64;

fn stream(seed: u64) -> Stream {
    Stream::new(seed, Purpose::Single, 0, 0, 0)
}

fn shape() -> Shape {
    Shape::new(5, 3, 3).unwrap()
}

fn lengths(program: &Program) -> Vec<usize> {
    program.pages().iter().map(|page| page.0.len()).collect()
}

/// Fields in which two instructions differ. A second operand that came or left with its operation is part of it.
fn changed_fields(a: &Instruction, b: &Instruction) -> usize {
    let arity = a.operation.is_unary() == b.operation.is_unary();
    [
        a.operation != b.operation,
        a.destination != b.destination,
        a.first != b.first,
        arity && a.second != b.second,
    ]
    .into_iter()
    .filter(|changed| *changed)
    .count()
}

fn constants(program: &Program) -> Vec<f64> {
    let constant = |one: &Instruction| match one.second {
        Some(Operand::Constant(constant)) => Some(constant),
        _ => None,
    };
    program.instructions().filter_map(constant).collect()
}

/// Pages in an order of their own, to be compared as multisets.
fn pages(programs: &[&Program]) -> Vec<String> {
    let mut pages: Vec<String> =
        programs.iter().flat_map(|one| one.pages()).map(|page| format!("{page:?}")).collect();
    pages.sort();
    pages
}

proptest! {
    #[test]
    fn random_programs_have_the_lengths_and_operations_that_were_asked_for(
        seed in any::<u64>(),
        pages in 1..6_usize,
        page_length in 1..12_usize,
        operations in prop::sample::subsequence(Operation::ALL.to_vec(), 1..=12),
        writable_inputs in any::<bool>(),
    ) {
        let grammar = Grammar { pages, page_length, operations, writable_inputs, ..grammar(shape()) };
        let program = grammar.random(&mut stream(seed));
        prop_assert_eq!(lengths(&program), vec![page_length; pages]);
        prop_assert!(grammar.check(&program).is_ok());
        for one in program.instructions() {
            prop_assert!(grammar.operations.contains(&one.operation));
            prop_assert!(writable_inputs || usize::from(one.destination) >= shape().inputs);
            prop_assert_eq!(one.operation.is_unary(), one.second.is_none());
        }
        prop_assert!(constants(&program).iter().all(|c| (1e-3 * (1.0 - 1e-12)..=10.0 * (1.0 + 1e-12)).contains(&c.abs())));
    }

    #[test]
    fn mutation_keeps_lengths_and_changes_one_field_of_an_instruction_at_most(
        program in program_of(shape()),
        seed in any::<u64>(),
        mutation_rate in 0.0..1.0,
    ) {
        let grammar = Grammar { mutation_rate, ..grammar(shape()) };
        let child = grammar.mutate(&program, &mut stream(seed));
        prop_assert_eq!(lengths(&child), lengths(&program));
        for (child, parent) in child.instructions().zip(program.instructions()) {
            prop_assert!(changed_fields(child, parent) <= 1, "{} / {}", parent, child);
            prop_assert_eq!(child.operation.is_unary(), child.second.is_none());
        }
        // What mutation makes is a program: it would be refused otherwise.
        prop_assert!(Program::new(child.shape(), child.pages().to_vec()).is_ok());
    }

    #[test]
    fn at_rate_zero_one_instruction_is_redrawn_and_at_rate_one_every_one_may_be(
        seed in any::<u64>(),
    ) {
        // So many registers and so fine a constant that a redrawn field is hardly ever the old one.
        let rare = grammar(Shape::new(2000, 1000, 1000).unwrap());
        let rare = Grammar { mutation_rate: 0.0, operations: vec![Operation::Add], ..rare };
        let program = rare.random(&mut stream(seed));
        let differing = |grammar: &Grammar, child: u64| {
            let child = grammar.mutate(&program, &mut stream(!seed ^ child));
            child.instructions().zip(program.instructions()).filter(|(a, b)| a != b).count()
        };
        prop_assert!(differing(&rare, 0) <= 1);
        // One field of four or five is the operation, of which there is one only: many children, so that none is by luck
        // so much like its parent.
        let frequent = Grammar { mutation_rate: 1.0, ..rare.clone() };
        let often: usize = (0..CHILDREN).map(|child| differing(&frequent, child)).sum();
        prop_assert!(often > program.len() * CHILDREN as usize / 3);
    }

    #[test]
    fn crossover_exchanges_one_page_and_loses_none(
        first in program_of(shape()),
        second in program_of(shape()),
        seed in any::<u64>(),
        aligned in any::<bool>(),
    ) {
        let grammar = Grammar { aligned_pages: f64::from(u8::from(aligned)), ..grammar(shape()) };
        let (a, b) = grammar.crossover(&first, &second, &mut stream(seed));
        prop_assert_eq!(pages(&[&a, &b]), pages(&[&first, &second]));
        prop_assert_eq!((a.pages().len(), b.pages().len()), (first.pages().len(), second.pages().len()));
        let places = |child: &Program, parent: &Program| -> Vec<usize> {
            (0..parent.pages().len()).filter(|&i| child.pages()[i] != parent.pages()[i]).collect()
        };
        let (in_a, in_b) = (places(&a, &first), places(&b, &second));
        prop_assert!(in_a.len() <= 1 && in_b.len() <= 1);
        if aligned && !in_a.is_empty() && !in_b.is_empty() {
            prop_assert_eq!(in_a, in_b);
        }
    }
}

#[test]
fn every_field_can_mutate() {
    let grammar = Grammar { mutation_rate: 0.0, ..grammar(shape()) };
    let seen = |place: usize, same: fn(&Instruction, &Instruction) -> bool| {
        let program = grammar.random(&mut stream(1));
        (0..3000).any(|seed| {
            let child = grammar.mutate(&program, &mut stream(seed));
            let at = |program: &Program| *program.instructions().nth(place).unwrap();
            !same(&at(&child), &at(&program))
        })
    };
    for place in [0, 11, 23] {
        assert!(seen(place, |a, b| a.destination == b.destination));
        assert!(seen(place, |a, b| a.operation == b.operation));
        assert!(seen(place, |a, b| a.first == b.first));
        assert!(seen(place, |a, b| a.second == b.second));
    }
}

#[test]
fn a_mutation_nearly_always_changes_a_program() {
    let grammar = Grammar { mutation_rate: 0.0, ..grammar(shape()) };
    let changed = (0..4000).filter(|&seed| {
        let program = grammar.random(&mut stream(seed));
        grammar.mutate(&program, &mut stream(!seed)) != program
    });
    // A field is redrawn as it was with a probability of at most 1/11 (registers) or 1/12 (operations).
    let share = changed.count() as f64 / 4000.0;
    assert!((0.90..0.97).contains(&share), "{share}");
}

#[test]
fn fresh_constants_are_log_uniform_with_either_sign() {
    let grammar = Grammar { operations: vec![Operation::Add], ..grammar(shape()) };
    let constants: Vec<f64> =
        (0..1000).flat_map(|seed| constants(&grammar.random(&mut stream(seed)))).collect();
    let count = constants.len() as f64;
    let share = |of: fn(f64) -> bool| constants.iter().filter(|c| of(**c)).count() as f64 / count;
    assert!((count / 24_000.0 - 0.5).abs() < 0.02, "half of the second operands");
    assert!((share(|c| c > 0.0) - 0.5).abs() < 0.02, "either sign");
    // Four decades: a quarter of the constants in each.
    assert!((share(|c| c.abs() < 1e-2) - 0.25).abs() < 0.02);
    assert!((share(|c| c.abs() < 1e-1) - 0.50).abs() < 0.02);
    assert!((share(|c| c.abs() < 1.0) - 0.75).abs() < 0.02);
}

#[test]
fn a_mutated_constant_moves_by_a_share_of_its_magnitude() {
    let one = Instruction {
        operation: Operation::Add,
        destination: 0,
        first: 0,
        second: Some(Operand::Constant(-0.02)),
    };
    let shape = Shape::new(1, 1, 0).unwrap();
    let grammar = Grammar { constant_share: 0.0, ..grammar(shape) };
    let program = Program::new(shape, vec![Page(vec![one])]).unwrap();
    let children = (0..20_000).map(|seed| grammar.mutate(&program, &mut stream(seed)));
    let steps: Vec<f64> = children
        .flat_map(|child| constants(&child))
        .filter(|c| *c != -0.02)
        .map(|c| c / -0.02 - 1.0)
        .collect();
    let deviation = (steps.iter().map(|step| step * step).sum::<f64>() / steps.len() as f64).sqrt();
    assert!(steps.len() > 3500 && (deviation - 0.1).abs() < 0.005, "{} {deviation}", steps.len());
}

#[test]
fn a_constant_never_grows_past_what_a_number_can_hold() {
    let one = Instruction {
        operation: Operation::Add,
        destination: 0,
        first: 0,
        second: Some(Operand::Constant(f64::MAX)),
    };
    let shape = Shape::new(1, 1, 0).unwrap();
    let program = Program::new(shape, vec![Page(vec![one])]).unwrap();
    for seed in 0..200 {
        let child = grammar(shape).mutate(&program, &mut stream(seed));
        assert!(Program::new(shape, child.pages().to_vec()).is_ok());
    }
}

#[test]
fn empty_programs_vary_into_themselves() {
    let empty = Program::new(shape(), vec![]).unwrap();
    let full = grammar(shape()).random(&mut stream(0));
    assert_eq!(grammar(shape()).mutate(&empty, &mut stream(1)), empty);
    assert_eq!(grammar(shape()).crossover(&empty, &full, &mut stream(1)), (empty, full));
}

#[test]
fn programs_of_other_registers_are_refused() {
    let other = Program::new(Shape::new(5, 3, 4).unwrap(), vec![]).unwrap();
    let error = grammar(shape()).check(&other).unwrap_err().to_string();
    assert!(error.contains("registers: 11") && error.contains("registers: 12"), "{error}");
}

#[test]
fn grammars_that_make_no_program_are_refused() {
    let good = grammar(shape());
    assert_eq!(good.clone().validated(), Ok(good.clone()));
    type Spoil = fn(&mut Grammar);
    let table: [(Spoil, &str); 17] = [
        (|g| g.pages = 0, "at least one page"),
        (|g| g.page_length = 0, "at least one page"),
        (|g| g.pages = 6000, "at most 32768 instructions, found 6000 pages of 6"),
        (|g| (g.pages, g.page_length) = (usize::MAX, 2), "at most 32768"),
        (|g| g.operations.clear(), "at least one operation"),
        (|g| g.constant_magnitudes = (0.0, 1.0), "magnitudes"),
        (|g| g.constant_magnitudes = (2.0, 1.0), "magnitudes"),
        (|g| g.constant_magnitudes = (1.0, f64::INFINITY), "magnitudes"),
        (|g| g.constant_magnitudes = (f64::NAN, 1.0), "magnitudes"),
        (|g| g.constant_step = -0.1, "constant step"),
        (|g| g.constant_step = f64::NAN, "constant step"),
        (|g| g.constant_step = f64::INFINITY, "constant step"),
        (|g| g.constant_share = 1.1, "shares and rates"),
        (|g| g.mutation_rate = -0.1, "shares and rates"),
        (|g| g.mutation_rate = f64::NAN, "shares and rates"),
        (|g| g.aligned_pages = 2.0, "shares and rates"),
        (|g| g.constant_share = f64::NAN, "shares and rates"),
    ];
    for (spoil, expected) in table {
        let mut grammar = good.clone();
        spoil(&mut grammar);
        let error = grammar.validated().unwrap_err().to_string();
        assert!(error.starts_with("grammar: ") && error.contains(expected), "{error}");
    }
}

#[test]
#[should_panic(expected = "a program of the grammar's registers")]
fn a_page_never_gets_into_a_program_that_lacks_its_registers() {
    let larger = Shape::new(5, 3, 100).unwrap();
    let (first, second) = (grammar(shape()).random(&mut stream(0)), grammar(larger).random(&mut stream(0)));
    grammar(shape()).crossover(&first, &second, &mut stream(1));
}

#[test]
#[should_panic(expected = "a program of the grammar's registers")]
fn an_instruction_never_names_a_register_that_its_program_lacks() {
    let larger = Shape::new(5, 3, 100).unwrap();
    let program = grammar(shape()).random(&mut stream(0));
    grammar(larger).mutate(&program, &mut stream(1));
}
