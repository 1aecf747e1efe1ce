//! A model: a program and the form that makes it dynamics (paper, section IV.A; specification, section 4).

use std::borrow::Cow;
use std::str::FromStr;

use crate::actuators::{Actuation, Line};
use crate::attitude::{angles, quaternion, turning};
use crate::difference::Periods;
use crate::dynamics::{Dynamics, step_apart};
use crate::error::{Error, Result, invalid};
use crate::integrator::{Field, Stages, rk4};
use crate::lanes::{Vector, vectors};
use crate::lgp::{Bank, Code, Inputs, Program};
use crate::sensors::{Recent, Sensors};
use crate::signals::{RigidBody, Signals};

/// What the outputs of a program mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// The next state.
    Absolute,
    /// What is added to the state.
    Increment,
    /// The derivative of each state whose motion no other states are declared to give, integrated by RK4.
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

    /// Inputs (states, then commands) and outputs that a program must have where nothing is hidden.
    pub fn shape(self, signals: &Signals) -> (usize, usize) {
        let outputs = match self {
            Self::Absolute | Self::Increment => signals.states(),
            Self::Acceleration => (0..signals.states()).filter(|&state| !signals.is_given(state)).count(),
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
    /// An angle of the rigid body, which goes on as a quaternion.
    Turn,
}

/// Where the derivative of each state comes from.
fn slopes(signals: &Signals) -> impl Iterator<Item = Slope> {
    let mut outputs = 0..;
    (0..signals.states()).map(move |state| {
        match signals.derivative_of.iter().position(|&of| of == Some(state)) {
            Some(rate) => Slope::State(rate),
            None if signals.is_given(state) => Slope::Turn,
            None => Slope::Output(outputs.next().expect("endless")),
        }
    })
}

/// How the outputs of programs become dynamics; shared by all models of a search.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    form: Form,
    dt: f64,
    /// Commands of the signals.
    commands: usize,
    /// What the inputs of a program after the states are multiplied by: commands, then hidden states.
    factors: Vec<f64>,
    slopes: Vec<Slope>,
    body: Option<RigidBody>,
    /// A model sees a periodic state within half a period of 0.
    periods: Periods,
    actuation: Actuation,
    sensors: Sensors,
}

impl Frame {
    /// The frame of a form for these signals.
    pub fn new(form: Form, signals: &Signals) -> Self {
        let slopes = slopes(signals).collect();
        let factors: Vec<f64> = signals.command_scales.iter().map(|scale| 1.0 / scale).collect();
        let (commands, actuation) = (factors.len(), Actuation::default());
        let (body, periods) = (signals.kinematics, signals.periods.clone());
        let (dt, sensors) = (signals.dt, Sensors::default());
        Self { form, dt, commands, factors, slopes, body, periods, actuation, sensors }
    }

    /// The same with something between commands and model, an actuator for each command.
    pub fn with_actuation(self, actuation: Actuation) -> Result<Self> {
        let actuation = actuation.validated(self.commands)?;
        let mut factors = self.factors;
        // Hidden states are made of commands in units of their scales.
        factors.resize(self.commands + actuation.hidden.len(), 1.0);
        Ok(Self { actuation, factors, ..self })
    }

    /// The same, read by such sensors.
    pub fn with_sensors(self, sensors: Sensors) -> Self {
        Self { sensors, ..self }
    }

    /// What reads the states.
    pub fn sensors(&self) -> &Sensors {
        &self.sensors
    }

    /// What stands between commands and model.
    pub fn actuation(&self) -> &Actuation {
        &self.actuation
    }

    /// What the outputs mean.
    pub fn form(&self) -> Form {
        self.form
    }

    /// Whether these signals have the states, commands, period and derivatives of the frame.
    pub fn fits(&self, signals: &Signals) -> bool {
        let factors = signals.command_scales.iter().map(|scale| 1.0 / scale);
        self.dt == signals.dt
            && self.body == signals.kinematics
            && self.periods == signals.periods
            && factors.eq(self.factors.iter().copied().take(self.commands))
            && slopes(signals).eq(self.slopes.iter().copied())
    }

    fn states(&self) -> usize {
        self.slopes.len()
    }

    pub(crate) fn commands(&self) -> usize {
        self.commands
    }

    pub(crate) fn periods(&self) -> &Periods {
        &self.periods
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

    /// Moves the states of a run on by the period whose command is remembered already.
    #[inline(always)]
    pub(crate) fn advance<V: Vector>(
        &self,
        workspace: &mut ModelWorkspace<V>,
        state: &mut [V],
        command: &[V],
    ) {
        let ModelWorkspace { bank, stages, line, turned, seen, .. } = workspace;
        let effects = match line {
            None => [command; 3],
            Some(line) => [&line.effects[0][..], &line.effects[1][..], &line.effects[2][..]],
        };
        match self.frame.form {
            form @ (Form::Absolute | Form::Increment) => {
                let outputs = self.outputs(bank, state, effects[1]);
                for (state, output) in state.iter_mut().zip(outputs) {
                    *state = if form == Form::Absolute { *output } else { *state + *output };
                }
            }
            Form::Acceleration => {
                let body = self.frame.body.as_ref();
                let before = body.map(|body| body.angles.map(|angle| state[angle]));
                if let Some(before) = before {
                    turned[..state.len()].copy_from_slice(state);
                    set_attitude(&mut turned[state.len()..], before);
                }
                let held = Held { model: self, bank, effects, stage: 0, before, seen };
                rk4(if body.is_some() { turned } else { state }, self.frame.dt, stages, held);
                if let (Some(body), Some(before)) = (body, before) {
                    let (states, attitude) = turned.split_at(state.len());
                    state.copy_from_slice(states);
                    set_angles(state, body, attitude, before);
                }
            }
        }
    }

    /// The code's outputs at a state, under a command.
    #[inline(always)]
    fn outputs<'b, V: Vector>(&self, bank: &'b mut Bank<V>, state: &[V], command: &[V]) -> &'b [V] {
        let mut wrapped = Vec::new();
        if self.frame.periods.any() {
            wrapped.extend_from_slice(state);
            self.frame.periods.wrap(&mut wrapped);
        }
        let state = if wrapped.is_empty() { state } else { &wrapped };
        self.code.run(bank, &StateAndCommand { state, command, factors: &self.frame.factors })
    }
}

/// The inputs of a model's program: states, commands in units of their scale, then hidden states.
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
#[derive(Clone)]
pub struct ModelWorkspace<V: Vector> {
    bank: Bank<V>,
    stages: Stages<V>,
    /// What the actuators hold, where there are any.
    line: Option<Line<V>>,
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
        self.workspace_of(self.code.bank_of(constants), self.line(Some(times)))
    }

    fn line<V: Vector>(&self, times: Option<&[V]>) -> Option<Line<V>> {
        let Frame { actuation, factors, dt, .. } = self.frame;
        (!actuation.is_direct()).then(|| Line::new(actuation, factors, *dt, times))
    }

    fn workspace_of<V: Vector>(&self, bank: Bank<V>, line: Option<Line<V>>) -> ModelWorkspace<V> {
        let states = if self.frame.form == Form::Acceleration { self.frame.states() } else { 0 };
        let body = if states > 0 && self.frame.body.is_some() { states } else { 0 };
        let turned = vec![V::splat(0.0); if body > 0 { body + 4 } else { 0 }];
        let (stages, seen) = (Stages::new(states.max(turned.len())), turned[..body].to_vec());
        ModelWorkspace { bank, stages, line, recent: Recent::default(), turned, seen }
    }
}

impl Dynamics for Model<'_> {
    type Workspace<V: Vector> = ModelWorkspace<V>;

    fn workspace<V: Vector>(&self) -> ModelWorkspace<V> {
        self.workspace_of(self.code.bank(), self.line(None))
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

/// A model in a period: the effect of the command is known at its start, middle and end.
struct Held<'a, V: Vector> {
    model: &'a Model<'a>,
    bank: &'a mut Bank<V>,
    effects: [&'a [V]; 3],
    stage: usize,
    /// Angles of the rigid body, if there is one, at the start of the period.
    before: Option<[V; 3]>,
    seen: &'a mut [V],
}

/// Which of the three effects each stage of the integrator sees.
const STAGES: [usize; 4] = [0, 1, 1, 2];

impl<V: Vector> Field<V> for Held<'_, V> {
    /// Of the states, and of the quaternion of a rigid body's angles behind them.
    #[inline(always)]
    fn slope(&mut self, point: &[V], slope: &mut [V]) {
        let frame = self.model.frame;
        let (states, attitude) = point.split_at(frame.states());
        let states = match (&frame.body, self.before) {
            (Some(body), Some(before)) => {
                self.seen.copy_from_slice(states);
                set_angles(self.seen, body, attitude, before);
                &*self.seen
            }
            _ => states,
        };
        let outputs = self.model.outputs(self.bank, states, self.effects[STAGES[self.stage]]);
        self.stage += 1;
        for (slope, source) in slope.iter_mut().zip(&frame.slopes) {
            *slope = match *source {
                Slope::State(rate) => states[rate],
                Slope::Output(output) => outputs[output],
                Slope::Turn => V::splat(0.0),
            };
        }
        if let Some(body) = &frame.body {
            set_turning(&mut slope[states.len()..], attitude, body.rates.map(|rate| states[rate]));
        }
    }
}

// An attitude is worked on a register after another: code that does so for many lanes at once is long, and no faster.

/// Writes the quaternion of a rigid body's angles.
#[inline(always)]
fn set_attitude<V: Vector>(attitude: &mut [V], angles: [V; 3]) {
    for piece in 0..V::PIECES {
        let found = quaternion(angles.map(|angle| angle.piece(piece)));
        attitude.iter_mut().zip(found).for_each(|(part, found)| part.set_piece(piece, found));
    }
}

/// Writes how body rates turn a quaternion.
#[inline(always)]
fn set_turning<V: Vector>(slope: &mut [V], attitude: &[V], rates: [V; 3]) {
    for piece in 0..V::PIECES {
        let attitude = std::array::from_fn(|i| attitude[i].piece(piece));
        let found = turning(attitude, rates.map(|rate| rate.piece(piece)));
        slope.iter_mut().zip(found).for_each(|(part, found)| part.set_piece(piece, found));
    }
}

/// Writes the angles of a quaternion into the states of a rigid body.
#[inline(always)]
fn set_angles<V: Vector>(state: &mut [V], body: &RigidBody, attitude: &[V], before: [V; 3]) {
    for piece in 0..V::PIECES {
        let attitude = std::array::from_fn(|i| attitude[i].piece(piece));
        let found = angles(attitude, before.map(|angle| angle.piece(piece)));
        body.angles.iter().zip(found).for_each(|(&at, angle)| state[at].set_piece(piece, angle));
    }
}
