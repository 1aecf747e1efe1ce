//! Each objective sorted once, for all that needs it sorted.

use super::objectives::Objectives;

/// The columns of a matrix in ascending order, ties by row.
pub(super) struct SortedColumns {
    rows: usize,
    /// Keys of the values, column after column: (columns, rows).
    keys: Vec<u64>,
    /// Rows in the order of each column: (columns, rows).
    orders: Vec<usize>,
}

impl SortedColumns {
    pub(super) fn new(objectives: &Objectives) -> Self {
        let rows = objectives.len();
        let mut keys = Vec::with_capacity(rows * objectives.columns());
        for column in 0..objectives.columns() {
            keys.extend(objectives.rows().map(|row| key(row[column])));
        }
        let mut orders = Vec::with_capacity(keys.len());
        let mut packed = Vec::with_capacity(rows);
        for keys in keys.chunks_exact(rows.max(1)) {
            sort_into(keys, &mut packed, &mut orders);
        }
        Self { rows, keys, orders }
    }

    /// The rows in the order of a column, (rows).
    pub(super) fn order(&self, column: usize) -> &[usize] {
        &self.orders[column * self.rows..][..self.rows]
    }

    /// The rows in the order of a column, in groups of equal value.
    pub(super) fn ties(&self, column: usize) -> impl Iterator<Item = &[usize]> {
        let keys = &self.keys[column * self.rows..][..self.rows];
        self.order(column).chunk_by(|&a, &b| keys[a] == keys[b])
    }
}

/// Appends the rows of `keys`, in ascending order, to `order`.
pub(super) fn sort_into(keys: &[u64], packed: &mut Vec<u64>, order: &mut Vec<usize>) {
    // Whole numbers sort twice as fast as pairs, so the row takes the place of the last bits of its key.
    let row_bits = keys.len().next_power_of_two() as u64 - 1;
    packed.clear();
    packed.extend(keys.iter().enumerate().map(|(row, key)| key & !row_bits | row as u64));
    packed.sort_unstable();
    // Those that differ in nothing but these last bits are still to be told apart.
    for alike in packed.chunk_by_mut(|a, b| a | row_bits == b | row_bits) {
        if alike.len() > 1 {
            alike.sort_unstable_by_key(|&packed| {
                let row = packed & row_bits;
                (keys[row as usize], row)
            });
        }
    }
    order.extend(packed.iter().map(|packed| (packed & row_bits) as usize));
}

/// A whole number that has the order of the numbers; both zeros have the same.
pub(super) fn key(value: f64) -> u64 {
    // Adding zero makes a negative zero positive.
    let bits = (value + 0.0).to_bits();
    let negative = (bits >> 63).wrapping_neg();
    bits ^ (negative | 1 << 63)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn keys_have_the_order_of_the_numbers(
            a in prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL | prop::num::f64::ZERO,
            b in prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL | prop::num::f64::ZERO,
        ) {
            prop_assert_eq!(key(a).partial_cmp(&key(b)), a.partial_cmp(&b));
            prop_assert_eq!(key(-a).partial_cmp(&key(a)), (-a).partial_cmp(&a));
        }
    }

    #[test]
    fn ties_are_in_the_order_of_the_rows() {
        let objectives = Objectives::new(1, vec![0.0, 2.0, -0.0, -1.0, 2.0]).unwrap();
        let sorted = SortedColumns::new(&objectives);
        let groups: Vec<&[usize]> = sorted.ties(0).collect();
        assert_eq!(groups, [[3].as_slice(), &[0, 2], &[1, 4]]);
    }

    #[test]
    fn numbers_that_differ_in_their_last_bits_are_told_apart() {
        let values = (0..300_u64).map(|i| f64::from_bits(1.5_f64.to_bits() + i * 7 % 300)).collect();
        let objectives = Objectives::new(1, values).unwrap();
        let sorted = SortedColumns::new(&objectives);
        let values = sorted.order(0).iter().map(|&row| objectives.row(row)[0]);
        assert!(values.is_sorted_by(|a, b| a < b));
    }
}
