//! The box of a family's parameters: bounds, scale, and how a search draws and moves within it.

use crate::error::{Result, invalid};
use crate::rng::Stream;

/// One gain of a law, as a family has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Gain {
    /// The same in all controllers of the family: no parameter.
    Fixed(f64),
    /// A parameter.
    Free {
        /// Smallest value.
        low: f64,
        /// Largest value.
        high: f64,
        /// Whether decades matter more than differences.
        logarithmic: bool,
    },
}

/// Bounds of one parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Interval {
    low: f64,
    high: f64,
    logarithmic: bool,
}

impl Interval {
    /// The value at a place between 0 and 1 of the interval, on its own scale.
    fn at(&self, place: f64) -> f64 {
        let place = place.clamp(0.0, 1.0);
        let value = if self.logarithmic {
            let (low, high) = (libm::log(self.low), libm::log(self.high));
            libm::exp(low + (high - low) * place)
        } else {
            self.low + (self.high - self.low) * place
        };
        value.clamp(self.low, self.high)
    }

    /// The place of a value: the inverse of [`Interval::at`].
    fn place(&self, value: f64) -> f64 {
        if self.logarithmic {
            let low = libm::log(self.low);
            (libm::log(value) - low) / (libm::log(self.high) - low)
        } else {
            (value - self.low) / (self.high - self.low)
        }
    }
}

/// Bounds of a parameter vector.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters(Vec<Interval>);

impl Parameters {
    /// Bounds `low < high` of each parameter; a logarithmic one needs `low > 0`.
    pub fn new(low: &[f64], high: &[f64], logarithmic: &[bool]) -> Result<Self> {
        if low.len() != high.len() || low.len() != logarithmic.len() || low.is_empty() {
            return invalid(format!(
                "parameters: expected as many low bounds as high bounds and scales, at least one, found {}, {} and {}",
                low.len(),
                high.len(),
                logarithmic.len()
            ));
        }
        let intervals: Vec<_> = low
            .iter()
            .zip(high)
            .zip(logarithmic)
            .map(|((&low, &high), &logarithmic)| Interval { low, high, logarithmic })
            .collect();
        for (i, &Interval { low, high, logarithmic }) in intervals.iter().enumerate() {
            if !(low.is_finite() && high.is_finite() && low < high && (!logarithmic || low > 0.0)) {
                let above = if logarithmic { "0 < low < high" } else { "low < high" };
                return invalid(format!("parameter {i}: expected bounds {above}, found {low} and {high}"));
            }
        }
        Ok(Self(intervals))
    }

    /// Number of parameters.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Never: a family has at least one parameter.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Whether a vector has a value for each parameter, within its bounds.
    pub fn hold(&self, values: &[f64]) -> bool {
        let within = |(interval, value): (&Interval, &f64)| (interval.low..=interval.high).contains(value);
        values.len() == self.len() && self.0.iter().zip(values).all(within)
    }

    /// The places of values, 0 to 1 between the bounds, on each parameter's scale.
    pub fn places(&self, values: &[f64]) -> Vec<f64> {
        self.0.iter().zip(values).map(|(interval, value)| interval.place(*value)).collect()
    }

    /// The values at places, those beyond a bound at the bound.
    pub fn at(&self, places: &[f64]) -> Vec<f64> {
        self.0.iter().zip(places).map(|(interval, place)| interval.at(*place)).collect()
    }

    /// A vector drawn uniformly, on each parameter's scale.
    pub fn uniform(&self, stream: &mut Stream) -> Vec<f64> {
        self.0.iter().map(|interval| interval.at(stream.uniform())).collect()
    }

    /// A copy with parameter `index` moved by `share` of its range, within the bounds.
    pub fn moved(&self, values: &[f64], index: usize, share: f64) -> Vec<f64> {
        let mut moved = values.to_vec();
        let interval = self.0[index];
        moved[index] = interval.at(interval.place(values[index]) + share);
        moved
    }
}
