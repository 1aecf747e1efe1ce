//! Roll-outs: closed loops side by side.

use std::sync::Arc;

use proptest::prelude::*;
use twinloop_core::{
    Code, Controller, Family, ForeignController, ForeignLaw, Form, Frame, Influences, Model, Periods,
    Program, Task, Trajectory, Width, final_distances, record, replay,
};

use crate::oracle::{Pids, all_same, close, run, step};
use crate::worlds::{GAINS, STATES, World, any_model, free, gains, one_worker, state};

fn slices(rows: &[Vec<f64>]) -> Vec<&[f64]> {
    rows.iter().map(|row| &row[..]).collect()
}

/// A learnt system and the runs of several controllers on it.
struct Scene {
    world: World,
    frame: Frame,
    code: Code,
    program: Program,
    task: Task,
    factor: f64,
}

impl Scene {
    fn new(
        form: Form,
        program: Program,
        [initial, target]: [Vec<f64>; 2],
        steps: usize,
        factor: f64,
    ) -> Self {
        let world = World::new();
        Self {
            frame: Frame::new(form, &world.signals),
            code: Code::new(&program),
            task: Task::new(initial, target, steps).unwrap(),
            world,
            program,
            factor,
        }
    }

    fn record(&self, gains: &[Vec<f64>], noise: &[Vec<f64>]) -> Vec<Trajectory> {
        let model = Model { code: &self.code, frame: &self.frame };
        let (gains, noise) = (slices(gains), slices(noise));
        let influences = Influences { noise: &noise, ..Influences::default() };
        record(
            model.into(),
            &self.world.setting(self.factor),
            &gains,
            &self.task,
            influences,
            Width::widest(),
        )
    }

    fn expected(&self, gains: &[f64], noise: &[f64]) -> crate::oracle::Run {
        let Task { initial, target, steps } = &self.task;
        let step = |state: &[f64], command: &[f64]| {
            step(&self.world, &self.program, self.frame.form(), state, command)
        };
        let limits = self.world.limits(self.factor);
        run(step, Pids::new(&self.world, gains), [initial, target], *steps, limits.magnitudes(), noise)
    }
}

/// A family as something outside of the engine would fly it: one controller at a time.
#[derive(Debug)]
struct Outside(Arc<Family>);

impl ForeignLaw for Outside {
    fn gains(&self) -> usize {
        GAINS
    }

    fn start(&self, gains: &[f64]) -> Box<dyn ForeignController> {
        Box::new(One(Controller::new(self.0.clone(), gains.to_vec()).unwrap()))
    }
}

struct One(Controller);

impl ForeignController for One {
    fn reset(&mut self) {
        self.0.reset();
    }

    fn command(&mut self, state: &[f64], target: &[f64], command: &mut [f64]) {
        command.copy_from_slice(&self.0.command(state, target).unwrap());
    }

    fn copied(&self) -> Box<dyn ForeignController> {
        Box::new(Self(self.0.copied()))
    }
}

/// Adds a constant of its own to the first state of each lane: the command that its gain asks for, and nothing else.
fn drift() -> Program {
    "program inputs=5 outputs=3 registers=8\npage 1\nr5 = r3 * 0.5\n".parse().unwrap()
}

proptest! {
    #[test]
    fn a_run_is_that_of_a_single_loop_whatever_runs_beside_it(
        (form, program) in any_model(),
        ends in [state(), state()],
        gains in prop::collection::vec(gains(), 1..45),
        steps in 1..25_usize,
        factor in 0.5..10.0,
        noisy in any::<bool>(),
    ) {
        let scene = Scene::new(form, program, ends, steps, factor);
        let noise = |gains: &Vec<f64>| (0..(steps + 1) * STATES).map(|i| 0.1 * gains[i % 6]).collect::<Vec<f64>>();
        let noise: Vec<Vec<f64>> = if noisy { gains.iter().map(noise).collect() } else { vec![] };
        let runs = scene.record(&gains, &noise);
        prop_assert_eq!(runs.len(), gains.len());
        for (l, (found, gains)) in runs.iter().zip(&gains).enumerate() {
            let noise = noise.get(l).map_or(&[][..], |noise| noise);
            let expected = scene.expected(gains, noise);
            prop_assert_eq!(found.lasted, expected.lasted);
            for (found, expected) in [
                (&found.states, &expected.states),
                (&found.measured, &expected.readings),
                (&found.commands, &expected.commands),
            ] {
                // Zero and minus zero are one command.
                let expected: Vec<f64> = expected.concat();
                prop_assert!(found.len() >= expected.len());
                prop_assert!(found.iter().zip(&expected).all(|(a, b)| a == b || (a.is_nan() && b.is_nan())));
            }
            if found.lasted == steps {
                prop_assert_eq!(found.states.len(), (steps + 1) * STATES);
                prop_assert_eq!(found.measured.len(), found.states.len());
                prop_assert_eq!(found.commands.len(), steps * 2);
            }
        }
    }

    #[test]
    fn a_run_under_recorded_commands_is_the_run_that_they_were_recorded_of(
        (form, program) in any_model(),
        ends in [state(), state()],
        gains in gains(),
        steps in 1..25_usize,
    ) {
        let scene = Scene::new(form, program, ends, steps, 10.0);
        let run = scene.record(&[gains], &[]).remove(0);
        let model = Model { code: &scene.code, frame: &scene.frame };
        let sent = run.commands.len() / 2;
        let (limits, quiet) = (scene.world.limits(10.0), Influences::default());
        let again = replay(model.into(), &limits, &scene.task.initial, &run.commands, quiet, Width::widest()).remove(0);
        prop_assert_eq!(again.lasted, run.lasted.min(sent));
        prop_assert!(all_same(&again.states, &run.states));
    }

    #[test]
    fn a_law_outside_of_the_engine_flies_as_one_inside_does(
        (form, program) in any_model(),
        ends in [state(), state()],
        gains in prop::collection::vec(gains(), 1..12),
    ) {
        let mut scene = Scene::new(form, program, ends, 12, 10.0);
        let inside = scene.record(&gains, &[]);
        let bounds = scene.world.signals.command_bounds.clone();
        let law = Arc::new(Outside(scene.world.family.clone()));
        let family = Family::foreign(law, vec![free(-1.0, 5.0); GAINS], STATES, bounds).unwrap();
        scene.world.family = Arc::new(family);
        for (found, expected) in scene.record(&gains, &[]).iter().zip(&inside) {
            prop_assert_eq!(found.lasted, expected.lasted);
            let lasted = expected.lasted;
            prop_assert!(all_same(&found.states[..(lasted + 1) * STATES], &expected.states[..(lasted + 1) * STATES]));
            prop_assert!(all_same(&found.commands[..lasted * 2], &expected.commands[..lasted * 2]));
        }
    }

    #[test]
    fn a_run_has_the_same_bits_in_a_group_of_any_size(
        (form, program) in any_model(),
        ends in [state(), state()],
        gains in prop::collection::vec(gains(), 32),
        place in 0..32_usize,
    ) {
        let scene = Scene::new(form, program, ends, 12, 10.0);
        let alone = scene.record(&gains[place..=place], &[]).remove(0);
        for size in [4, 8, 32] {
            let start = place / size * size;
            let beside = scene.record(&gains[start..start + size], &[]).swap_remove(place % size);
            prop_assert_eq!(beside.lasted, alone.lasted);
            prop_assert!(all_same(&beside.states[..(alone.lasted + 1) * STATES], &alone.states[..(alone.lasted + 1) * STATES]));
            prop_assert!(all_same(&beside.commands[..alone.lasted * 2], &alone.commands[..alone.lasted * 2]));
        }
    }

    #[test]
    fn a_single_controller_commands_what_the_lanes_commanded(
        (form, program) in any_model(),
        ends in [state(), state()],
        gains in prop::collection::vec(gains(), 1..40),
    ) {
        let scene = Scene::new(form, program, ends, 20, 10.0);
        for (run, gains) in scene.record(&gains, &[]).iter().zip(gains) {
            let mut controller = Controller::new(scene.world.family.clone(), gains).unwrap();
            for t in 0..run.lasted {
                let command = controller.command(&run.measured[t * STATES..][..STATES], &scene.task.target);
                prop_assert!(all_same(&command.unwrap(), &run.commands[t * 2..][..2]));
            }
        }
    }

    #[test]
    fn the_final_distance_is_that_of_the_last_state_and_infinite_after_a_divergence(
        models in prop::collection::vec(any_model(), 1..4),
        ends in [state(), state()],
        gains in prop::collection::vec(gains(), 1..70),
        steps in 1..15_usize,
    ) {
        let form = models[0].0;
        let models = models.into_iter().filter(|one| one.0 == form);
        let scenes: Vec<Scene> =
            models.map(|(_, program)| Scene::new(form, program, ends.clone(), steps, 3.0)).collect();
        let Scene { world, task, .. } = &scenes[0];
        let dynamics: Vec<Model<'_>> = scenes.iter().map(|s| Model { code: &s.code, frame: &s.frame }).collect();
        let found = final_distances(&dynamics, &world.setting(3.0), &slices(&gains), task, &one_worker());
        prop_assert_eq!(found.len(), scenes.len());
        for (found, scene) in found.iter().zip(&scenes) {
            prop_assert_eq!(found.len(), gains.len());
            for (found, gains) in found.iter().zip(&gains) {
                let run = scene.expected(gains, &[]);
                let last = run.states[run.lasted].iter().zip(&task.target);
                let distance = last.map(|(x, y)| (x - y).powi(2)).sum::<f64>().sqrt();
                let expected = if run.lasted < steps { f64::INFINITY } else { distance };
                prop_assert!(close(*found, expected), "{found} {expected}");
            }
        }
    }
}

#[test]
fn a_lane_that_diverges_does_not_end_its_neighbours() {
    // Lane l commands 0.1 + its gain, so the first state, 0 at first, grows by as much at each step and leaves 1.
    for lanes in [1_usize, 2, 4, 5, 8, 9, 31, 32, 33, 40, 64, 65] {
        let mut scene = Scene::new(Form::Increment, drift(), [vec![0.0; 3], vec![1.0, 0.0, 0.0]], 30, 1.0);
        // A controller that asks for K_P · (1 − 0) would see the state; the derivative gain of a zero rate sees nothing.
        scene.world = scene.world.within(vec![1.0, 1e9, 1e9]);
        let gains: Vec<Vec<f64>> =
            (0..lanes).map(|l| vec![0.02 * (l % 7) as f64, 0.0, 0.0, 0.0, 0.0, 0.0]).collect();
        for (run, gains) in scene.record(&gains, &[]).iter().zip(&gains) {
            let (mut x, mut expected) = (0.0_f64, 0);
            while expected < 30 {
                x += 0.1 + gains[0] * (1.0 - x);
                if x.abs() >= 1.0 {
                    break;
                }
                expected += 1;
            }
            assert_eq!(run.lasted, expected, "{lanes} lanes, gain {}", gains[0]);
        }
    }
}

#[test]
fn a_run_lasts_until_the_state_reaches_a_limit_or_stops_being_a_number() {
    // 0.125 a step from 0: at 1 after the eighth, exactly.
    let counting: Program =
        "program inputs=5 outputs=3 registers=8\npage 1\nr5 = r5 + 0.125\n".parse().unwrap();
    let exploding: Program =
        "program inputs=5 outputs=3 registers=8\npage 1\nr6 = r0 * 1e200\nr5 = r6 * r6\nr5 = r5 - r5\nr5 = r5 + 0.125\n"
            .parse()
            .unwrap();
    let lasted = |program: &Program, limit: f64| {
        let mut scene = Scene::new(Form::Increment, program.clone(), [vec![0.0; 3], vec![1.0; 3]], 20, 1.0);
        scene.world = scene.world.within(vec![limit, f64::INFINITY, f64::INFINITY]);
        scene.record(&[vec![0.0; 6]], &[])[0].lasted
    };
    assert_eq!(lasted(&counting, 1.0), 7);
    assert_eq!(lasted(&counting, 1.0625), 8);
    assert_eq!(lasted(&counting, 100.0), 20);
    // inf − inf in the second step.
    assert_eq!(lasted(&exploding, f64::INFINITY), 1);
}

#[test]
fn noise_is_what_the_controller_reads_and_never_what_the_system_does() {
    // Commands do not matter to this model, so noise must leave every true state where it was.
    let program: Program =
        "program inputs=5 outputs=3 registers=8\npage 1\nr5 = r0 * 0.5\nr6 = r1 - 0.25\n".parse().unwrap();
    let scene = Scene::new(Form::Absolute, program, [vec![0.5; 3], vec![1.0; 3]], 10, 100.0);
    let gains = vec![vec![1.0, 0.5, 0.25, 1.0, 0.5, 0.25]; 3];
    let noise: Vec<Vec<f64>> = (0..3).map(|l| vec![0.01 * l as f64; 11 * STATES]).collect();
    let (quiet, noisy) = (scene.record(&gains, &[]), scene.record(&gains, &noise));
    for (l, (quiet, noisy)) in quiet.iter().zip(&noisy).enumerate() {
        assert_eq!(quiet.states, quiet.measured);
        assert_eq!(quiet.states, noisy.states);
        let read = |(state, noise): (&f64, &f64)| state + noise;
        assert_eq!(noisy.measured, noisy.states.iter().zip(&noise[l]).map(read).collect::<Vec<_>>());
        assert_eq!(l == 0, quiet.commands == noisy.commands);
    }
}

#[test]
fn tasks_that_no_run_can_have_are_refused() {
    let refusal =
        |initial: Vec<f64>, target, steps| Task::new(initial, target, steps).unwrap_err().to_string();
    assert!(refusal(vec![0.0], vec![0.0; 3], 1).contains("found 3 and 1"));
    assert!(refusal(vec![0.0; 2], vec![0.0; 4], 2).contains("for each of 3 states, found 4 and 2"));
    assert!(refusal(vec![], vec![], 1).contains("found 0 and 0"));
    assert!(refusal(vec![f64::NAN], vec![0.0], 1).contains("finite states"));
    assert!(refusal(vec![0.0], vec![f64::INFINITY], 1).contains("finite states"));
    assert!(refusal(vec![0.0], vec![1.0], 0).contains("found 0"));
    assert!(refusal(vec![0.0], vec![1.0], Task::MOST_STEPS + 1).contains("found 10000001"));
    let task = Task::new(vec![1.0, 2.0], vec![4.0, -2.0], 1).unwrap();
    assert_eq!(task.distance(&Periods::default()), 5.0);
    // Of a reference the last row counts.
    let rows = vec![9.0, 9.0, 4.0, -2.0];
    assert_eq!(Task::new(vec![1.0, 2.0], rows, 1).unwrap().distance(&Periods::default()), 5.0);
}
