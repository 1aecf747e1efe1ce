//! One PID per axis (paper, section V.B): derivative on the measurement, no anti-windup.

use super::Law;
use super::mixer::Mixer;
use crate::error::{Result, invalid};
use crate::lanes::Vector;

/// What one loop controls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Axis {
    /// The state that is led to its target.
    pub angle: usize,
    /// The state that is its measured rate; none: the difference of the measured angle over a period.
    pub rate: Option<usize>,
}

/// A PID per axis and an output map; parameters (K_P, K_I, K_D) for the first axis, then the second, …
#[derive(Clone, Debug, PartialEq)]
pub struct Pid {
    /// The loops.
    pub axes: Vec<Axis>,
    /// From the loops' outputs to commands.
    pub output: Mixer,
    /// Period of the commands, s.
    pub dt: f64,
}

/// What an axis remembers.
const INTEGRAL: usize = 0;
const OUTPUT: usize = 1;
const LAST_ANGLE: usize = 2;
const STARTED: usize = 3;
const MEMORY: usize = 4;

impl Pid {
    /// Refuses axes that name states which are not there.
    pub(super) fn check(&self, states: usize) -> Result<()> {
        for axis in &self.axes {
            if axis.angle >= states || axis.rate.is_some_and(|rate| rate >= states) {
                return invalid(format!(
                    "controller: expected axes over states 0 to {}, found {axis:?}",
                    states - 1
                ));
            }
        }
        Ok(())
    }
}

impl Law for Pid {
    fn memory(&self) -> usize {
        MEMORY * self.axes.len()
    }

    #[inline(always)]
    fn command<V: Vector>(
        &self,
        parameters: &[V],
        memory: &mut [V],
        state: &[V],
        target: &[V],
        command: &mut [V],
    ) {
        for ((axis, gains), memory) in
            self.axes.iter().zip(parameters.chunks_exact(3)).zip(memory.chunks_exact_mut(MEMORY))
        {
            let angle = state[axis.angle];
            let error = target[axis.angle] - angle;
            let rate = match axis.rate {
                Some(rate) => state[rate],
                None => {
                    let difference = (angle - memory[LAST_ANGLE]) / self.dt;
                    let rate = difference * memory[STARTED];
                    memory[LAST_ANGLE] = angle;
                    memory[STARTED] = V::splat(1.0);
                    rate
                }
            };
            memory[INTEGRAL] = memory[INTEGRAL] + error * self.dt;
            memory[OUTPUT] = gains[0] * error + gains[1] * memory[INTEGRAL] - gains[2] * rate;
        }
        self.output.apply(&memory[OUTPUT..], MEMORY, command);
    }
}
