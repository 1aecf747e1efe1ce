//! An archive whose members are numbers, in the order in which points were offered.

use super::archive::Archive;
use super::objectives::Objectives;
use crate::error::{Result, invalid};
use crate::lanes::Width;

/// Non-dominated points, each with the number under which it was offered.
#[derive(Clone, Debug)]
pub struct NumberedArchive {
    archive: Archive<usize>,
    columns: usize,
    offered: usize,
}

impl NumberedArchive {
    /// More objectives than this are refused.
    pub const MOST_COLUMNS: usize = 1_000_000;

    /// An empty one of points with so many columns.
    pub fn new(columns: usize, width: Width) -> Result<Self> {
        if !(1..=Self::MOST_COLUMNS).contains(&columns) {
            return invalid(format!(
                "archive: expected 1 to {} columns, found {columns}",
                Self::MOST_COLUMNS
            ));
        }
        Ok(Self { archive: Archive::new(columns, width), columns, offered: 0 })
    }

    /// Offers each row in turn.
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

    /// Drops members until no more than `cap` are left; whether any had to go.
    pub fn prune(&mut self, cap: usize) -> bool {
        self.archive.prune(cap)
    }
}
