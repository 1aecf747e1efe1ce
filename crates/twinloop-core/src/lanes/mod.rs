//! Lanes: the same arithmetic on several rows or tests at once, for each vector width of the processor.
//!
//! A lane never looks at its neighbours, and no product and sum are ever contracted, so the width changes the speed of
//! a result and never its bits.

mod groups;
mod piece;
mod vector;
mod width;

pub(crate) use groups::{groups, interleave, lanes_for, pack, vectors, with_lanes, with_test_lanes};
pub use piece::{Apart, Piece};
pub use vector::{Scalar, Vector, Wide};
pub use width::{Isa, Kernel, Width, dispatch};
