//! Linear algebra of dense matrices, with every sum in a fixed order so that all machines agree. Cholesky's factor is
//! here in each layout that something hot needs: of any size, of a known size, one a lane, and updated by a member.

mod ascending;
mod blocks;
mod cholesky;
mod curvature;
mod inverse;
mod log_determinant;
mod small;
mod symmetric;

pub use cholesky::Cholesky;
pub use symmetric::Eigen;

pub(crate) use ascending::ascending;
pub(crate) use curvature::{covariance, damped_step};
pub(crate) use inverse::{Inverse, Products};
pub(crate) use log_determinant::{log_determinant, place};
pub(crate) use small::{Small, congruent, inverse_root};
