//! A frame: what makes dynamics of a program's outputs.

use super::form::Form;
use crate::actuators::Actuation;
use crate::difference::Periods;
use crate::error::{Result, invalid};
use crate::hidden::Hidden;
use crate::levels::Levels;
use crate::sensors::Sensors;
use crate::signals::{RigidBody, Signals};

/// Where the derivative of a state comes from, in a form whose outputs are derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Slope {
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

/// What moves states that others give.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Given {
    /// A state goes on by another one.
    Integral { state: usize, of: usize },
    /// The angles of the rigid body go on by its rates.
    Turn,
}

/// All that is given, in an order in which what moves a state stands before it.
fn in_order(slopes: &[Slope], body: Option<&RigidBody>) -> Vec<Given> {
    let mut left: Vec<Given> = (0..slopes.len())
        .filter_map(|state| match slopes[state] {
            Slope::State(of) => Some(Given::Integral { state, of }),
            _ => None,
        })
        .chain(body.map(|_| Given::Turn))
        .collect();
    let mut known: Vec<bool> = slopes.iter().map(|slope| matches!(slope, Slope::Output(_))).collect();
    let mut found = vec![];
    while !left.is_empty() {
        let ready = |given: &Given| match given {
            Given::Integral { of, .. } => known[*of],
            Given::Turn => body.is_some_and(|body| body.rates.iter().all(|&rate| known[rate])),
        };
        // Of states that are each other's derivatives none is first.
        let next = left.remove(left.iter().position(ready).unwrap_or(0));
        match (next, body) {
            (Given::Integral { state, .. }, _) => known[state] = true,
            (Given::Turn, Some(body)) => body.angles.iter().for_each(|&angle| known[angle] = true),
            (Given::Turn, None) => {}
        }
        found.push(next);
    }
    found
}

/// How the outputs of programs become dynamics; shared by all models of a search.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    pub(super) form: Form,
    pub(super) dt: f64,
    /// Steps of the integrator in a period.
    pub(super) substeps: usize,
    /// Commands of the signals.
    commands: usize,
    /// What the inputs of a program after the states are multiplied by: commands, then hidden states.
    pub(super) factors: Vec<f64>,
    /// One over the scale of each state, for the hidden states that they fill.
    pub(super) state_factors: Vec<f64>,
    pub(super) slopes: Vec<Slope>,
    pub(super) given: Vec<Given>,
    pub(super) body: Option<RigidBody>,
    /// A model sees a periodic state within half a period of 0.
    pub(super) periods: Periods,
    pub(super) actuation: Actuation,
    pub(super) sensors: Sensors,
    pub(super) levels: Levels,
}

impl Frame {
    /// The frame of a form for these signals.
    pub fn new(form: Form, signals: &Signals) -> Self {
        let slopes: Vec<_> = slopes(signals).collect();
        let given = in_order(&slopes, signals.kinematics.as_ref());
        let factors: Vec<f64> = signals.command_scales.iter().map(|scale| 1.0 / scale).collect();
        let state_factors = signals.state_scales.iter().map(|scale| 1.0 / scale).collect();
        let (commands, actuation) = (factors.len(), Actuation::default());
        let (body, periods) = (signals.kinematics, signals.periods.clone());
        let (dt, substeps, sensors) = (signals.dt, signals.substeps(), Sensors::default());
        Self {
            form,
            dt,
            substeps,
            commands,
            factors,
            state_factors,
            slopes,
            given,
            body,
            periods,
            actuation,
            sensors,
            levels: Levels::default(),
        }
    }

    /// The same with something between commands and model, an actuator for each command.
    pub fn with_actuation(self, actuation: Actuation) -> Result<Self> {
        let actuation = actuation.validated(self.commands, self.slopes.len())?;
        if self.form != Form::Acceleration && actuation.hidden.iter().any(Hidden::is_fine) {
            return invalid(
                "hidden states: expected a gap, and two that turn while commands fill them, only in a law of derivatives \
                 that are integrated finely",
            );
        }
        let mut factors = self.factors;
        // Hidden states are made of commands in units of their scales.
        factors.resize(self.commands + actuation.hidden.len(), 1.0);
        Ok(Self { actuation, factors, ..self })
    }

    /// The same, read by such sensors.
    pub fn with_sensors(self, sensors: Sensors) -> Self {
        Self { sensors, ..self }
    }

    /// The same, with commands that are sent in such levels.
    pub fn with_levels(self, levels: Levels) -> Self {
        Self { levels, ..self }
    }

    /// What is sent of commands.
    pub fn levels(&self) -> &Levels {
        &self.levels
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
            && self.substeps == signals.substeps()
            && self.body == signals.kinematics
            && self.periods == signals.periods
            && factors.eq(self.factors.iter().copied().take(self.commands))
            && slopes(signals).eq(self.slopes.iter().copied())
    }

    pub(super) fn states(&self) -> usize {
        self.slopes.len()
    }

    pub(crate) fn commands(&self) -> usize {
        self.commands
    }

    pub(crate) fn periods(&self) -> &Periods {
        &self.periods
    }
}
