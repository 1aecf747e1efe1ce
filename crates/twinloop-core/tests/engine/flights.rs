//! Flights on a committee: qualities, usage and disagreement, beside plain loops over numbers.

use proptest::prelude::*;
use twinloop_core::{
    Candidate, Code, Draws, Envelope, Flights, Form, Frame, Model, Program, Quality, QualityKind,
    disagreements, qualities,
};

use crate::dense::{product, solved, transposed};
use crate::oracle::{Pids, Run, run, step};
use crate::worlds::{GAINS, STATES, World, any_model, gains, one_worker, state};

const STEPS: usize = 8;
const DIVERGENCE: f64 = 10.0;

/// A committee of one form in its world.
struct Committee {
    world: World,
    form: Form,
    programs: Vec<Program>,
    codes: Vec<Code>,
    frame: Frame,
}

impl Committee {
    fn new(form: Form, programs: Vec<Program>) -> Self {
        let world = World::new();
        let codes = programs.iter().map(Code::new).collect();
        let frame = Frame::new(form, &world.signals);
        Self { world, form, programs, codes, frame }
    }

    fn models(&self) -> Vec<Model<'_>> {
        self.codes.iter().map(|code| Model { code, frame: &self.frame }).collect()
    }

    fn limits(&self) -> Vec<f64> {
        self.world.signals.state_scales.iter().map(|scale| DIVERGENCE * scale).collect()
    }

    /// A candidate's flight on a member.
    fn flown(&self, member: usize, flight: &Candidate, noise: &[f64]) -> Run {
        let program = &self.programs[member];
        let next = |state: &[f64], command: &[f64]| step(&self.world, program, self.form, state, command);
        let controller = Pids::new(&self.world, &flight.parameters);
        run(next, controller, [&flight.initial, &flight.target], STEPS, &self.limits(), noise)
    }
}

fn committee() -> impl Strategy<Value = (Form, Vec<Program>)> {
    (any_model(), any_model())
        .prop_filter("one form", |((a, _), (b, _))| a == b)
        .prop_map(|((form, a), (_, b))| (form, vec![a, b]))
}

fn candidates() -> impl Strategy<Value = Vec<Candidate>> {
    let one = (gains(), state(), state()).prop_map(|(gains, initial, target)| Candidate {
        parameters: gains.into_iter().map(f64::abs).take(GAINS).collect(),
        initial,
        target,
        excitation: vec![],
    });
    prop::collection::vec(one, 1..12)
}

/// The quality of a run, by its definition.
fn worth(world: &World, quality: &Quality, flight: &Candidate, run: &Run) -> f64 {
    if run.lasted < STEPS {
        return f64::INFINITY;
    }
    let (dt, scales) = (world.signals.dt, &world.signals.command_scales);
    let error = |state: &[f64], of: fn(f64) -> f64| -> f64 {
        (0..STATES).map(|i| quality.weights[i] * of(state[i] - flight.target[i])).sum()
    };
    let left: f64 = match quality.kind {
        QualityKind::Iae => run.states[1..].iter().map(|state| dt * error(state, f64::abs)).sum(),
        QualityKind::Ise => run.states[1..].iter().map(|state| dt * error(state, |x| x * x)).sum(),
        QualityKind::FinalDistance => error(&run.states[STEPS], |x| x * x).sqrt(),
    };
    let sent: Vec<Vec<f64>> =
        run.commands.iter().map(|row| row.iter().zip(scales).map(|(u, s)| u / s).collect()).collect();
    let squares = |row: Vec<f64>| row.iter().map(|x| x * x).sum::<f64>();
    let effort: f64 = sent.iter().map(|row| dt * squares(row.clone())).sum();
    let changes: f64 = sent
        .windows(2)
        .map(|pair| squares(pair[1].iter().zip(&pair[0]).map(|(a, b)| a - b).collect()) / dt)
        .sum();
    left + quality.effort * effort + quality.effort_rate * changes
}

fn close(found: f64, expected: f64) -> bool {
    found == expected || (found - expected).abs() <= 1e-9 * (1.0 + expected.abs())
}

proptest! {
    #[test]
    fn a_flight_is_worth_what_its_definition_says(
        (form, programs) in committee(),
        candidates in candidates(),
        kind in prop::sample::select(QualityKind::ALL.to_vec()),
        weights in prop::collection::vec(0.0..3.0_f64, STATES),
        costs in [0.0..1.0_f64, 0.0..1.0_f64],
        noise in prop::collection::vec(prop::collection::vec(-0.1..0.1_f64, (STEPS + 1) * STATES), 0..3),
        half_width in 0.5..2.0_f64,
    ) {
        let committee = Committee::new(form, programs);
        let quality = Quality { kind, weights, effort: costs[0], effort_rate: costs[1] }.validated().unwrap();
        let envelope = Envelope::new(&[None, Some((0.5 - half_width, 0.5 + half_width)), None]).unwrap();
        let flights = Flights::new(committee.world.setting(DIVERGENCE), &candidates, STEPS).unwrap();
        let rows: Vec<&[f64]> = noise.iter().map(Vec::as_slice).collect();
        let draws = Draws { noise: &rows, ..Draws::default() };
        let members: Vec<_> = committee.models().into_iter().map(Into::into).collect();
        let found = qualities(&members, &flights, &quality, &envelope, draws, &one_worker()).unwrap();
        prop_assert_eq!(found.len(), 2 * draws.count() * candidates.len());
        for (unit, judged) in found.iter().enumerate() {
            let flight = &candidates[unit % candidates.len()];
            let draw = unit / candidates.len() % draws.count();
            let member = unit / candidates.len() / draws.count();
            let run = committee.flown(member, flight, rows.get(draw).copied().unwrap_or(&[]));
            let expected = worth(&committee.world, &quality, flight, &run);
            prop_assert!(close(judged.quality, expected), "{} {}", judged.quality, expected);
            let usage = run.states.iter().map(|state| (state[1] - 0.5).abs() / half_width).fold(0.0, f64::max);
            let usage = if run.lasted < STEPS { f64::INFINITY } else { usage };
            prop_assert!(close(judged.usage, usage), "{} {}", judged.usage, usage);
        }
    }

    #[test]
    fn disagreement_is_the_logarithm_of_a_determinant(
        (form, programs) in committee(),
        candidates in candidates(),
        sds in prop::collection::vec(0.1..2.0_f64, STATES),
    ) {
        let (committee, cap) = (Committee::new(form, programs), 5.0);
        let flights = Flights::new(committee.world.setting(DIVERGENCE), &candidates, STEPS).unwrap();
        let found = disagreements(&committee.models(), &flights, &sds, cap, &one_worker()).unwrap();
        for (found, flight) in found.iter().zip(&candidates) {
            // A member that diverges stays where it last was within the limits.
            let row = |member: usize| -> Vec<f64> {
                let run = committee.flown(member, flight, &[]);
                let state = |k: usize| run.states[k.min(run.lasted)].clone();
                (1..=STEPS).flat_map(state).zip(sds.iter().cycle()).map(|(x, sd)| x / sd).collect()
            };
            let rows = [row(0), row(1)];
            let mean: Vec<f64> = rows[0].iter().zip(&rows[1]).map(|(a, b)| 0.5 * (a + b)).collect();
            let off = rows.each_ref().map(|row| -> Vec<f64> {
                row.iter().zip(&mean).map(|(x, mean)| (x - mean).clamp(-cap, cap)).collect()
            });
            let off = off.to_vec();
            let mut gram = product(&off, &transposed(&off));
            (0..2).for_each(|i| gram[i][i] += 1.0);
            let (_, determinant) = solved(&gram, &vec![vec![0.0]; 2]);
            prop_assert!(close(found.value, determinant.ln()), "{} {}", found.value, determinant.ln());
            let apart: Vec<f64> = rows[0].iter().zip(&rows[1]).map(|(a, b)| (a - b).abs()).collect();
            let most = apart.iter().fold(0.0_f64, |a, b| a.max(*b));
            if most > 0.0 {
                let place = (found.step - 1) * STATES + found.state;
                prop_assert!(close(apart[place], most));
                prop_assert!(rows[found.highest][place] > rows[found.lowest][place]);
            } else {
                prop_assert_eq!(found.step, 0);
            }
        }
    }
}
