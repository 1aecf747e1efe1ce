//! Lanes: the same arithmetic on several rows or tests at once, for each vector width of the processor.
//!
//! A lane never looks at its neighbours, and no product and sum are ever contracted, so the width changes the speed of
//! a result and never its bits.
//!
//! Which instructions a vector is made of is nobody's business outside: a vector of a width is had from the [`Isa`] that
//! [`dispatch`] chose, so that no safe code can name instructions that the processor lacks.
//!
//! ```compile_fail
//! use twinloop_core::Wide;
//! ```
//! ```compile_fail
//! use twinloop_core::Piece;
//! ```

mod groups;
mod piece;
mod vector;
mod width;

pub(crate) use groups::{
    filled, flight_lanes, groups, interleave, lanes_for, numbers, pack, scalars, splats, vectors,
    with_flight_lanes, with_lanes, with_test_lanes, zeros,
};
pub use piece::Apart;
#[cfg(test)]
pub(crate) use vector::Wide;
pub use vector::{Scalar, Vector};
pub use width::{Isa, Kernel, Width, dispatch};
