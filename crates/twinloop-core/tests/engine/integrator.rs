//! The integrator against solutions that are known.

use twinloop_core::{Field, Scalar, Slopes, Stages, Vector, rk4};

/// x' = −x; a rotation; and time with the integral of a cubic of it.
struct Decay;
struct Rotation;
struct Cubic;

impl Field<Scalar> for &Decay {
    fn slope(&mut self, point: &[Scalar], slopes: &mut Slopes<'_, Scalar>) {
        slopes.put(0, point[0] * -1.0);
    }
}

impl Field<Scalar> for &Rotation {
    fn slope(&mut self, point: &[Scalar], slopes: &mut Slopes<'_, Scalar>) {
        slopes.put_all(0, &[point[1] * -1.0, point[0]]);
    }
}

impl Field<Scalar> for &Cubic {
    fn slope(&mut self, point: &[Scalar], slopes: &mut Slopes<'_, Scalar>) {
        let t = point[0];
        slopes.put(0, Scalar::splat(1.0));
        slopes.put(1, t * t * t * 4.0 - t * t * 3.0 + t * 2.0 - Scalar::splat(5.0));
    }
}

/// The state at `end` after so many steps.
fn solve<'a, F>(field: &'a F, start: &[f64], end: f64, steps: usize) -> Vec<f64>
where
    &'a F: Field<Scalar>,
{
    let mut state: Vec<Scalar> = start.iter().map(|&x| Scalar::splat(x)).collect();
    let mut stages = Stages::new(state.len());
    for _ in 0..steps {
        rk4(&mut state, end / steps as f64, &mut stages, field);
    }
    state.iter().map(|lane| lane.lane(0)).collect()
}

#[test]
fn halving_the_step_divides_the_error_by_sixteen() {
    let decay = |steps| (solve(&Decay, &[1.0], 2.0, steps)[0] - (-2.0_f64).exp()).abs();
    let rotation = |steps| {
        let end = solve(&Rotation, &[1.0, 0.0], 3.0, steps);
        (end[0] - 3.0_f64.cos()).hypot(end[1] - 3.0_f64.sin())
    };
    for steps in [20, 40, 80] {
        for ratio in [decay(steps) / decay(2 * steps), rotation(steps) / rotation(2 * steps)] {
            assert!((15.0..17.5).contains(&ratio), "{steps} steps: {ratio}");
        }
    }
}

#[test]
fn the_integral_of_a_cubic_is_exact() {
    for steps in [1, 2, 7] {
        let end = solve(&Cubic, &[0.0, 1.0], 3.0, steps);
        // 1 + t⁴ − t³ + t² − 5 t at 3
        assert!((end[0] - 3.0).abs() < 1e-14 && (end[1] - 49.0).abs() < 1e-12, "{end:?}");
    }
}

#[test]
fn one_step_is_the_taylor_polynomial_of_order_four() {
    let h: f64 = 0.5;
    let expected = 1.0 - h + h.powi(2) / 2.0 - h.powi(3) / 6.0 + h.powi(4) / 24.0;
    assert!((solve(&Decay, &[1.0], h, 1)[0] - expected).abs() < 1e-15);
}
