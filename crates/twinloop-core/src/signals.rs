//! What the engine knows of a system's signals: period, scales, bounds, and which state is the derivative of which.

use crate::difference::Periods;
use crate::error::{Result, invalid};

/// States and commands as numbers; their names and units live in the layers above.
#[derive(Clone, Debug, PartialEq)]
pub struct Signals {
    /// Period of the commands, s.
    pub dt: f64,
    /// Usual size of each state (n_x,).
    pub state_scales: Vec<f64>,
    /// Smallest and largest value of each command (n_u,).
    pub command_bounds: Vec<(f64, f64)>,
    /// What a model sees as 1 of each command (n_u,).
    pub command_scales: Vec<f64>,
    /// The state that each state is the derivative of, where that is known (n_x,).
    pub derivative_of: Vec<Option<usize>>,
    /// Angles and rates of a rigid body, where the states hold them.
    pub kinematics: Option<RigidBody>,
    /// Which states are periodic.
    pub periods: Periods,
}

/// Three angles (roll, pitch, yaw; z-y-x) and the three body rates that turn them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RigidBody {
    /// Their states.
    pub angles: [usize; 3],
    /// Their states.
    pub rates: [usize; 3],
}

impl Signals {
    /// Angle by which a rigid body turns in one step of the integrator at most, rad: a step of order four leaves some
    /// 5e-7 rad of it.
    pub const FARTHEST_TURN: f64 = 0.25;
    /// More steps a period than this are not taken.
    const MOST_SUBSTEPS: f64 = 64.0;

    /// Refuses signals that no loop can be closed with.
    pub fn validated(self) -> Result<Self> {
        let positive = |x: f64| x.is_finite() && x > 0.0;
        let states = self.states();
        let mut integrated = vec![false; states];
        let complaint = if !positive(self.dt) {
            format!("expected a period above 0 s, found {}", self.dt)
        } else if states == 0 || self.commands() == 0 {
            "expected at least one state and one command".to_owned()
        } else if self.command_scales.len() != self.commands() || self.derivative_of.len() != states {
            "expected one scale for each command and one derivative entry for each state".to_owned()
        } else if !self.state_scales.iter().chain(&self.command_scales).all(|&x| positive(x)) {
            "expected scales above 0".to_owned()
        } else if let Some((low, high)) = self
            .command_bounds
            .iter()
            .find(|(low, high)| !(low.is_finite() && high.is_finite() && low < high))
        {
            format!("expected command bounds low < high, found {low} and {high}")
        } else if self.derivative_of.iter().enumerate().any(|(state, of)| {
            of.is_some_and(|of| of >= states || of == state || std::mem::replace(&mut integrated[of], true))
        }) {
            "expected each state to be the integral of at most one other state".to_owned()
        } else if self.kinematics.is_some_and(|body| {
            let mut all = [body.angles, body.rates].concat();
            all.sort_unstable();
            all.windows(2).any(|pair| pair[0] == pair[1])
                || all[5] >= states
                || body.angles.iter().any(|&angle| integrated[angle])
        }) {
            "expected six different states in the kinematics, none of the angles the integral of another"
                .to_owned()
        } else if !self.periods.fit(states) {
            format!("expected a period or none for each of {states} states")
        } else {
            return Ok(self);
        };
        invalid(format!("signals: {complaint}"))
    }

    /// Number of states, n_x.
    pub fn states(&self) -> usize {
        self.state_scales.len()
    }

    /// Whether other states alone say how a state moves: it is the integral of one, or an angle of a rigid body.
    pub fn is_given(&self, state: usize) -> bool {
        self.derivative_of.contains(&Some(state))
            || self.kinematics.is_some_and(|body| body.angles.contains(&state))
    }

    /// Steps in which a model integrates a rigid body over a period, so that at the scale of its rates it turns by
    /// [`Self::FARTHEST_TURN`] at most in each; 1 for what is no rigid body. Signals alone decide it: all models, exports
    /// and lanes do the same.
    pub fn substeps(&self) -> usize {
        let Some(body) = self.kinematics else { return 1 };
        let fastest = body.rates.iter().fold(0.0_f64, |most, &rate| most.max(self.state_scales[rate]));
        // A quotient that is whole but for its rounding takes no step more.
        let steps = libm::ceil(self.dt * fastest / Self::FARTHEST_TURN - 1e-9);
        steps.clamp(1.0, Self::MOST_SUBSTEPS) as usize
    }

    /// Number of commands, n_u.
    pub fn commands(&self) -> usize {
        self.command_bounds.len()
    }
}
