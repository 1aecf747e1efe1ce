//! Attitude: the angles of a rigid body as a quaternion, for which no attitude is singular (Diebel 2006).

use std::f64::consts::{FRAC_PI_2, TAU};

use crate::lanes::Vector;

/// Roll, pitch and yaw (turned about z, then y, then x) as a unit quaternion (Diebel 2006, equation 297).
#[inline(always)]
pub(crate) fn quaternion<V: Vector>(angles: [V; 3]) -> [V; 4] {
    let [(sr, cr), (sp, cp), (sy, cy)] = angles.map(|angle| {
        let half = angle * 0.5;
        (half.map(libm::sin), half.map(libm::cos))
    });
    [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ]
}

/// How body rates turn a quaternion: ½ q ⊗ (0, p, q, r).
#[inline(always)]
pub(crate) fn turning<V: Vector>(attitude: [V; 4], rates: [V; 3]) -> [V; 4] {
    let [a, b, c, d] = attitude;
    let [p, q, r] = rates.map(|rate| rate * 0.5);
    [(b * p + c * q + d * r) * -1.0, a * p + c * r - d * q, a * q - b * r + d * p, a * r + b * q - c * p]
}

/// Cosine of a pitch nearest to 0 that is divided by.
const UPRIGHT: f64 = 1e-3;

/// How body rates turn roll, pitch and yaw (Diebel 2006, equation 79). Near a pitch of a quarter turn, where the angles are
/// singular, its cosine is kept from 0.
#[inline(always)]
pub(crate) fn euler_rates<V: Vector>(angles: [V; 3], rates: [V; 3]) -> [V; 3] {
    let [roll, pitch, _] = angles;
    let [p, q, r] = rates;
    let (sine, cosine) = (roll.map(libm::sin), roll.map(libm::cos));
    let upright = pitch.map(|pitch| {
        let cosine = libm::cos(pitch);
        if cosine.abs() < UPRIGHT { UPRIGHT.copysign(cosine) } else { cosine }
    });
    let yawing = q * sine + r * cosine;
    [p + yawing * pitch.map(libm::sin) / upright, q * cosine - r * sine, yawing / upright]
}

/// Roll, pitch and yaw of a quaternion of any length, as sensors give them: the pitch within a quarter turn, roll and yaw
/// by whole turns the nearest to what they were. Where the pitch was beyond a quarter turn it stays there.
#[inline(always)]
pub(crate) fn angles<V: Vector>(attitude: [V; 4], before: [V; 3]) -> [V; 3] {
    let [a, b, c, d] = attitude;
    let forward = a * a + b * b - c * c - d * d;
    let side = (b * c + a * d) * 2.0;
    let down = (b * d - a * c) * -2.0;
    let across = (c * d + a * b) * 2.0;
    let up = a * a - b * b - c * c + d * d;
    let level = (across * across + up * up).sqrt();
    let [roll, pitch, yaw] =
        [across.with(up, libm::atan2), down.with(level, libm::atan2), side.with(forward, libm::atan2)];
    // The same attitude, tipped over: roll and yaw half a turn further, and the pitch from the other side.
    let tipped = before[1].map(|pitch| if libm::cos(pitch) < 0.0 { 1.0 } else { 0.0 });
    let half_turn = tipped * (2.0 * FRAC_PI_2);
    let pitch = pitch + tipped * (pitch * -2.0 + V::splat(2.0 * FRAC_PI_2));
    let nearest = |angle: V, before: V| angle + (before - angle).map(|away| TAU * libm::rint(away / TAU));
    [nearest(roll + half_turn, before[0]), nearest(pitch, before[1]), nearest(yaw + half_turn, before[2])]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::Scalar;
    use proptest::prelude::*;

    fn scalars<const N: usize>(values: [f64; N]) -> [Scalar; N] {
        values.map(Scalar::splat)
    }

    fn numbers<const N: usize>(values: [Scalar; N]) -> [f64; N] {
        values.map(|value| value.lane(0))
    }

    proptest! {
        #[test]
        fn a_quaternion_gives_its_angles_back(
            roll in -7.0..7.0_f64, pitch in -1.57..1.57_f64, yaw in -7.0..7.0_f64,
            off in prop::array::uniform3(-0.1..0.1_f64), length in 0.5..2.0_f64,
        ) {
            let given = [roll, pitch, yaw];
            let before = [roll + off[0], (pitch + off[1]).clamp(-1.57, 1.57), yaw + off[2]];
            let longer = quaternion(scalars(given)).map(|part| part * length);
            let found = numbers(angles(longer, scalars(before)));
            for (found, given) in found.iter().zip(given) {
                prop_assert!((found - given).abs() < 1e-9 / libm::cos(pitch), "{found} {given}");
            }
        }

        #[test]
        fn a_pitch_beyond_a_quarter_turn_stays_there(roll in -3.0..3.0_f64, over in 0.1..1.4_f64, yaw in -3.0..3.0_f64) {
            let given = [roll, FRAC_PI_2 + over, yaw];
            let found = numbers(angles(quaternion(scalars(given)), scalars(given)));
            for (found, given) in found.iter().zip(given) {
                prop_assert!((found - given).abs() < 1e-9, "{found} {given}");
            }
        }

        #[test]
        fn turning_is_the_derivative_that_eulers_angles_have_away_from_their_singularity(
            roll in -3.0..3.0_f64, pitch in -1.2..1.2_f64, yaw in -3.0..3.0_f64,
            rates in prop::array::uniform3(-5.0..5.0_f64),
        ) {
            let at = [roll, pitch, yaw];
            let h = 1e-6;
            let q = quaternion(scalars(at));
            let slope = turning(q, scalars(rates));
            let moved: [Scalar; 4] = std::array::from_fn(|i| q[i] + slope[i] * h);
            let found = numbers(angles(moved, scalars(at)));
            // Diebel 2006, equation 79.
            let across = rates[1] * roll.sin() + rates[2] * roll.cos();
            let expected = [
                rates[0] + across * pitch.tan(),
                rates[1] * roll.cos() - rates[2] * roll.sin(),
                across / pitch.cos(),
            ];
            for i in 0..3 {
                let derivative = (found[i] - at[i]) / h;
                prop_assert!((derivative - expected[i]).abs() < 1e-3, "{i}: {derivative} {}", expected[i]);
            }
        }
    }
}
