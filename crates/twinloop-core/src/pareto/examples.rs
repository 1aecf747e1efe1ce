//! Populations for the tests: many ties, many duplicates, few or many fronts.

use super::objectives::Objectives;
use proptest::prelude::*;
use std::ops::Range;

/// A matrix whose values are one of `levels` whole numbers around zero: few levels give ties and duplicates.
pub(super) fn objectives(rows: usize, columns: usize, levels: u64, seed: u64) -> Objectives {
    let mut state = seed;
    let values = (0..rows * columns).map(|_| (next(&mut state) % levels) as f64 - (levels / 2) as f64);
    Objectives::new(columns, values.collect()).unwrap()
}

/// Matrices of so many rows and 1 to 14 columns: from nearly all equal to all different, and from a front for every
/// row (columns that agree) to one front for all (columns that oppose each other).
pub(super) fn any_objectives(rows: Range<usize>) -> impl Strategy<Value = Objectives> {
    let levels = prop_oneof![1..4_u64, 4..40_u64, Just(1 << 40)];
    (rows, 1..15_usize, levels, -2..3_i32, any::<u64>()).prop_map(
        |(rows, columns, levels, agreement, seed)| {
            let noise = objectives(rows, columns, levels, seed);
            let trend = objectives(rows, 1, levels, !seed);
            let values = noise.rows().zip(trend.rows()).flat_map(|(noise, trend)| {
                noise.iter().enumerate().map(move |(column, value)| {
                    // The last column goes against the trend where the columns oppose each other.
                    let sign = if column + 1 == noise.len() { f64::from(agreement.signum()) } else { 1.0 };
                    value + trend[0] * sign * f64::from(agreement.abs())
                })
            });
            Objectives::new(columns, values.collect()).unwrap()
        },
    )
}

/// SplitMix64.
fn next(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut mixed = *state;
    mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    mixed ^ (mixed >> 31)
}
