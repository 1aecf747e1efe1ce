//! Pieces: what one vector register holds, and the few operations that everything else is made of.
//!
//! Instructions are named one by one, because a compiler that is left to find vectors in loops over arrays finds them
//! across the wrong loop.

/// Work that is compiled once for each piece and called, rather than inlined into each loop around it.
///
/// Implementations carry `#[inline(always)]`: what is inlined into [`Piece::apart`] gets the instructions of the piece.
pub trait Apart {
    /// The work.
    fn run(self);
}

/// A few numbers in one register.
pub trait Piece: Copy + Send + Sync + 'static {
    /// How many.
    const LANES: usize;
    /// The same number everywhere.
    fn splat(value: f64) -> Self;
    /// The first [`Piece::LANES`] numbers of a slice.
    fn load(values: &[f64]) -> Self;
    /// Writes the first [`Piece::LANES`] numbers of a slice.
    fn store(self, values: &mut [f64]);
    /// self + other
    fn add(self, other: Self) -> Self;
    /// self − other
    fn sub(self, other: Self) -> Self;
    /// self × other
    fn mul(self, other: Self) -> Self;
    /// self / other
    fn div(self, other: Self) -> Self;
    /// √self
    fn sqrt(self) -> Self;
    /// |self|
    fn abs(self) -> Self;
    /// `yes` where self < other, else `no`, which is also the answer of a NaN.
    fn select_less(self, other: Self, yes: Self, no: Self) -> Self;
    /// Whether self < other anywhere.
    fn any_less(self, other: Self) -> bool;
    /// Calls work in a function of its own that has the instructions of this piece.
    fn apart(work: impl Apart);
}

impl Piece for f64 {
    const LANES: usize = 1;
    #[inline(always)]
    fn splat(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn load(values: &[f64]) -> Self {
        values[0]
    }
    #[inline(always)]
    fn store(self, values: &mut [f64]) {
        values[0] = self;
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self + other
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self - other
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self * other
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self / other
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        f64::abs(self)
    }
    #[inline(always)]
    fn select_less(self, other: Self, yes: Self, no: Self) -> Self {
        if self < other { yes } else { no }
    }
    #[inline(always)]
    fn any_less(self, other: Self) -> bool {
        self < other
    }
    #[inline(never)]
    fn apart(work: impl Apart) {
        work.run();
    }
}

/// Several numbers without vector instructions that are named. Each operation is a call: processors that lack the wider
/// pieces are old, and code for them that is written out is a tenth of the module.
impl<const N: usize> Piece for [f64; N] {
    const LANES: usize = N;
    #[inline(never)]
    fn splat(value: f64) -> Self {
        [value; N]
    }
    #[inline(never)]
    fn load(values: &[f64]) -> Self {
        std::array::from_fn(|i| values[..N][i])
    }
    #[inline(never)]
    fn store(self, values: &mut [f64]) {
        values[..N].copy_from_slice(&self);
    }
    #[inline(never)]
    fn add(self, other: Self) -> Self {
        std::array::from_fn(|i| self[i] + other[i])
    }
    #[inline(never)]
    fn sub(self, other: Self) -> Self {
        std::array::from_fn(|i| self[i] - other[i])
    }
    #[inline(never)]
    fn mul(self, other: Self) -> Self {
        std::array::from_fn(|i| self[i] * other[i])
    }
    #[inline(never)]
    fn div(self, other: Self) -> Self {
        std::array::from_fn(|i| self[i] / other[i])
    }
    #[inline(never)]
    fn sqrt(self) -> Self {
        self.map(f64::sqrt)
    }
    #[inline(never)]
    fn abs(self) -> Self {
        self.map(f64::abs)
    }
    #[inline(never)]
    fn select_less(self, other: Self, yes: Self, no: Self) -> Self {
        std::array::from_fn(|i| if self[i] < other[i] { yes[i] } else { no[i] })
    }
    #[inline(never)]
    fn any_less(self, other: Self) -> bool {
        self.iter().zip(&other).any(|(a, b)| a < b)
    }
    #[inline(never)]
    fn apart(work: impl Apart) {
        work.run();
    }
}

#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
mod x86 {
    use super::{Apart, Piece};
    use std::arch::x86_64::*;

    // SAFETY, for every block below: a piece wider than the baseline is named only by the `Isa` of its width, and only
    // `dispatch` runs code of an `Isa`, after it was asked whether the processor has the width. Loads and stores are
    // unaligned and within a slice whose length was checked.
    // No closures: what is not inlined by force would not get the instructions of its width.
    macro_rules! piece {
        ($piece:ident, $features:literal, $lanes:literal, $splat:ident, $load:ident, $store:ident, $add:ident, $sub:ident, $mul:ident,
         $div:ident, $sqrt:ident, abs($a:ident) = $abs:expr,
         select_less($x:ident, $y:ident, $yes:ident, $no:ident) = $select:expr,
         any_less($p:ident, $q:ident) = $any:expr) => {
            impl Piece for $piece {
                const LANES: usize = $lanes;
                #[inline(always)]
                fn splat(value: f64) -> Self {
                    unsafe { $splat(value) }
                }
                #[inline(always)]
                fn load(values: &[f64]) -> Self {
                    unsafe { $load(values[..$lanes].as_ptr()) }
                }
                #[inline(always)]
                fn store(self, values: &mut [f64]) {
                    unsafe { $store(values[..$lanes].as_mut_ptr(), self) }
                }
                #[inline(always)]
                fn add(self, other: Self) -> Self {
                    unsafe { $add(self, other) }
                }
                #[inline(always)]
                fn sub(self, other: Self) -> Self {
                    unsafe { $sub(self, other) }
                }
                #[inline(always)]
                fn mul(self, other: Self) -> Self {
                    unsafe { $mul(self, other) }
                }
                #[inline(always)]
                fn div(self, other: Self) -> Self {
                    unsafe { $div(self, other) }
                }
                #[inline(always)]
                fn sqrt(self) -> Self {
                    unsafe { $sqrt(self) }
                }
                #[inline(always)]
                fn abs(self) -> Self {
                    let $a = self;
                    unsafe { $abs }
                }
                #[inline(always)]
                fn select_less(self, other: Self, yes: Self, no: Self) -> Self {
                    let ($x, $y, $yes, $no) = (self, other, yes, no);
                    unsafe { $select }
                }
                #[inline(always)]
                fn any_less(self, other: Self) -> bool {
                    let ($p, $q) = (self, other);
                    unsafe { $any }
                }
                #[inline(always)]
                fn apart(work: impl Apart) {
                    #[target_feature(enable = $features)]
                    #[inline(never)]
                    fn call(work: impl Apart) {
                        work.run();
                    }
                    unsafe { call(work) }
                }
            }
        };
    }

    piece!(
        __m256d,
        "avx2",
        4,
        _mm256_set1_pd,
        _mm256_loadu_pd,
        _mm256_storeu_pd,
        _mm256_add_pd,
        _mm256_sub_pd,
        _mm256_mul_pd,
        _mm256_div_pd,
        _mm256_sqrt_pd,
        abs(a) = _mm256_andnot_pd(_mm256_set1_pd(-0.0), a),
        select_less(a, b, yes, no) = _mm256_blendv_pd(no, yes, _mm256_cmp_pd::<_CMP_LT_OQ>(a, b)),
        any_less(a, b) = _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LT_OQ>(a, b)) != 0
    );
    piece!(
        __m512d,
        "avx512f,avx2",
        8,
        _mm512_set1_pd,
        _mm512_loadu_pd,
        _mm512_storeu_pd,
        _mm512_add_pd,
        _mm512_sub_pd,
        _mm512_mul_pd,
        _mm512_div_pd,
        _mm512_sqrt_pd,
        abs(a) = _mm512_abs_pd(a),
        select_less(a, b, yes, no) = _mm512_mask_blend_pd(_mm512_cmp_pd_mask::<_CMP_LT_OQ>(a, b), no, yes),
        any_less(a, b) = _mm512_cmp_pd_mask::<_CMP_LT_OQ>(a, b) != 0
    );
}
