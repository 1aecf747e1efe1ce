//! Rows dealt to their fronts.

/// Where each front lies when rows are put front after front, in ascending order of rank.
pub(super) struct Fronts {
    /// Front of each row, numbered without holes. (rows)
    numbers: Vec<usize>,
    /// Place of the first row of each front, and the number of rows at the end. (fronts + 1)
    starts: Vec<usize>,
}

impl Fronts {
    /// Fronts of so many rows, given the ranks of the first of them; those beyond share one more front.
    pub(super) fn new(rows: usize, ranks: &[u32]) -> Self {
        let rank = |row: usize| ranks.get(row).copied().unwrap_or(u32::MAX);
        // Ranks may have holes; what they take here does not depend on how large they are.
        let mut distinct: Vec<u32> = (0..rows).map(rank).collect();
        distinct.sort_unstable();
        distinct.dedup();
        let number = |row: usize| distinct.partition_point(|&other| other < rank(row));
        let numbers: Vec<usize> = (0..rows).map(number).collect();
        let mut starts = vec![0; distinct.len() + 1];
        for &number in &numbers {
            starts[number + 1] += 1;
        }
        for front in 0..distinct.len() {
            starts[front + 1] += starts[front];
        }
        Self { numbers, starts }
    }

    /// Puts the rows of `order`, (rows), into `dealt`, (rows), front after front, each front in the order in which they come.
    pub(super) fn deal(&self, order: &[usize], dealt: &mut [usize]) {
        if self.starts.len() == 2 {
            dealt.copy_from_slice(order);
            return;
        }
        let mut next = self.starts.clone();
        for &row in order {
            let place = &mut next[self.numbers[row]];
            dealt[*place] = row;
            *place += 1;
        }
    }

    /// The fronts, one after another, as ranges of what was dealt.
    pub(super) fn ranges(&self) -> impl Iterator<Item = std::ops::Range<usize>> {
        self.starts.windows(2).map(|bounds| bounds[0]..bounds[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_dealt_by_rank_and_stay_in_order_within_a_front() {
        let fronts = Fronts::new(6, &[7, 0, u32::MAX - 1, 7, 0]);
        let mut dealt = [0; 6];
        fronts.deal(&[5, 4, 3, 2, 1, 0], &mut dealt);
        assert_eq!(dealt, [4, 1, 3, 0, 2, 5]);
        assert_eq!(fronts.ranges().collect::<Vec<_>>(), [0..2, 2..4, 4..5, 5..6]);
    }
}
