//! Tuning: beside generalised least squares where the model is linear in its constants, and a step response in closed
//! form.
// Matrices are written as on paper, entry by entry.
#![allow(clippy::needless_range_loop)]

use std::sync::Arc;

use proptest::prelude::*;
use twinloop_core::{
    Actuation, Actuator, Chain, Code, Form, Frame, Limits, Noise, Observed, Periods, Program, Purpose,
    Recorded, Signals, Tuned, Tuning, Unit,
};

use crate::dense::{Matrix, product, solved, transposed};
use crate::worlds::one_worker;

const DT: f64 = 0.1;

fn limits() -> Limits {
    let signals = Signals {
        dt: DT,
        state_scales: vec![1e3],
        command_bounds: vec![(-10.0, 10.0)],
        command_scales: vec![1.0],
        derivative_of: vec![None],
        kinematics: None,
        periods: Periods::default(),
    };
    Limits::new(Arc::new(signals.validated().unwrap()), 10.0).unwrap()
}

fn code(text: &str) -> Code {
    let program: Program = format!("program inputs=2 outputs=1 registers=6\npage 1\n{text}").parse().unwrap();
    Code::new(&program)
}

fn observed(noise: Noise, form: Form) -> Vec<Observed> {
    let chain = Chain { states: 1, dt: DT, form }.validated().unwrap();
    vec![Observed { states: vec![0], chain, noise: noise.validated(1).unwrap() }]
}

/// A tuning of x(k + 1) = x(k) + a u + b u², from given constants on.
struct Line {
    code: Code,
    frame: Frame,
    observer: Vec<Observed>,
    records: Vec<Recorded>,
    limits: Limits,
}

impl Line {
    fn new(start: [f64; 2], noise: Noise, runs: &[(Vec<f64>, Vec<f64>)]) -> Self {
        let limits = limits();
        let text =
            format!("r3 = r1 * {:?}\nr4 = r1 * r1\nr4 = r4 * {:?}\nr2 = r3 + r4\n", start[0], start[1]);
        let recorded = |(states, commands): &(Vec<f64>, Vec<f64>)| Recorded {
            states: states.clone(),
            weights: vec![1.0; states.len()],
            commands: commands.clone(),
        };
        Self {
            code: code(&text),
            frame: Frame::new(Form::Increment, limits.signals()),
            observer: observed(noise, Form::Increment),
            records: runs.iter().map(recorded).collect(),
            limits,
        }
    }

    fn tuning(&self) -> Tuning<'_> {
        let Self { code, frame, observer, records, limits } = self;
        Tuning { code, frame, observer, records, limits, free: &[0, 1], lags: &[] }
    }
}

/// Constants, χ² and curvature that generalised least squares give on the differences of neighbouring readings.
fn by_least_squares(noise: &Noise, runs: &[(Vec<f64>, Vec<f64>)]) -> (Vec<f64>, f64, Matrix) {
    let (mut curvature, mut right, mut total) = (vec![vec![0.0; 2]; 2], vec![vec![0.0]; 2], 0.0);
    for (states, commands) in runs {
        let n = commands.len();
        let covariance: Matrix = (0..n)
            .map(|i| {
                let entry = |j: usize| {
                    let apart = i.abs_diff(j);
                    let white = [noise.process + 2.0 * noise.sensors[0], -noise.sensors[0]];
                    white.get(apart).copied().unwrap_or(0.0)
                        + noise.gust * (-(apart as f64) * DT / noise.correlation_time).exp()
                };
                (0..n).map(entry).collect()
            })
            .collect();
        let features: Matrix = commands.iter().map(|u| vec![*u, u * u]).collect();
        let changes: Matrix = states.windows(2).map(|pair| vec![pair[1] - pair[0]]).collect();
        let (white, _) = solved(&covariance, &features);
        let (image, _) = solved(&covariance, &changes);
        for i in 0..2 {
            for j in 0..2 {
                curvature[i][j] += product(&transposed(&features), &white)[i][j];
            }
            right[i][0] += product(&transposed(&features), &image)[i][0];
        }
        total += product(&transposed(&changes), &image)[0][0];
    }
    let (constants, _) = solved(&curvature, &right);
    let constants: Vec<f64> = constants.concat();
    let explained: f64 = constants.iter().zip(&right).map(|(c, r)| c * r[0]).sum();
    (constants, total - explained, curvature)
}

fn runs() -> impl Strategy<Value = Vec<(Vec<f64>, Vec<f64>)>> {
    let run = (8..15_usize).prop_flat_map(|n| {
        (prop::collection::vec(-2.0..2.0_f64, n), prop::collection::vec(-0.3..0.3_f64, n)).prop_map(
            |(commands, off)| {
                // Far from 0, so that nothing is known of the first state but its reading.
                let mut states = vec![500.0];
                for (u, off) in commands.iter().zip(off) {
                    states.push(states[states.len() - 1] + 0.7 * u - 0.4 * u * u + off);
                }
                (states, commands)
            },
        )
    });
    prop::collection::vec(run, 1..4)
}

fn noise() -> impl Strategy<Value = Noise> {
    (1e-3..0.1_f64, 1e-3..0.1_f64, prop_oneof![Just(0.0), 1e-3..0.05_f64], 0.1..1.0_f64).prop_map(
        |(sensor, process, gust, correlation_time)| Noise {
            sensors: vec![sensor],
            process,
            gust,
            correlation_time,
        },
    )
}

proptest! {
    #[test]
    fn a_model_that_is_linear_in_its_constants_is_tuned_to_generalised_least_squares(
        runs in runs(), noise in noise(), start in [0.1..1.0_f64, -1.0..-0.1_f64],
    ) {
        let (expected, least, mut curvature) = by_least_squares(&noise, &runs);
        // Constants are known to their own size beforehand.
        prop_assume!(expected.iter().all(|c| c.abs() > 0.05));
        let line = Line::new(start, noise, &runs);
        let Tuned { constants, chi_squared, readings, covariance, .. } = line.tuning().tune(60, &one_worker());
        prop_assert_eq!(readings, runs.iter().map(|(states, _)| states.len()).sum::<usize>());
        prop_assert!((chi_squared - least).abs() < 1e-2 + 1e-5 * least, "{} {}", chi_squared, least);
        for i in 0..2 {
            curvature[i][i] += 1.0 / (constants[i] * constants[i]);
        }
        let (open, _) = solved(&curvature, &vec![vec![1.0, 0.0], vec![0.0, 1.0]]);
        for i in 0..2 {
            let sd = open[i][i].sqrt();
            prop_assert!((constants[i] - expected[i]).abs() < 0.1 * sd, "{:?} {:?} {}", constants, expected, sd);
            for j in 0..2 {
                let scale = (open[i][i] * open[j][j]).sqrt();
                prop_assert!((covariance[2 * i + j] - open[i][j]).abs() < 1e-4 * scale);
            }
        }
    }

    #[test]
    fn squares_of_predictions_are_what_is_left(runs in runs(), noise in noise(), start in [0.1..1.0_f64, -1.0..-0.1_f64]) {
        let line = Line::new(start, noise, &runs);
        let chi_squared = line.tuning().tune(0, &one_worker()).chi_squared;
        let found = line.tuning().predictions(&one_worker()).expect("no divergence");
        let squares: f64 = found.iter().flat_map(|run| &run.errors).map(|error| error * error).sum();
        prop_assert!((squares - chi_squared).abs() < 1e-9 * chi_squared);
        for (run, (readings, _)) in found.iter().zip(&runs) {
            prop_assert_eq!((run.errors.len(), run.states.len()), (readings.len(), readings.len()));
            prop_assert_eq!((run.errors[0], run.states[0]), (0.0, readings[0]));
            prop_assert_eq!(run.gusts.len(), readings.len());
        }
    }
}

#[test]
fn draws_scatter_by_the_covariance() {
    let commands: Vec<f64> = (0..40).map(|k| 2.0 * (0.7 * k as f64).sin()).collect();
    let mut states = vec![500.0];
    for (k, u) in commands.iter().enumerate() {
        states.push(states[k] + 0.7 * u - 0.4 * u * u + 0.1 * (1.3 * k as f64).cos());
    }
    let noise = Noise { sensors: vec![1e-2], process: 1e-2, gust: 0.0, correlation_time: 1.0 };
    let line = Line::new([0.5, -0.5], noise, &[(states, commands)]);
    let tuned = line.tuning().tune(60, &one_worker());
    let count = 4000;
    let unit = Unit::new(5, Purpose::Members, &[0]).expect("a unit");
    let drawn = line.tuning().drawn(&tuned, &unit, count, &one_worker()).expect("draws");
    for i in 0..2 {
        for j in 0..2 {
            let off = |constants: &[f64], i: usize| constants[i] - tuned.constants[i];
            let found: f64 =
                drawn.iter().map(|(constants, _)| off(constants, i) * off(constants, j)).sum::<f64>()
                    / count as f64;
            // The share of draws with r² > 8, e⁻⁴ in two dimensions, is taken back by half: Σ r² loses ¾ of their (8 + 2) e⁻⁴.
            let expected = (1.0 - 0.75 * 5.0 * (-4.0_f64).exp()) * tuned.covariance[2 * i + j];
            let scale = (tuned.covariance[3 * i] * tuned.covariance[3 * j]).sqrt();
            assert!((found - expected).abs() < 0.07 * scale, "{i} {j}: {found} {expected}");
        }
    }
}

#[test]
fn a_lag_is_found_from_a_step_response() {
    let (lag, steps) = (0.25, 30);
    // dx/dt = u behind a lag, from rest: x(t) = t − lag (1 − e^(−t / lag)).
    let states: Vec<f64> =
        (0..=steps).map(|k| f64::from(k) * DT).map(|t| t - lag * (1.0 - (-t / lag).exp())).collect();
    let limits = limits();
    let actuator = Actuator { lag: 0.4, rest: Some(0.0), ..Actuator::DIRECT };
    let actuation = Actuation { actuators: vec![actuator], hidden: vec![] };
    let frame = Frame::new(Form::Acceleration, limits.signals()).with_actuation(actuation).unwrap();
    let record = Recorded { weights: vec![1.0; states.len()], commands: vec![1.0; steps as usize], states };
    let noise = Noise { sensors: vec![1e-8], process: 1e-12, gust: 0.0, correlation_time: 1.0 };
    let code = code("r2 = r1 * 1.0\n");
    let tuning = Tuning {
        code: &code,
        frame: &frame,
        observer: &observed(noise, Form::Acceleration),
        records: &[record],
        limits: &limits,
        free: &[],
        lags: &[vec![0]],
    };
    let tuned = tuning.tune(60, &one_worker());
    // Simpson's rule on the lagged command leaves some 1e-4 of it.
    assert!((tuned.lags[0] - lag).abs() < 1e-3, "{tuned:?}");
}

#[test]
fn a_model_that_diverges_is_left_as_it_is() {
    let noise = Noise { sensors: vec![1e-2], process: 1e-9, gust: 0.0, correlation_time: 1.0 };
    let line = Line::new([1e6, 1.0], noise, &[(vec![500.0; 4], vec![1.0; 3])]);
    let tuned = line.tuning().tune(10, &one_worker());
    assert_eq!(
        (tuned.chi_squared, tuned.constants, tuned.covariance),
        (f64::INFINITY, vec![1e6, 1.0], vec![])
    );
    assert!(line.tuning().predictions(&one_worker()).is_none());
}

#[test]
fn parts_that_do_not_fit_are_refused() {
    let noise = Noise { sensors: vec![1e-2], process: 1e-2, gust: 0.0, correlation_time: 1.0 };
    let line = Line::new([1.0, 1.0], noise, &[(vec![0.0; 4], vec![1.0; 3])]);
    assert!(line.tuning().check().is_ok());
    let short = [Recorded { commands: vec![1.0; 2], ..line.records[0].clone() }];
    for wrong in [
        Tuning { free: &[2], ..line.tuning() },
        Tuning { lags: &[vec![0]], ..line.tuning() },
        Tuning { lags: &[vec![]], ..line.tuning() },
        Tuning { records: &[], ..line.tuning() },
        Tuning { records: &short, ..line.tuning() },
        Tuning { observer: &[], ..line.tuning() },
    ] {
        assert!(wrong.check().is_err());
    }
}
