//! The quality of a flight: how well it led to its target, and what that cost; smaller is better.

use std::str::FromStr;

use crate::difference::Periods;
use crate::error::{Error, Result, invalid};
use crate::lanes::{Vector, scalars};
use crate::signals::Signals;
use crate::task::target_at;

/// How the distance to the target counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QualityKind {
    /// Integral of the absolute error: Σ_k dt Σ_i w_i |x_i(k + 1) − target_i|.
    Iae,
    /// Integral of the squared error: Σ_k dt Σ_i w_i (x_i(k + 1) − target_i)².
    Ise,
    /// √(Σ_i w_i (x_i(n) − target_i)²): the last state alone.
    FinalDistance,
}

impl QualityKind {
    /// Every kind.
    pub const ALL: [Self; 3] = [Self::Iae, Self::Ise, Self::FinalDistance];

    /// The name that [`FromStr`] reads.
    pub fn name(self) -> &'static str {
        match self {
            Self::Iae => "iae",
            Self::Ise => "ise",
            Self::FinalDistance => "final_distance",
        }
    }
}

impl FromStr for QualityKind {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        match Self::ALL.into_iter().find(|kind| kind.name() == name) {
            Some(kind) => Ok(kind),
            None => invalid(format!(
                "quality: expected one of {}, found {name:?}",
                Self::ALL.map(Self::name).join(", ")
            )),
        }
    }
}

/// What a flight is judged by: the error that is left, plus what commands and their changes cost.
#[derive(Clone, Debug, PartialEq)]
pub struct Quality {
    /// How the distance to the target counts.
    pub kind: QualityKind,
    /// How much each state counts, w (n_x).
    pub weights: Vec<f64>,
    /// Factor of Σ_k dt Σ_j (u_j(k) / scale_j)².
    pub effort: f64,
    /// Factor of Σ_{k ≥ 1} Σ_j ((u_j(k) − u_j(k − 1)) / scale_j)² / dt.
    pub effort_rate: f64,
}

impl Quality {
    /// Refuses weights and factors that are not finite, or negative.
    pub fn validated(self) -> Result<Self> {
        let numbers = [self.effort, self.effort_rate];
        if !numbers.iter().chain(&self.weights).all(|x| x.is_finite() && *x >= 0.0) {
            return invalid(format!(
                "quality: expected finite weights and factors of at least 0, found {self:?}"
            ));
        }
        Ok(self)
    }

    /// Of a run that was recorded: its states (n + 1) × n_x and commands n × n_u; towards a target (n_x), or a row for
    /// each of its states or more.
    pub fn recorded(
        &self,
        signals: &Signals,
        target: &[f64],
        states: &[f64],
        commands: &[f64],
    ) -> Result<f64> {
        let (n_x, n_u) = (signals.states(), signals.commands());
        let steps = commands.len() / n_u;
        let found = [self.weights.len(), states.len(), commands.len()];
        let varies = target.len().is_multiple_of(n_x) && target.len() >= (steps + 1) * n_x;
        let fits = found == [n_x, (steps + 1) * n_x, steps * n_u] && (target.len() == n_x || varies);
        if steps == 0 || !fits {
            return invalid(format!(
                "quality: expected weights of {n_x} states, n + 1 ≥ 2 of them, n times {n_u} commands and a target or a row \
                 of it for each state, found {found:?} and {} numbers",
                target.len()
            ));
        }
        let target = scalars(target);
        let mut tally = self.tally(signals, &target);
        let steps = commands.chunks_exact(n_u).zip(states.chunks_exact(n_x).skip(1));
        for (step, (command, next)) in steps.enumerate() {
            tally.add(step, &scalars(command), &scalars(next));
        }
        Ok(tally.total().lane(0))
    }

    /// Nothing flown yet.
    #[inline(always)]
    pub(super) fn tally<'a, V: Vector>(&'a self, signals: &'a Signals, target: &'a [V]) -> Tally<'a, V> {
        let zero = V::splat(0.0);
        let factors = signals.command_scales.iter().map(|scale| 1.0 / scale).collect();
        let last = vec![zero; signals.commands()];
        Tally {
            quality: self,
            periods: &signals.periods,
            dt: signals.dt,
            factors,
            target,
            error: zero,
            effort: zero,
            change: zero,
            last,
        }
    }
}

/// The sums of a quality, as far as flights have come.
pub(super) struct Tally<'a, V> {
    quality: &'a Quality,
    periods: &'a Periods,
    /// Period, s.
    dt: f64,
    /// 1 / scale of each command (n_u).
    factors: Vec<f64>,
    target: &'a [V],
    error: V,
    effort: V,
    change: V,
    /// Commands of the step before, in units of their scale (n_u).
    last: Vec<V>,
}

impl<V: Vector> Tally<'_, V> {
    /// Adds a step: the command (n_u) and the state (n_x) after it.
    #[inline(always)]
    pub(super) fn add(&mut self, step: usize, command: &[V], next: &[V]) {
        let Quality { kind, weights, effort, effort_rate } = self.quality;
        let mut error = V::splat(0.0);
        let target = target_at(self.target, next.len(), step + 1);
        for (i, ((state, target), &weight)) in next.iter().zip(target).zip(weights).enumerate() {
            let difference = self.periods.difference(i, *state, *target);
            let size = if *kind == QualityKind::Iae { difference.abs() } else { difference * difference };
            error = error + size * weight;
        }
        self.error = if *kind == QualityKind::FinalDistance { error } else { self.error + error };
        if *effort == 0.0 && *effort_rate == 0.0 {
            return;
        }
        for ((last, command), &factor) in self.last.iter_mut().zip(command).zip(&self.factors) {
            let command = *command * factor;
            let change = command - *last;
            self.effort = self.effort + command * command;
            if step > 0 {
                self.change = self.change + change * change;
            }
            *last = command;
        }
    }

    /// The quality of flights that are over.
    #[inline(always)]
    pub(super) fn total(&self) -> V {
        let Quality { kind, effort, effort_rate, .. } = *self.quality;
        let error = if kind == QualityKind::FinalDistance { self.error.sqrt() } else { self.error * self.dt };
        error + self.effort * (effort * self.dt) + self.change * (effort_rate / self.dt)
    }
}
