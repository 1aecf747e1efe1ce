//! Widths: they change the speed of a result and never its bits.

use proptest::prelude::*;
use twinloop_core::{
    Code, Frame, HoldBack, Influences, Model, Outcome, Task, Trajectory, Width, Workers, closed_loops,
    final_distances, open_loops, record, run_rows, step_rows,
};

use crate::oracle::{all_same, evaluate};
use crate::worlds::{World, any_model, any_program, experiment, gains, state};

fn slices(rows: &[Vec<f64>]) -> Vec<&[f64]> {
    rows.iter().map(|row| &row[..]).collect()
}

/// What `work` returns is the same with every width that this processor has; one of them at least.
fn same_with_every_width<T>(work: impl Fn(Width) -> Vec<T>, equal: impl Fn(&[T], &[T]) -> bool) -> bool {
    let baseline = work(Width::Baseline);
    Width::available().into_iter().all(|width| equal(&work(width), &baseline))
}

fn all_rows_same(a: &[Vec<f64>], b: &[Vec<f64>]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| all_same(a, b))
}

fn same_run(a: &Trajectory, b: &Trajectory) -> bool {
    a.lasted == b.lasted
        && all_same(&a.states, &b.states)
        && all_same(&a.measured, &b.measured)
        && all_same(&a.commands, &b.commands)
}

proptest! {
    #[test]
    fn rows_of_code_are_those_of_single_evaluations_with_every_width(
        program in any_program(),
        rows in prop::collection::vec(prop::collection::vec(prop_oneof![4 => -3.0..3.0, 1 => any::<f64>()], 4), 0..140),
    ) {
        let rows: Vec<&[f64]> = rows.iter().map(|row| &row[..program.shape().inputs]).collect();
        let expected: Vec<f64> = rows.iter().flat_map(|row| evaluate(&program, row)).collect();
        for width in Width::available() {
            let found = run_rows(&Code::new(&program), &rows, width);
            prop_assert!(all_same(&found, &expected), "{width:?}\n{program}");
        }
    }

    #[test]
    fn steps_have_the_same_bits_with_every_width(
        (form, program) in any_model(),
        rows in prop::collection::vec((state(), prop::collection::vec(-2.0..2.0, 2)), 1..140),
    ) {
        let frame = Frame::new(form, &World::new().signals);
        let (states, commands): (Vec<_>, Vec<_>) = rows.into_iter().unzip();
        let model = Model { code: &Code::new(&program), frame: &frame };
        let step = |width| step_rows(model.into(), &slices(&states), &slices(&commands), &[], width);
        prop_assert!(same_with_every_width(step, all_same));
    }

    #[test]
    fn runs_have_the_same_bits_with_every_width(
        (form, program) in any_model(),
        gains in prop::collection::vec(gains(), 1..70),
        [initial, target] in [state(), state()],
        steps in 1..30_usize,
        power in prop::sample::select(vec![0.5, 1.0, 2.0]),
    ) {
        let world = World::with_power(power);
        let frame = Frame::new(form, &world.signals);
        let model = Model { code: &Code::new(&program), frame: &frame };
        let task = Task::new(initial, target, steps).unwrap();
        let setting = world.setting(10.0);
        let rows = |count: usize, factor: f64| -> Vec<Vec<f64>> {
            gains.iter().map(|g| (0..count).map(|i| factor * g[i % 6]).collect()).collect()
        };
        let (noise, excitation, disturbance) =
            (rows(3 * (steps + 1), 0.1), rows(2 * steps, 0.3), rows(3 * steps, -0.02));
        let (noise, excitation, disturbance) = (slices(&noise), slices(&excitation), slices(&disturbance));
        let hold_back = HoldBack::new(&[(-0.2, 0.2); 3], &[(-0.6, 0.9); 3]).unwrap();
        let hold_back = Some(&hold_back);
        let influences = Influences { noise: &noise, excitation: &excitation, hold_back, disturbance: &disturbance, anchors: &[] };
        let runs = |width| record(model.into(), &setting, &slices(&gains), &task, influences, width);
        let equal = |a: &[Trajectory], b: &[Trajectory]| {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same_run(a, b))
        };
        prop_assert!(same_with_every_width(runs, equal));
        let distances = |width| {
            let workers = Workers::new(1, width).unwrap();
            final_distances(&[model, model], &setting, &slices(&gains), &task, &workers)
        };
        prop_assert!(same_with_every_width(distances, all_rows_same));
    }

    #[test]
    fn model_objectives_have_the_same_bits_with_every_width(
        models in prop::collection::vec(any_model(), 1..4),
        experiments in prop::collection::vec(experiment(1..90), 1..12),
    ) {
        let world = World::new();
        let frames: Vec<Frame> = models.iter().map(|(form, _)| Frame::new(*form, &world.signals)).collect();
        let codes: Vec<Code> = models.iter().map(|(_, program)| Code::new(program)).collect();
        let models: Vec<Model<'_>> = codes.iter().zip(&frames).map(|(code, frame)| Model { code, frame }).collect();
        let selected = world.selected(&experiments);
        let workers = |width| Workers::new(1, width).unwrap();
        prop_assert!(same_with_every_width(|w| open_loops(&models, &selected, &workers(w)), all_rows_same));
        let errors = |outcomes: Vec<Outcome>| outcomes.into_iter().map(Outcome::error).collect::<Vec<_>>();
        let closed = |w| closed_loops(&models, &selected, &workers(w)).into_iter().map(errors).collect();
        prop_assert!(same_with_every_width(closed, all_rows_same));
    }
}

#[test]
fn a_width_is_read_by_its_name_and_refused_where_the_processor_lacks_it() {
    for width in Width::available() {
        assert_eq!(width.name().parse(), Ok(width));
    }
    assert_eq!("auto".parse(), Ok(Width::widest()));
    let error = "mmx".parse::<Width>().unwrap_err().to_string();
    assert!(error.contains("baseline") && error.contains("found \"mmx\""), "{error}");
}

#[test]
fn no_threads_and_too_many_threads_are_refused() {
    for threads in [0, 1025] {
        let error = Workers::new(threads, Width::Baseline).err().unwrap().to_string();
        assert_eq!(error, format!("threads: expected 1 to 1024, found {threads}"));
    }
}

#[test]
fn work_comes_back_in_the_order_in_which_it_was_numbered() {
    for threads in [1, 3] {
        let workers = Workers::new(threads, Width::Baseline).unwrap();
        assert_eq!(workers.threads(), threads);
        assert_eq!(workers.map(1000, |i| i * i), (0..1000).map(|i| i * i).collect::<Vec<_>>());
        assert!(workers.map(0, |i| i).is_empty());
    }
}
