//! Vectors: a number of lanes, as pieces that each fill a register.

use std::ops::{Add, Div, Mul, Sub};

use super::piece::{Apart, Piece};

/// One number in each of several lanes.
pub trait Vector:
    Copy
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Mul<f64, Output = Self>
    + Div<f64, Output = Self>
{
    /// How many lanes.
    const LANES: usize;
    /// What one register holds of it.
    type Piece: Vector;
    /// How many registers it fills.
    const PIECES: usize;
    /// The `i`-th piece, first lanes first.
    fn piece(&self, i: usize) -> Self::Piece;
    /// Writes the `i`-th piece.
    fn set_piece(&mut self, i: usize, piece: Self::Piece);
    /// The same number in every lane.
    fn splat(value: f64) -> Self;
    /// The first [`Vector::LANES`] numbers of a slice.
    fn load(values: &[f64]) -> Self;
    /// Writes the first [`Vector::LANES`] numbers of a slice.
    fn store(self, values: &mut [f64]);
    /// √self
    fn sqrt(self) -> Self;
    /// |self|
    fn abs(self) -> Self;
    /// `yes` where self < other, else `no`, which is also the answer of a NaN.
    fn select_less(self, other: Self, yes: Self, no: Self) -> Self;
    /// Whether self < other in any lane.
    fn any_less(self, other: Self) -> bool;

    /// Calls work in a function of its own that has the instructions of these vectors.
    fn apart(work: impl Apart);

    /// The nearest number from `low` to `high`; nothing is less than a NaN, so a NaN stays one.
    #[inline(always)]
    fn clamp(self, low: f64, high: f64) -> Self {
        let (low, high) = (Self::splat(low), Self::splat(high));
        let above = self.select_less(low, low, self);
        high.select_less(above, high, above)
    }

    /// `f` of each lane by itself: for functions that have no vector instruction.
    #[inline(always)]
    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        let mut lanes = [0.0; 64];
        self.store(&mut lanes);
        lanes[..Self::LANES].iter_mut().for_each(|lane| *lane = f(*lane));
        Self::load(&lanes)
    }

    /// `f` of each lane and the same lane of another.
    #[inline(always)]
    fn with(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        let (mut lanes, mut others) = ([0.0; 64], [0.0; 64]);
        self.store(&mut lanes);
        other.store(&mut others);
        lanes[..Self::LANES].iter_mut().zip(&others).for_each(|(lane, &other)| *lane = f(*lane, other));
        Self::load(&lanes)
    }

    /// The number in one lane.
    fn lane(self, l: usize) -> f64 {
        let mut lanes = [0.0; 64];
        self.store(&mut lanes);
        lanes[l]
    }
}

/// `N` pieces side by side. Its loops are written out, for a closure might not be inlined and then lack the width.
#[derive(Clone, Copy)]
pub struct Wide<P, const N: usize>([P; N]);

/// One lane.
pub type Scalar = Wide<f64, 1>;

impl<P: Piece, const N: usize> Vector for Wide<P, N> {
    const LANES: usize = P::LANES * N;
    type Piece = Wide<P, 1>;
    const PIECES: usize = N;

    #[inline(always)]
    fn piece(&self, i: usize) -> Wide<P, 1> {
        Wide([self.0[i]])
    }
    #[inline(always)]
    fn set_piece(&mut self, i: usize, piece: Wide<P, 1>) {
        self.0[i] = piece.0[0];
    }
    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self([P::splat(value); N])
    }
    #[inline(always)]
    fn load(values: &[f64]) -> Self {
        let values = &values[..Self::LANES];
        let mut out = Self([P::splat(0.0); N]);
        for i in 0..N {
            out.0[i] = P::load(&values[i * P::LANES..]);
        }
        out
    }
    #[inline(always)]
    fn store(self, values: &mut [f64]) {
        let values = &mut values[..Self::LANES];
        for i in 0..N {
            self.0[i].store(&mut values[i * P::LANES..]);
        }
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let mut out = self;
        for i in 0..N {
            out.0[i] = out.0[i].sqrt();
        }
        out
    }
    #[inline(always)]
    fn abs(self) -> Self {
        let mut out = self;
        for i in 0..N {
            out.0[i] = out.0[i].abs();
        }
        out
    }
    #[inline(always)]
    fn select_less(self, other: Self, yes: Self, no: Self) -> Self {
        let mut out = self;
        for i in 0..N {
            out.0[i] = self.0[i].select_less(other.0[i], yes.0[i], no.0[i]);
        }
        out
    }
    #[inline(always)]
    fn any_less(self, other: Self) -> bool {
        let mut any = false;
        for i in 0..N {
            any |= self.0[i].any_less(other.0[i]);
        }
        any
    }
    #[inline(always)]
    fn apart(work: impl Apart) {
        P::apart(work);
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident) => {
        impl<P: Piece, const N: usize> $trait for Wide<P, N> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                let mut out = self;
                for i in 0..N {
                    out.0[i] = out.0[i].$method(other.0[i]);
                }
                out
            }
        }
        impl<P: Piece, const N: usize> $trait<f64> for Wide<P, N> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: f64) -> Self {
                self.$method(Self::splat(other))
            }
        }
    };
}
operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::{Isa, Kernel, Width, dispatch};
    use proptest::prelude::*;

    /// Every operation on eight lanes.
    struct Operations<'a>(&'a [f64], &'a [f64]);

    impl Kernel for Operations<'_> {
        type Output = Vec<Vec<f64>>;
        #[inline(always)]
        fn run<W: Isa>(self) -> Vec<Vec<f64>> {
            let (a, b) = (W::Of8::load(self.0), W::Of8::load(self.1));
            let results = [
                a + b,
                a - b,
                a * b,
                a / b,
                a.abs(),
                a.abs().sqrt(),
                a.select_less(b, a, b),
                a.map(|x| x + 1.0),
                a.clamp(-1.0, 2.0),
                W::Of8::splat(f64::from(u8::from(a.any_less(b)))),
            ];
            let to_vec = |v: W::Of8| (0..8).map(|l| v.lane(l)).collect();
            results.into_iter().map(to_vec).collect()
        }
    }

    proptest! {
        #[test]
        fn every_width_gives_the_bits_of_plain_arithmetic(
            a in prop::array::uniform8(any::<f64>()),
            b in prop::array::uniform8(any::<f64>()),
        ) {
            let zip = |f: fn(f64, f64) -> f64| a.iter().zip(&b).map(|(a, b)| f(*a, *b)).collect::<Vec<f64>>();
            let any = a.iter().zip(&b).any(|(a, b)| a < b);
            let expected = [
                zip(|a, b| a + b),
                zip(|a, b| a - b),
                zip(|a, b| a * b),
                zip(|a, b| a / b),
                zip(|a, _| a.abs()),
                zip(|a, _| a.abs().sqrt()),
                zip(|a, b| if a < b { a } else { b }),
                zip(|a, _| a + 1.0),
                zip(|a, _| a.clamp(-1.0, 2.0)),
                vec![f64::from(u8::from(any)); 8],
            ];
            for width in Width::available() {
                for (found, expected) in dispatch(width, Operations(&a, &b)).iter().zip(&expected) {
                    for (found, expected) in found.iter().zip(expected) {
                        // The payload of a NaN is the one thing that a processor may choose.
                        prop_assert!(found.to_bits() == expected.to_bits() || (found.is_nan() && expected.is_nan()));
                    }
                }
            }
        }
    }
}
