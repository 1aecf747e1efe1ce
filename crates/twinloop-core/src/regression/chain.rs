//! A chain: a state that a sum of features drives, its integral, the integral of that; how they move in a period.

use super::linear::Linear;
use crate::error::{Result, invalid};
use crate::model::Form;

/// States of a chain at most: position, speed, acceleration, jerk.
pub const LONGEST: usize = 4;

/// How a sum of features moves the states of a chain, the driven one first, then its integral, and so on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chain {
    /// Number of states, 1 to [`LONGEST`].
    pub states: usize,
    /// Period, s.
    pub dt: f64,
    /// What features are: derivatives and how they move the states, or increments of a period.
    pub form: Form,
}

impl Chain {
    /// Refuses what is no chain.
    pub fn validated(self) -> Result<Self> {
        if !((1..=LONGEST).contains(&self.states) && self.dt.is_finite() && self.dt > 0.0) {
            return invalid(format!(
                "chain: expected 1 to {LONGEST} states and a period above 0, found {} and {}",
                self.states, self.dt
            ));
        }
        Ok(self)
    }

    /// What a period adds to each state where the features' values at its start, middle and end are known.
    pub fn increments(&self, start: f64, middle: f64, end: f64) -> [f64; LONGEST] {
        match self.form {
            Form::Absolute | Form::Increment => [start, 0.0, 0.0, 0.0],
            Form::Acceleration => self.simpson(start, middle, end),
            Form::ExplicitEuler | Form::SemiImplicitEuler => self.reach().map(|reach| reach * start),
        }
    }

    /// What each state is moved by where a feature of 1 is held for a period.
    fn reach(&self) -> [f64; LONGEST] {
        let dt = self.dt;
        match self.form {
            Form::Absolute | Form::Increment => [1.0, 0.0, 0.0, 0.0],
            Form::ExplicitEuler => [dt, 0.0, 0.0, 0.0],
            Form::SemiImplicitEuler => [dt, dt * dt, dt * dt * dt, dt * dt * dt * dt],
            Form::Acceleration => self.powers(),
        }
    }

    /// dt^m / m! from m = 1 on.
    fn powers(&self) -> [f64; LONGEST] {
        let mut powers = [0.0; LONGEST];
        let mut power = 1.0;
        for (i, entry) in powers.iter_mut().enumerate() {
            power *= self.dt / (i + 1) as f64;
            *entry = power;
        }
        powers
    }

    /// Simpson's rule on ∫ (dt − s)^m / m! f(s) ds.
    fn simpson(&self, start: f64, middle: f64, end: f64) -> [f64; LONGEST] {
        let mut out = [0.0; LONGEST];
        let (mut factorial, mut whole, mut half) = (1.0, 1.0, 1.0);
        for (m, out) in out.iter_mut().enumerate() {
            if m > 0 {
                factorial *= m as f64;
                whole *= self.dt;
                half *= 0.5 * self.dt;
            }
            let end = if m == 0 { end } else { 0.0 };
            *out = self.dt / 6.0 * (whole * start + 4.0 * half * middle + end) / factorial;
        }
        out
    }

    /// How its states move on by themselves.
    pub(crate) fn motion(&self) -> Motion {
        let Self { states, dt, form } = *self;
        Motion { states, dt, form, powers: self.powers(), reach: self.reach() }
    }

    /// Covariance that a period of the disturbance adds (states × states).
    pub(super) fn disturbance(&self, process: f64) -> Vec<f64> {
        let d = self.states;
        if self.form != Form::Acceleration {
            // One push a period.
            let (push, reach) =
                (if self.form.gives_derivatives() { process / self.dt } else { process }, self.reach());
            return (0..d * d).map(|at| push * reach[at / d] * reach[at % d]).collect();
        }
        let mut q = vec![0.0; d * d];
        let factorial = |n: usize| (1..=n).map(|i| i as f64).product::<f64>();
        for a in 0..d {
            for b in 0..d {
                let power = a + b + 1;
                // Not `powi`: how that rounds is the compiler's choice.
                let dt_to_power: f64 = (0..power).map(|_| self.dt).product();
                q[a * d + b] = process * dt_to_power / (factorial(a) * factorial(b) * power as f64);
            }
        }
        q
    }
}

/// How the states of a chain move in a period in which no feature drives them. The divisions are done beforehand.
#[derive(Clone, Copy)]
pub(crate) struct Motion {
    /// Number of states.
    pub states: usize,
    pub(super) dt: f64,
    pub(super) form: Form,
    /// dt^m / m! from m = 1 on.
    pub(super) powers: [f64; LONGEST],
    /// How far each state is moved by a disturbance of 1 that is held.
    pub reach: [f64; LONGEST],
}

impl Motion {
    /// Predicts the states one period ahead. After them there may be a correlated disturbance that drives them, with its
    /// `correlation` over a period.
    #[inline(always)]
    pub fn predict<T: Linear>(&self, states: &mut [T], correlation: f64) {
        let (states, hidden) = states.split_at_mut(self.states);
        match self.form {
            Form::Absolute | Form::Increment => {}
            Form::Acceleration => {
                for i in (1..self.states).rev() {
                    for m in 1..=i {
                        states[i] = states[i] + states[i - m] * self.powers[m - 1];
                    }
                }
            }
            Form::ExplicitEuler => {
                for i in (1..self.states).rev() {
                    states[i] = states[i] + states[i - 1] * self.dt;
                }
            }
            Form::SemiImplicitEuler => {
                for i in 1..self.states {
                    states[i] = states[i] + states[i - 1] * self.dt;
                }
            }
        }
        if let [gust] = hidden {
            for (state, reach) in states.iter_mut().zip(self.reach) {
                *state = *state + *gust * reach;
            }
            *gust = *gust * correlation;
        }
    }
}
