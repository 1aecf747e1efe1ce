//! Controllers: the law, the map to commands, the box of the parameters.

use std::sync::Arc;

use proptest::prelude::*;
use twinloop_core::{
    Axis, Controller, Family, Gain, Mixer, Outer, Parameters, Pid, Purpose, Scalar, StateFeedback, Stream,
    Vector,
};

use crate::oracle::Pids;
use crate::worlds::{GAINS, World, axis, free, gains, state};

fn stream(seed: u64) -> Stream {
    Stream::new(seed, Purpose::Single, 0, 0, 0)
}

/// One command of one effort.
fn mixed(power: f64, (low, high): (f64, f64), effort: f64) -> f64 {
    let mixer = Mixer::new(vec![vec![2.0]], vec![-1.0], power, vec![(low, high)], 1).unwrap();
    let mut command = [Scalar::splat(0.0)];
    mixer.apply(&[Scalar::splat(effort)], 1, &mut command);
    command[0].lane(0)
}

/// Some linear and some logarithmic parameters.
fn parameters() -> Parameters {
    Parameters::new(&[-1.0, 1e-4, 0.0, 2.0], &[3.0, 10.0, 1e-9, 3.0], &[false, true, false, true]).unwrap()
}

const BOX: [(f64, f64); 4] = [(-1.0, 3.0), (1e-4, 10.0), (0.0, 1e-9), (2.0, 3.0)];

fn inside(values: &[f64]) -> bool {
    values.iter().zip(BOX).all(|(value, (low, high))| (low..=high).contains(value))
}

/// Two outputs that read states 2 and 0 and the integral of state 1, through a map with an offset.
fn feedback(states: Vec<usize>, integrals: Vec<usize>, outputs: usize) -> StateFeedback {
    let bounds = vec![(-1e3, 1e3), (-1e3, 1e3)];
    let matrix = vec![[1.0, 0.5][..outputs].to_vec(), [-0.25, 2.0][..outputs].to_vec()];
    let output = Mixer::new(matrix, vec![0.1, -0.2], 1.0, bounds, outputs).unwrap();
    StateFeedback { states, integrals, outputs, output, dt: 0.05 }
}

proptest! {
    #[test]
    fn a_state_feedback_is_two_matrices_and_an_integral(
        gains in prop::array::uniform6(-3.0..3.0),
        target in state(),
        states in prop::collection::vec(state(), 1..20),
    ) {
        let family = Family::new(feedback(vec![2, 0], vec![1], 2), vec![free(-3.0, 3.0); 6], 3).unwrap();
        let mut controller = Controller::new(Arc::new(family), gains.to_vec()).unwrap();
        let mut integral = 0.0;
        for state in &states {
            let error = |i: usize| target[i] - state[i];
            integral += error(1) * 0.05;
            let u = |j: usize| gains[3 * j] * error(2) + gains[3 * j + 1] * error(0) + gains[3 * j + 2] * integral;
            let expected = [0.1 + u(0) + 0.5 * u(1), -0.2 - 0.25 * u(0) + 2.0 * u(1)];
            for (found, expected) in controller.command(state, &target).unwrap().iter().zip(expected) {
                prop_assert!((found - expected).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn a_controller_is_a_pid_on_each_axis(
        gains in gains(),
        target in state(),
        states in prop::collection::vec(state(), 1..40),
        power in prop::sample::select(vec![0.5, 1.0, 2.0]),
    ) {
        let world = World::with_power(power);
        let mut controller = Controller::new(world.family.clone(), gains.clone()).unwrap();
        for _ in 0..2 {
            let mut expected = Pids::new(&world, &gains);
            for state in &states {
                prop_assert_eq!(controller.command(state, &target).unwrap(), expected.command(state, &target));
            }
            controller.reset();
        }
        prop_assert_eq!(controller.parameters().collect::<Vec<_>>(), gains);
    }

    #[test]
    fn a_command_is_a_signed_power_within_its_bounds(
        effort in -30.0..30.0,
        power in prop::sample::select(vec![0.5, 1.0, 2.0, 3.0, 0.75]),
    ) {
        let v: f64 = 2.0 * effort - 1.0;
        let expected = (v.signum() * v.abs().powf(power)).clamp(-5.0, 4.0);
        prop_assert!((mixed(power, (-5.0, 4.0), effort) - expected).abs() <= 1e-12 * expected.abs());
    }

    #[test]
    fn drawn_and_moved_parameters_stay_in_their_box(
        seed in any::<u64>(),
        index in 0..4_usize,
        share in prop_oneof![-0.2..0.2, -1e3..1e3],
    ) {
        let parameters = parameters();
        let drawn = parameters.uniform(&mut stream(seed));
        let moved = parameters.moved(&drawn, index, share);
        prop_assert!(inside(&drawn) && inside(&moved), "{drawn:?} {moved:?}");
        for other in (0..4).filter(|&other| other != index) {
            prop_assert_eq!(drawn[other], moved[other]);
        }
        let still = parameters.moved(&drawn, index, 0.0);
        let rounding = 1e-12 * (drawn[index].abs() + BOX[index].1 - BOX[index].0);
        prop_assert!((still[index] - drawn[index]).abs() <= rounding);
    }

    #[test]
    fn a_share_of_the_range_is_one_on_the_parameters_own_scale(place in 0.0..0.5_f64, share in 0.0..0.5_f64) {
        let linear = parameters().moved(&[-1.0 + 4.0 * place, 1.0, 0.0, 2.0], 0, share);
        prop_assert!((linear[0] - (-1.0 + 4.0 * (place + share))).abs() < 1e-12);
        // Five decades from 1e-4 to 10.
        let logarithmic = parameters().moved(&[0.0, 10.0_f64.powf(5.0 * place - 4.0), 0.0, 2.0], 1, share);
        prop_assert!((logarithmic[1].log10() - (5.0 * (place + share) - 4.0)).abs() < 1e-10);
    }
}

#[test]
fn the_integral_counts_before_it_is_used_and_the_derivative_is_of_the_measurement() {
    // One axis without mixing: K_P = 2, K_I = 3, K_D = 5, a period of 0.1 s.
    let family = |rate| {
        let output = Mixer::direct(vec![(-1e6, 1e6)], 1).unwrap();
        let pid = Pid::new(vec![axis(0, rate)], output, 0.1);
        Arc::new(Family::new(pid, vec![free(0.0, 9.0); 3], 2).unwrap())
    };
    let commands = |rate| -> Vec<f64> {
        let mut controller = Controller::new(family(rate), vec![2.0, 3.0, 5.0]).unwrap();
        // The target jumps: a derivative of the error would kick.
        let steps = [([1.0, 0.5], [4.0, 0.0]), ([1.5, 0.25], [9.0, 0.0]), ([1.5, 0.0], [9.0, 0.0])];
        steps.iter().map(|(state, target)| controller.command(state, target).unwrap()[0]).collect()
    };
    let close = |found: Vec<f64>, expected: [f64; 3]| {
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}, not {expected:?}");
    };
    let without_rate = [2.0 * 3.0 + 3.0 * 0.3, 2.0 * 7.5 + 3.0 * 1.05, 2.0 * 7.5 + 3.0 * 1.8];
    close(commands(Some(1)), [without_rate[0] - 2.5, without_rate[1] - 1.25, without_rate[2]]);
    // Differences of the angle: none before the first step, then 0.5 in 0.1 s, then 0.
    close(commands(None), [without_rate[0], without_rate[1] - 25.0, without_rate[2]]);
}

#[test]
fn commands_are_clipped_at_both_ends_and_a_nan_stays_one() {
    for power in [0.5, 1.0, 2.0] {
        assert_eq!(mixed(power, (-0.5, 0.25), 1e6), 0.25);
        assert_eq!(mixed(power, (-0.5, 0.25), -1e6), -0.5);
        assert_eq!(mixed(power, (-0.5, 0.25), f64::INFINITY), 0.25);
        assert!(mixed(power, (-0.5, 0.25), f64::NAN).is_nan());
    }
}

#[test]
fn draws_are_uniform_on_the_parameters_own_scale() {
    let draws: Vec<Vec<f64>> = (0..20_000).map(|seed| parameters().uniform(&mut stream(seed))).collect();
    let below = |i: usize, value: f64| draws.iter().filter(|d| d[i] < value).count() as f64 / 20_000.0;
    for (i, value, expected) in [(0, 0.0, 0.25), (0, 2.0, 0.75), (1, 1e-3, 0.2), (1, 1.0, 0.8)] {
        assert!((below(i, value) - expected).abs() < 0.015, "parameter {i} below {value}");
    }
}

#[test]
fn boxes_without_room_are_refused() {
    let refusal =
        |low: &[f64], high: &[f64], log: &[bool]| Parameters::new(low, high, log).unwrap_err().to_string();
    assert!(refusal(&[], &[], &[]).contains("at least one"));
    assert!(refusal(&[0.0], &[1.0, 2.0], &[false]).contains("found 1, 2 and 1"));
    assert!(refusal(&[0.0], &[1.0], &[]).contains("found 1, 1 and 0"));
    for (low, high, log) in
        [(1.0, 1.0, false), (2.0, 1.0, false), (f64::NAN, 1.0, false), (0.0, f64::INFINITY, false)]
    {
        assert!(
            refusal(&[0.0, low], &[1.0, high], &[false, log])
                .starts_with("parameter 1: expected bounds low < high")
        );
    }
    assert!(refusal(&[0.0], &[1.0], &[true]).contains("0 < low < high"));
}

#[test]
fn families_whose_parts_do_not_fit_are_refused() {
    let bounds = vec![(-1.0, 1.0)];
    let pid = |axis| Pid::new(vec![axis], Mixer::direct(bounds.clone(), 1).unwrap(), 0.1);
    let refusal = |axis, n| Family::new(pid(axis), vec![free(0.0, 1.0); n], 2).unwrap_err().to_string();
    assert!(refusal(axis(0, None), 4).contains("3 gains"));
    assert!(refusal(axis(2, None), 3).contains("states 0 to 1"));
    assert!(refusal(axis(0, Some(2)), 3).contains("states 0 to 1"));
    let outer = |angle, limit| Axis { outer: Some(Outer { angle, limit }), ..axis(1, None) };
    assert!(refusal(outer(0, 1.0), 3).contains("4 gains"));
    assert!(refusal(outer(2, 1.0), 4).contains("states 0 to 1"));
    for limit in [0.0, -1.0, f64::NAN] {
        assert!(refusal(outer(0, limit), 4).contains("limits of the rates above 0"));
    }
    for time in [-0.1, f64::NAN, f64::INFINITY] {
        let refused = pid(axis(0, None)).filtered(time).unwrap_err().to_string();
        assert!(refused.contains("at least 0 s"), "{refused}");
    }
    let fixed =
        |value| Family::new(pid(axis(0, None)), vec![Gain::Fixed(value); 3], 2).unwrap_err().to_string();
    assert!(fixed(f64::NAN).contains("finite gains"));
    assert!(fixed(1.0).contains("at least one"));
    assert!(Mixer::direct(bounds.clone(), 2).unwrap_err().to_string().contains("2 axes and 1 commands"));
    let mixer =
        |matrix, offset, power| Mixer::new(matrix, offset, power, bounds.clone(), 1).unwrap_err().to_string();
    assert!(mixer(vec![], vec![0.0], 1.0).contains("found 0 rows"));
    assert!(mixer(vec![vec![1.0, 2.0]], vec![0.0], 1.0).contains("1 rows of 2"));
    assert!(mixer(vec![vec![1.0]], vec![], 1.0).contains("0 offsets"));
    for (factor, offset, power) in [
        (f64::NAN, 0.0, 1.0),
        (1.0, f64::INFINITY, 1.0),
        (1.0, 0.0, 0.0),
        (1.0, 0.0, -1.0),
        (1.0, 0.0, f64::NAN),
    ] {
        assert!(mixer(vec![vec![factor]], vec![offset], power).contains("power above 0"));
    }
}

#[test]
fn state_feedbacks_whose_parts_do_not_fit_are_refused() {
    let refusal = |feedback: StateFeedback, n: usize| {
        Family::new(feedback, vec![free(0.0, 1.0); n], 3).unwrap_err().to_string()
    };
    assert!(refusal(feedback(vec![0, 1], vec![2], 2), 5).contains("6 gains"));
    assert!(refusal(feedback(vec![0, 3], vec![], 2), 4).contains("states 0 to 2, found 3"));
    assert!(refusal(feedback(vec![0], vec![5], 2), 4).contains("found 5"));
    assert!(refusal(feedback(vec![], vec![], 2), 1).contains("feed something back"));
}

#[test]
fn a_controller_refuses_what_it_cannot_act_on() {
    let family = World::new().family;
    for bad in [vec![0.0; GAINS - 1], vec![f64::NAN; GAINS]] {
        assert!(
            Controller::new(family.clone(), bad).err().unwrap().to_string().contains("6 finite parameters")
        );
    }
    let mut controller = Controller::new(family, vec![1.0; GAINS]).unwrap();
    let mut refusal =
        |state: &[f64], target: &[f64]| controller.command(state, target).unwrap_err().to_string();
    assert!(refusal(&[0.0; 2], &[0.0; 3]).contains("found 2 and 3"));
    assert!(refusal(&[0.0; 3], &[0.0; 4]).contains("found 3 and 4"));
    assert!(refusal(&[0.0, f64::NAN, 0.0], &[0.0; 3]).contains("stop the run"));
    assert!(refusal(&[0.0; 3], &[0.0, 0.0, f64::INFINITY]).contains("stop the run"));
    // Nor did a refused state leave a trace in the memory.
    let mut fresh = Controller::new(World::new().family, vec![1.0; GAINS]).unwrap();
    assert_eq!(controller.command(&[0.1; 3], &[1.0; 3]), fresh.command(&[0.1; 3], &[1.0; 3]));
}
