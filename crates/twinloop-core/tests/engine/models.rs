//! Models: what the outputs of a program mean.

use proptest::prelude::*;
use twinloop_core::{Code, Form, Frame, Model, Program, Signals, Width, step_rows};

use crate::oracle::{all_same, rk4, step};
use crate::worlds::{World, any_model, state};

fn one_step(world: &World, form: Form, program: &Program, state: &[f64], command: &[f64]) -> Vec<f64> {
    let frame = Frame::new(form, &world.signals);
    let model = Model { code: &Code::new(program), frame: &frame };
    step_rows(model.into(), &[state], &[command], &[], Width::Baseline)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1024))]

    #[test]
    fn a_step_is_what_the_form_says(
        (form, program) in any_model(),
        state in state(),
        command in prop::collection::vec(-2.0..2.0, 2),
    ) {
        let world = World::new();
        let found = one_step(&world, form, &program, &state, &command);
        let expected = step(&world, &program, form, &state, &command);
        prop_assert!(all_same(&found, &expected), "{form:?}: {found:?} {expected:?}\n{program}");
    }

    #[test]
    fn accelerations_are_integrated_and_rates_are_their_angles_derivatives(
        state in state(),
        command in prop::collection::vec(-2.0..2.0, 2),
    ) {
        // A pendulum with friction and a first-order lag, inputs (x, v, y, c0, c1), outputs (v', y').
        let text = "program inputs=5 outputs=2 registers=9\npage 1\n\
                    r5 = sin(r0)\nr5 = r5 * -9.0\nr7 = r1 * 0.5\nr5 = r5 - r7\nr5 = r5 + r3\nr6 = r4 - r2\n";
        let world = World::new();
        let found = one_step(&world, Form::Acceleration, &text.parse().unwrap(), &state, &command);
        let expected = rk4(&state, 0.05, |x| {
            vec![x[1], x[0].sin() * -9.0 - x[1] * 0.5 + command[0] / 0.5, command[1] / 2.0 - x[2]]
        });
        for (found, expected) in found.iter().zip(expected) {
            prop_assert!((found - expected).abs() < 1e-14);
        }
    }
}

#[test]
fn a_form_is_read_by_its_name_and_has_its_shape() {
    let signals = &World::new().signals;
    for (form, name, outputs) in [
        (Form::Absolute, "absolute", 3),
        (Form::Increment, "increment", 3),
        (Form::Acceleration, "acceleration", 2),
        (Form::ExplicitEuler, "explicit-euler", 2),
        (Form::SemiImplicitEuler, "semi-implicit-euler", 2),
    ] {
        assert_eq!(name.parse(), Ok(form));
        assert_eq!(form.shape(signals), (5, outputs));
    }
    let error = "velocity".parse::<Form>().unwrap_err().to_string();
    assert!(error.contains("absolute, increment, acceleration") && error.contains("velocity"), "{error}");
}

#[test]
fn programs_of_other_inputs_or_outputs_are_refused() {
    let signals = &World::new().signals;
    let program = |inputs, outputs| {
        Program::new(twinloop_core::Shape::new(inputs, outputs, 0).unwrap(), vec![]).unwrap()
    };
    assert!(Model::check(&program(5, 3), Form::Absolute, signals, 0).is_ok());
    assert!(Model::check(&program(5, 2), Form::Acceleration, signals, 0).is_ok());
    for (inputs, outputs, form) in
        [(4, 3, Form::Absolute), (5, 2, Form::Increment), (5, 3, Form::Acceleration)]
    {
        let error = Model::check(&program(inputs, outputs), form, signals, 0).unwrap_err().to_string();
        assert!(error.contains(form.name()) && error.contains(&format!("found {inputs} and {outputs}")));
    }
}

#[test]
fn a_frame_fits_the_signals_that_it_was_made_for() {
    let signals = &*World::new().signals;
    let frame = Frame::new(Form::Increment, signals);
    assert!(frame.fits(signals) && frame.form() == Form::Increment);
    assert!(frame.fits(&Signals { state_scales: vec![9.0; 3], ..signals.clone() }));
    assert!(!frame.fits(&Signals { dt: 0.1, ..signals.clone() }));
    assert!(!frame.fits(&Signals { command_scales: vec![1.0, 2.0], ..signals.clone() }));
    assert!(!frame.fits(&Signals { derivative_of: vec![None; 3], ..signals.clone() }));
}

#[test]
fn signals_that_no_loop_can_be_closed_with_are_refused() {
    type Spoil = fn(&mut Signals);
    let table: [(Spoil, &str); 14] = [
        (|s| s.dt = 0.0, "period above 0"),
        (|s| s.dt = f64::NAN, "period above 0"),
        (|s| (s.state_scales, s.derivative_of) = (vec![], vec![]), "at least one state"),
        (|s| (s.command_bounds, s.command_scales) = (vec![], vec![]), "one command"),
        (|s| s.command_scales = vec![1.0], "one scale for each command"),
        (|s| s.derivative_of = vec![None], "one derivative entry"),
        (|s| s.state_scales[1] = 0.0, "scales above 0"),
        (|s| s.command_scales[1] = f64::INFINITY, "scales above 0"),
        (|s| s.command_bounds[0] = (1.0, 1.0), "bounds low < high"),
        (|s| s.command_bounds[0] = (f64::NEG_INFINITY, 1.0), "bounds low < high"),
        (|s| s.command_bounds[1] = (0.0, f64::NAN), "bounds low < high"),
        (|s| s.derivative_of[1] = Some(1), "integral of at most one"),
        (|s| s.derivative_of[1] = Some(3), "integral of at most one"),
        (|s| s.derivative_of[2] = Some(0), "integral of at most one"),
    ];
    for (spoil, expected) in table {
        let mut signals = (*World::new().signals).clone();
        spoil(&mut signals);
        let error = signals.validated().unwrap_err().to_string();
        assert!(error.starts_with("signals: ") && error.contains(expected), "{error}");
    }
}
