//! The attitude of a quadrotor under four rotor speeds (paper, section V.B; specification, section 5).

use std::str::FromStr;

use crate::dynamics::Dynamics;
use crate::error::{Error, Result, invalid};
use crate::integrator::{Field, Stages, rk4};
use crate::lanes::Vector;

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
}

impl Quadrotor {
    /// Refuses constants that no vehicle has.
    pub fn validated(self) -> Result<Self> {
        let constants = [self.dt, self.arm, self.thrust_factor, self.drag_factor];
        let positive = constants.iter().chain(&self.inertia).all(|x| x.is_finite() && *x > 0.0);
        let rotor_inertia = self.rotor_inertia.is_finite() && self.rotor_inertia >= 0.0;
        if !positive || !rotor_inertia {
            return invalid(format!("quadrotor: expected finite constants above 0, found {self:?}"));
        }
        Ok(self)
    }

    /// Accelerations and rates at a state, under a command.
    #[inline(always)]
    pub fn derivative<V: Vector>(&self, state: &[V], command: &[V], slope: &mut [V]) {
        let [w1, w2, w3, w4] = [command[0], command[1], command[2], command[3]];
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
    }
}

impl Dynamics for Quadrotor {
    type Workspace<V: Vector> = Stages<V>;

    fn workspace<V: Vector>(&self) -> Stages<V> {
        Stages::new(6)
    }

    #[inline(always)]
    fn step<V: Vector>(&self, stages: &mut Stages<V>, state: &mut [V], command: &[V]) {
        rk4(state, self.dt, stages, Held { plant: self, command });
    }
}

/// The plant under a command.
struct Held<'a, V: Vector> {
    plant: &'a Quadrotor,
    command: &'a [V],
}

impl<V: Vector> Field<V> for Held<'_, V> {
    #[inline(always)]
    fn slope(&mut self, point: &[V], slope: &mut [V]) {
        self.plant.derivative(point, self.command, slope);
    }
}
