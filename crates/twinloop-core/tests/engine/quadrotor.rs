//! The built-in quadrotor against its equations and the check values of the specification (section 5).

use std::f64::consts::PI;
use std::sync::Arc;

use proptest::prelude::*;
use twinloop_core::{
    Dynamics, Family, Gyroscopic, Influences, Limits, Mixer, Periods, Pid, Quadrotor, Scalar, Setting,
    Signals, Task, Trajectory, Vector, Width, record, step_rows,
};

use crate::oracle::rk4;
use crate::worlds::{axis, free};

fn quadrotor(gyroscopic: Gyroscopic) -> Quadrotor {
    Quadrotor {
        dt: 0.02,
        arm: 0.23,
        inertia: [7.5e-3, 7.5e-3, 1.3e-2],
        rotor_inertia: 6e-5,
        thrust_factor: 3.13e-5,
        drag_factor: 7.5e-7,
        gyroscopic,
        drag: [0.0; 3],
        motor_lag: 0.0,
        hover_speed: 225.0,
    }
}

/// The flight of C0 over the paper's task.
fn first_flight(gyroscopic: Gyroscopic) -> Trajectory {
    let plant = quadrotor(gyroscopic);
    let (roll, yaw) = (1.0 / (2.0 * plant.arm * plant.thrust_factor), 1.0 / (4.0 * plant.drag_factor));
    let hover = 0.650 * 9.81 / (4.0 * plant.thrust_factor);
    let matrix =
        vec![vec![0.0, roll, -yaw], vec![-roll, 0.0, yaw], vec![0.0, -roll, -yaw], vec![roll, 0.0, yaw]];
    let output = Mixer::new(matrix, vec![hover; 4], 0.5, vec![(0.0, 300.0); 4], 3).unwrap();
    let axes = (0..3).map(|i| axis(i, Some(i + 3))).collect();
    let bounds = [0.3, 0.1, 0.1].repeat(3).into_iter().map(|high| free(0.0, high)).collect();
    let family = Family::new(Pid::new(axes, output, 0.02), bounds, 6).unwrap();
    let degrees = |x: f64| x * PI / 180.0;
    let target = vec![degrees(-30.0), degrees(30.0), degrees(-70.0), 0.0, 0.0, 0.0];
    let task = Task::new(vec![0.0; 6], target, 100).unwrap();
    let gains = [0.03, 0.004, 0.024, 0.03, 0.004, 0.024, 0.052, 0.004, 0.0416];
    let signals = Signals {
        dt: 0.02,
        state_scales: vec![1.0; 6],
        command_bounds: vec![(0.0, 300.0); 4],
        command_scales: vec![300.0; 4],
        derivative_of: vec![None; 6],
        kinematics: None,
        periods: Periods::default(),
    };
    let limits = Limits::new(Arc::new(signals.validated().unwrap()), 1e9).unwrap();
    let setting = Setting::new(limits, Arc::new(family)).unwrap();
    record((&plant).into(), &setting, &[&gains], &task, Influences::default(), Width::widest()).remove(0)
}

fn final_distance(flight: &Trajectory) -> f64 {
    let target = [-PI / 6.0, PI / 6.0, -PI * 7.0 / 18.0, 0.0, 0.0, 0.0];
    flight.states[600..].iter().zip(target).map(|(x, y)| (x - y).powi(2)).sum::<f64>().sqrt()
}

#[test]
fn the_first_controller_ends_where_the_specification_says() {
    for (signs, expected) in [(Gyroscopic::Physical, 0.2013), (Gyroscopic::Print, 0.2008)] {
        let flight = first_flight(signs);
        assert_eq!((flight.states.len(), flight.commands.len(), flight.lasted), (101 * 6, 100 * 4, 100));
        assert!((final_distance(&flight) - expected).abs() < 5e-5, "{}", final_distance(&flight));
    }
}

#[test]
fn the_model_that_never_moves_scores_what_the_specification_says() {
    let flight = first_flight(Gyroscopic::Physical);
    let frozen = flight.states[6..].iter().map(|x| x * x).sum::<f64>() / 600.0;
    assert!((frozen - 0.294).abs() < 5e-4, "{frozen}");
}

#[test]
fn the_hovering_quadrotor_stays_where_it_is() {
    let hover = (0.650 * 9.81 / (4.0 * 3.13e-5_f64)).sqrt();
    assert!((hover - 225.68).abs() < 0.005);
    let next = step_rows(
        (&quadrotor(Gyroscopic::Physical)).into(),
        &[&[0.1, 0.2, 0.3, 0.0, 0.0, 0.0]],
        &[&[hover; 4]],
        &[],
        Width::Baseline,
    );
    assert_eq!(next, [0.1, 0.2, 0.3, 0.0, 0.0, 0.0]);
}

#[test]
fn constants_that_no_vehicle_has_are_refused() {
    let good = quadrotor(Gyroscopic::Physical);
    assert!(good.clone().validated().is_ok());
    assert!(Quadrotor { rotor_inertia: 0.0, ..good.clone() }.validated().is_ok());
    let bad = [
        Quadrotor { dt: 0.0, ..good.clone() },
        Quadrotor { arm: -1.0, ..good.clone() },
        Quadrotor { inertia: [1.0, f64::NAN, 1.0], ..good.clone() },
        Quadrotor { rotor_inertia: -1.0, ..good.clone() },
        Quadrotor { drag: [0.0, -1e-9, 0.0], ..good.clone() },
        Quadrotor { motor_lag: f64::NAN, ..good.clone() },
        Quadrotor { hover_speed: -1.0, ..good.clone() },
        Quadrotor { thrust_factor: f64::INFINITY, ..good.clone() },
        Quadrotor { drag_factor: 0.0, ..good },
    ];
    for bad in bad {
        assert!(bad.validated().unwrap_err().to_string().contains("constants above 0"));
    }
    assert_eq!("print".parse(), Ok(Gyroscopic::Print));
    assert_eq!("physical".parse(), Ok(Gyroscopic::Physical));
    assert!("both".parse::<Gyroscopic>().unwrap_err().to_string().contains("found \"both\""));
}

proptest! {
    #[test]
    fn rotors_that_lag_and_drag_are_what_small_steps_integrate(
        state in prop::array::uniform6(-2.0..2.0),
        first in prop::array::uniform4(150.0..290.0),
        second in prop::array::uniform4(150.0..290.0),
        drag in prop::array::uniform3(0.0..0.02),
        motor_lag in 0.02..0.2,
    ) {
        let plain = quadrotor(Gyroscopic::Physical);
        let plant = Quadrotor { drag, motor_lag, ..plain.clone() };
        let mut flight = plant.workspace::<Scalar>();
        let mut found: Vec<_> = state.iter().map(|&x| Scalar::splat(x)).collect();
        // The rotors are four more states; a thousand steps a period leave no error of the integrator to speak of.
        let mut expected = [&state[..], &[225.0; 4]].concat();
        for speeds in [first, second] {
            plant.step(&mut flight, &mut found, &speeds.map(Scalar::splat));
            let derivative = |x: &[f64]| {
                let lanes = |values: &[f64]| values.iter().map(|&x| Scalar::splat(x)).collect::<Vec<_>>();
                let mut slope = [Scalar::splat(0.0); 6];
                plain.derivative(&lanes(&x[..6]), &lanes(&x[6..]), &mut slope);
                let mut all: Vec<f64> = slope.iter().map(|slope| slope.lane(0)).collect();
                for i in 0..3 {
                    all[3 + i] -= drag[i] * x[3 + i] * x[3 + i].abs() / plain.inertia[i];
                }
                all.extend(speeds.iter().zip(&x[6..]).map(|(wanted, speed)| (wanted - speed) / motor_lag));
                all
            };
            for _ in 0..1000 {
                expected = rk4(&expected, 0.02 / 1000.0, derivative);
            }
        }
        for (found, expected) in found.iter().zip(&expected) {
            prop_assert!((found.lane(0) - expected).abs() < 2e-3, "{} and {expected}", found.lane(0));
        }
    }

    #[test]
    fn a_row_knows_nothing_of_the_rows_before_it_though_the_rotors_lag(
        speeds in prop::collection::vec(prop::array::uniform4(0.0..300.0), 70),
    ) {
        let plant = Quadrotor { motor_lag: 0.03, ..quadrotor(Gyroscopic::Physical) };
        let states = vec![[0.1; 6]; speeds.len()];
        let (states, speeds): (Vec<&[f64]>, Vec<&[f64]>) =
            (states.iter().map(|x| &x[..]).collect(), speeds.iter().map(|x| &x[..]).collect());
        let together = step_rows((&plant).into(), &states, &speeds, &[], Width::widest());
        let alone: Vec<f64> = (0..speeds.len())
            .flat_map(|i| step_rows((&plant).into(), &states[i..=i], &speeds[i..=i], &[], Width::Baseline))
            .collect();
        prop_assert_eq!(together, alone);
    }

    #[test]
    fn a_step_is_the_equations_of_the_paper(
        state in prop::array::uniform6(-2.0..2.0),
        speeds in prop::array::uniform4(0.0..300.0),
        inertia in prop::array::uniform3(5e-3..2e-2),
        physical in any::<bool>(),
    ) {
        let signs = if physical { Gyroscopic::Physical } else { Gyroscopic::Print };
        let plant = Arc::new(Quadrotor { inertia, ..quadrotor(signs) });
        let [w1, w2, w3, w4]: [f64; 4] = speeds;
        let [ix, iy, iz] = inertia;
        let (l, b, d, jr) = (0.23, 3.13e-5, 7.5e-7, 6e-5);
        let torques = [
            l * b * (w4.powi(2) - w2.powi(2)),
            l * b * (w1.powi(2) - w3.powi(2)),
            d * (-w1.powi(2) + w2.powi(2) - w3.powi(2) + w4.powi(2)),
        ];
        let rotors = -w1 + w2 - w3 + w4;
        let roll_sign = if physical { 1.0 } else { -1.0 };
        let derivative = |x: &[f64]| {
            let (p, q, r) = (x[3], x[4], x[5]);
            vec![
                p,
                q,
                r,
                torques[0] / ix + roll_sign * jr * rotors / ix * q + q * r * (iy - iz) / ix,
                torques[1] / iy - jr * rotors / iy * p + p * r * (iz - ix) / iy,
                torques[2] / iz + p * q * (ix - iy) / iz,
            ]
        };
        let mut slope = [Scalar::splat(0.0); 6];
        let lanes = |values: &[f64]| values.iter().map(|&x| Scalar::splat(x)).collect::<Vec<_>>();
        plant.derivative(&lanes(&state), &lanes(&speeds), &mut slope);
        for (found, expected) in slope.iter().zip(derivative(&state)) {
            prop_assert!((found.lane(0) - expected).abs() < 1e-10);
        }
        let found = step_rows((&*plant).into(), &[&state], &[&speeds], &[], Width::widest());
        for (found, expected) in found.iter().zip(rk4(&state, 0.02, derivative)) {
            prop_assert!((found - expected).abs() < 1e-12);
        }
    }
}
