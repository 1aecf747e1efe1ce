//! A chain: a state that a sum of features drives, its integral, the integral of that; how they move in a period.

use crate::error::{Result, invalid};

/// States of a chain at most: position, speed, acceleration, jerk.
pub const LONGEST: usize = 4;

/// How a sum of features moves the states of a chain, the driven one first, then its integral, and so on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chain {
    /// Number of states, 1 to [`LONGEST`].
    pub states: usize,
    /// Period, s.
    pub dt: f64,
    /// Whether features are derivatives to be integrated over a period, or increments of a period.
    pub integrated: bool,
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
        if !self.integrated {
            return [start, 0.0, 0.0, 0.0];
        }
        // Simpson's rule on ∫ (dt − s)^m / m! f(s) ds.
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
        let mut powers = [0.0; LONGEST];
        let mut power = 1.0;
        for (i, entry) in powers.iter_mut().enumerate() {
            power *= self.dt / (i + 1) as f64;
            *entry = power;
        }
        let reach = if self.integrated { powers } else { [1.0, 0.0, 0.0, 0.0] };
        Motion { states: self.states, integrated: self.integrated, powers, reach }
    }

    /// Covariance that a period of the disturbance adds (states × states).
    pub(super) fn disturbance(&self, process: f64) -> Vec<f64> {
        let d = self.states;
        let mut q = vec![0.0; d * d];
        if !self.integrated {
            q[0] = process;
            return q;
        }
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
    pub(super) integrated: bool,
    /// dt^m / m! from m = 1 on.
    pub(super) powers: [f64; LONGEST],
    /// How far each state is moved by a disturbance of 1 that is held.
    pub reach: [f64; LONGEST],
}

impl Motion {
    /// Predicts the states one period ahead. After them there may be a correlated disturbance that drives them, with its
    /// `correlation` over a period.
    #[inline(always)]
    pub fn predict(&self, states: &mut [f64], correlation: f64) {
        let (states, hidden) = states.split_at_mut(self.states);
        if self.integrated {
            for i in (1..self.states).rev() {
                for m in 1..=i {
                    states[i] += self.powers[m - 1] * states[i - m];
                }
            }
        }
        if let [gust] = hidden {
            for (state, reach) in states.iter_mut().zip(self.reach) {
                *state += reach * *gust;
            }
            *gust *= correlation;
        }
    }
}
