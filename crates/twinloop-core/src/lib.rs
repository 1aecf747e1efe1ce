//! The engine of Twinloop: models are programs that are evolved on experiments, tests are controllers that are evolved
//! on models. It knows numbers only: no files, no clock, no Python, no global state.
//!
//! The two loops are those of S. Koos, J.-B. Mouret and S. Doncieux, *Automatic system identification based on
//! coevolution of models and tests*, CEC 2009; "the paper" means this one. Identification by regression follows
//! A. C. Harvey, *Forecasting, Structural Time Series Models and the Kalman Filter*, 1989, and L. Ljung, *System
//! Identification: Theory for the User*, 2nd edition, 1999.
//!
//! A program, here the acceleration of a pendulum from its angle (r0) and rate (r1), runs without its introns:
//!
//! ```
//! use twinloop_core::{Code, Program, Width, run_rows};
//!
//! let program: Program = "program inputs=2 outputs=1 registers=4
//! page 1
//!   r2 = sin(r0)
//!   r3 = r1 * 0.1
//!   r2 = r2 + r3
//!   r2 = r2 * -1.0
//!   r3 = r0 * 2.0
//! ".parse()?;
//! let code = Code::new(&program);
//! assert_eq!(code.len(), 4);
//! assert_eq!(run_rows(&code, &[&[0.0, 2.0], &[0.0, -2.0]], Width::widest()), [-0.2, 0.2]);
//! # Ok::<(), twinloop_core::Error>(())
//! ```

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
mod levels;
mod lgp;
mod linear_algebra;
mod look_ahead;
mod model;
mod model_loop;
mod objective;
pub mod pareto;
mod plants;
mod regression;
mod reports;
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

// The two loops, and the tuning of gains.
pub use cmaes::CmaEs;
pub use evolution::{Problem, Search, Snapshot, Variation};
pub use model_loop::ModelSearch;
pub use test_loop::{TestSearch, TestSettings};

// Identification.
pub use regression::{
    Annealing, Chain, Choices, Found, Gram, Leftover, Noise, Record, Regression, Solution, likelihood,
    most_likely_noise, most_likely_noises, search, search_all,
};
pub use tuning::{Observed, Predictions, Recorded, Tuned, Tuning};

// Judgement.
pub use flights::{
    Candidate, Disagreement, Draws, Envelope, Flights, Judged, Quality, QualityKind, disagreements, qualities,
};
pub use objective::{
    Outcome, closed_loops, discrimination, final_distances, instability, k_steps, of_model, open_loops,
};

// Programs and what they are made of.
pub use lgp::{Bank, Code, Grammar, Inputs, Instruction, Learnt, Operand, Operation, Page, Program, Shape};

// Dynamics: models, plants, and what stands between them and the world.
pub use actuators::{Actuation, Actuator, checked_effects};
pub use any_dynamics::{AnyDynamics, AnyWorkspace};
pub use dynamics::{Dynamics, state_of};
pub use hidden::{Hidden, Mass, Play, Pressed, Source};
pub use integrator::{Field, Slopes, Stages, rk4};
pub use levels::Levels;
pub use model::{Form, Frame, Model, OwnedModel, views};
pub use plants::{Gyroscopic, Quadrotor};
pub use sensors::Sensors;

// Runs: controllers, the loop, records.
pub use controller::{
    AnyLaw, Axis, Controller, Controllers, Family, ForeignController, ForeignLaw, Gain, Mixer, Outer,
    Parameters, Pid, StateFeedback,
};
pub use excitation::{Excitation, HoldBack};
pub use look_ahead::{Ahead, Leaving, LookAhead};
pub use reports::{Report, Reports};
pub use rollout::{Commands, Seen, Start, Watch, rollout};
pub use rows::{run_rows, step_rows};
pub use selected::{Experiment, SelectedTests};
pub use setting::{Limits, Setting};
pub use task::Task;
pub use trajectory::{Influences, Trajectory, record, record_one, replay};

// Signals.
pub use difference::Periods;
pub use signals::{RigidBody, Signals};

// The ground.
pub use error::{Error, Result};
pub use lanes::{Apart, Isa, Kernel, Scalar, Vector, Width, dispatch};
pub use linear_algebra::{Cholesky, Eigen};
pub use rng::{Purpose, Stream, Unit};
pub use workers::Workers;
