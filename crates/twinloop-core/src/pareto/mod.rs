//! Ranking and archive: they see a matrix of numbers to be minimised, and nothing else.

mod archive;
mod blocks;
mod crowding;
mod dominance;
mod fronts;
mod ideal;
mod numbered;
mod objectives;
mod pruning;
mod ranks;
mod selection;
mod sorted;

#[cfg(test)]
mod examples;

pub use archive::Archive;
pub use crowding::crowding_distances;
pub use dominance::dominates;
pub use ideal::{Distance, best_tradeoff, ideal_point};
pub use numbered::NumberedArchive;
pub use objectives::Objectives;
pub use ranks::ranks;
pub use selection::{LinearRanking, Ranking, order, select};
