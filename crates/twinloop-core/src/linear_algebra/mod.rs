//! Linear algebra of small dense matrices, row after row, with every sum in a fixed order so that all machines agree.

mod cholesky;
mod symmetric;

pub use cholesky::Cholesky;
pub use symmetric::Eigen;
