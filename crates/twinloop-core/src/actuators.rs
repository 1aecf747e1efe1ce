//! Actuators: what stands between a command and its effect, a delay and a first-order lag; a hidden state of a model.

use crate::error::{Result, invalid};
use crate::lanes::Vector;

/// The way from one command to its effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Actuator {
    /// Time constant of the lag, s; 0 for none.
    pub lag: f64,
    /// Whole periods before a command begins to act.
    pub delay: usize,
    /// Command whose effect is there at the start of a run; none: the first one.
    pub rest: Option<f64>,
}

impl Actuator {
    /// A command that acts at once.
    pub const DIRECT: Self = Self { lag: 0.0, delay: 0, rest: None };
    /// More periods of delay than this are refused.
    pub const LONGEST_DELAY: usize = 1000;

    /// Refuses what no actuator has.
    pub fn validated(self) -> Result<Self> {
        let finite = self.lag.is_finite() && self.lag >= 0.0 && self.rest.is_none_or(f64::is_finite);
        if !finite || self.delay > Self::LONGEST_DELAY {
            return invalid(format!(
                "actuator: expected a lag of at least 0 s, a delay of at most {} periods and a finite rest, found \
                 {self:?}",
                Self::LONGEST_DELAY
            ));
        }
        Ok(self)
    }

    fn is_direct(&self) -> bool {
        self.lag == 0.0 && self.delay == 0
    }
}

/// Whether commands act at once, so that a model has no hidden state.
pub fn all_direct(actuators: &[Actuator]) -> bool {
    actuators.iter().all(Actuator::is_direct)
}

/// What the actuators of a run hold, and what they pass on in the current period.
pub struct Line<V> {
    actuators: Vec<Actuator>,
    /// e^(−dt / 2 lag) of each command.
    halves: Vec<V>,
    memory: Vec<V>,
    /// Commands on their way, the oldest first, for each command.
    queues: Vec<Vec<V>>,
    /// Effect at the start, the middle and the end of the period.
    pub effects: [Vec<V>; 3],
    started: bool,
}

impl<V: Vector> Line<V> {
    /// Actuators at the start of a run. `lags` (n_u lanes) stand in for those of the actuators, where they are given.
    pub fn new(actuators: &[Actuator], dt: f64, lags: Option<&[V]>) -> Self {
        let halves = actuators.iter().enumerate().map(|(i, actuator)| match lags {
            Some(lags) => lags[i].map(|lag| decay(lag, dt)),
            None => V::splat(decay(actuator.lag, dt)),
        });
        let zeros = || vec![V::splat(0.0); actuators.len()];
        Self {
            halves: halves.collect(),
            memory: zeros(),
            queues: actuators.iter().map(|actuator| Vec::with_capacity(actuator.delay + 1)).collect(),
            effects: [zeros(), zeros(), zeros()],
            actuators: actuators.to_vec(),
            started: false,
        }
    }

    /// Takes the commands of a period and moves on by it.
    #[inline(always)]
    pub fn pass(&mut self, command: &[V]) {
        for (i, &command) in command.iter().enumerate() {
            let Actuator { delay, rest, .. } = self.actuators[i];
            if !self.started {
                let before = match rest {
                    Some(rest) => V::splat(rest),
                    None => command,
                };
                self.memory[i] = before;
                for _ in 0..delay {
                    self.queues[i].push(before);
                }
            }
            self.queues[i].push(command);
            let arrived = self.queues[i].remove(0);
            let start = self.memory[i];
            let middle = arrived + (start - arrived) * self.halves[i];
            let end = arrived + (middle - arrived) * self.halves[i];
            self.effects[0][i] = start;
            self.effects[1][i] = middle;
            self.effects[2][i] = end;
            if self.actuators[i].lag == 0.0 {
                self.effects[0][i] = arrived;
            }
            self.memory[i] = end;
        }
        self.started = true;
    }
}

/// e^(−dt / 2 lag), 0 where there is no lag.
fn decay(lag: f64, dt: f64) -> f64 {
    if lag > 0.0 { libm::exp(-0.5 * dt / lag) } else { 0.0 }
}

/// Effects of recorded commands (n × n_u) at the start, the middle and the end of each period (n × n_u each).
pub fn effects(actuators: &[Actuator], dt: f64, commands: &[f64]) -> [Vec<f64>; 3] {
    use crate::lanes::Scalar;
    let mut line = Line::<Scalar>::new(actuators, dt, None);
    let mut out = [vec![], vec![], vec![]];
    for command in commands.chunks_exact(actuators.len().max(1)) {
        line.pass(&command.iter().map(|&value| Scalar::splat(value)).collect::<Vec<_>>());
        for (out, effects) in out.iter_mut().zip(&line.effects) {
            out.extend(effects.iter().map(|value| value.lane(0)));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_rises_as_one_minus_an_exponential() {
        let (lag, dt) = (0.05, 0.02);
        let actuator = Actuator { lag, delay: 0, rest: Some(1.0) };
        let [start, middle, end] = effects(&[actuator], dt, &[3.0; 20]);
        for k in 0..20 {
            let expected = |t: f64| 3.0 - 2.0 * (-t / lag).exp();
            let t = k as f64 * dt;
            assert!((start[k] - expected(t)).abs() < 1e-12);
            assert!((middle[k] - expected(t + 0.5 * dt)).abs() < 1e-12);
            assert!((end[k] - expected(t + dt)).abs() < 1e-12);
        }
    }

    #[test]
    fn a_delay_shifts_commands_by_whole_periods_and_nothing_is_direct() {
        let commands: Vec<f64> = (0..10).map(f64::from).collect();
        let [start, _, end] = effects(&[Actuator { lag: 0.0, delay: 3, rest: Some(-1.0) }], 0.1, &commands);
        let expected = [-1.0, -1.0, -1.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        assert_eq!(start, expected);
        assert_eq!(end, expected);
        let [start, middle, end] = effects(&[Actuator::DIRECT], 0.1, &commands);
        assert!(start == commands && middle == commands && end == commands);
    }
}
