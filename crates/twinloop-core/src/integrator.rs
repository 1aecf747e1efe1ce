//! The classical Runge–Kutta method of order four, on lanes, with the command held over the step.
//!
//! Kutta 1901; E. Hairer, S. P. Nørsett, G. Wanner, *Solving Ordinary Differential Equations I*, 2nd edition, 1993,
//! section II.1.

use crate::lanes::{Vector, zeros};

/// A stage of the method: where the next one is taken, and what this one counts.
struct Stage {
    /// Share of the step from the start to the next stage's point, along this stage's derivative.
    next: f64,
    /// Weight of this stage's derivative in the step, in sixths.
    sixths: f64,
}

/// The method as data. The last stage has no next one.
static CLASSICAL: [Stage; 4] = [
    Stage { next: 0.5, sixths: 1.0 },
    Stage { next: 0.5, sixths: 2.0 },
    Stage { next: 1.0, sixths: 2.0 },
    Stage { next: 0.0, sixths: 1.0 },
];

/// Scratch of a step, (states) each.
#[derive(Clone)]
pub struct Stages<V: Vector> {
    /// The stage's point.
    point: Vec<V>,
    /// The next one's.
    next: Vec<V>,
    /// Weighted sum of the derivatives so far.
    sum: Vec<V>,
}

impl<V: Vector> Stages<V> {
    /// Scratch for `states` states.
    pub fn new(states: usize) -> Self {
        Self { point: zeros(states), next: zeros(states), sum: zeros(states) }
    }
}

/// Where a field puts its derivative at a stage's point. Each number is counted and followed at once: the next stage would
/// wait for one that is written to memory first.
pub struct Slopes<'a, V> {
    stage: &'static Stage,
    first: bool,
    dt: f64,
    state: &'a [V],
    sum: &'a mut [V],
    next: &'a mut [V],
}

impl<V: Vector> Slopes<'_, V> {
    /// Takes the derivative of the `j`-th state, in its units per second; of each state once.
    #[inline(always)]
    pub fn put(&mut self, j: usize, slope: V) {
        let weighted = slope * self.stage.sixths;
        self.sum[j] = if self.first { weighted } else { self.sum[j] + weighted };
        self.next[j] = self.state[j] + slope * (self.stage.next * self.dt);
    }

    /// Takes the derivatives of states one after another, from the `first` one on.
    #[inline(always)]
    pub fn put_all(&mut self, first: usize, slopes: &[V]) {
        for (j, &slope) in (first..).zip(slopes) {
            self.put(j, slope);
        }
    }
}

/// A vector field at a held command. A trait and not a closure, because only a named function can be made to be inlined
/// into each vector width's copy of the loop around it.
pub trait Field<V: Vector> {
    /// Puts the derivative of each state at a point (states).
    fn slope(&mut self, point: &[V], slopes: &mut Slopes<'_, V>);
}

/// Moves `state`, (states), by `dt` seconds along the field.
#[inline(always)]
pub fn rk4<V: Vector>(state: &mut [V], dt: f64, stages: &mut Stages<V>, mut field: impl Field<V>) {
    // Slices of one length: the last loop then needs no checks.
    let n = state.len();
    let (mut point, mut next, sum) = (&mut stages.point[..n], &mut stages.next[..n], &mut stages.sum[..n]);
    point.copy_from_slice(state);
    for (number, stage) in CLASSICAL.iter().enumerate() {
        let mut slopes = Slopes { stage, first: number == 0, dt, state, sum: &mut *sum, next: &mut *next };
        field.slope(point, &mut slopes);
        std::mem::swap(&mut point, &mut next);
    }
    for j in 0..n {
        state[j] = state[j] + sum[j] * (dt / 6.0);
    }
}
