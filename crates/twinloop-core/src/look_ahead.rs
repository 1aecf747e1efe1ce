//! Looking ahead in the midst of a flight: which member of a committee says that a state will leave its envelope, and when.

use std::sync::Arc;

use crate::any_dynamics::{AnyDynamics, AnyWorkspace};
use crate::controller::Controllers;
use crate::dynamics::Dynamics;
use crate::error::{Result, invalid};
use crate::excitation::{Excitation, HoldBack};
use crate::lanes::{Scalar, Vector, scalars};
use crate::model::{Model, ModelWorkspace, OwnedModel};
use crate::rollout::{Commands, Midway, Seen, Start, Watch, resumed};
use crate::setting::Setting;
use crate::task::{Task, is_target};

/// The flight that is looked ahead in, and what it must keep to.
pub struct Ahead {
    /// Its signals, the limits of its runs, and the family of its controller.
    pub setting: Arc<Setting>,
    /// Of its controller (size).
    pub parameters: Vec<f64>,
    /// State to lead to: constant (n_x), or a row for each state ((n + 1) × n_x).
    pub target: Vec<f64>,
    /// What is added to the commands, n × n_u; empty for nothing.
    pub excitation: Vec<f64>,
    /// What holds that back.
    pub hold_back: Option<HoldBack>,
    /// Steps, n.
    pub steps: usize,
    /// Smallest and largest value of each state; infinite where a state has none.
    pub envelope: Vec<(f64, f64)>,
}

/// How a state will leave its envelope.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Leaving {
    /// Periods from now.
    pub periods: usize,
    /// The state.
    pub state: usize,
    /// The member that says so.
    pub member: usize,
}

/// Where a flight is: what its controller and the actuators of each member remember.
pub struct LookAhead {
    members: Vec<OwnedModel>,
    flight: Ahead,
    parameters: Vec<Scalar>,
    target: Vec<Scalar>,
    excitation: Vec<Scalar>,
    hold_back: Vec<Scalar>,
    controllers: Controllers<Scalar>,
    workspaces: Vec<ModelWorkspace<Scalar>>,
    period: usize,
}

impl LookAhead {
    /// At the start of a flight.
    pub fn new(members: Vec<OwnedModel>, flight: Ahead) -> Result<Self> {
        members.iter().try_for_each(|member| member.check_for(flight.setting.signals()))?;
        let Ahead { setting, parameters, target, excitation, hold_back, steps, envelope } = &flight;
        let (family, n_x, n_u) = (setting.family(), setting.signals().states(), setting.signals().commands());
        if family.is_foreign() {
            return invalid("look-ahead: expected a law of the engine, found one whose memory is its own");
        }
        let size = family.parameters().len();
        let fits = parameters.len() == size
            && is_target(target.len(), n_x, *steps)
            && (1..=Task::MOST_STEPS).contains(steps)
            && (excitation.is_empty() || excitation.len() == steps * n_u)
            && envelope.len() == n_x;
        if !fits || ![parameters, target, excitation].into_iter().flatten().all(|x| x.is_finite()) {
            return invalid(format!(
                "look-ahead: expected {size} finite parameters, targets, excitation and envelope of {n_x} states, {n_u} \
                 commands and {steps} steps, found others",
            ));
        }
        if let Some(hold_back) = hold_back {
            hold_back.check(n_x)?;
        }
        let hold_back = hold_back.as_ref().map_or_else(Vec::new, |found| scalars(found.lines()));
        let parameters = scalars(parameters);
        let controllers = family.start(&parameters);
        let (target, excitation) = (scalars(target), scalars(excitation));
        let workspaces = fresh(&members);
        Ok(Self {
            members,
            parameters,
            target,
            excitation,
            hold_back,
            controllers,
            workspaces,
            period: 0,
            flight,
        })
    }

    /// Back to the start.
    pub fn reset(&mut self) {
        self.controllers.reset();
        self.workspaces = fresh(&self.members);
        self.period = 0;
    }

    /// The soonest leaving within so many periods of a reading (n_x), if the controller goes on; none after the last step.
    pub fn leaving(&self, reading: &[f64], horizon: usize) -> Result<Option<Leaving>> {
        finite("reading", reading, self.states())?;
        let left = self.flight.steps.saturating_sub(self.period);
        let mut soonest: Option<Leaving> = None;
        for (member, (model, workspace)) in self.members.iter().zip(&self.workspaces).enumerate() {
            let within = soonest.map_or(horizon, |found| found.periods - 1).min(left);
            if within == 0 {
                break;
            }
            if let Some((periods, state)) = self.of_one(model.view(), workspace, reading, within) {
                soonest = Some(Leaving { periods, state, member });
            }
        }
        Ok(soonest)
    }

    fn of_one(
        &self,
        model: Model<'_>,
        workspace: &ModelWorkspace<Scalar>,
        reading: &[f64],
        steps: usize,
    ) -> Option<(usize, usize)> {
        let (family, n_x) = (&**self.flight.setting.family(), reading.len());
        let from = |rows: &[Scalar], width: usize| rows.get(self.period * width..).map_or(0, <[_]>::len);
        let target = if self.target.len() == n_x { n_x } else { from(&self.target, n_x) };
        let excitation = from(&self.excitation, family.commands());
        let start = Start {
            commands: Commands::Law {
                family,
                parameters: &self.parameters,
                target: &self.target[self.target.len() - target..],
                excitation: Excitation {
                    rows: &self.excitation[self.excitation.len() - excitation..],
                    hold_back: &self.hold_back,
                },
            },
            initial: &model.state_of(&scalars(reading)),
            steps,
            limits: self.flight.setting.limits(),
            noise: &[],
            disturbance: &[],
        };
        let workspace = AnyWorkspace::Model(workspace.clone());
        let midway = Midway { workspace, controllers: self.controllers.ahead() };
        let mut fence = Fence { envelope: &self.flight.envelope, found: None };
        let lasted = resumed(AnyDynamics::Model(model), midway, &start, &mut fence);
        // A run that diverges leaves any envelope; where no state has one, the step itself is all that is known.
        fence.found.or_else(|| (lasted[0] < steps).then_some((lasted[0] + 1, 0)))
    }

    /// Moves the flight on by a period: what the controller read, where it led, and what was sent.
    pub fn sent(&mut self, reading: &[f64], target: &[f64], command: &[f64]) -> Result<()> {
        finite("reading", reading, self.states())?;
        finite("target", target, self.states())?;
        finite("command", command, self.flight.setting.signals().commands())?;
        let mut own = vec![Scalar::splat(0.0); command.len()];
        self.flight.setting.family().command(
            &mut self.controllers,
            &scalars(reading),
            &scalars(target),
            &mut own,
        );
        let command = scalars(command);
        for (model, workspace) in self.members.iter().zip(&mut self.workspaces) {
            let model = model.view();
            let state = model.state_of(&scalars(reading));
            model.pass(workspace, &state, &command);
        }
        self.period += 1;
        Ok(())
    }

    /// What the first member expects to be read (n_x) a period after a reading (n_x) and a command (n_u).
    pub fn following(&self, reading: &[f64], command: &[f64]) -> Result<Vec<f64>> {
        finite("state", reading, self.states())?;
        finite("command", command, self.flight.setting.signals().commands())?;
        let mut following = scalars(reading);
        if let (Some(model), Some(workspace)) = (self.members.first(), self.workspaces.first()) {
            let model = model.view();
            let (mut workspace, mut state) = (workspace.clone(), model.state_of(&following));
            // Late sensors read what they have seen.
            model.read(&mut workspace, &state, &mut following);
            model.step(&mut workspace, &mut state, &scalars(command));
            model.read(&mut workspace, &state, &mut following);
        }
        Ok(following.iter().map(|lane| lane.lane(0)).collect())
    }

    fn states(&self) -> usize {
        self.flight.setting.signals().states()
    }
}

/// The first time that a state is outside.
struct Fence<'a> {
    envelope: &'a [(f64, f64)],
    /// Periods, and the state.
    found: Option<(usize, usize)>,
}

impl Watch<Scalar> for Fence<'_> {
    #[inline(always)]
    fn see(&mut self, seen: Seen<'_, Scalar>) {
        if self.found.is_some() {
            return;
        }
        for (state, (value, &(low, high))) in seen.next.iter().zip(self.envelope).enumerate() {
            // A NaN is not inside.
            if !(low..=high).contains(&value.lane(0)) {
                self.found = Some((seen.step + 1, state));
                return;
            }
        }
    }
}

/// Workspaces at the start of a flight.
fn fresh(members: &[OwnedModel]) -> Vec<ModelWorkspace<Scalar>> {
    members.iter().map(|member| member.view().workspace()).collect()
}

/// Refuses anything but so many finite numbers.
fn finite(what: &str, found: &[f64], expected: usize) -> Result<()> {
    if found.len() == expected && found.iter().all(|x| x.is_finite()) {
        return Ok(());
    }
    invalid(format!("look-ahead: expected a {what} of {expected} finite numbers, found {found:?}"))
}
