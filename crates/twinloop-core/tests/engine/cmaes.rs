//! CMA-ES on functions whose least value is known, and the laws that its search obeys.

use proptest::prelude::*;
use twinloop_core::{CmaEs, Purpose, Unit};

fn square(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum()
}

fn name(seed: u64, purpose: Purpose, path: &[u64]) -> Unit {
    Unit::new(seed, purpose, path).expect("a unit")
}

fn search(mean: &[f64], step: f64, population: usize, unit: u64) -> CmaEs {
    CmaEs::new(mean, step, population, name(7, Purpose::Gains, &[1, unit])).expect("a search")
}

/// The search after some generations, or as soon as it has stopped.
fn minimised(mut search: CmaEs, generations: usize, value: impl Fn(&[f64]) -> f64) -> CmaEs {
    for _ in 0..generations {
        if search.stopped() {
            break;
        }
        let points = search.ask();
        let values: Vec<f64> = points.iter().map(|x| value(x)).collect();
        search = search.tell(&points, &values).expect("values");
    }
    search
}

fn sphere(x: &[f64]) -> f64 {
    square(x)
}

fn ellipsoid(x: &[f64]) -> f64 {
    let n = x.len() as f64;
    x.iter().enumerate().map(|(i, x)| libm::pow(10.0, 6.0 * i as f64 / (n - 1.0)) * x * x).sum()
}

fn rosenbrock(x: &[f64]) -> f64 {
    x.windows(2).map(|x| 100.0 * square(&[x[1] - x[0] * x[0]]) + square(&[1.0 - x[0]])).sum()
}

#[test]
fn it_finds_the_bottom_of_a_sphere_an_ellipsoid_and_a_bent_valley() {
    for unit in 0..5 {
        assert!(sphere(minimised(search(&[3.0; 9], 0.5, 10, unit), 400, sphere).mean()) < 1e-12);
        assert!(ellipsoid(minimised(search(&[1.0; 8], 0.5, 10, unit), 1000, ellipsoid).mean()) < 1e-10);
        // Of more than three numbers it has a second minimum.
        let valley = minimised(search(&[-1.0, 0.5, 0.0], 0.3, 16, unit), 1500, rosenbrock);
        assert!(valley.mean().iter().all(|x| (x - 1.0).abs() < 1e-6), "{:?}", valley.mean());
    }
}

#[test]
fn the_distribution_takes_the_shape_of_the_valley() {
    // In the limit C is the inverse of the Hessian, but for a factor (section 0.4 of the tutorial).
    let weights = [1.0, 100.0, 10_000.0];
    let found = minimised(search(&[1.0; 3], 0.5, 12, 0), 150, |x| {
        x.iter().zip(&weights).map(|(x, w)| w * x * x).sum()
    });
    let curvature: Vec<f64> = (0..3).map(|i| found.covariance()[4 * i] * weights[i]).collect();
    let largest = curvature.iter().fold(0.0, |a: f64, b| a.max(*b));
    let smallest = curvature.iter().fold(f64::INFINITY, |a, b| a.min(*b));
    assert!(largest / smallest < 10.0, "{curvature:?}");
}

#[test]
fn points_have_the_mean_and_the_covariance_that_the_search_says() {
    let told = minimised(search(&[1.0, -2.0], 0.5, 2000, 0), 3, ellipsoid);
    let points = told.ask();
    for i in 0..2 {
        for j in 0..=i {
            let expected = told.step() * told.step() * told.covariance()[2 * i + j];
            let product = |x: &Vec<f64>| (x[i] - told.mean()[i]) * (x[j] - told.mean()[j]);
            let found = points.iter().map(product).sum::<f64>() / points.len() as f64;
            let size =
                told.step() * told.step() * (told.covariance()[3 * i] * told.covariance()[3 * j]).sqrt();
            assert!((found - expected).abs() < 0.1 * size, "({i}, {j}): {found} instead of {expected}");
        }
    }
}

#[test]
fn searches_of_other_names_draw_other_points() {
    let first = search(&[0.0; 3], 1.0, 8, 0).ask();
    let points = |unit| CmaEs::new(&[0.0; 3], 1.0, 8, unit).expect("a search").ask();
    assert_eq!(first, points(name(7, Purpose::Gains, &[1, 0])));
    for other in [
        name(8, Purpose::Gains, &[1, 0]),
        name(7, Purpose::FineGains, &[1, 0]),
        name(7, Purpose::Gains, &[2, 0]),
        name(7, Purpose::Gains, &[1, 1]),
    ] {
        let others = points(other).concat();
        assert!(first.iter().flatten().all(|x| !others.contains(x)));
    }
}

#[test]
fn a_flat_function_and_a_minimum_at_rounding_stop_it() {
    assert!(minimised(search(&[0.5; 4], 0.2, 16, 0), 60, |_| 1.0).stopped());
    assert!(minimised(search(&[0.5; 4], 0.2, 16, 0), 60, |_| f64::INFINITY).stopped());
    assert!(minimised(search(&[1.0; 4], 0.2, 16, 0), 3000, |x| sphere(x).sqrt()).stopped());
    assert!(!minimised(search(&[1.0; 4], 0.2, 16, 0), 10, sphere).stopped());
}

#[test]
fn what_does_not_fit_is_refused() {
    let name = || name(0, Purpose::Gains, &[0]);
    assert!(CmaEs::new(&[], 1.0, 8, name()).is_err());
    assert!(CmaEs::new(&[f64::NAN], 1.0, 8, name()).is_err());
    assert!(CmaEs::new(&[0.0], 0.0, 8, name()).is_err());
    assert!(CmaEs::new(&[0.0], 1.0, 1, name()).is_err());
    let search = search(&[0.0; 2], 1.0, 4, 0);
    let points = search.ask();
    assert!(search.tell(&points[..3], &[0.0; 3]).is_err());
    assert!(search.tell(&points, &[0.0; 3]).is_err());
    assert!(search.tell(&points, &[0.0, 1.0, f64::NAN, 2.0]).is_err());
    assert!(search.tell(&vec![vec![0.0; 3]; 4], &[0.0; 4]).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn only_the_order_of_values_counts(unit in 0_u64..1000) {
        let start = search(&[1.0, 2.0, -1.0], 0.5, 12, unit);
        let plain = minimised(start.clone(), 30, rosenbrock);
        let bent = minimised(start, 30, |x| libm::exp(libm::log1p(rosenbrock(x)) / 3.0) - 4.0);
        prop_assert_eq!(plain.mean(), bent.mean());
        prop_assert_eq!(plain.covariance(), bent.covariance());
    }

    #[test]
    fn units_of_the_parameters_change_nothing(unit in 0_u64..1000, power in -30_i32..30) {
        let factor = libm::ldexp(1.0, power);
        let plain = minimised(search(&[1.0, 2.0, -1.0], 0.5, 12, unit), 30, rosenbrock);
        let mean = [factor, 2.0 * factor, -factor];
        let back = |x: &[f64]| rosenbrock(&x.iter().map(|x| x / factor).collect::<Vec<_>>());
        let scaled = minimised(search(&mean, 0.5 * factor, 12, unit), 30, back);
        let expected: Vec<f64> = plain.mean().iter().map(|x| factor * x).collect();
        prop_assert_eq!(scaled.mean(), &expected[..]);
        prop_assert_eq!(scaled.step(), factor * plain.step());
        prop_assert_eq!(scaled.covariance(), plain.covariance());
    }

    #[test]
    fn points_may_be_told_in_any_order(unit in 0_u64..1000, turn in 1_usize..12) {
        let start = minimised(search(&[1.0, 2.0, -1.0], 0.5, 12, unit), 5, rosenbrock);
        let mut points = start.ask();
        let values = |points: &[Vec<f64>]| points.iter().map(|x| rosenbrock(x)).collect::<Vec<_>>();
        let told = start.tell(&points, &values(&points)).expect("values");
        points.rotate_left(turn);
        prop_assert_eq!(told, start.tell(&points, &values(&points)).expect("values"));
    }

    #[test]
    fn a_turned_function_is_searched_as_well(unit in 0_u64..1000, angle in 0.0..6.3_f64) {
        let turned = |x: &[f64]| {
            let (sine, cosine) = (libm::sin(angle), libm::cos(angle));
            ellipsoid(&[cosine * x[0] - sine * x[1], sine * x[0] + cosine * x[1]])
        };
        prop_assert!(turned(minimised(search(&[1.0, 1.0], 0.5, 12, unit), 150, turned).mean()) < 1e-8);
    }
}
