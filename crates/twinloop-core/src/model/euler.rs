//! One step of Euler a period, explicit or semi-implicit.

use super::frame::{Frame, Given, Slope};
use crate::attitude::euler_rates;
use crate::lanes::Vector;
use crate::signals::RigidBody;

/// Moves the states on by a period in which outputs are as they were at its start.
///
/// What other states give goes on by these as they were, which are moved last, or as they have become, which are moved
/// first: the one order is the other backwards.
#[inline(always)]
pub(super) fn euler<V: Vector>(state: &mut [V], outputs: &[V], frame: &Frame, semi_implicit: bool) {
    let (dt, last) = (frame.dt, frame.given.len());
    if semi_implicit {
        driven(state, outputs, frame);
    }
    for number in 0..last {
        let number = if semi_implicit { number } else { last - 1 - number };
        match (&frame.given[number], &frame.body) {
            (&Given::Integral { state: at, of }, _) => state[at] = state[at] + state[of] * dt,
            (Given::Turn, Some(body)) => turn(state, body, dt),
            (Given::Turn, None) => unreachable!("angles of no body"),
        }
    }
    if !semi_implicit {
        driven(state, outputs, frame);
    }
}

/// Moves on what nothing but outputs gives.
#[inline(always)]
fn driven<V: Vector>(state: &mut [V], outputs: &[V], frame: &Frame) {
    for (state, slope) in state.iter_mut().zip(&frame.slopes) {
        if let Slope::Output(output) = *slope {
            *state = *state + outputs[output] * frame.dt;
        }
    }
}

/// Moves the angles of a body on, a register after another: code that does so for many lanes at once is long.
#[inline(always)]
fn turn<V: Vector>(state: &mut [V], body: &RigidBody, dt: f64) {
    for piece in 0..V::PIECES {
        let [angles, rates] = [body.angles, body.rates].map(|three| three.map(|at| state[at].piece(piece)));
        let slopes = euler_rates(angles, rates);
        for ((&at, angle), slope) in body.angles.iter().zip(angles).zip(slopes) {
            state[at].set_piece(piece, angle + slope * dt);
        }
    }
}
