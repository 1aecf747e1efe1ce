//! A model: a program and the form that makes it dynamics (paper, section IV.A; specification, section 4).

use std::borrow::Cow;
use std::str::FromStr;

use crate::dynamics::Dynamics;
use crate::error::{Error, Result, invalid};
use crate::integrator::{Field, Stages, rk4};
use crate::lanes::{Vector, vectors};
use crate::lgp::{Bank, Code, Inputs, Program};
use crate::signals::Signals;

/// What the outputs of a program mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// The next state.
    Absolute,
    /// What is added to the state.
    Increment,
    /// The derivative of each state that no other state is declared the derivative of, integrated by RK4.
    Acceleration,
}

impl Form {
    /// Every form.
    pub const ALL: [Self; 3] = [Self::Absolute, Self::Increment, Self::Acceleration];

    /// The name that [`FromStr`] reads.
    pub fn name(self) -> &'static str {
        match self {
            Self::Absolute => "absolute",
            Self::Increment => "increment",
            Self::Acceleration => "acceleration",
        }
    }

    /// Inputs (states, then commands) and outputs that a program must have.
    pub fn shape(self, signals: &Signals) -> (usize, usize) {
        let outputs = match self {
            Self::Absolute | Self::Increment => signals.states(),
            Self::Acceleration => signals.states() - signals.derivative_of.iter().flatten().count(),
        };
        (signals.states() + signals.commands(), outputs)
    }
}

impl FromStr for Form {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        match Self::ALL.into_iter().find(|form| form.name() == name) {
            Some(form) => Ok(form),
            None => invalid(format!(
                "form: expected one of {}, found {name:?}",
                Self::ALL.map(Self::name).join(", ")
            )),
        }
    }
}

/// Where the derivative of a state comes from, in the form [`Form::Acceleration`].
#[derive(Clone, Copy, Debug, PartialEq)]
enum Slope {
    State(usize),
    Output(usize),
}

/// How the outputs of programs become dynamics; shared by all models of a search.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    form: Form,
    dt: f64,
    command_factors: Vec<f64>,
    slopes: Vec<Slope>,
}

impl Frame {
    /// The frame of a form for these signals.
    pub fn new(form: Form, signals: &Signals) -> Self {
        let mut outputs = 0..;
        let slopes = (0..signals.states()).map(|state| {
            match signals.derivative_of.iter().position(|&of| of == Some(state)) {
                Some(rate) => Slope::State(rate),
                None => Slope::Output(outputs.next().expect("endless")),
            }
        });
        let slopes = slopes.collect();
        let command_factors = signals.command_scales.iter().map(|scale| 1.0 / scale).collect();
        Self { form, dt: signals.dt, command_factors, slopes }
    }

    /// What the outputs mean.
    pub fn form(&self) -> Form {
        self.form
    }

    /// Whether these signals have the states, commands, period and derivatives of the frame.
    pub fn fits(&self, signals: &Signals) -> bool {
        *self == Self::new(self.form, signals)
    }

    fn states(&self) -> usize {
        self.slopes.len()
    }
}

/// Code in a frame: dynamics that were learnt.
#[derive(Clone, Copy)]
pub struct Model<'a> {
    /// The effective program.
    pub code: &'a Code,
    /// What makes it dynamics.
    pub frame: &'a Frame,
}

impl<'a> Model<'a> {
    /// Refuses a program whose inputs and outputs do not fit the form.
    pub fn check(program: &Program, form: Form, signals: &Signals) -> Result<()> {
        let (inputs, outputs) = form.shape(signals);
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
        if self.frame.form == Form::Absolute {
            let inputs = Interleaved { state, command, factors: &self.frame.command_factors };
            return Cow::Borrowed(self.code.run(&mut workspace.bank, &inputs));
        }
        let mut state = vectors(state);
        self.step(workspace, &mut state, &vectors::<V>(command));
        Cow::Owned(state)
    }

    /// The code's outputs at a state, under a command.
    #[inline(always)]
    fn outputs<'b, V: Vector>(&self, bank: &'b mut Bank<V>, state: &[V], command: &[V]) -> &'b [V] {
        self.code.run(bank, &StateAndCommand { state, command, factors: &self.frame.command_factors })
    }
}

/// The inputs of a model's program: states, then commands in units of their scale.
struct StateAndCommand<'a, V> {
    state: &'a [V],
    command: &'a [V],
    factors: &'a [f64],
}

impl<V: Vector> Inputs<V> for StateAndCommand<'_, V> {
    #[inline(always)]
    fn input(&self, i: usize) -> V {
        match i.checked_sub(self.state.len()) {
            None => self.state[i],
            Some(j) => self.command[j] * self.factors[j],
        }
    }
}

/// The same inputs where they lie, as interleaved numbers.
struct Interleaved<'a> {
    state: &'a [f64],
    command: &'a [f64],
    factors: &'a [f64],
}

impl<V: Vector> Inputs<V> for Interleaved<'_> {
    #[inline(always)]
    fn input(&self, i: usize) -> V {
        match (i * V::LANES).checked_sub(self.state.len()) {
            None => V::load(&self.state[i * V::LANES..]),
            Some(place) => V::load(&self.command[place..]) * self.factors[place / V::LANES],
        }
    }
}

/// Registers and integrator stages of a model's run.
pub struct ModelWorkspace<V: Vector> {
    bank: Bank<V>,
    stages: Stages<V>,
}

impl Dynamics for Model<'_> {
    type Workspace<V: Vector> = ModelWorkspace<V>;

    fn workspace<V: Vector>(&self) -> ModelWorkspace<V> {
        let integrated = if self.frame.form == Form::Acceleration { self.frame.states() } else { 0 };
        ModelWorkspace { bank: self.code.bank(), stages: Stages::new(integrated) }
    }

    #[inline(always)]
    fn step<V: Vector>(&self, workspace: &mut ModelWorkspace<V>, state: &mut [V], command: &[V]) {
        let ModelWorkspace { bank, stages } = workspace;
        match self.frame.form {
            Form::Absolute => state.copy_from_slice(self.outputs(bank, state, command)),
            Form::Increment => {
                let increments = self.outputs(bank, state, command);
                for (state, increment) in state.iter_mut().zip(increments) {
                    *state = *state + *increment;
                }
            }
            Form::Acceleration => rk4(state, self.frame.dt, stages, Held { model: self, bank, command }),
        }
    }
}

/// A model under a command.
struct Held<'a, V: Vector> {
    model: &'a Model<'a>,
    bank: &'a mut Bank<V>,
    command: &'a [V],
}

impl<V: Vector> Field<V> for Held<'_, V> {
    #[inline(always)]
    fn slope(&mut self, point: &[V], slope: &mut [V]) {
        let outputs = self.model.outputs(self.bank, point, self.command);
        for (slope, source) in slope.iter_mut().zip(&self.model.frame.slopes) {
            *slope = match *source {
                Slope::State(rate) => point[rate],
                Slope::Output(output) => outputs[output],
            };
        }
    }
}
