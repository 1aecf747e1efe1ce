//! The inverse of a small Gram matrix that gains and loses a member at a time.

use super::blocks::Blocks;
use crate::lanes::Vector;

/// Symmetric up to rounding. Every sum is taken in the order of the members, so the width of a vector never shows.
pub(crate) struct Inverse<V> {
    order: usize,
    /// Numbers from a column to the next, with room for a vector from the last member on. Nobody looks at what is there.
    stride: usize,
    /// Column after column: the product with a vector is then a sum of whole columns.
    columns: Vec<f64>,
    /// Where the next columns are written.
    spare: Vec<f64>,
    /// A row on its way.
    row: Vec<f64>,
    /// Members of which the rows of Lᵀ and L⁻¹ are known.
    factored: Vec<usize>,
    upper: Blocks<V>,
    lower: Blocks<V>,
}

/// A matrix that members are taken from.
#[derive(Clone, Copy)]
pub(crate) struct Products<'a> {
    /// Row after row.
    pub numbers: &'a [f64],
    /// Length of a row.
    pub features: usize,
}

impl<'a> Products<'a> {
    /// Inner products of a feature with all.
    #[inline(always)]
    pub fn row(&self, i: usize) -> &'a [f64] {
        &self.numbers[i * self.features..][..self.features]
    }
}

/// A row's numbers divided, so many and may be some behind them.
#[inline(always)]
fn divide<V: Vector>(row: &mut [f64], divisor: f64, length: usize) {
    for vector in row.chunks_exact_mut(V::LANES).take(length.div_ceil(V::LANES)) {
        (V::load(vector) / divisor).store(vector);
    }
}

/// One row less a multiple of another, so many numbers and may be some behind them.
#[inline(always)]
fn less<V: Vector>(row: &[f64], factor: f64, other: &[f64], target: &mut [f64], length: usize) {
    let rows = row.chunks_exact(V::LANES).zip(other.chunks_exact(V::LANES));
    let targets = target.chunks_exact_mut(V::LANES).take(length.div_ceil(V::LANES));
    for (target, (row, other)) in targets.zip(rows) {
        (V::load(row) - V::load(other) * factor).store(target);
    }
}

impl<V: Vector> Inverse<V> {
    /// Of no member, with room for `most`.
    pub fn new(most: usize) -> Self {
        let stride = (most / V::LANES + 2) * V::LANES;
        let (columns, spare) = (vec![0.0; most * stride], vec![0.0; most * stride]);
        let (upper, lower) = (Blocks::new(most), Blocks::new(most));
        Self { order: 0, stride, columns, spare, row: vec![0.0; stride], factored: vec![], upper, lower }
    }

    /// A row of numbers, with room for all members and a vector behind them.
    pub fn empty_row(&self) -> Vec<f64> {
        vec![0.0; self.stride]
    }

    /// A diagonal entry.
    #[inline(always)]
    pub fn diagonal(&self, i: usize) -> f64 {
        self.columns[i * self.stride + i]
    }

    /// The inverse times a row.
    #[inline(always)]
    pub fn times(&self, row: &[f64], product: &mut [f64]) {
        for at in (0..self.order).step_by(V::LANES) {
            let mut sum = V::splat(0.0);
            for (&x, column) in row[..self.order].iter().zip(self.columns.chunks_exact(self.stride)) {
                sum = sum + V::load(&column[at..]) * x;
            }
            sum.store(&mut product[at..]);
        }
    }

    /// Gains a member: `images` is the inverse times its products with the others, `outside` what they leave of it.
    #[inline(always)]
    pub fn grow(&mut self, images: &[f64], outside: f64) {
        let (k, stride, shares) = (self.order, self.stride, &mut self.row);
        shares.copy_from_slice(images);
        divide::<V>(shares, -outside, k);
        let (places, last) = self.spare.split_at_mut(k * stride);
        let columns = self.columns.chunks_exact(stride).zip(places.chunks_exact_mut(stride));
        for (i, (column, next)) in columns.enumerate() {
            less::<V>(column, images[i], shares, next, k);
            next[k] = shares[i];
        }
        last[..k].copy_from_slice(&shares[..k]);
        last[k] = 1.0 / outside;
        std::mem::swap(&mut self.columns, &mut self.spare);
        self.order += 1;
    }

    /// Loses a member, of which `row` becomes the row that it had.
    #[inline(always)]
    pub fn shrink(&mut self, at: usize, row: &mut [f64]) {
        let (k, stride, shares) = (self.order, self.stride, &mut self.row);
        for (entry, column) in row[..k].iter_mut().zip(self.columns.chunks_exact(stride)) {
            *entry = column[at];
        }
        shares.copy_from_slice(row);
        divide::<V>(shares, row[at], k);
        let mut places = self.spare.chunks_exact_mut(stride);
        for (i, column) in self.columns.chunks_exact(stride).enumerate().take(k) {
            if i != at
                && let Some(next) = places.next()
            {
                less::<V>(column, row[i], shares, next, at);
                // What comes after the member moves up by one.
                less::<V>(&column[at + 1..], row[i], &shares[at + 1..], &mut next[at..], k - 1 - at);
            }
        }
        std::mem::swap(&mut self.columns, &mut self.spare);
        self.order -= 1;
    }

    /// From scratch, by Cholesky; whether no pivot fell below `smallest` times its entry.
    ///
    /// What was found for the first members is still true of them, up to the first one that is another now.
    #[inline(always)]
    pub fn invert(&mut self, members: &[usize], products: Products<'_>, smallest: f64) -> bool {
        let same = self.factored.iter().zip(members).take_while(|(a, b)| a == b).count();
        // Whole blocks of them only.
        let same = same - same % V::LANES;
        self.factored.truncate(same);
        for j in 0..members.len() {
            if !self.factor(j, same, members, products.row(members[j]), smallest) {
                return false;
            }
        }
        self.order = members.len();
        // L⁻ᵀ L⁻¹.
        let none = V::splat(0.0);
        for (a, column) in self.columns.chunks_exact_mut(self.stride).enumerate().take(self.order) {
            for at in (0..self.order).step_by(V::LANES) {
                let sum = none - self.lower.less(none, at, &self.lower, a, a.max(at)..self.order);
                sum.store(&mut column[at..]);
            }
        }
        true
    }

    /// The j-th rows of Lᵀ and L⁻¹, as far as they are not known: those of the first `same` members are, and so is
    /// L among them.
    #[inline(always)]
    fn factor(&mut self, j: usize, same: usize, members: &[usize], products: &[f64], smallest: f64) -> bool {
        let known = j < same;
        let mut root = if known { self.upper.get(j, j) } else { 0.0 };
        let first = if known { same } else { j - j % V::LANES };
        for at in (first..members.len()).step_by(V::LANES) {
            for (entry, &other) in self.row.iter_mut().zip(members[at..].iter().take(V::LANES)) {
                *entry = products[other];
            }
            let left = self.upper.less(V::load(&self.row), at, &self.upper, j, 0..j);
            if !known && at == first {
                left.store(&mut self.row);
                let pivot = self.row[j - at];
                if !(pivot > smallest * products[members[j]].abs() && pivot > 0.0) {
                    return false;
                }
                root = pivot.sqrt();
            }
            self.upper.set_vector(j, at, left / root);
        }
        if !known {
            self.upper.set(j, j, root);
            for at in (0..=j).step_by(V::LANES) {
                self.row.fill(0.0);
                if at == first {
                    self.row[j - at] = 1.0;
                }
                let left = self.lower.less(V::load(&self.row), at, &self.upper, j, at..j);
                self.lower.set_vector(j, at, left / root);
            }
            self.factored.push(members[j]);
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::{Scalar, Wide};
    use crate::linear_algebra::Cholesky;
    use proptest::prelude::*;

    const FEATURES: usize = 9;

    /// Inner products of features that are far from collinear.
    fn products(columns: &[Vec<f64>]) -> Vec<f64> {
        let entry = |i: usize, j: usize| {
            let product: f64 = columns[i].iter().zip(&columns[j]).map(|(a, b)| a * b).sum();
            product + f64::from(u8::from(i == j))
        };
        (0..FEATURES * FEATURES).map(|ij| entry(ij / FEATURES, ij % FEATURES)).collect()
    }

    /// What an inverse makes of each unit row.
    fn entries<V: Vector>(inverse: &Inverse<V>) -> Vec<f64> {
        let (mut row, mut product) = (inverse.empty_row(), inverse.empty_row());
        let mut all = vec![];
        for i in 0..inverse.order {
            row[i] = 1.0;
            inverse.times(&row, &mut product);
            all.extend_from_slice(&product[..inverse.order]);
            row[i] = 0.0;
        }
        all
    }

    /// Goes from one set of members to the next by what is asked for, and tells the inverse after each step.
    fn followed<V: Vector>(numbers: &[f64], steps: &[(u8, usize)]) -> Vec<(Vec<usize>, Vec<f64>)> {
        let products = Products { numbers, features: FEATURES };
        let mut inverse = Inverse::<V>::new(FEATURES);
        let (mut members, mut steps_seen): (Vec<usize>, _) = (vec![], vec![]);
        let (mut row, mut images) = (inverse.empty_row(), inverse.empty_row());
        for &(kind, pick) in steps {
            let feature = pick % FEATURES;
            match (kind, members.iter().position(|&i| i == feature)) {
                (0, _) => assert!(inverse.invert(&members, products, 1e-12)),
                (_, Some(at)) => {
                    inverse.shrink(at, &mut images);
                    members.remove(at);
                }
                (_, None) => {
                    let all = products.row(feature);
                    row.iter_mut().zip(&members).for_each(|(entry, &i)| *entry = all[i]);
                    inverse.times(&row, &mut images);
                    let inside: f64 = (0..members.len()).map(|i| row[i] * images[i]).sum();
                    inverse.grow(&images, all[feature] - inside);
                    members.push(feature);
                }
            }
            steps_seen.push((members.clone(), entries(&inverse)));
        }
        steps_seen
    }

    proptest! {
        #[test]
        fn however_it_came_about_it_is_the_inverse_for_vectors_of_any_width(
            columns in prop::collection::vec(prop::collection::vec(-2.0..2.0_f64, 6), FEATURES),
            steps in prop::collection::vec((0..4_u8, 0..FEATURES), 1..40),
        ) {
            let numbers = products(&columns);
            let steps_seen = followed::<Wide<f64, 4>>(&numbers, &steps);
            prop_assert_eq!(&steps_seen, &followed::<Scalar>(&numbers, &steps));
            prop_assert_eq!(&steps_seen, &followed::<Wide<f64, 8>>(&numbers, &steps));
            for (members, found) in steps_seen {
                let gram: Vec<f64> =
                    members.iter().flat_map(|&i| members.iter().map(move |&j| (i, j))).map(|(i, j)| numbers[i * FEATURES + j]).collect();
                let expected = Cholesky::new(&gram, members.len(), 1e-12).expect("positive definite").inverse();
                for (a, b) in found.iter().zip(&expected) {
                    prop_assert!((a - b).abs() < 1e-9, "{} beside {}", a, b);
                }
            }
        }

        #[test]
        fn what_was_known_of_the_first_members_does_not_show(
            columns in prop::collection::vec(prop::collection::vec(-2.0..2.0_f64, 6), FEATURES),
            first in Just((0..FEATURES).collect::<Vec<_>>()).prop_shuffle(),
            at in 0..FEATURES,
        ) {
            let numbers = products(&columns);
            let products = Products { numbers: &numbers, features: FEATURES };
            let (mut used, mut fresh) = (Inverse::<Wide<f64, 4>>::new(FEATURES), Inverse::<Wide<f64, 4>>::new(FEATURES));
            prop_assert!(used.invert(&first, products, 1e-12));
            let mut second = first.clone();
            second.remove(at);
            prop_assert!(used.invert(&second, products, 1e-12) && fresh.invert(&second, products, 1e-12));
            prop_assert_eq!(entries(&used), entries(&fresh));
        }
    }

    #[test]
    fn a_member_that_the_others_span_has_none_until_it_is_gone() {
        let numbers = [2.0, 1.0, 3.0, 1.0, 2.0, 3.0, 3.0, 3.0, 6.0];
        let products = Products { numbers: &numbers, features: 3 };
        let mut inverse = Inverse::<Scalar>::new(3);
        assert!(!inverse.invert(&[0, 1, 2], products, 1e-8));
        assert!(inverse.invert(&[0, 1], products, 1e-8));
        let expected = [2.0 / 3.0, -1.0 / 3.0, -1.0 / 3.0, 2.0 / 3.0];
        assert!(entries(&inverse).iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-14));
    }
}
