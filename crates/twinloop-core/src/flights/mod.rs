//! Flights: candidates that differ in gains, start, target and excitation, flown side by side and judged on a committee.

mod disagreement;
mod envelope;
mod qualities;
mod quality;

pub use disagreement::{Disagreement, disagreements};
pub use envelope::Envelope;
pub use qualities::{Draws, Judged, qualities};
pub use quality::{Quality, QualityKind};

use std::sync::Arc;

use crate::error::{Result, invalid};
use crate::excitation::{Excitation, HoldBack};
use crate::lanes::{Vector, flight_lanes, groups, interleave, splats, vectors};
use crate::rollout::{Commands, Start};
use crate::setting::Setting;
use crate::signals::Signals;
use crate::task::{Task, is_target};

/// One flight that could be made.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// Parameters of the controller (size).
    pub parameters: Vec<f64>,
    /// First state (n_x).
    pub initial: Vec<f64>,
    /// State to lead to: constant (n_x), or a row for each state ((n + 1) × n_x).
    pub target: Vec<f64>,
    /// What is added to the commands before they are clipped, n × n_u; empty for nothing.
    pub excitation: Vec<f64>,
}

/// Candidates of one length, laid out for lanes.
#[derive(Clone, Debug)]
pub struct Flights {
    setting: Arc<Setting>,
    steps: usize,
    groups: Vec<Group>,
}

impl Flights {
    /// Candidates that fly `steps` steps each, all with an excitation or none of them, all to constant targets or none.
    pub fn new(setting: Arc<Setting>, candidates: &[Candidate], steps: usize) -> Result<Self> {
        let (signals, family) = (setting.signals(), setting.family());
        if candidates.is_empty() || !(1..=Task::MOST_STEPS).contains(&steps) {
            return invalid(format!(
                "flights: expected at least one candidate of 1 to {} steps, found {} of {steps}",
                Task::MOST_STEPS,
                candidates.len()
            ));
        }
        let excitation = if candidates[0].excitation.is_empty() { 0 } else { steps * signals.commands() };
        let target = candidates[0].target.len();
        if !is_target(target, signals.states(), steps) {
            return invalid(format!(
                "flights: expected targets of {} states, or a row of them for each of {} states of a flight, found \
                 {target} numbers",
                signals.states(),
                steps + 1
            ));
        }
        let lengths = [family.parameters().len(), signals.states(), target, excitation];
        for (i, Candidate { parameters, initial, target, excitation }) in candidates.iter().enumerate() {
            let parts = [parameters, initial, target, excitation];
            let found = parts.map(Vec::len);
            if found != lengths || !parts.into_iter().flatten().all(|x| x.is_finite()) {
                return invalid(format!(
                    "flight {i}: expected finite numbers, {lengths:?} of them as parameters, start, target and \
                     excitation, found {found:?}"
                ));
            }
        }
        let groups =
            groups(candidates.len()).into_iter().map(|group| Group::new(&candidates[group])).collect();
        Ok(Self { setting, steps, groups })
    }

    /// The same with excitations that are held back, all of them alike.
    pub fn held_back(mut self, hold_back: &HoldBack) -> Result<Self> {
        hold_back.check(self.signals().states())?;
        for group in &mut self.groups {
            group.hold_back = hold_back.lines().to_vec();
        }
        Ok(self)
    }

    /// Number of candidates, K.
    pub fn len(&self) -> usize {
        self.groups.iter().map(|group| group.candidates).sum()
    }

    /// Never: there is at least one candidate.
    pub fn is_empty(&self) -> bool {
        self.groups.is_empty()
    }

    /// Steps of each, n.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// The signals of the system.
    pub fn signals(&self) -> &Arc<Signals> {
        self.setting.signals()
    }

    /// What a roll-out of a group starts from.
    #[inline(always)]
    fn start<'a, V: Vector>(
        &'a self,
        lanes: &'a GroupLanes<V>,
        noise: &'a [V],
        disturbance: &'a [V],
    ) -> Start<'a, V> {
        Start {
            commands: Commands::Law {
                family: self.setting.family(),
                parameters: &lanes.parameters,
                target: &lanes.target,
                excitation: Excitation { rows: &lanes.excitation, hold_back: &lanes.hold_back },
            },
            initial: &lanes.initial,
            steps: self.steps,
            limits: self.setting.limits(),
            noise,
            disturbance,
        }
    }
}

/// Neighbouring candidates, one a lane.
#[derive(Clone, Debug)]
struct Group {
    /// Candidates in the group; further lanes repeat the last.
    candidates: usize,
    /// size × lanes
    parameters: Vec<f64>,
    /// n_x × lanes
    initial: Vec<f64>,
    /// n_x × lanes, or (n + 1) × n_x × lanes.
    target: Vec<f64>,
    /// n × n_u × lanes, or empty.
    excitation: Vec<f64>,
    /// Lines of what holds it back, the same in all lanes; empty for nothing.
    hold_back: Vec<f64>,
}

impl Group {
    fn new(candidates: &[Candidate]) -> Self {
        let lanes = flight_lanes(candidates.len());
        let part = |of: fn(&Candidate) -> &Vec<f64>| {
            interleave(&candidates.iter().map(of).collect::<Vec<_>>(), lanes)
        };
        Self {
            candidates: candidates.len(),
            parameters: part(|candidate| &candidate.parameters),
            initial: part(|candidate| &candidate.initial),
            target: part(|candidate| &candidate.target),
            excitation: part(|candidate| &candidate.excitation),
            hold_back: vec![],
        }
    }

    #[inline(always)]
    fn lanes<V: Vector>(&self) -> GroupLanes<V> {
        GroupLanes {
            hold_back: splats(&self.hold_back),
            parameters: vectors(&self.parameters),
            initial: vectors(&self.initial),
            target: vectors(&self.target),
            excitation: vectors(&self.excitation),
        }
    }
}

/// A group as vectors.
struct GroupLanes<V> {
    parameters: Vec<V>,
    initial: Vec<V>,
    target: Vec<V>,
    excitation: Vec<V>,
    hold_back: Vec<V>,
}
