//! A model: a program and the form that makes it dynamics (paper, section IV.A; specification, section 4).

mod euler;
mod form;
mod frame;
mod held;
mod inputs;
mod owned;
mod turning;

pub use form::Form;
pub use frame::Frame;
pub use owned::{OwnedModel, views};

use std::borrow::Cow;

use crate::actuators::Line;
use crate::dynamics::{Dynamics, step_apart};
use crate::error::{Result, invalid};
use crate::hidden::Storage;
use crate::integrator::{Stages, rk4};
use crate::lanes::{Vector, numbers, vectors, zeros};
use crate::levels::Levels;
use crate::lgp::{Bank, Code, Program};
use crate::sensors::Recent;
use crate::signals::Signals;
use euler::euler;
use held::Held;
use inputs::{Interleaved, StateAndCommand};
use turning::turn;

/// Code in a frame: dynamics that were learnt.
#[derive(Clone, Copy)]
pub struct Model<'a> {
    /// The effective program.
    pub code: &'a Code,
    /// What makes it dynamics.
    pub frame: &'a Frame,
}

impl<'a> Model<'a> {
    /// Refuses a program whose inputs and outputs do not fit the form, with so many hidden states after the commands.
    pub fn check(program: &Program, form: Form, signals: &Signals, hidden: usize) -> Result<()> {
        let (inputs, outputs) = form.shape(signals);
        let inputs = inputs + hidden;
        let shape = program.shape();
        if (shape.inputs, shape.outputs) != (inputs, outputs) {
            return invalid(format!(
                "model: expected a program of {inputs} inputs and {outputs} outputs for the form {}, found {} and {}",
                form.name(),
                shape.inputs,
                shape.outputs
            ));
        }
        Ok(())
    }

    /// The next states of interleaved states (n_x × lanes) under interleaved commands (n_u × lanes): what
    /// [`step`](Dynamics::step) gives, with fewer copies where the outputs are the next state.
    #[inline(always)]
    pub(crate) fn predict<'w, V: Vector>(
        &self,
        workspace: &'w mut ModelWorkspace<V>,
        state: &[f64],
        command: &[f64],
    ) -> Cow<'w, [V]> {
        let Frame { form, actuation, periods, .. } = self.frame;
        if *form == Form::Absolute && actuation.is_direct() && !periods.any() {
            let inputs = Interleaved { state, command, factors: &self.frame.factors };
            return Cow::Borrowed(self.code.run(&mut workspace.bank, &inputs));
        }
        let mut state = vectors(state);
        step_apart(self, workspace, &mut state, &vectors::<V>(command));
        Cow::Owned(state)
    }

    /// Moves the memory on by a period that began at a state, under a command.
    pub(crate) fn pass<V: Vector>(&self, workspace: &mut ModelWorkspace<V>, state: &[V], command: &[V]) {
        if workspace.storage.is_some() {
            step_apart(self, workspace, &mut state.to_vec(), command);
        } else {
            self.remember(workspace, command);
        }
    }

    /// Moves the states of a run on by the period whose command is remembered already.
    #[inline(always)]
    fn advance<V: Vector>(&self, workspace: &mut ModelWorkspace<V>, state: &mut [V], command: &[V]) {
        let ModelWorkspace { bank, stages, line, storage, turned, seen, .. } = workspace;
        let effects = match line {
            None => [command; 3],
            Some(line) => [&line.effects[0][..], &line.effects[1][..], &line.effects[2][..]],
        };
        match self.frame.form {
            Form::Acceleration => {
                let field = Held { model: self, bank, storage, effects, stage: 0 };
                match &self.frame.body {
                    None => rk4(state, self.frame.dt, stages, field),
                    Some(body) => turn(state, self.frame, stages, field, body, turned, seen),
                }
            }
            form => {
                let stepped = matches!(form, Form::ExplicitEuler | Form::SemiImplicitEuler);
                let outputs = self.outputs(bank, storage, state, effects[usize::from(!stepped)]);
                match form {
                    Form::Absolute => state.copy_from_slice(outputs),
                    Form::Increment => {
                        for (state, &output) in state.iter_mut().zip(outputs) {
                            *state = *state + output;
                        }
                    }
                    _ => euler(state, outputs, self.frame, form == Form::SemiImplicitEuler),
                }
            }
        }
    }

    /// The code's outputs at the next point of a period: a state, under a command.
    #[inline(always)]
    fn outputs<'b, V: Vector>(
        &self,
        bank: &'b mut Bank<V>,
        storage: &mut Option<Box<Storage<V>>>,
        state: &[V],
        command: &[V],
    ) -> &'b [V] {
        let command = match storage {
            None => command,
            Some(storage) => storage.see(state, command),
        };
        let mut wrapped = Vec::new();
        if self.frame.periods.any() {
            wrapped.extend_from_slice(state);
            self.frame.periods.wrap(&mut wrapped);
        }
        let state = if wrapped.is_empty() { state } else { &wrapped };
        self.code.run(bank, &StateAndCommand { state, command, factors: &self.frame.factors })
    }
}

/// Registers and integrator stages of a model's run.
#[derive(Clone)]
pub struct ModelWorkspace<V: Vector> {
    bank: Bank<V>,
    stages: Stages<V>,
    /// What the actuators hold, where there are any.
    line: Option<Line<V>>,
    /// What motion has filled, where it fills anything.
    storage: Option<Box<Storage<V>>>,
    /// What sensors may read yet.
    recent: Recent,
    /// Of a rigid body: the states and the quaternion of its angles behind them; the states of a stage.
    turned: Vec<V>,
    seen: Vec<V>,
}

impl<'a> Model<'a> {
    /// A workspace whose lanes are models of their own: constants of the code (each on lanes, in the code's order), and
    /// times of the actuation.
    pub(crate) fn variants<V: Vector>(&self, constants: &[V], times: &[V]) -> ModelWorkspace<V> {
        self.workspace_of(self.code.bank_of(constants), Some(times))
    }

    /// What commands and motion leave in the actuation, at the start of a run. `times` (lanes) stand in for its own, where
    /// they are given.
    #[inline(never)]
    fn memory<V: Vector>(&self, times: Option<&[V]>) -> (Option<Line<V>>, Option<Box<Storage<V>>>) {
        let Frame { actuation, factors, state_factors, dt, .. } = self.frame;
        let times = times.map_or_else(|| actuation.times_on(V::LANES), numbers);
        let line = Line::new(actuation, factors, *dt, &times);
        let of_hidden = &times[actuation.actuators.len() * V::LANES..];
        let staged = self.frame.form == Form::Acceleration;
        let steps = if staged && self.frame.body.is_some() { self.frame.substeps } else { 1 };
        let factors = [&state_factors[..], factors];
        (Some(line), Storage::new(&actuation.hidden, factors, of_hidden, dt / steps as f64, staged))
    }

    fn workspace_of<V: Vector>(&self, bank: Bank<V>, times: Option<&[V]>) -> ModelWorkspace<V> {
        let (line, storage) = match self.frame.actuation.is_direct() {
            true => (None, None),
            false => self.memory(times),
        };
        let states = if self.frame.form == Form::Acceleration { self.frame.states() } else { 0 };
        let body = if states > 0 && self.frame.body.is_some() { states } else { 0 };
        let turned = zeros(if body > 0 { body + 4 } else { 0 });
        let (stages, seen) = (Stages::new(states.max(turned.len())), zeros(body));
        ModelWorkspace { bank, stages, line, storage, recent: Recent::default(), turned, seen }
    }
}

impl Dynamics for Model<'_> {
    type Workspace<V: Vector> = ModelWorkspace<V>;

    fn workspace<V: Vector>(&self) -> ModelWorkspace<V> {
        self.workspace_of(self.code.bank(), None)
    }

    #[inline(always)]
    fn remember<V: Vector>(&self, workspace: &mut ModelWorkspace<V>, command: &[V]) {
        if let Some(line) = &mut workspace.line {
            line.pass(command);
        }
    }

    #[inline(always)]
    fn step<V: Vector>(&self, workspace: &mut ModelWorkspace<V>, state: &mut [V], command: &[V]) {
        self.remember(workspace, command);
        self.advance(workspace, state, command);
    }

    #[inline(always)]
    fn levels(&self) -> Option<&Levels> {
        Some(&self.frame.levels).filter(|levels| !levels.is_none())
    }

    #[inline(always)]
    fn in_time(&self) -> bool {
        self.frame.sensors.in_time()
    }

    #[inline(always)]
    fn read<V: Vector>(&self, workspace: &mut ModelWorkspace<V>, state: &[V], reading: &mut [V]) {
        self.frame.sensors.read(&mut workspace.recent, state, reading);
    }

    #[inline(always)]
    fn state_of<V: Vector>(&self, reading: &[V]) -> Vec<V> {
        if self.in_time() { reading.to_vec() } else { self.frame.sensors.state_of(reading) }
    }
}
