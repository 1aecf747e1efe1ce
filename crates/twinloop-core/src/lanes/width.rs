//! Widths: the vector instructions that a processor has, and how work is compiled for each of them.

use std::str::FromStr;

use super::vector::{Scalar, Vector, Wide};
use crate::error::{Error, invalid};

/// The vector instructions that work is carried out with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Width {
    /// What every processor of the target has: SSE2 on x86-64, NEON on AArch64.
    Baseline,
    /// 256-bit vectors.
    Avx2,
    /// 512-bit vectors.
    Avx512,
}

impl Width {
    /// The widths that this processor can run, narrowest first.
    pub fn available() -> Vec<Self> {
        let mut widths = vec![Self::Baseline];
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx2") {
                widths.push(Self::Avx2);
            }
            if is_x86_feature_detected!("avx512f") {
                widths.push(Self::Avx512);
            }
        }
        widths
    }

    /// The widest that this processor can run.
    pub fn widest() -> Self {
        Self::available().pop().unwrap_or(Self::Baseline)
    }

    /// The name that [`FromStr`] reads.
    pub fn name(self) -> &'static str {
        match self {
            Self::Baseline => "baseline",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }
}

impl FromStr for Width {
    type Err = Error;

    /// A width by its name, or `auto` for the widest; one that this processor lacks is refused.
    fn from_str(name: &str) -> Result<Self, Error> {
        if name == "auto" {
            return Ok(Self::widest());
        }
        let available = Self::available();
        match available.iter().find(|width| width.name() == name) {
            Some(width) => Ok(*width),
            None => invalid(format!(
                "vector width: expected auto or one that this processor has ({}), found {name:?}",
                available.iter().map(|width| width.name()).collect::<Vec<_>>().join(", ")
            )),
        }
    }
}

/// The vectors of a width, by their number of lanes.
pub trait Isa {
    /// 1 lane.
    type Of1: Vector;
    /// 4 lanes.
    type Of4: Vector;
    /// 8 lanes.
    type Of8: Vector;
    /// 8 lanes of numbers that are only compared: nothing waits for them, so the widest registers serve best.
    type Compared8: Vector;
    /// 32 lanes.
    type Of32: Vector;
    /// 64 lanes.
    type Of64: Vector;
}

struct Baseline;
#[cfg(target_arch = "x86_64")]
struct Avx2;
#[cfg(target_arch = "x86_64")]
struct Avx512;

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::*;
    use std::arch::x86_64::{__m256d, __m512d};

    impl Isa for Baseline {
        type Of1 = Scalar;
        type Of4 = Wide<[f64; 4], 1>;
        type Of8 = Wide<[f64; 8], 1>;
        type Compared8 = Self::Of8;
        type Of32 = Wide<[f64; 32], 1>;
        type Of64 = Wide<[f64; 64], 1>;
    }

    impl Isa for Avx2 {
        type Of1 = Scalar;
        type Of4 = Wide<__m256d, 1>;
        type Of8 = Wide<__m256d, 2>;
        type Compared8 = Self::Of8;
        type Of32 = Wide<__m256d, 8>;
        type Of64 = Wide<__m256d, 16>;
    }

    impl Isa for Avx512 {
        type Of1 = Scalar;
        type Of4 = Wide<__m256d, 1>;
        // Two registers and not one of 512 bits: what the next step waits for is there sooner, and the code is that of AVX2.
        type Of8 = Wide<__m256d, 2>;
        type Compared8 = Wide<__m512d, 1>;
        type Of32 = Wide<__m512d, 4>;
        type Of64 = Wide<__m512d, 8>;
    }
}

#[cfg(not(target_arch = "x86_64"))]
impl Isa for Baseline {
    type Of1 = Scalar;
    type Of4 = Wide<f64, 4>;
    type Of8 = Wide<f64, 8>;
    type Compared8 = Self::Of8;
    type Of32 = Wide<f64, 32>;
    type Of64 = Wide<f64, 64>;
}

/// Work that is worth compiling for each width. Everything that it calls in a hot loop must be `#[inline(always)]`: only
/// what is inlined gets the instructions of the width.
pub trait Kernel {
    /// What the work returns.
    type Output;
    /// The work, with the vectors of a width. Implementations carry `#[inline(always)]` too.
    fn run<W: Isa>(self) -> Self::Output;
}

/// Runs a kernel with the vector instructions of `width`.
#[allow(unsafe_code)]
pub fn dispatch<K: Kernel>(width: Width, kernel: K) -> K::Output {
    match width {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a `Width` other than the baseline comes from `available`, which asked the processor; and if somebody
        // made it up, the question is asked again here.
        Width::Avx2 if is_x86_feature_detected!("avx2") => unsafe { run_avx2(kernel) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above. Every processor with AVX-512 has AVX2.
        Width::Avx512 if is_x86_feature_detected!("avx512f") => unsafe { run_avx512(kernel) },
        _ => kernel.run::<Baseline>(),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Avx2>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx2")]
fn run_avx512<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Avx512>()
}
