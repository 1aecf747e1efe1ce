//! Built-in plants: dynamics that are known, and stand for the real system in studies.

mod quadrotor;

pub use quadrotor::{Gyroscopic, Quadrotor};
