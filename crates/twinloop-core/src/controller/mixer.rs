//! The output map of a controller: linear mixing, a signed power, and the clamp to the command's bounds.

use crate::error::{Result, invalid};
use crate::lanes::Vector;

/// `command = clip(sign(v) |v|^power)` with `v = matrix · u + offset`; the paper's conversion chart has power ½.
#[derive(Clone, Debug, PartialEq)]
pub struct Mixer {
    /// Row of each command over the controller's axes (n_u, axes).
    matrix: Vec<Vec<f64>>,
    offset: Vec<f64>,
    power: f64,
    bounds: Vec<(f64, f64)>,
}

impl Mixer {
    /// A map of `axes` outputs to the commands whose bounds are given.
    pub fn new(
        matrix: Vec<Vec<f64>>,
        offset: Vec<f64>,
        power: f64,
        bounds: Vec<(f64, f64)>,
        axes: usize,
    ) -> Result<Self> {
        let commands = bounds.len();
        if matrix.len() != commands || matrix.iter().any(|row| row.len() != axes) || offset.len() != commands
        {
            return invalid(format!(
                "mixer: expected a matrix of {commands} rows (commands) by {axes} columns (axes) and {commands} \
                 offsets, found {} rows of {} and {} offsets",
                matrix.len(),
                matrix.first().map_or(0, Vec::len),
                offset.len()
            ));
        }
        let finite = matrix.iter().flatten().chain(&offset).all(|x| x.is_finite()) && power.is_finite();
        if !finite || power <= 0.0 {
            return invalid(
                "mixer: expected finite numbers and a power above 0; check matrix, offset and power",
            );
        }
        Ok(Self { matrix, offset, power, bounds })
    }

    /// The map that only clips: axis i drives command i.
    pub fn direct(bounds: Vec<(f64, f64)>, axes: usize) -> Result<Self> {
        if bounds.len() != axes {
            return invalid(format!(
                "controller: expected as many axes as commands where there is no mixer, found {axes} axes and {} \
                 commands; give output=Mixer(...)",
                bounds.len()
            ));
        }
        let unit = |i: usize| (0..axes).map(|j| if i == j { 1.0 } else { 0.0 }).collect();
        Self::new((0..axes).map(unit).collect(), vec![0.0; axes], 1.0, bounds, axes)
    }

    /// Smallest and largest value of each command (n_u).
    pub fn bounds(&self) -> &[(f64, f64)] {
        &self.bounds
    }

    /// How much an axis moves each command (n_u), before the power.
    pub(super) fn column(&self, axis: usize) -> impl Iterator<Item = f64> {
        self.matrix.iter().map(move |row| row[axis])
    }

    /// Writes the commands of the axes' outputs, which stand `stride` apart.
    #[inline(always)]
    pub fn apply<V: Vector>(&self, outputs: &[V], stride: usize, command: &mut [V]) {
        for (i, row) in self.matrix.iter().enumerate() {
            let mut v = V::splat(self.offset[i]);
            for (axis, &factor) in row.iter().enumerate() {
                v = v + outputs[axis * stride] * factor;
            }
            let (low, high) = self.bounds[i];
            let raised = if self.power == 0.5 {
                signed(v, v.abs().sqrt())
            } else if self.power == 1.0 {
                v
            } else {
                signed(v, v.abs().map(|v| libm::pow(v, self.power)))
            };
            command[i] = raised.clamp(low, high);
        }
    }
}

/// A magnitude with the sign of `v`.
#[inline(always)]
fn signed<V: Vector>(v: V, magnitude: V) -> V {
    v.select_less(V::splat(0.0), magnitude * -1.0, magnitude)
}
