//! The archive: all offered points that no other offered point dominates (paper, section IV.A, S and footnote 2).
//!
//! An offer is compared with all members. That is where a search spends its ranking, so points lie in blocks of lanes
//! (`blocks.rs`), and a batch of offers is cleared away once.

use super::blocks::{Blocks, Verdict};
use super::objectives::Objectives;
use super::pruning::rows_to_drop;
use crate::error::{Result, invalid};
use crate::lanes::Width;

/// A non-dominated set of points, each with a member of type `T`, in the order in which they were offered.
///
/// All objectives are minimised. The members of an archive, offered in order to an empty one, make the same archive.
#[derive(Clone, Debug)]
pub struct Archive<T> {
    width: Width,
    points: Blocks,
    members: Vec<T>,
    /// The block that dominated a candidate last; it is compared first. It changes the speed, never a result.
    recent: usize,
    /// Whether vacant places wait for [`compact`](Self::compact); never between two public calls.
    any_vacant: bool,
}

impl<T> Archive<T> {
    /// An empty archive of points with this number of `columns`, compared with the vector instructions of `width`. The
    /// width changes the speed, never a result.
    pub fn new(columns: usize, width: Width) -> Self {
        Self { width, points: Blocks::new(columns), members: Vec::new(), recent: 0, any_vacant: false }
    }

    /// Offers a point, (columns), and says whether it was accepted; only then is its `member` made.
    ///
    /// A point is rejected if a member is no worse in every objective, so of equal points the first stays. An accepted
    /// point removes the members that it dominates. A point with a number that is not finite, or with another number of
    /// columns, is rejected.
    pub fn offer(&mut self, objectives: &[f64], member: impl FnOnce() -> T) -> bool {
        let accepted = self.insert(objectives, member);
        self.compact();
        accepted
    }

    /// Offers points one after another with the result of [`offer`](Self::offer), but faster: the places of removed
    /// members are cleared once, at the end.
    pub fn offer_all<'a, F: FnOnce() -> T>(&mut self, offers: impl IntoIterator<Item = (&'a [f64], F)>) {
        for (objectives, member) in offers {
            self.insert(objectives, member);
        }
        self.compact();
    }

    /// Inserts a point unless it is rejected. The places of the members that it dominates become vacant.
    fn insert(&mut self, objectives: &[f64], member: impl FnOnce() -> T) -> bool {
        let is_row = !objectives.is_empty() && objectives.len() == self.points.columns();
        if !is_row || !objectives.iter().all(|value| value.is_finite()) {
            return false;
        }
        match self.points.confront(objectives, self.recent, self.width) {
            Verdict::Dominated { block } => {
                self.recent = block;
                false
            }
            Verdict::Free { beaten } => {
                self.any_vacant |= !beaten.is_empty();
                beaten.into_iter().for_each(|place| self.points.vacate(place));
                self.points.push(objectives);
                self.members.push(member());
                true
            }
        }
    }

    /// Number of members.
    pub fn len(&self) -> usize {
        self.members.len()
    }

    /// Whether there are no members.
    pub fn is_empty(&self) -> bool {
        self.members.is_empty()
    }

    /// The points of the members, (members, columns), in their order.
    pub fn objectives(&self) -> Objectives {
        let columns = self.points.columns();
        let values = (0..self.len()).flat_map(|i| (0..columns).map(move |j| (i, j)));
        Objectives::from_checked(columns, values.map(|(i, j)| self.points.value(i, j)).collect())
    }

    /// The members, in the order in which they were offered.
    pub fn members(&self) -> &[T] {
        &self.members
    }

    /// The point of member `i`, (columns).
    ///
    /// # Panics
    /// When `i` is not below [`len`](Self::len), as indexing does.
    pub fn objectives_of(&self, i: usize) -> Vec<f64> {
        assert!(i < self.len(), "expected a member below {}, found {i}", self.len());
        (0..self.points.columns()).map(|column| self.points.value(i, column)).collect()
    }

    /// Drops all but the `cap` members with the largest crowding distances, and says whether any was dropped.
    ///
    /// The best trade-offs, by raw and by normalised distance, and the first minimum of each objective always stay, even
    /// if they are more than `cap`. Distances are computed once, not after each dropped member. The order stays.
    pub fn prune(&mut self, cap: usize) -> bool {
        if self.len() <= cap {
            return false;
        }
        let dropped = rows_to_drop(&self.objectives(), cap);
        self.remove(&dropped);
        !dropped.is_empty()
    }

    /// The same members at other points, (members, columns), for example with one more column. Members that are now
    /// dominated leave; of equal points the first stays. The order stays.
    ///
    /// # Errors
    /// When there is not one row for each member.
    pub fn replace_objectives(self, objectives: Objectives) -> Result<Self> {
        if objectives.len() != self.len() {
            return invalid(format!(
                "archive: expected a row of objectives for each of its {} members, found {} rows; evaluate every \
                 member, in the archive's order",
                self.len(),
                objectives.len()
            ));
        }
        let mut archive = Self::new(objectives.columns(), self.width);
        for (row, member) in objectives.rows().zip(self.members) {
            archive.offer(row, || member);
        }
        Ok(archive)
    }

    /// Clears vacant places.
    fn compact(&mut self) {
        if std::mem::take(&mut self.any_vacant) {
            let vacant: Vec<usize> = (0..self.len()).filter(|&place| self.points.is_vacant(place)).collect();
            self.remove(&vacant);
        }
    }

    /// Removes the members at these places, given in ascending order.
    fn remove(&mut self, places: &[usize]) {
        if places.is_empty() {
            return;
        }
        self.points.remove(places);
        let mut removed = places.iter().peekable();
        let mut place = 0;
        self.members.retain(|_| {
            let stays = removed.next_if_eq(&&place).is_none();
            place += 1;
            stays
        });
    }
}

/// Archives are equal when their members and points are, at whatever width.
impl<T: PartialEq> PartialEq for Archive<T> {
    fn eq(&self, other: &Self) -> bool {
        self.points == other.points && self.members == other.members
    }
}

#[cfg(test)]
mod tests {
    use super::super::dominance::dominates;
    use super::super::examples::{any_objectives, objectives};
    use super::super::numbered::NumberedArchive;
    use super::*;
    use proptest::prelude::*;

    /// An archive to which every row was offered, with its index.
    fn archive_of(offered: &Objectives, width: Width) -> Archive<usize> {
        let mut archive = Archive::new(offered.columns(), width);
        for (i, row) in offered.rows().enumerate() {
            archive.offer(row, || i);
        }
        archive
    }

    /// Rows that no other dominates, without those equal to an earlier one.
    fn non_dominated(objectives: &Objectives) -> Vec<usize> {
        let stays = |&i: &usize| {
            let row = objectives.row(i);
            let dominated = objectives.rows().any(|other| dominates(other, row));
            let repeated = (0..i).any(|earlier| objectives.row(earlier) == row);
            !dominated && !repeated
        };
        (0..objectives.len()).filter(stays).collect()
    }

    fn rows_at(objectives: &Objectives, rows: &[usize]) -> Objectives {
        let values = rows.iter().flat_map(|&row| objectives.row(row)).copied().collect();
        Objectives::new(objectives.columns(), values).unwrap()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(512))]

        #[test]
        fn the_archive_is_the_non_dominated_part_of_all_that_was_offered(offered in any_objectives(0..150)) {
            let expected = non_dominated(&offered);
            for width in Width::available() {
                let archive = archive_of(&offered, width);
                prop_assert_eq!(archive.members(), &expected);
                prop_assert_eq!(archive.objectives(), rows_at(&offered, &expected));
            }
        }

        #[test]
        fn an_offer_says_whether_it_was_accepted_and_makes_the_member_only_then(offered in any_objectives(0..60)) {
            for width in Width::available() {
                let mut archive = Archive::new(offered.columns(), width);
                for row in offered.rows() {
                    let mut made = false;
                    let rejected = archive.objectives().rows().any(|point| dominates(point, row) || point == row);
                    prop_assert_eq!(archive.offer(row, || made = true), !rejected);
                    prop_assert_eq!(made, !rejected);
                }
            }
        }

        #[test]
        fn offers_in_batches_make_the_archive_of_single_offers(
            offered in any_objectives(0..150),
            batch in 1..40_usize,
        ) {
            let rows: Vec<(usize, &[f64])> = offered.rows().enumerate().collect();
            for width in Width::available() {
                let mut archive = Archive::new(offered.columns(), width);
                let mut numbered = NumberedArchive::new(offered.columns(), width).unwrap();
                for part in rows.chunks(batch) {
                    archive.offer_all(part.iter().map(|&(i, row)| (row, move || i)));
                    let part: Vec<usize> = part.iter().map(|&(i, _)| i).collect();
                    numbered.offer(&rows_at(&offered, &part)).unwrap();
                }
                prop_assert_eq!(&archive, &archive_of(&offered, width));
                prop_assert_eq!(numbered.archive(), &archive);
            }
        }

        #[test]
        fn pruning_keeps_members_with_their_points_and_in_their_order(
            offered in any_objectives(0..150),
            cap in 0..100_usize,
        ) {
            let before = archive_of(&offered, Width::widest());
            let mut after = before.clone();
            let dropped = after.prune(cap);
            prop_assert_eq!(dropped, after.len() < before.len());
            prop_assert_eq!(before.len() - after.len(), rows_to_drop(&before.objectives(), cap).len());
            prop_assert!(after.members().is_sorted());
            prop_assert_eq!(after.objectives(), rows_at(&offered, after.members()));
        }

        #[test]
        fn with_a_new_column_the_archive_is_what_it_would_be_had_it_been_there(
            points in any_objectives(0..100),
        ) {
            // One column more than before is one column less than now.
            let columns = points.columns();
            let narrow = points.rows().flat_map(|row| &row[..(columns - 1).max(1)]).copied().collect();
            let narrow = Objectives::new((columns - 1).max(1), narrow).unwrap();
            let archive = archive_of(&narrow, Width::widest());
            let wide = rows_at(&points, archive.members());
            let expected: Vec<usize> =
                non_dominated(&wide).into_iter().map(|i| archive.members()[i]).collect();
            let replaced = archive.replace_objectives(wide).unwrap();
            prop_assert_eq!(replaced.members(), &expected);
            prop_assert_eq!(replaced.objectives(), rows_at(&points, &expected));
        }

        #[test]
        fn offered_again_in_order_the_members_make_the_same_archive(offered in any_objectives(0..100)) {
            let archive = archive_of(&offered, Width::Baseline);
            let mut again = Archive::new(offered.columns(), Width::widest());
            for (i, &member) in archive.members().iter().enumerate() {
                again.offer(&archive.objectives_of(i), || member);
            }
            prop_assert_eq!(again, archive);
        }
    }

    #[test]
    fn replaced_objectives_can_make_members_dominated() {
        let archive =
            archive_of(&Objectives::new(2, vec![0.0, 2.0, 1.0, 1.0, 2.0, 0.0]).unwrap(), Width::Baseline);
        let chain = Objectives::new(3, vec![1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).unwrap();
        let replaced = archive.replace_objectives(chain).unwrap();
        assert_eq!(replaced.members(), [1]);
    }

    #[test]
    fn replaced_objectives_need_a_row_for_each_member() {
        let archive = archive_of(&objectives(4, 1, 9, 1), Width::Baseline);
        let sentence = archive.replace_objectives(objectives(3, 2, 9, 1)).unwrap_err().to_string();
        assert!(sentence.contains("each of its 1 members, found 3 rows"), "{sentence}");
    }

    #[test]
    fn what_could_not_be_a_row_is_rejected() {
        for width in Width::available() {
            let mut archive = Archive::new(2, width);
            for bad in [&[f64::NAN, 0.0][..], &[0.0, f64::INFINITY], &[0.0], &[0.0; 3], &[]] {
                assert!(!archive.offer(bad, || ()), "{bad:?}");
            }
            assert!(!Archive::new(0, width).offer(&[], || ()));
            assert!(Archive::<()>::new(0, width).objectives().is_empty());
        }
    }

    #[test]
    fn zeros_are_equal_whatever_their_sign() {
        let mut archive = Archive::new(1, Width::widest());
        assert!(archive.offer(&[-0.0], || ()));
        assert!(!archive.offer(&[0.0], || ()));
    }
}
