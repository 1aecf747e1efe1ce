//! Search over subsets of features by annealing: add, drop, swap, on inner products alone.
//!
//! Features of one smooth run are close to collinear, and then greedy selection ends at an alias of the law that fits
//! as well and predicts nothing. Annealing crosses between them (Kirkpatrick, Gelatt, Vecchi 1983).

use super::cholesky::Cholesky;
use super::gram::Gram;
use crate::rng::Stream;

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

/// What a subset costs beside its χ².
#[derive(Clone, Debug, PartialEq)]
pub struct Prices {
    /// Of each feature (p), in units of χ²; infinite if it may not be used.
    pub features: Vec<f64>,
    /// What χ² is divided by: above 1 where even all features leave more than the noise explains.
    pub scale: f64,
    /// Features that are always in.
    pub fixed: Vec<usize>,
}

/// A subset and its energy, χ² / scale + prices.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Its features, ascending.
    pub subset: Vec<usize>,
    /// Its energy.
    pub energy: f64,
}

/// A column whose part outside the others' span is shorter than this share (squared) is the same column.
const COLLINEAR: f64 = 1e-8;
/// Sum of 1 / (share outside the span) over the updates since the last inversion from scratch at which the next is due.
const DOUBT: f64 = 1e4;
/// Distinct subsets that are kept of a walk.
const KEPT: usize = 64;
/// Energy above the best at which a subset is not worth keeping.
const WORTH: f64 = 14.0;

struct Walk<'a> {
    gram: &'a Gram,
    prices: &'a Prices,
    lengths: Vec<f64>,
    usable: Vec<usize>,
    members: Vec<usize>,
    place: Vec<Option<usize>>,
    inverse: Vec<f64>,
    coefficients: Vec<f64>,
    left: f64,
    price: f64,
    /// Rounding that updates have let in since the last inversion from scratch, in the inverse's own terms.
    doubt: f64,
}

impl<'a> Walk<'a> {
    fn new(gram: &'a Gram, prices: &'a Prices) -> Self {
        let p = gram.features;
        let lengths: Vec<f64> = (0..p).map(|j| gram.product(j, j).sqrt()).collect();
        let longest = lengths.iter().copied().filter(|l| l.is_finite()).fold(0.0, f64::max);
        let usable = (0..p)
            .filter(|&j| {
                lengths[j].is_finite()
                    && lengths[j] > 1e-9 * longest.min(1e3)
                    && prices.features[j].is_finite()
                    && !prices.fixed.contains(&j)
            })
            .collect();
        let mut walk = Self {
            gram,
            prices,
            lengths,
            usable,
            members: prices.fixed.clone(),
            place: vec![None; p],
            inverse: vec![],
            coefficients: vec![],
            left: gram.total(),
            price: 0.0,
            doubt: 0.0,
        };
        for (at, &j) in walk.members.iter().enumerate() {
            walk.place[j] = Some(at);
        }
        if !walk.refresh() {
            walk.members.clear();
            walk.place.fill(None);
            walk.refresh();
        }
        walk
    }

    fn product(&self, i: usize, j: usize) -> f64 {
        self.gram.product(i, j) / (self.lengths[i] * self.lengths[j])
    }

    fn target(&self, j: usize) -> f64 {
        self.gram.product(j, self.gram.features) / self.lengths[j]
    }

    fn energy(&self) -> f64 {
        self.left / self.prices.scale + self.price
    }

    /// Inverse, coefficients and χ² of the members from scratch.
    fn refresh(&mut self) -> bool {
        let k = self.members.len();
        let mut matrix = vec![0.0; k * k];
        for (a, &i) in self.members.iter().enumerate() {
            for (b, &j) in self.members.iter().enumerate() {
                matrix[a * k + b] = self.product(i, j);
            }
        }
        let Some(factor) = Cholesky::new(&matrix, k, COLLINEAR) else { return false };
        let right: Vec<f64> = self.members.iter().map(|&j| self.target(j)).collect();
        self.inverse = factor.inverse();
        self.coefficients = factor.solve(&right);
        self.doubt = 0.0;
        let explained: f64 = self.coefficients.iter().zip(&right).map(|(c, r)| c * r).sum();
        self.left = (self.gram.total() - explained).max(0.0);
        self.price = self.members.iter().map(|&j| self.prices.features[j]).filter(|x| x.is_finite()).sum();
        true
    }

    /// Inner products of a feature with the members, and the inverse times them.
    fn against(&self, j: usize, products: &mut Vec<f64>, images: &mut Vec<f64>) {
        let k = self.members.len();
        products.clear();
        products.extend(self.members.iter().map(|&i| self.product(i, j)));
        images.clear();
        for a in 0..k {
            let row = &self.inverse[a * k..][..k];
            images.push(row.iter().zip(products.iter()).map(|(m, g)| m * g).sum());
        }
    }

    fn insert(&mut self, j: usize, images: &[f64], outside: f64, gain: f64) {
        let k = self.members.len();
        self.doubt += 1.0 / outside;
        let mut inverse = vec![0.0; (k + 1) * (k + 1)];
        for a in 0..k {
            for b in 0..k {
                inverse[a * (k + 1) + b] = self.inverse[a * k + b] + images[a] * images[b] / outside;
            }
            inverse[a * (k + 1) + k] = -images[a] / outside;
            inverse[k * (k + 1) + a] = -images[a] / outside;
        }
        inverse[(k + 1) * (k + 1) - 1] = 1.0 / outside;
        let new = gain / outside;
        for (c, image) in self.coefficients.iter_mut().zip(images) {
            *c -= image * new;
        }
        self.coefficients.push(new);
        self.left = (self.left - gain * gain / outside).max(0.0);
        self.inverse = inverse;
        self.place[j] = Some(k);
        self.members.push(j);
        self.price += self.prices.features[j];
    }

    fn remove(&mut self, at: usize) {
        let k = self.members.len();
        let pivot = self.inverse[at * k + at];
        self.doubt += pivot;
        let old = self.coefficients[at];
        let column: Vec<f64> = (0..k).map(|a| self.inverse[a * k + at]).collect();
        let mut inverse = Vec::with_capacity((k - 1) * (k - 1));
        for a in (0..k).filter(|&a| a != at) {
            for b in (0..k).filter(|&b| b != at) {
                inverse.push(self.inverse[a * k + b] - column[a] * column[b] / pivot);
            }
        }
        for (a, c) in self.coefficients.iter_mut().enumerate() {
            *c -= column[a] * old / pivot;
        }
        self.coefficients.remove(at);
        self.left += old * old / pivot;
        self.inverse = inverse;
        let j = self.members.remove(at);
        self.price -= self.prices.features[j];
        self.place[j] = None;
        for (a, &member) in self.members.iter().enumerate().skip(at) {
            self.place[member] = Some(a);
        }
    }

    /// One move at a temperature; whether it was made.
    fn step(
        &mut self,
        largest: usize,
        heat: f64,
        stream: &mut Stream,
        work: &mut (Vec<f64>, Vec<f64>),
    ) -> bool {
        let k = self.members.len();
        let kind = stream.below(3);
        let accept = |change: f64, stream: &mut Stream| {
            change <= 0.0 || (heat > 0.0 && stream.uniform() < libm::exp(-change / heat))
        };
        let fixed = self.prices.fixed.len();
        if kind == 0 || k <= fixed {
            if k >= largest || self.usable.is_empty() {
                return false;
            }
            let j = self.usable[stream.below(self.usable.len())];
            if self.place[j].is_some() {
                return false;
            }
            let (products, images) = work;
            self.against(j, products, images);
            let outside = 1.0 - dot(products, images);
            if outside < COLLINEAR {
                return false;
            }
            let gain = self.target(j) - dot(products, &self.coefficients);
            let change = self.prices.features[j] - gain * gain / outside / self.prices.scale;
            if !accept(change, stream) {
                return false;
            }
            let images = std::mem::take(images);
            self.insert(j, &images, outside, gain);
            work.1 = images;
        } else {
            let at = stream.below(k);
            if self.prices.fixed.contains(&self.members[at]) {
                return false;
            }
            let pivot = self.inverse[at * k + at];
            let loss = self.coefficients[at] * self.coefficients[at] / pivot;
            let old = self.prices.features[self.members[at]];
            if kind == 1 {
                if !accept(loss / self.prices.scale - old, stream) {
                    return false;
                }
                self.remove(at);
            } else {
                let j = self.usable[stream.below(self.usable.len())];
                if self.place[j].is_some() {
                    return false;
                }
                let (products, images) = work;
                self.against(j, products, images);
                let shared = images[at];
                let outside = 1.0 - dot(products, images) + shared * shared / pivot;
                if outside < COLLINEAR {
                    return false;
                }
                let gain = self.target(j) - dot(products, &self.coefficients)
                    + shared * self.coefficients[at] / pivot;
                let change =
                    (loss - gain * gain / outside) / self.prices.scale + self.prices.features[j] - old;
                if !accept(change, stream) {
                    return false;
                }
                self.remove(at);
                let (mut products, mut images) = std::mem::take(work);
                self.against(j, &mut products, &mut images);
                let outside = 1.0 - dot(&products, &images);
                let gain = self.target(j) - dot(&products, &self.coefficients);
                if outside >= COLLINEAR {
                    self.insert(j, &images, outside, gain);
                }
                *work = (products, images);
            }
        }
        if self.doubt > DOUBT {
            // Where rounding has let a collinear column in, the latest ones go until the rest has an inverse.
            while !self.refresh() {
                let Some(j) = self.members.pop() else { break };
                self.place[j] = None;
            }
        }
        true
    }
}

#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Walks from hot to cold; the best subset first, then others that are nearly as good, best first.
pub fn search(gram: &Gram, prices: &Prices, annealing: &Annealing, stream: &mut Stream) -> Vec<Found> {
    let mut walk = Walk::new(gram, prices);
    let mut kept: Vec<Found> = vec![];
    let keep = |walk: &Walk<'_>, kept: &mut Vec<Found>| {
        let energy = walk.energy();
        if kept.len() == KEPT && energy >= kept[KEPT - 1].energy {
            return;
        }
        let mut subset = walk.members.clone();
        subset.sort_unstable();
        if kept.iter().any(|found| found.subset == subset) {
            return;
        }
        let at = kept.partition_point(|found| found.energy <= energy);
        kept.insert(at, Found { subset, energy });
        kept.truncate(KEPT);
    };
    keep(&walk, &mut kept);
    let hottest = (0.02 * gram.total() / prices.scale).max(100.0 * annealing.coldest);
    let cooling = libm::log(annealing.coldest / hottest);
    let mut work = (vec![], vec![]);
    // The last tenth goes down only.
    let cooled = annealing.moves - annealing.moves / 10;
    for n in 0..annealing.moves {
        let heat = if n < cooled { hottest * libm::exp(cooling * n as f64 / cooled as f64) } else { 0.0 };
        // Early subsets are passed through only, but the best of a walk is often one that it never leaves again.
        if walk.step(annealing.largest, heat, stream, &mut work)
            && (heat <= 20.0 * annealing.coldest || n % 16 == 0 || walk.energy() < kept[0].energy)
        {
            keep(&walk, &mut kept);
        }
    }
    let best = kept[0].energy;
    kept.retain(|found| found.energy <= best + WORTH);
    kept
}
