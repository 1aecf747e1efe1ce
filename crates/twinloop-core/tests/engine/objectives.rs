//! What models are judged by, against a computation test by test and step by step.

use proptest::prelude::*;
use twinloop_core::{
    Code, Experiment, Form, Frame, Model, Outcome, Program, SelectedTests, Width, Workers, closed_loops,
    of_model, open_loops,
};

use crate::oracle::{Pids, close, run, step};
use crate::worlds::{COMMANDS, GAINS, STATES, World, any_model, experiment, one_worker};

fn rows(experiment: &Experiment) -> Vec<&[f64]> {
    experiment.states.chunks(STATES).collect()
}

fn expected_open_loop(world: &World, form: Form, program: &Program, experiment: &Experiment) -> f64 {
    let mut sum = 0.0;
    for (pair, command) in rows(experiment).windows(2).zip(experiment.commands.chunks(COMMANDS)) {
        let next = step(world, program, form, pair[0], command);
        sum += next.iter().zip(pair[1]).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
    }
    let mean = sum / (experiment.states.len() - STATES) as f64;
    if mean < 2e6 { mean } else { 2e6 }
}

fn expected_closed_loop(world: &World, form: Form, program: &Program, experiment: &Experiment) -> f64 {
    let (recorded, n) = (rows(experiment), experiment.commands.len() / COMMANDS);
    let limits = world.limits(10.0);
    let step = |state: &[f64], command: &[f64]| step(world, program, form, state, command);
    let controller = Pids::new(world, &experiment.parameters);
    let run = run(step, controller, [recorded[0], &experiment.target], n, limits.magnitudes(), &[]);
    if run.lasted < n {
        return 1e6 * (2.0 - run.lasted as f64 / n as f64);
    }
    let errors = run.states.concat().into_iter().zip(recorded.concat()).map(|(a, b)| (a - b).powi(2));
    errors.sum::<f64>() / (n * STATES) as f64
}

/// Both objectives of one model on the tests as the ranking sees them, open loop first.
fn objectives(form: Form, program: &Program, selected: &SelectedTests) -> [Vec<f64>; 2] {
    let frame = Frame::new(form, selected.signals());
    let row = of_model(Model { code: &Code::new(program), frame: &frame }, selected, Width::widest());
    let every_other = |first| row.iter().skip(first).step_by(2).copied().collect();
    [every_other(0), every_other(1)]
}

/// Both objectives of one model on the tests as values.
fn outcomes(form: Form, program: &Program, selected: &SelectedTests) -> (Vec<f64>, Vec<Outcome>) {
    let frame = Frame::new(form, selected.signals());
    let models = [Model { code: &Code::new(program), frame: &frame }];
    let open = open_loops(&models, selected, &one_worker()).remove(0);
    (open, closed_loops(&models, selected, &one_worker()).remove(0))
}

/// A recording in which nothing ever happens.
fn still(steps: usize) -> Experiment {
    Experiment {
        parameters: vec![0.0; GAINS],
        target: vec![0.0; STATES],
        states: vec![0.0; (steps + 1) * STATES],
        commands: vec![0.0; steps * COMMANDS],
        excitation: vec![],
        hold_back: None,
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn each_test_of_any_number_is_judged_as_if_it_were_the_only_one(
        (form, program) in any_model(),
        experiments in prop::collection::vec(experiment(1..80), 1..=40),
    ) {
        let world = World::new();
        let selected = world.selected(&experiments);
        let [open, closed] = objectives(form, &program, &selected);
        prop_assert_eq!((open.len(), closed.len()), (experiments.len(), experiments.len()));
        for (i, experiment) in experiments.iter().enumerate() {
            let expected = expected_open_loop(&world, form, &program, experiment);
            prop_assert!(close(open[i], expected), "open loop of test {}: {} {}\n{}", i, open[i], expected, program);
            let expected = expected_closed_loop(&world, form, &program, experiment);
            prop_assert!(close(closed[i], expected), "closed loop of test {}: {} {}\n{}", i, closed[i], expected, program);
        }
    }

    #[test]
    fn an_experiment_has_the_same_bits_alone_and_among_others(
        (form, program) in any_model(),
        experiments in prop::collection::vec(experiment(1..40), 1..=40),
        place in any::<prop::sample::Index>(),
    ) {
        let world = World::new();
        let i = place.index(experiments.len());
        let [open, closed] = objectives(form, &program, &world.selected(&experiments));
        let [open_alone, closed_alone] = objectives(form, &program, &world.selected(&experiments[i..=i]));
        prop_assert_eq!((open[i].to_bits(), closed[i].to_bits()), (open_alone[0].to_bits(), closed_alone[0].to_bits()));
    }

    #[test]
    fn the_ranking_sees_finite_numbers_and_everybody_else_the_outcomes(
        (form, program) in any_model(),
        experiments in prop::collection::vec(experiment(1..20), 1..=5),
    ) {
        let selected = World::new().selected(&experiments);
        let [open, closed] = objectives(form, &program, &selected);
        let (errors, outcomes) = outcomes(form, &program, &selected);
        for (ranked, error) in open.iter().zip(errors) {
            prop_assert_eq!(*ranked, error.min(2e6));
        }
        for (i, (ranked, outcome)) in closed.iter().zip(outcomes).enumerate() {
            let steps = experiments[i].commands.len() / COMMANDS;
            match outcome {
                Outcome::Followed(error) => prop_assert_eq!(*ranked, error),
                Outcome::Diverged { lasted, of } => {
                    prop_assert!(lasted < of && of == steps && outcome.error().is_infinite());
                    prop_assert_eq!(*ranked, 1e6 * (2.0 - lasted as f64 / of as f64));
                }
            }
            prop_assert_eq!(outcome.lasted(steps) == steps, outcome.error().is_finite());
        }
    }
}

#[test]
fn a_model_that_is_right_has_no_error() {
    // The system itself: x += 0.25 c0, v −= 0.5 c1, y unmoved, with commands as the models see them.
    let text = "program inputs=5 outputs=3 registers=8\npage 1\nr5 = r3 * 0.25\nr6 = r4 * -0.5\n";
    let world = World::new();
    let program: Program = text.parse().unwrap();
    let gains = vec![1.0, 0.5, 0.25, 0.5, 0.25, 0.125];
    let step = |x: &[f64], c: &[f64]| vec![x[0] + c[0] / 0.5 * 0.25, x[1] - c[1] / 2.0 * 0.5, x[2]];
    let target = [0.5, 0.0, -0.5];
    let run = run(step, Pids::new(&world, &gains), [&[0.0; 3], &target], 50, &[1e9; 3], &[]);
    let (states, commands) = (run.states.concat(), run.commands.concat());
    let experiment = Experiment {
        parameters: gains,
        target: target.to_vec(),
        states,
        commands,
        excitation: vec![],
        hold_back: None,
    };
    for objective in objectives(Form::Increment, &program, &world.selected(&[experiment])) {
        assert!(objective[0] < 1e-28, "{objective:?}");
    }
}

#[test]
fn the_sooner_a_run_diverges_the_worse_it_is_and_always_worse_than_one_that_does_not() {
    // A model that adds a constant to the first state, whose limit is 10, and a recording that stays at 0.
    let selected = World::new().selected(&[still(40)]);
    let mut last = 0.0;
    for (step, lasted) in [(0.125, 40), (0.25, 39), (0.5, 19), (1.0, 9), (4.0, 2), (11.0, 0)] {
        let text = format!("program inputs=5 outputs=3 registers=8\npage 1\nr5 = r5 + {step:?}\n");
        let [_, closed] = objectives(Form::Increment, &text.parse().unwrap(), &selected);
        assert!(closed[0] > last, "{step}: {closed:?}");
        if lasted < 40 {
            assert_eq!(closed[0], 1e6 * (2.0 - lasted as f64 / 40.0));
        }
        last = closed[0];
    }
}

#[test]
fn a_recording_ends_for_its_test_only() {
    // The model leaves the limits at step 40: after the end of two recordings, within the third.
    let text = "program inputs=5 outputs=3 registers=8\npage 1\nr5 = r5 + 0.25\n";
    let selected = World::new().selected(&[still(10), still(39), still(40)]);
    let [_, closed] = objectives(Form::Increment, &text.parse().unwrap(), &selected);
    let mean = |n: u32| (1..=n).map(|t| (0.25 * f64::from(t)).powi(2)).sum::<f64>() / (3.0 * f64::from(n));
    assert!(close(closed[0], mean(10)) && close(closed[1], mean(39)), "{closed:?}");
    assert_eq!(closed[2], 1e6 * (2.0 - 39.0 / 40.0));
}

#[test]
fn a_prediction_that_is_not_finite_is_worth_a_run_that_diverges_at_once() {
    let text =
        "program inputs=5 outputs=3 registers=8\npage 1\nr6 = r6 + 1e300\nr6 = r6 * r6\nr5 = r6 - r6\n";
    let [open, closed] =
        objectives(Form::Absolute, &text.parse().unwrap(), &World::new().selected(&[still(7)]));
    assert_eq!((open, closed), (vec![2e6], vec![2e6]));
}

#[test]
fn an_error_beyond_the_largest_number_is_worth_a_run_that_diverges_at_once() {
    let selected = World::new().within(vec![1e200; STATES]).selected(&[still(3)]);
    let text = "program inputs=5 outputs=3 registers=8\npage 1\nr5 = r5 + 1e200\n";
    assert_eq!(objectives(Form::Increment, &text.parse().unwrap(), &selected), [vec![2e6], vec![2e6]]);
}

#[test]
fn threads_share_the_work_and_not_the_results() {
    let world = World::new();
    let selected = world.selected(&[still(5), still(20)]);
    let frame = Frame::new(Form::Increment, &world.signals);
    let codes: Vec<Code> = (0..50)
        .map(|i| format!("program inputs=5 outputs=3 registers=8\npage 1\nr5 = r5 + {i}.0\n"))
        .map(|text| Code::new(&text.parse().unwrap()))
        .collect();
    let models: Vec<Model<'_>> = codes.iter().map(|code| Model { code, frame: &frame }).collect();
    let with = |threads| closed_loops(&models, &selected, &Workers::new(threads, Width::widest()).unwrap());
    assert_eq!(with(1), with(3));
}
