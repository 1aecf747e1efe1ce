//! The attitude of a quadrotor under four rotor speeds (paper, section V.B; specification, section 5).

use std::str::FromStr;

use crate::dynamics::Dynamics;
use crate::error::{Error, Result, invalid};
use crate::integrator::{Field, Slopes, Stages, rk4};
use crate::lanes::{Scalar, Vector, scalars, zeros};
use crate::signals::Signals;

/// The signs of the two gyroscopic terms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gyroscopic {
    /// + in roll, − in pitch: a rigid body with this mixing.
    Physical,
    /// − in both: as the paper prints them.
    Print,
}

impl FromStr for Gyroscopic {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        match name {
            "physical" => Ok(Self::Physical),
            "print" => Ok(Self::Print),
            _ => invalid(format!("gyroscopic: expected physical or print, found {name:?}")),
        }
    }
}

/// State (Φ, Θ, Ψ, Φ̇, Θ̇, Ψ̇) in rad and rad/s, command (ω1, ω2, ω3, ω4) in rad/s.
#[derive(Clone, Debug, PartialEq)]
pub struct Quadrotor {
    /// Period of the commands and step of the integrator, s.
    pub dt: f64,
    /// Distance of a rotor from the centre l, m.
    pub arm: f64,
    /// Moments of inertia I_x, I_y, I_z, kg m².
    pub inertia: [f64; 3],
    /// Moment of inertia of a rotor J_R, kg m².
    pub rotor_inertia: f64,
    /// Thrust of a rotor over its squared speed b, N s².
    pub thrust_factor: f64,
    /// Torque of a rotor over its squared speed d, N m s².
    pub drag_factor: f64,
    /// Signs of the gyroscopic terms.
    pub gyroscopic: Gyroscopic,
    /// Torque that brakes each axis, over its squared rate, N m s²; zeros in the paper.
    pub drag: [f64; 3],
    /// Time constant at which a rotor follows its commanded speed, s; zero in the paper: it follows at once.
    pub motor_lag: f64,
    /// Speed of the rotors at the start of a run, rad/s; nothing depends on it without a lag.
    pub hover_speed: f64,
}

impl Quadrotor {
    /// Refuses constants that no vehicle has.
    pub fn validated(self) -> Result<Self> {
        let constants = [self.dt, self.arm, self.thrust_factor, self.drag_factor];
        let positive = constants.iter().chain(&self.inertia).all(|x| x.is_finite() && *x > 0.0);
        let absent = [self.rotor_inertia, self.motor_lag, self.hover_speed];
        let possible = absent.iter().chain(&self.drag).all(|x| x.is_finite() && *x >= 0.0);
        if !positive || !possible {
            return invalid(format!(
                "quadrotor: expected finite constants above 0, and rotor inertia, drag, motor lag and hover speed of \
                 at least 0, found {self:?}"
            ));
        }
        Ok(self)
    }

    /// Refuses signals of another number of states or commands, or another period.
    pub fn check(&self, signals: &Signals) -> Result<()> {
        let found = (signals.states(), signals.commands(), signals.dt);
        if found != (6, 4, self.dt) {
            return invalid(format!(
                "quadrotor: expected 6 states, 4 commands and a period of {} s, found {found:?}",
                self.dt
            ));
        }
        Ok(())
    }

    /// Accelerations and rates at one state (6) under one command (4).
    pub fn slope(&self, state: &[f64], command: &[f64]) -> Result<Vec<f64>> {
        if (state.len(), command.len()) != (6, 4) {
            let found = (state.len(), command.len());
            return invalid(format!("quadrotor: expected 6 states and 4 commands, found {found:?}"));
        }
        let mut slope = zeros::<Scalar>(6);
        self.derivative(&scalars(state), &scalars(command), &mut slope);
        Ok(slope.iter().map(|lane| lane.lane(0)).collect())
    }

    /// Accelerations and rates at a state, with the rotors at given speeds.
    #[inline(always)]
    pub fn derivative<V: Vector>(&self, state: &[V], speeds: &[V], slope: &mut [V]) {
        let [w1, w2, w3, w4] = [speeds[0], speeds[1], speeds[2], speeds[3]];
        let squared = [w1 * w1, w2 * w2, w3 * w3, w4 * w4];
        let roll_torque = (squared[3] - squared[1]) * (self.arm * self.thrust_factor);
        let pitch_torque = (squared[0] - squared[2]) * (self.arm * self.thrust_factor);
        let yaw_torque = (squared[1] - squared[0] + squared[3] - squared[2]) * self.drag_factor;
        let rotors = (w2 - w1 + w4 - w3) * self.rotor_inertia;
        let [p, q, r] = [state[3], state[4], state[5]];
        let [ix, iy, iz] = self.inertia;
        let roll_sign = match self.gyroscopic {
            Gyroscopic::Physical => 1.0,
            Gyroscopic::Print => -1.0,
        };
        slope[0] = p;
        slope[1] = q;
        slope[2] = r;
        slope[3] = (roll_torque + rotors * q * roll_sign + q * r * (iy - iz)) / ix;
        slope[4] = (pitch_torque - rotors * p + p * r * (iz - ix)) / iy;
        slope[5] = (yaw_torque + p * q * (ix - iy)) / iz;
        // Skipped without drag: what is subtracted would be a zero, and might still turn the sign of a zero.
        if self.drag != [0.0; 3] {
            for (i, rate) in [p, q, r].into_iter().enumerate() {
                slope[3 + i] = slope[3 + i] - rate.abs() * rate * (self.drag[i] / self.inertia[i]);
            }
        }
    }
}

impl Quadrotor {
    /// Speeds of lagging rotors in the middle and at the end of a period. They approach a held command exponentially,
    /// whatever the body does: no need to integrate them.
    #[inline(always)]
    fn follow<V: Vector>(&self, flight: &mut Flight<V>, command: &[V]) {
        for (moment, share) in [(1, 0.5), (2, 1.0)] {
            let left = libm::exp(-share * self.dt / self.motor_lag);
            for (i, &wanted) in command.iter().enumerate() {
                flight.speeds[moment][i] = wanted + (flight.speeds[0][i] - wanted) * left;
            }
        }
    }
}

/// What the plant needs for a run and remembers in it.
pub struct Flight<V: Vector> {
    stages: Stages<V>,
    /// Speeds of the rotors now, half a period and a whole period later; only the first outlives a step.
    speeds: [[V; 4]; 3],
}

impl Dynamics for Quadrotor {
    type Workspace<V: Vector> = Flight<V>;

    fn workspace<V: Vector>(&self) -> Flight<V> {
        Flight { stages: Stages::new(6), speeds: [[V::splat(self.hover_speed); 4]; 3] }
    }

    #[inline(always)]
    fn remember<V: Vector>(&self, flight: &mut Flight<V>, command: &[V]) {
        self.follow(flight, command);
        flight.speeds[0] = flight.speeds[2];
    }

    #[inline(always)]
    fn step<V: Vector>(&self, flight: &mut Flight<V>, state: &mut [V], command: &[V]) {
        if self.motor_lag == 0.0 {
            rk4(state, self.dt, &mut flight.stages, Held { plant: self, command });
            return;
        }
        self.follow(flight, command);
        let lagging = Lagging { plant: self, speeds: &flight.speeds, stage: 0 };
        rk4(state, self.dt, &mut flight.stages, lagging);
        flight.speeds[0] = flight.speeds[2];
    }
}

/// The plant whose rotors turn as commanded.
struct Held<'a, V: Vector> {
    plant: &'a Quadrotor,
    command: &'a [V],
}

impl<V: Vector> Field<V> for Held<'_, V> {
    #[inline(always)]
    fn slope(&mut self, point: &[V], slopes: &mut Slopes<'_, V>) {
        let mut slope = [V::splat(0.0); 6];
        self.plant.derivative(point, self.command, &mut slope);
        slopes.put_all(0, &slope);
    }
}

/// The plant whose rotors are on their way to what was commanded.
struct Lagging<'a, V: Vector> {
    plant: &'a Quadrotor,
    speeds: &'a [[V; 4]; 3],
    stage: usize,
}

impl<V: Vector> Field<V> for Lagging<'_, V> {
    #[inline(always)]
    fn slope(&mut self, point: &[V], slopes: &mut Slopes<'_, V>) {
        let mut slope = [V::splat(0.0); 6];
        // Runge and Kutta look at the start, twice at the middle, and at the end of the step.
        let moment = [0, 1, 1, 2][self.stage];
        self.stage += 1;
        self.plant.derivative(point, &self.speeds[moment], &mut slope);
        slopes.put_all(0, &slope);
    }
}
