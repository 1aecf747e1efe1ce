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
const CLASSICAL: [Stage; 4] = [
    Stage { next: 0.5, sixths: 1.0 },
    Stage { next: 0.5, sixths: 2.0 },
    Stage { next: 1.0, sixths: 2.0 },
    Stage { next: 0.0, sixths: 1.0 },
];

/// Scratch of a step, (states) each.
#[derive(Clone)]
pub struct Stages<V: Vector> {
    /// Derivative at the stage's point.
    slope: Vec<V>,
    /// The stage's point.
    point: Vec<V>,
    /// Weighted sum of the derivatives so far.
    sum: Vec<V>,
}

impl<V: Vector> Stages<V> {
    /// Scratch for `states` states.
    pub fn new(states: usize) -> Self {
        Self { slope: zeros(states), point: zeros(states), sum: zeros(states) }
    }
}

/// A vector field at a held command. A trait and not a closure, because only a named function can be made to be inlined
/// into each vector width's copy of the loop around it.
pub trait Field<V: Vector> {
    /// Writes the derivative at a point, (states) both, in the states' units per second.
    fn slope(&mut self, point: &[V], slope: &mut [V]);
}

/// Moves `state`, (states), by `dt` seconds along the field.
#[inline(always)]
pub fn rk4<V: Vector>(state: &mut [V], dt: f64, stages: &mut Stages<V>, mut field: impl Field<V>) {
    // Slices of one length: their loops then need no checks.
    let n = state.len();
    let (slope, point, sum) = (&mut stages.slope[..n], &mut stages.point[..n], &mut stages.sum[..n]);
    point.copy_from_slice(state);
    for (number, Stage { next, sixths }) in CLASSICAL.into_iter().enumerate() {
        field.slope(point, slope);
        for j in 0..n {
            let weighted = slope[j] * sixths;
            sum[j] = if number == 0 { weighted } else { sum[j] + weighted };
            point[j] = state[j] + slope[j] * (next * dt);
        }
    }
    for j in 0..n {
        state[j] = state[j] + sum[j] * (dt / 6.0);
    }
}
