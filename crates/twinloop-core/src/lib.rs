//! The engine of Twinloop: models are programs that are evolved on experiments, tests are controllers that are evolved
//! on models. It knows numbers only: no files, no clock, no Python, no global state.

mod actuators;
mod any_dynamics;
mod attitude;
mod cmaes;
mod controller;
mod difference;
mod dynamics;
mod error;
mod evolution;
mod excitation;
mod flights;
mod hidden;
mod integrator;
mod lanes;
mod lgp;
mod linear_algebra;
mod look_ahead;
mod model;
mod model_loop;
mod objective;
pub mod pareto;
mod plants;
mod regression;
mod rng;
mod rollout;
mod rows;
mod selected;
mod sensors;
mod setting;
mod signals;
mod task;
mod test_loop;
mod trajectory;
mod tuning;
mod workers;

pub use actuators::{Actuation, Actuator, effects};
pub use any_dynamics::{AnyDynamics, AnyWorkspace};
pub use cmaes::CmaEs;
pub use controller::*;
pub use difference::Periods;
pub use dynamics::{Dynamics, state_of};
pub use error::{Error, Result};
pub use evolution::{Problem, Search, Snapshot, Variation};
pub use excitation::{Excitation, HoldBack};
pub use flights::{
    Candidate, Disagreement, Draws, Envelope, Flights, Judged, Quality, QualityKind, disagreements, qualities,
};
pub use hidden::Hidden;
pub use integrator::{Field, Stages, rk4};
pub use lanes::{Apart, Isa, Kernel, Scalar, Vector, Width, dispatch};
pub use lgp::{Bank, Code, Grammar, Inputs, Instruction, Operand, Operation, Page, Program, Shape};
pub use linear_algebra::{Cholesky, Eigen};
pub use look_ahead::{Ahead, Leaving, LookAhead};
pub use model::{Form, Frame, Model};
pub use model_loop::{Learnt, ModelSearch};
pub use objective::{
    Outcome, closed_loops, discrimination, final_distances, instability, k_steps, of_model, open_loops,
};
pub use plants::{Gyroscopic, Quadrotor};
pub use regression::{
    Annealing, Chain, Choices, Found, Gram, Noise, Record, Solution, likelihood, most_likely_noise, search,
};
pub use rng::{Purpose, Stream, Unit};
pub use rollout::{Commands, Seen, Start, Watch, rollout};
pub use rows::{run_rows, step_rows};
pub use selected::{Experiment, SelectedTests};
pub use sensors::Sensors;
pub use setting::{Limits, Setting};
pub use signals::{RigidBody, Signals};
pub use task::Task;
pub use test_loop::{TestSearch, TestSettings};
pub use trajectory::{Influences, Trajectory, record, record_one, replay};
pub use tuning::{Observed, Recorded, Tuned, Tuning};
pub use workers::Workers;
