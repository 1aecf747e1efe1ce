//! An archive of numbers: each member is the number of its offer.

use super::archive::Archive;
use super::objectives::Objectives;
use crate::error::{Result, invalid};
use crate::lanes::Width;

/// Non-dominated points, each with the number of its offer, from 0.
#[derive(Clone, Debug)]
pub struct NumberedArchive {
    archive: Archive<usize>,
    columns: usize,
    offered: usize,
}

impl NumberedArchive {
    /// More objectives than this are refused.
    pub const MOST_COLUMNS: usize = 1_000_000;

    /// An empty archive of points with this number of columns.
    ///
    /// # Errors
    /// When there are no columns, or too many.
    pub fn new(columns: usize, width: Width) -> Result<Self> {
        if !(1..=Self::MOST_COLUMNS).contains(&columns) {
            return invalid(format!(
                "archive: expected 1 to {} columns, found {columns}",
                Self::MOST_COLUMNS
            ));
        }
        Ok(Self { archive: Archive::new(columns, width), columns, offered: 0 })
    }

    /// Offers each row, (rows, columns), in turn.
    ///
    /// # Errors
    /// When the rows have another number of columns.
    pub fn offer(&mut self, objectives: &Objectives) -> Result<()> {
        if objectives.columns() != self.columns {
            let (expected, found) = (self.columns, objectives.columns());
            return invalid(format!("archive: expected {expected} objectives, found {found}"));
        }
        let first = self.offered;
        self.offered += objectives.len();
        self.archive.offer_all(objectives.rows().zip(first..).map(|(row, number)| (row, move || number)));
        Ok(())
    }

    /// The archive itself.
    pub fn archive(&self) -> &Archive<usize> {
        &self.archive
    }

    /// Drops members beyond `cap`, as [`Archive::prune`] does, and says whether any was dropped.
    pub fn prune(&mut self, cap: usize) -> bool {
        self.archive.prune(cap)
    }
}
