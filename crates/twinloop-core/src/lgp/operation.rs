//! The function set: what an instruction may compute.

use std::str::FromStr;

use crate::error::{Error, invalid};
use crate::lanes::Vector;

/// A divisor whose magnitude is not above this leaves the dividend as it is.
pub const SMALLEST_DIVISOR: f64 = 1e-6;

/// An operation on one or two numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Operation {
    /// a + b
    Add,
    /// a − b
    Sub,
    /// a × b
    Mul,
    /// a / b where |b| > [`SMALLEST_DIVISOR`], else a
    Div,
    /// The smaller of two, b if they do not compare
    Min,
    /// The larger of two, b if they do not compare
    Max,
    /// sin a
    Sin,
    /// cos a
    Cos,
    /// tanh a
    Tanh,
    /// eᵃ
    Exp,
    /// √|a|, so that it has a value everywhere
    Sqrt,
    /// |a|
    Abs,
}

impl Operation {
    /// Every operation, binary ones first.
    pub const ALL: [Self; 12] = [
        Self::Add,
        Self::Sub,
        Self::Mul,
        Self::Div,
        Self::Min,
        Self::Max,
        Self::Sin,
        Self::Cos,
        Self::Tanh,
        Self::Exp,
        Self::Sqrt,
        Self::Abs,
    ];

    /// The symbol or name in a program's text.
    pub fn name(self) -> &'static str {
        match self {
            Self::Add => "+",
            Self::Sub => "-",
            Self::Mul => "*",
            Self::Div => "/",
            Self::Min => "min",
            Self::Max => "max",
            Self::Sin => "sin",
            Self::Cos => "cos",
            Self::Tanh => "tanh",
            Self::Exp => "exp",
            Self::Sqrt => "sqrt",
            Self::Abs => "abs",
        }
    }

    /// Whether it has one operand only.
    pub fn is_unary(self) -> bool {
        matches!(self, Self::Sin | Self::Cos | Self::Tanh | Self::Exp | Self::Sqrt | Self::Abs)
    }

    /// The result in each lane; a unary operation does not look at `b`.
    #[inline(always)]
    pub fn apply<V: Vector>(self, a: V, b: V) -> V {
        match self {
            Self::Add => a + b,
            Self::Sub => a - b,
            Self::Mul => a * b,
            // The division does not wait for the answer whether it counts.
            Self::Div => V::splat(SMALLEST_DIVISOR).select_less(b.abs(), a / b, a),
            Self::Min => a.select_less(b, a, b),
            Self::Max => b.select_less(a, a, b),
            Self::Sin => a.map(libm::sin),
            Self::Cos => a.map(libm::cos),
            Self::Tanh => a.map(libm::tanh),
            Self::Exp => a.map(libm::exp),
            Self::Sqrt => a.abs().sqrt(),
            Self::Abs => a.abs(),
        }
    }
}

impl FromStr for Operation {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self, Error> {
        match Self::ALL.into_iter().find(|operation| operation.name() == name) {
            Some(operation) => Ok(operation),
            None => invalid(format!(
                "operation: expected one of {}, found {name:?}",
                Self::ALL.map(Self::name).join(" ")
            )),
        }
    }
}
