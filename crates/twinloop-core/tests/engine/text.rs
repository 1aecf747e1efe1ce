//! The text of programs.

use proptest::prelude::*;
use twinloop_core::{Error, Operand, Operation, Program};

use crate::worlds::any_program;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2048))]

    #[test]
    fn a_program_reads_back_from_its_text_bit_for_bit(program in any_program()) {
        let read: Program = program.to_string().parse().unwrap();
        prop_assert_eq!(&read, &program);
        for (read, written) in read.instructions().zip(program.instructions()) {
            if let (Some(Operand::Constant(a)), Some(Operand::Constant(b))) = (read.second, written.second) {
                prop_assert_eq!(a.to_bits(), b.to_bits());
            }
        }
    }

    #[test]
    fn no_text_makes_the_parser_panic(noise in "(program inputs=1 outputs=1 registers=3\npage 1\n)?(.{0,9}[r=(,)0-9\n ]){0,9}") {
        let _ = noise.parse::<Program>();
    }
}

#[test]
fn blank_lines_and_spaces_do_not_matter() {
    let neat = "program inputs=2 outputs=1 registers=4\npage 1\n  r3 = r0 * 0.5\n  r2 = sin(r3)\npage 2\n  r2 = min(r2, r1)\n";
    let untidy = "\n  program  inputs=2 outputs=1   registers=4\n\npage 1\nr3 =  r0  *  0.5\n\tr2 = sin( r3 )\r\n page 2\nr2=min(r2,r1)";
    let program: Program = untidy.parse().unwrap();
    assert_eq!(program.to_string(), neat);
    assert_eq!(program, neat.parse().unwrap());
}

#[test]
fn operations_are_read_by_the_name_that_they_are_written_with() {
    for operation in Operation::ALL {
        assert_eq!(operation.name().parse(), Ok(operation));
    }
    assert!("%".parse::<Operation>().unwrap_err().to_string().contains("+ - * / min max sin"));
}

#[test]
fn an_error_names_the_line_and_what_was_found_there() {
    let header = "program inputs=2 outputs=1 registers=4";
    let table = [
        ("", 1, "expected a header"),
        ("\n\nprogramme", 3, "programme"),
        ("program inputs=2 outputs=1", 1, "expected a header"),
        ("program inputs=2 outputs=1 registers=x", 1, "registers=x"),
        ("program outputs=1 inputs=2 registers=4", 1, "expected a header"),
        ("prog inputs=2 outputs=1 registers=4", 1, "expected a header"),
        ("program inputs=2 outputs=3 registers=4", 1, "2 inputs and 3 outputs, found 4"),
        ("program inputs=0 outputs=1 registers=4", 1, "at least one input"),
        ("program inputs=2 outputs=1 registers=5000", 1, "at most 4096"),
        ("program inputs=18446744073709551615 outputs=1 registers=4", 1, "found 4"),
        ("HEADER\nr2 = r0 + r1", 2, "expected \"page 1\""),
        ("HEADER\npage 2", 2, "expected \"page 1\", found \"page 2\""),
        ("HEADER\npage 1\n\npage 3", 4, "expected \"page 2\", found \"page 3\""),
        ("HEADER\npage 1\nr2 = r0 + r1\nr2 := r0", 4, "expected a register like"),
        ("HEADER\npage 1\nnonsense", 3, "expected an instruction"),
        ("HEADER\npage 1\nr2 = r0 +", 3, "expected an instruction"),
        ("HEADER\npage 1\nr2 = r0 % r1", 3, "operation: expected one of"),
        ("HEADER\npage 1\nr2 = sinh(r1)", 3, "found \"sinh\""),
        ("HEADER\npage 1\nr2 = sin(r1", 3, "expected an instruction"),
        ("HEADER\npage 1\nr2 = sin(0.5)", 3, "expected a register like \"r3\", found \"0.5\""),
        ("HEADER\npage 1\nr2 = sin(r0, r1)", 3, "one operand of sin, found two"),
        ("HEADER\npage 1\nr2 = min(r0)", 3, "two operands of min, found one"),
        ("HEADER\npage 1\nr2 = 0.5 * r0", 3, "expected a register like \"r3\", found \"0.5\""),
        ("HEADER\npage 1\nr2 = r0 * x", 3, "a register or a number, found \"x\""),
        ("HEADER\npage 1\nr2 = r0 * r", 3, "expected a register like"),
        ("HEADER\npage 1\nr2 = r0 * r4", 3, "r0 to r3, found r4"),
        ("HEADER\npage 1\nr70000 = r0 * r1", 3, "found \"r70000\""),
        ("HEADER\npage 1\nr2 = r0 * inf", 3, "finite constant"),
        ("HEADER\npage 1\nr2 = r0 * 1e999", 3, "finite constant"),
        ("HEADER\npage 1\nr2 = r0 * NaN", 3, "finite constant"),
    ];
    for (text, expected_line, expected) in table {
        match text.replace("HEADER", header).parse::<Program>() {
            Err(Error::Parse { line, message }) => {
                assert!(
                    line == expected_line && message.contains(expected),
                    "{text:?}: line {line}: {message}"
                );
            }
            other => panic!("{text:?}: {other:?}"),
        }
    }
}

#[test]
fn a_text_that_goes_on_for_ever_is_refused_where_it_becomes_too_long() {
    let text =
        "program inputs=1 outputs=1 registers=2\npage 1\n".to_owned() + &"r1 = sin(r1)\n".repeat(32769);
    let error = text.parse::<Program>().unwrap_err().to_string();
    assert_eq!(error, "line 32771: expected at most 32768 instructions");
}

#[test]
fn a_long_line_is_quoted_in_part() {
    let text = "program inputs=1 outputs=1 registers=2\npage 1\n".to_owned() + &"x".repeat(100_000);
    assert!(text.parse::<Program>().unwrap_err().to_string().len() < 200);
}
