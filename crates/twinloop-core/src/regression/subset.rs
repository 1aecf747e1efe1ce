//! Search over subsets of features by annealing: add, drop, swap, on inner products alone.
//!
//! Features of one smooth run are close to collinear, and then greedy selection ends at an alias of the law that fits
//! as well and predicts nothing. Annealing crosses between them (Kirkpatrick, Gelatt, Vecchi 1983).

use std::sync::Arc;

use super::gram::Gram;
use crate::error::{Result, invalid};
use crate::lanes::{Isa, Kernel, Vector, Width, dispatch};
use crate::linear_algebra::{Inverse, Products};
use crate::rng::{Stream, Unit};
use crate::workers::Workers;

/// How long and how hot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Annealing {
    /// Moves that are tried.
    pub moves: usize,
    /// Features in a subset at most.
    pub largest: usize,
    /// Temperature at the end, in units of χ²; 2 draws subsets as often as they are likely.
    pub coldest: f64,
}

impl Annealing {
    /// Refuses what is no walk.
    pub fn validated(self) -> Result<Self> {
        if self.largest == 0 || !(self.coldest.is_finite() && self.coldest > 0.0) {
            return invalid(format!(
                "annealing: expected subsets of 1 feature or more and a temperature above 0, found {} and {}",
                self.largest, self.coldest
            ));
        }
        Ok(self)
    }
}

/// A subset and its energy: χ² and the prices of its features.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Its features, ascending.
    pub subset: Vec<usize>,
    /// Its energy.
    pub energy: f64,
}

/// A column whose part outside the others' span is shorter than this share (squared) is the same column.
const COLLINEAR: f64 = 1e-8;
/// Sum of 1 / (share outside the span) over the updates at which the next inversion from scratch is due.
const MOST_ROUNDING: f64 = 1e4;
/// Distinct subsets that are kept of a walk.
const KEPT: usize = 64;
/// Energy above the best at which a subset is not worth keeping.
const WORTH: f64 = 14.0;

/// Inner products of columns of unit length, of those features that may be used.
#[derive(Clone, Debug)]
pub struct Choices {
    /// The features, ascending.
    features: Vec<usize>,
    /// Of each with each (row after row).
    products: Vec<f64>,
    /// Of each with the readings.
    targets: Vec<f64>,
    /// Of each, in units of χ².
    prices: Vec<f64>,
    /// χ² of no feature at all.
    total: f64,
}

impl Choices {
    /// Of a Gram matrix, with the price of each feature in units of χ²; infinite if it may not be used.
    pub fn new(gram: &Gram, prices: &[f64]) -> Self {
        let lengths: Vec<f64> = (0..gram.features).map(|j| gram.product(j, j).sqrt()).collect();
        // Features have units of their own: none is short beside another.
        let usable = |j: &usize| {
            lengths[*j].is_finite() && lengths[*j] > f64::MIN_POSITIVE.sqrt() && prices[*j].is_finite()
        };
        let features: Vec<usize> = (0..gram.features).filter(usable).collect();
        let row = |&i: &usize| {
            let scale = |&j: &usize| gram.product(i, j) / (lengths[i] * lengths[j]);
            features.iter().map(scale).collect::<Vec<_>>()
        };
        Self {
            products: features.iter().flat_map(row).collect(),
            targets: features.iter().map(|&j| gram.product(j, gram.features) / lengths[j]).collect(),
            prices: features.iter().map(|&j| prices[j]).collect(),
            total: gram.total(),
            features,
        }
    }

    fn len(&self) -> usize {
        self.features.len()
    }

    /// Inner products of all with all.
    #[inline(always)]
    fn products(&self) -> Products<'_> {
        Products { numbers: &self.products, features: self.len() }
    }
}

/// A subset on its way, with the inverse of its Gram matrix.
struct Walk<'a, V> {
    choices: &'a Choices,
    members: Vec<usize>,
    /// Whether each feature is a member.
    inside: Vec<bool>,
    inverse: Inverse<V>,
    coefficients: Vec<f64>,
    chi_squared: f64,
    price: f64,
    /// Rounding of the updates since the last inversion from scratch: the sum that [`MOST_ROUNDING`] limits.
    rounding: f64,
    /// Inner products of a feature with the members, and the inverse times them.
    products: Vec<f64>,
    images: Vec<f64>,
}

impl<'a, V: Vector> Walk<'a, V> {
    fn new(choices: &'a Choices, largest: usize) -> Self {
        let inverse = Inverse::new(largest.min(choices.len()));
        Self {
            choices,
            members: vec![],
            inside: vec![false; choices.len()],
            coefficients: vec![],
            chi_squared: choices.total,
            price: 0.0,
            rounding: 0.0,
            products: inverse.empty_row(),
            images: inverse.empty_row(),
            inverse,
        }
    }

    fn energy(&self) -> f64 {
        self.chi_squared + self.price
    }

    /// Inverse, coefficients and χ² of the members from scratch.
    #[inline(always)]
    fn refresh(&mut self) -> bool {
        let (k, choices, members) = (self.members.len(), self.choices, &self.members);
        if !self.inverse.invert(members, choices.products(), COLLINEAR) {
            return false;
        }
        self.products.iter_mut().zip(members).for_each(|(target, &j)| *target = choices.targets[j]);
        self.inverse.times(&self.products, &mut self.images);
        self.coefficients.clear();
        self.coefficients.extend_from_slice(&self.images[..k]);
        self.rounding = 0.0;
        self.chi_squared = (choices.total - dot(&self.coefficients, &self.products)).max(0.0);
        self.price = members.iter().map(|&j| choices.prices[j]).sum();
        true
    }

    /// What of a feature lies outside the members' span, and what of the rest of the readings it would explain.
    #[inline(always)]
    fn against(&mut self, j: usize) -> (f64, f64) {
        let row = self.choices.products().row(j);
        for (product, &i) in self.products.iter_mut().zip(&self.members) {
            *product = row[i];
        }
        self.inverse.times(&self.products, &mut self.images);
        let products = &self.products[..self.members.len()];
        let outside = 1.0 - dot(products, &self.images);
        (outside, self.choices.targets[j] - dot(products, &self.coefficients))
    }

    /// Adds the feature that was last looked at; no more than that where all is computed from scratch afterwards.
    #[inline(always)]
    fn insert(&mut self, j: usize, outside: f64, gain: f64) {
        self.rounding += 1.0 / outside;
        self.members.push(j);
        self.inside[j] = true;
        if self.rounding > MOST_ROUNDING {
            return;
        }
        self.inverse.grow(&self.images, outside);
        let new = gain / outside;
        self.coefficients.iter_mut().zip(&self.images).for_each(|(c, image)| *c -= image * new);
        self.coefficients.push(new);
        self.chi_squared = (self.chi_squared - gain * gain / outside).max(0.0);
        self.price += self.choices.prices[j];
    }

    #[inline(always)]
    fn remove(&mut self, at: usize) {
        let pivot = self.inverse.diagonal(at);
        self.rounding += pivot;
        let old = self.coefficients[at];
        self.inverse.shrink(at, &mut self.images);
        self.coefficients.iter_mut().zip(&self.images).for_each(|(c, image)| *c -= image * old / pivot);
        self.coefficients.remove(at);
        self.chi_squared += old * old / pivot;
        let j = self.members.remove(at);
        self.price -= self.choices.prices[j];
        self.inside[j] = false;
    }

    /// One move at a temperature; whether it was made.
    #[inline(always)]
    fn step(&mut self, largest: usize, heat: impl Fn() -> f64, stream: &mut Stream) -> bool {
        let k = self.members.len();
        let kind = stream.below(3);
        let accept = |change: f64, stream: &mut Stream| {
            change <= 0.0 || {
                let heat = heat();
                heat > 0.0 && is_below_exp(stream.uniform(), change / heat)
            }
        };
        if kind == 0 || k == 0 {
            if k >= largest || self.choices.len() == 0 {
                return false;
            }
            let j = stream.below(self.choices.len());
            if self.inside[j] {
                return false;
            }
            let (outside, gain) = self.against(j);
            if outside < COLLINEAR || !accept(self.choices.prices[j] - gain * gain / outside, stream) {
                return false;
            }
            self.insert(j, outside, gain);
        } else {
            let at = stream.below(k);
            let pivot = self.inverse.diagonal(at);
            let loss =
                self.coefficients[at] * self.coefficients[at] / pivot - self.choices.prices[self.members[at]];
            if kind == 1 {
                if !accept(loss, stream) {
                    return false;
                }
                self.remove(at);
            } else {
                let j = stream.below(self.choices.len());
                if self.inside[j] {
                    return false;
                }
                // As if the member had gone already.
                let (outside, gain) = self.against(j);
                let shared = self.images[at];
                let outside = outside + shared * shared / pivot;
                let gain = gain + shared * self.coefficients[at] / pivot;
                let change = loss + self.choices.prices[j] - gain * gain / outside;
                if outside < COLLINEAR || !accept(change, stream) {
                    return false;
                }
                self.remove(at);
                let (outside, gain) = self.against(j);
                if outside >= COLLINEAR {
                    self.insert(j, outside, gain);
                }
            }
        }
        if self.rounding > MOST_ROUNDING {
            // Where rounding has let a collinear column in, the latest ones go until the rest has an inverse.
            while !self.refresh() {
                let Some(j) = self.members.pop() else { break };
                self.inside[j] = false;
            }
        }
        true
    }
}

/// Whether a number is below e^−x for an x above 0. Most are beyond 1 − x ≤ e^−x ≤ 1 / (1 + x), which are quick to compute.
#[inline(always)]
fn is_below_exp(number: f64, x: f64) -> bool {
    number < 1.0 - x || (number * (1.0 + x) < 1.0 && number < libm::exp(-x))
}

/// The first number below an end from which on something holds; the end where it holds nowhere.
fn first(end: usize, holds: impl Fn(usize) -> bool) -> usize {
    let (mut low, mut high) = (0, end);
    while low < high {
        let middle = low.midpoint(high);
        (low, high) = if holds(middle) { (low, middle) } else { (middle + 1, high) };
    }
    low
}

/// A loop, for a fold over both would be a call, without the instructions of the width.
#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sum = 0.0;
    for (a, b) in a.iter().zip(b) {
        sum += a * b;
    }
    sum
}

/// Walks from hot to cold; the best subset first, then others that are nearly as good, best first.
pub fn search(choices: &Choices, annealing: &Annealing, stream: &mut Stream, width: Width) -> Vec<Found> {
    dispatch(width, Walked { choices, annealing, stream })
}

/// More walks of a problem than this are refused.
const MOST_STARTS: usize = 1_000_000;

/// Walks `starts` times in each of some problems: a Gram matrix and the price of each of its features, infinite if it may
/// not be used. For each problem the distinct subsets of all its walks, best first.
pub fn search_all(
    problems: &[(Arc<Gram>, Vec<f64>)],
    annealing: &Annealing,
    starts: usize,
    unit: &Unit,
    workers: &Workers,
) -> Result<Vec<Vec<Found>>> {
    if !(1..=MOST_STARTS).contains(&starts) {
        return invalid(format!("search_subsets: expected 1 to {MOST_STARTS} starts, found {starts}"));
    }
    let priced = |(gram, prices): &(Arc<Gram>, Vec<f64>)| {
        prices.len() == gram.features && !prices.iter().any(|price| price.is_nan())
    };
    if !problems.iter().all(priced) {
        return invalid("search_subsets: expected a price for each feature, infinite if it may not be used");
    }
    let choices = workers.map(problems.len(), |i| Choices::new(&problems[i].0, &problems[i].1));
    let walks = workers.map(problems.len() * starts, |walk| {
        search(&choices[walk / starts], annealing, &mut unit.stream(walk as u64), workers.width())
    });
    Ok(walks.chunks(starts).map(merged).collect())
}

/// Distinct subsets of several walks, best first.
fn merged(walks: &[Vec<Found>]) -> Vec<Found> {
    let mut all = walks.concat();
    all.sort_by(|a, b| a.energy.total_cmp(&b.energy).then_with(|| a.subset.cmp(&b.subset)));
    all.dedup_by(|a, b| a.subset == b.subset);
    all
}

struct Walked<'a> {
    choices: &'a Choices,
    annealing: &'a Annealing,
    stream: &'a mut Stream,
}

impl Kernel for Walked<'_> {
    type Output = Vec<Found>;

    #[inline(always)]
    fn run<W: Isa>(self) -> Vec<Found> {
        let Self { choices, annealing, stream } = self;
        let mut walk = Walk::<W::Of4>::new(choices, annealing.largest);
        let mut kept: Vec<Found> = vec![];
        keep(&walk, &mut kept);
        let hottest = (0.02 * choices.total).max(100.0 * annealing.coldest);
        let cooling = libm::log(annealing.coldest / hottest);
        // The last tenth goes down only.
        let cooled = annealing.moves - annealing.moves / 10;
        let heat =
            |n: usize| if n < cooled { hottest * libm::exp(cooling * n as f64 / cooled as f64) } else { 0.0 };
        let cold = first(annealing.moves, |n| heat(n) <= 20.0 * annealing.coldest);
        for n in 0..annealing.moves {
            // Early subsets are passed through only, but the best of a walk is often one that it never leaves again.
            if walk.step(annealing.largest, || heat(n), stream)
                && (n % 16 == 0 || walk.energy() < kept[0].energy || n >= cold)
            {
                keep(&walk, &mut kept);
            }
        }
        let best = kept[0].energy;
        kept.retain(|found| found.energy <= best + WORTH);
        kept
    }
}

/// Keeps where a walk is, unless better subsets are there already.
fn keep<V: Vector>(walk: &Walk<'_, V>, kept: &mut Vec<Found>) {
    let energy = walk.energy();
    if kept.len() == KEPT && energy >= kept[KEPT - 1].energy {
        return;
    }
    let mut subset: Vec<usize> = walk.members.iter().map(|&i| walk.choices.features[i]).collect();
    subset.sort_unstable();
    if kept.iter().any(|found| found.subset == subset) {
        return;
    }
    let at = kept.partition_point(|found| found.energy <= energy);
    kept.insert(at, Found { subset, energy });
    kept.truncate(KEPT);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_number_is_below_an_exponential_where_it_is_computed_and_where_not(
            number in 0.0..1.0_f64, x in 1e-9..50.0_f64,
        ) {
            prop_assert_eq!(is_below_exp(number, x), number < (-x).exp());
        }

        #[test]
        fn what_holds_from_a_number_on_is_found_there(end in 0..1000_usize, from in 0..1200_usize) {
            prop_assert_eq!(first(end, |n| n >= from), from.min(end));
        }
    }
}
