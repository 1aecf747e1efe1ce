//! A rigid body in a period: its angles go on as a quaternion.

use super::frame::Frame;
use super::held::Held;
use crate::attitude::{angles, quaternion, turning};
use crate::integrator::{Field, Slopes, Stages, rk4};
use crate::lanes::Vector;
use crate::signals::RigidBody;

/// Moves the states of a rigid body on by a period. `turned` has room for the states and a quaternion, `seen` for the
/// states.
#[inline(always)]
pub(super) fn turn<V: Vector>(
    state: &mut [V],
    frame: &Frame,
    stages: &mut Stages<V>,
    field: Held<'_, V>,
    body: &RigidBody,
    turned: &mut [V],
    seen: &mut [V],
) {
    let before = body.angles.map(|angle| state[angle]);
    let (states, attitude) = turned.split_at_mut(state.len());
    states.copy_from_slice(state);
    set_attitude(attitude, before);
    let Held { model, bank, storage, effects, .. } = field;
    let steps = frame.substeps as f64;
    for part in 0..frame.substeps {
        let mut within = [vec![], vec![], vec![]];
        // What commands do is held, or known at three places of the period.
        let effects = if frame.substeps == 1 || frame.actuation.is_direct() {
            effects
        } else {
            for (within, share) in within.iter_mut().zip([0.0, 0.5, 1.0]) {
                between(effects, (part as f64 + share) / steps, within);
            }
            within.each_ref().map(Vec::as_slice)
        };
        let field = Held { model, bank: &mut *bank, storage: &mut *storage, effects, stage: 0 };
        rk4(turned, frame.dt / steps, stages, Turning { field, body, before, seen: &mut *seen });
    }
    let (states, attitude) = turned.split_at(state.len());
    state.copy_from_slice(states);
    set_angles(state, body, attitude, before);
}

/// Effects at a share of a period: the parabola through those at its start, middle and end.
#[inline(always)]
fn between<V: Vector>(effects: [&[V]; 3], share: f64, within: &mut Vec<V>) {
    let [start, middle, end] = effects;
    let weights =
        [(1.0 - share) * (1.0 - 2.0 * share), 4.0 * share * (1.0 - share), share * (2.0 * share - 1.0)];
    for ((&start, &middle), &end) in start.iter().zip(middle).zip(end) {
        within.push(start * weights[0] + middle * weights[1] + end * weights[2]);
    }
}

/// The slope of states, and of the quaternion of a rigid body's angles behind them.
struct Turning<'a, V> {
    field: Held<'a, V>,
    body: &'a RigidBody,
    /// Angles at the start of the period.
    before: [V; 3],
    /// The states of a stage.
    seen: &'a mut [V],
}

impl<V: Vector> Field<V> for Turning<'_, V> {
    #[inline(always)]
    fn slope(&mut self, point: &[V], slopes: &mut Slopes<'_, V>) {
        let (states, attitude) = point.split_at(self.seen.len());
        self.seen.copy_from_slice(states);
        set_angles(self.seen, self.body, attitude, self.before);
        self.field.slope(self.seen, slopes);
        let rates = self.body.rates.map(|rate| states[rate]);
        let mut turned = [V::splat(0.0); 4];
        set_turning(&mut turned, attitude, rates);
        slopes.put_all(states.len(), &turned);
    }
}

// An attitude is worked on a register after another: code that does so for many lanes at once is long, and no faster.

/// Writes the quaternion of a rigid body's angles.
#[inline(always)]
fn set_attitude<V: Vector>(attitude: &mut [V], angles: [V; 3]) {
    for piece in 0..V::PIECES {
        let found = quaternion(angles.map(|angle| angle.piece(piece)));
        attitude.iter_mut().zip(found).for_each(|(part, found)| part.set_piece(piece, found));
    }
}

/// Writes how body rates turn a quaternion.
#[inline(always)]
fn set_turning<V: Vector>(slope: &mut [V], attitude: &[V], rates: [V; 3]) {
    for piece in 0..V::PIECES {
        let attitude = std::array::from_fn(|i| attitude[i].piece(piece));
        let found = turning(attitude, rates.map(|rate| rate.piece(piece)));
        slope.iter_mut().zip(found).for_each(|(part, found)| part.set_piece(piece, found));
    }
}

/// Writes the angles of a quaternion into the states of a rigid body.
#[inline(always)]
fn set_angles<V: Vector>(state: &mut [V], body: &RigidBody, attitude: &[V], before: [V; 3]) {
    for piece in 0..V::PIECES {
        let attitude = std::array::from_fn(|i| attitude[i].piece(piece));
        let found = angles(attitude, before.map(|angle| angle.piece(piece)));
        body.angles.iter().zip(found).for_each(|(&at, angle)| state[at].set_piece(piece, angle));
    }
}
