//! A PID per axis (paper, section V.B), alone or inside a loop that asks it for a rate, as autopilots have it.

use super::Law;
use super::mixer::Mixer;
use crate::difference::Periods;
use crate::error::{Result, invalid};
use crate::lanes::Vector;

/// What one PID controls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// The state that is led to its set point.
    pub state: usize,
    /// The state that is its measured rate; none: the difference of the state over a period.
    pub rate: Option<usize>,
    /// The loop around it; none: the set point is the target.
    pub outer: Option<Outer>,
}

/// A proportional loop around a PID: it turns the error of an angle into the rate that the PID is to keep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outer {
    /// The state whose error asks for a rate.
    pub angle: usize,
    /// Largest rate that is asked for, in either direction; may be infinite.
    pub limit: f64,
}

impl Axis {
    /// Number of its gains: K_P, K_I and K_D, and before them that of the outer loop.
    fn gains(&self) -> usize {
        3 + usize::from(self.outer.is_some())
    }
}

/// A PID per axis and an output map; gains ((K of the outer loop), K_P, K_I, K_D) for the first axis, then the second, …
#[derive(Clone, Debug, PartialEq)]
pub struct Pid {
    axes: Vec<Axis>,
    output: Mixer,
    pub(super) dt: f64,
    /// Weight of a new rate in the filtered one; 1: no filter.
    share: f64,
    anti_windup: bool,
}

/// What an axis remembers.
const INTEGRAL: usize = 0;
const OUTPUT: usize = 1;
const LAST_VALUE: usize = 2;
const STARTED: usize = 3;
/// The filtered rate.
const RATE: usize = 4;
/// The integral a period before.
const INTEGRAL_BEFORE: usize = 5;
const MEMORY: usize = 6;

impl Pid {
    /// The plain one: no filter, no anti-windup. `dt` is the period of the commands, s.
    pub fn new(axes: Vec<Axis>, output: Mixer, dt: f64) -> Self {
        Self { axes, output, dt, share: 1.0, anti_windup: false }
    }

    /// The same with a low-pass filter of first order on the rates, of a time constant in s.
    pub fn filtered(self, time: f64) -> Result<Self> {
        if !(time.is_finite() && time >= 0.0) {
            return invalid(format!("derivative filter: expected a time of at least 0 s, found {time}"));
        }
        Ok(Self { share: self.dt / (self.dt + time), ..self })
    }

    /// The same with integrals that stop where more of them would only push commands further beyond their bounds.
    pub fn with_anti_windup(self) -> Self {
        Self { anti_windup: true, ..self }
    }

    /// The rate of an axis: measured, or the difference of its state, and filtered.
    #[inline(always)]
    fn rate<V: Vector>(&self, periods: &Periods, axis: &Axis, memory: &mut [V], state: &[V]) -> V {
        let (value, started) = (state[axis.state], memory[STARTED]);
        let rate = match axis.rate {
            Some(rate) => state[rate],
            None => periods.difference(axis.state, value, memory[LAST_VALUE]) / self.dt * started,
        };
        memory[LAST_VALUE] = value;
        memory[STARTED] = V::splat(1.0);
        if self.share == 1.0 {
            return rate;
        }
        // The filter starts where the first rate is.
        let filtered = memory[RATE] + (rate - memory[RATE]) * self.share;
        memory[RATE] = V::splat(0.0).select_less(started, filtered, rate);
        memory[RATE]
    }

    /// Takes back the last step of every integral that pushed a command further beyond the bound that it is at.
    #[inline(always)]
    fn unwind<V: Vector>(&self, gains: &[V], memory: &mut [V], command: &[V]) {
        let (zero, one) = (V::splat(0.0), V::splat(1.0));
        let mut first = 0;
        for (i, (axis, memory)) in self.axes.iter().zip(memory.chunks_exact_mut(MEMORY)).enumerate() {
            first += axis.gains();
            let push = gains[first - 2] * (memory[INTEGRAL] - memory[INTEGRAL_BEFORE]);
            let mut wound = zero;
            for ((factor, command), &(low, high)) in
                self.output.column(i).zip(command).zip(self.output.bounds())
            {
                let push = push * factor;
                let at_high = command.select_less(V::splat(high), zero, one);
                let at_low = V::splat(low).select_less(*command, zero, one);
                wound = wound + zero.select_less(push, at_high, zero) + push.select_less(zero, at_low, zero);
            }
            memory[INTEGRAL] = zero.select_less(wound, memory[INTEGRAL_BEFORE], memory[INTEGRAL]);
        }
    }
}

impl Law for Pid {
    fn gains(&self) -> usize {
        self.axes.iter().map(Axis::gains).sum()
    }

    fn memory(&self) -> usize {
        MEMORY * self.axes.len()
    }

    fn output(&self) -> &Mixer {
        &self.output
    }

    fn check(&self, states: usize) -> Result<()> {
        for axis in &self.axes {
            let outer = axis.outer.map(|outer| outer.angle);
            if [Some(axis.state), axis.rate, outer].into_iter().flatten().any(|state| state >= states) {
                return invalid(format!(
                    "controller: expected axes over states 0 to {}, found {axis:?}",
                    states - 1
                ));
            }
            if axis.outer.is_some_and(|outer| outer.limit.is_nan() || outer.limit <= 0.0) {
                return invalid(format!("controller: expected limits of the rates above 0, found {axis:?}"));
            }
        }
        Ok(())
    }

    #[inline(always)]
    fn command<V: Vector>(
        &self,
        periods: &Periods,
        gains: &[V],
        memory: &mut [V],
        state: &[V],
        target: &[V],
        command: &mut [V],
    ) {
        let mut first = 0;
        for (axis, memory) in self.axes.iter().zip(memory.chunks_exact_mut(MEMORY)) {
            let mut set_point = target[axis.state];
            if let Some(Outer { angle, limit }) = axis.outer {
                let asked = gains[first] * periods.difference(angle, target[angle], state[angle]) + set_point;
                set_point = asked.clamp(-limit, limit);
            }
            first += axis.gains();
            let gains = &gains[first - 3..first];
            let error = periods.difference(axis.state, set_point, state[axis.state]);
            let rate = self.rate(periods, axis, memory, state);
            memory[INTEGRAL_BEFORE] = memory[INTEGRAL];
            memory[INTEGRAL] = memory[INTEGRAL] + error * self.dt;
            memory[OUTPUT] = gains[0] * error + gains[1] * memory[INTEGRAL] - gains[2] * rate;
        }
        self.output.apply(&memory[OUTPUT..], MEMORY, command);
        if self.anti_windup {
            self.unwind(gains, memory, command);
        }
    }
}
