//! The classical Runge–Kutta method of order four, on lanes, with the command held over the step.

use crate::lanes::{Vector, zeros};

/// Scratch of a step: the stage's derivative, its argument, and the sum of the derivatives.
#[derive(Clone)]
pub struct Stages<V: Vector> {
    slope: Vec<V>,
    point: Vec<V>,
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
    /// Writes the derivative at a point.
    fn slope(&mut self, point: &[V], slope: &mut [V]);
}

/// Moves `state` by `dt` along the field.
#[inline(always)]
pub fn rk4<V: Vector>(state: &mut [V], dt: f64, stages: &mut Stages<V>, mut field: impl Field<V>) {
    // Slices of one length: their loops then need no checks.
    let n = state.len();
    let (slope, point, sum) = (&mut stages.slope[..n], &mut stages.point[..n], &mut stages.sum[..n]);
    point.copy_from_slice(state);
    // Fraction of the step at which the next stage is taken, and weight of this one in the sum.
    for (stage, (ahead, weight)) in [(0.5, 1.0), (0.5, 2.0), (1.0, 2.0), (0.0, 1.0)].into_iter().enumerate() {
        field.slope(point, slope);
        for j in 0..n {
            let weighted = slope[j] * weight;
            sum[j] = if stage == 0 { weighted } else { sum[j] + weighted };
            point[j] = state[j] + slope[j] * (ahead * dt);
        }
    }
    for j in 0..n {
        state[j] = state[j] + sum[j] * (dt / 6.0);
    }
}
