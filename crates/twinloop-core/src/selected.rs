//! The selected tests Ω: those that were run on the system, with their trajectories, laid out for lanes.

use std::ops::Range;
use std::sync::Arc;

use crate::error::{Result, invalid};
use crate::excitation::{HoldBack, side_by_side};
use crate::lanes::{groups, interleave, lanes_for};
use crate::setting::Setting;
use crate::signals::Signals;

/// A test and what the system did under it.
#[derive(Clone, Debug, PartialEq)]
pub struct Experiment {
    /// Parameters of the controller (size).
    pub parameters: Vec<f64>,
    /// Target state η_d: constant (n_x), or a row for each state of the test, as many as were recorded or more. Empty for a
    /// run that no test asked for: its commands are those of the record, and it has no parameters and no excitation.
    pub target: Vec<f64>,
    /// Measured states, (n + 1) × n_x.
    pub states: Vec<f64>,
    /// Commands, n × n_u.
    pub commands: Vec<f64>,
    /// What the test added to its controller's commands, a row of n_u for each step, as many as were recorded or
    /// more; empty for nothing.
    pub excitation: Vec<f64>,
    /// What holds that back.
    pub hold_back: Option<HoldBack>,
}

impl Experiment {
    /// Whether its commands are those of the record, and not of a controller.
    pub fn is_recorded(&self) -> bool {
        self.target.is_empty()
    }
}

/// Transitions (η_t, ω_t, η_{t+1}) of neighbouring rows, one a lane.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    /// Rows in the block; further lanes repeat the last.
    pub rows: usize,
    /// n_x × lanes
    pub state: Vec<f64>,
    /// n_u × lanes
    pub command: Vec<f64>,
    /// n_x × lanes
    pub next: Vec<f64>,
}

/// Closed loops of a group of tests, one a lane, with the runs that they should reproduce.
#[derive(Clone, Debug)]
pub(crate) struct Loops {
    /// Tests in the group; further lanes repeat the last.
    pub tests: usize,
    /// size × lanes
    pub parameters: Vec<f64>,
    /// n_x × lanes
    pub initial: Vec<f64>,
    /// n_x × lanes, or (n + 1) × n_x × lanes, n that of the longest.
    pub target: Vec<f64>,
    /// n × n_u × lanes, n that of the longest; empty if no test of the group has any.
    pub excitation: Vec<f64>,
    /// Lines of what holds it back, side by side; empty if no test of the group has any.
    pub hold_back: Vec<f64>,
    /// Commands to send, n × n_u × lanes, n that of the longest; empty where controllers give them.
    pub commands: Vec<f64>,
    /// Recorded states, (n + 1) × n_x × lanes, n that of the longest.
    pub recorded: Vec<f64>,
    /// Steps that were recorded of each test.
    pub steps: Vec<usize>,
}

/// Ω. A value: a further test makes a new one.
#[derive(Clone, Debug)]
pub struct SelectedTests {
    setting: Arc<Setting>,
    experiments: Vec<Arc<Experiment>>,
    /// The transitions of all tests one after another.
    blocks: Vec<Block>,
    /// The rows of each test in them.
    rows: Vec<Range<usize>>,
    loops: Vec<Loops>,
}

impl SelectedTests {
    /// No test yet.
    pub fn new(setting: Arc<Setting>) -> Self {
        let (experiments, blocks, rows, loops) = Default::default();
        Self { setting, experiments, blocks, rows, loops }
    }

    /// These and one more.
    pub fn with_test(&self, experiment: Experiment) -> Result<Self> {
        self.check(&experiment)?;
        let signals = self.signals();
        let states = signals.periods.continued(&experiment.states, signals.states());
        let mut experiments = self.experiments.clone();
        experiments.push(Arc::new(Experiment { states, ..experiment }));
        let (blocks, rows) = transitions(&experiments, signals.states(), signals.commands());
        let (n_x, n_u) = (signals.states(), signals.commands());
        // Neighbours whose commands come from the same source fly side by side.
        let alike = experiments.chunk_by(|a, b| a.is_recorded() == b.is_recorded());
        let of_alike = |alike: &[Arc<Experiment>]| {
            let of_group = |group: Range<usize>| loops(&alike[group], n_x, n_u);
            groups(alike.len()).into_iter().map(of_group).collect::<Vec<_>>()
        };
        let loops = alike.flat_map(of_alike).collect();
        Ok(Self { setting: self.setting.clone(), experiments, blocks, rows, loops })
    }

    /// Number of tests N.
    pub fn len(&self) -> usize {
        self.experiments.len()
    }

    /// Whether nothing was run yet.
    pub fn is_empty(&self) -> bool {
        self.experiments.is_empty()
    }

    /// What they were run in.
    pub fn setting(&self) -> &Setting {
        &self.setting
    }

    /// The signals of the system.
    pub fn signals(&self) -> &Arc<Signals> {
        self.setting.signals()
    }

    pub(crate) fn experiments(&self) -> impl Iterator<Item = &Experiment> {
        self.experiments.iter().map(|experiment| &**experiment)
    }

    /// Recorded steps of each test.
    pub fn steps(&self) -> impl Iterator<Item = usize> {
        self.experiments.iter().map(|experiment| experiment.commands.len() / self.signals().commands())
    }

    pub(crate) fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    pub(crate) fn rows(&self) -> &[Range<usize>] {
        &self.rows
    }

    pub(crate) fn loops(&self) -> &[Loops] {
        &self.loops
    }

    fn check(&self, experiment: &Experiment) -> Result<()> {
        let Experiment { parameters, target, states, commands, excitation, hold_back } = experiment;
        let (n_x, n_u) = (self.signals().states(), self.signals().commands());
        let parameters_of_family = self.setting.family().parameters().len();
        let steps = commands.len() / n_u;
        if steps == 0 || commands.len() != steps * n_u || states.len() != (steps + 1) * n_x {
            return invalid(format!(
                "trajectory: expected n ≥ 1 steps, (n + 1) × {n_x} states and n × {n_u} commands, found {} and {} \
                 numbers",
                states.len(),
                commands.len()
            ));
        }
        let rows = target.len() / n_x;
        let follows = rows == 1 || rows > steps;
        let alone = experiment.is_recorded() && parameters.is_empty() && excitation.is_empty();
        if alone {
            // A record speaks for itself.
        } else if parameters.len() != parameters_of_family || !target.len().is_multiple_of(n_x) || !follows {
            return invalid(format!(
                "test: expected {} parameters and a target of {n_x} states, or a row of it for each recorded state, \
                 found {} and {}",
                parameters_of_family,
                parameters.len(),
                target.len()
            ));
        }
        let rows = excitation.len() / n_u;
        if !excitation.is_empty() && (excitation.len() != rows * n_u || rows < steps) {
            return invalid(format!(
                "test: expected no excitation, or {n_u} numbers for each of at least the {steps} recorded steps, found \
                 {} numbers",
                excitation.len()
            ));
        }
        if let Some(hold_back) = hold_back {
            hold_back.check(n_x)?;
        }
        if ![parameters, target, states, commands, excitation].into_iter().flatten().all(|x| x.is_finite()) {
            return invalid(
                "trajectory: expected finite numbers, found NaN or an infinite one; cut the bad samples",
            );
        }
        Ok(())
    }
}

/// Rows of a block: as many as the widest vector has lanes, for an instruction costs little more than its dispatch.
const ROWS: usize = 64;

/// The transitions of all tests in blocks, and the rows of each test.
fn transitions(experiments: &[Arc<Experiment>], n_x: usize, n_u: usize) -> (Vec<Block>, Vec<Range<usize>>) {
    let (mut state, mut command, mut next, mut rows) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for experiment in experiments {
        let first = command.len();
        command.extend(experiment.commands.chunks_exact(n_u));
        state.extend(experiment.states.chunks_exact(n_x).take(command.len() - first));
        next.extend(experiment.states.chunks_exact(n_x).skip(1));
        rows.push(first..command.len());
    }
    let block = |first: usize| {
        let rows = (command.len() - first).min(ROWS);
        let part = |all: &[&[f64]]| interleave(&all[first..first + rows], lanes_for(rows));
        Block { rows, state: part(&state), command: part(&command), next: part(&next) }
    };
    let blocks = (0..command.len()).step_by(ROWS).map(block).collect();
    (blocks, rows)
}

/// The closed loops of a group of tests.
fn loops(group: &[Arc<Experiment>], n_x: usize, n_u: usize) -> Loops {
    let lanes = lanes_for(group.len());
    let steps: Vec<usize> = group.iter().map(|experiment| experiment.states.len() / n_x - 1).collect();
    let longest = steps.iter().copied().max().unwrap_or(0);
    let part = |of: fn(&Experiment) -> &[f64]| {
        interleave(&group.iter().map(|experiment| of(experiment)).collect::<Vec<_>>(), lanes)
    };
    let recorded = group.iter().map(|experiment| resized(&experiment.states, (longest + 1) * n_x, 0.0));
    // Minus zero is the one number that leaves every command as it is to the bit, a zero of either sign too.
    let excitation = group.iter().map(|experiment| resized(&experiment.excitation, longest * n_u, -0.0));
    let sent = group.iter().filter(|experiment| experiment.is_recorded());
    let sent: Vec<_> = sent.map(|experiment| resized(&experiment.commands, longest * n_u, 0.0)).collect();
    let target = if sent.is_empty() { targets(group, n_x, longest) } else { vec![vec![]; group.len()] };
    let excited = group.iter().any(|experiment| !experiment.excitation.is_empty());
    let hold_back = side_by_side(group.iter().map(|experiment| experiment.hold_back.as_ref()), n_x);
    let initial: Vec<&[f64]> = group.iter().map(|experiment| &experiment.states[..n_x]).collect();
    Loops {
        tests: group.len(),
        parameters: part(|experiment| &experiment.parameters),
        initial: interleave(&initial, lanes),
        target: interleave(&target, lanes),
        excitation: if excited { interleave(&excitation.collect::<Vec<_>>(), lanes) } else { vec![] },
        hold_back: hold_back.map_or_else(Vec::new, |lines| interleave(&lines, lanes)),
        commands: if sent.is_empty() { vec![] } else { interleave(&sent, lanes) },
        recorded: interleave(&recorded.collect::<Vec<_>>(), lanes),
        steps,
    }
}

/// Targets of a group: constant, or a row for each state as soon as one of them varies.
fn targets(group: &[Arc<Experiment>], n_x: usize, longest: usize) -> Vec<Vec<f64>> {
    if group.iter().all(|experiment| experiment.target.len() == n_x) {
        return group.iter().map(|experiment| experiment.target.clone()).collect();
    }
    let rows = |experiment: &Arc<Experiment>| {
        let last = experiment.target.len() / n_x - 1;
        let row = |k: usize| &experiment.target[k.min(last) * n_x..][..n_x];
        (0..=longest).flat_map(row).copied().collect()
    };
    group.iter().map(rows).collect()
}

/// Cut to a length, or filled up to it.
fn resized(values: &[f64], length: usize, filling: f64) -> Vec<f64> {
    values.iter().copied().chain(std::iter::repeat(filling)).take(length).collect()
}
