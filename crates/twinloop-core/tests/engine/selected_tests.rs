//! The selected tests: what is taken in, and what is refused.

use std::sync::Arc;

use twinloop_core::{Experiment, Limits, Setting, Signals};

use crate::worlds::{COMMANDS, GAINS, STATES, World};

fn experiment(steps: usize) -> Experiment {
    Experiment {
        parameters: vec![0.5; GAINS],
        target: vec![0.0; STATES],
        states: vec![0.0; (steps + 1) * STATES],
        commands: vec![0.0; steps * COMMANDS],
        excitation: vec![0.0; steps * COMMANDS],
        hold_back: None,
    }
}

#[test]
fn a_further_test_makes_a_new_value() {
    let none = World::new().no_tests();
    let one = none.with_test(experiment(3)).unwrap();
    let two = one.with_test(experiment(1)).unwrap();
    assert!(none.is_empty() && !one.is_empty());
    assert_eq!((none.len(), one.len(), two.len()), (0, 1, 2));
}

#[test]
fn recordings_that_do_not_fit_are_refused() {
    type Spoil = fn(&mut Experiment);
    let table: [(Spoil, &str); 14] = [
        (|e| (e.commands, e.states) = (vec![], vec![0.0; STATES]), "n ≥ 1 steps"),
        (|e| e.commands.truncate(5), "n × 2 commands, found 12 and 5 numbers"),
        (|e| e.states.truncate(11), "found 11 and 6 numbers"),
        (|e| e.states.extend([0.0; STATES]), "found 15 and 6 numbers"),
        (|e| e.parameters.push(0.0), "expected 6 parameters and a target of 3 states, or a row"),
        (|e| e.target.truncate(2), "found 6 and 2"),
        (|e| e.target = vec![0.0; 3 * STATES], "found 6 and 9"),
        (|e| e.excitation.truncate(5), "at least the 3 recorded steps, found 5 numbers"),
        (|e| e.excitation.truncate(4), "at least the 3 recorded steps, found 4 numbers"),
        (|e| e.excitation[2] = f64::NAN, "cut the bad samples"),
        (|e| e.states[4] = f64::NAN, "cut the bad samples"),
        (|e| e.commands[1] = f64::INFINITY, "cut the bad samples"),
        (|e| e.target[0] = f64::NAN, "cut the bad samples"),
        (|e| e.parameters[0] = f64::NEG_INFINITY, "cut the bad samples"),
    ];
    for (spoil, expected) in table {
        let mut bad = experiment(3);
        spoil(&mut bad);
        let error = World::new().no_tests().with_test(bad).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn controllers_of_another_system_are_refused() {
    let World { signals, family, .. } = World::new();
    let fewer_states =
        Signals { state_scales: vec![1.0; 2], derivative_of: vec![None; 2], ..(*signals).clone() };
    let more_commands =
        Signals { command_bounds: vec![(0.0, 1.0); 3], command_scales: vec![1.0; 3], ..(*signals).clone() };
    for signals in [fewer_states, more_commands] {
        let error = Setting::new(Limits::new(Arc::new(signals), 10.0).unwrap(), family.clone());
        let error = error.unwrap_err().to_string();
        assert!(error.contains("controllers of"), "{error}");
    }
}
