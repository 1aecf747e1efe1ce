//! A search taken apart into what must be written down, so that it goes on elsewhere with the same bits.

use std::sync::Arc;

use super::{Search, Variation};
use crate::error::{Result, invalid};
use crate::pareto::{Archive, Objectives, Ranking};
use crate::workers::Workers;

/// What a search consists of. Streams of random numbers are named by seed, iteration and generation, so these stand for
/// the state of the generator.
#[derive(Debug)]
pub struct Snapshot<G> {
    /// Of all random numbers.
    pub seed: u64,
    /// Turn of the double loop.
    pub iteration: u64,
    /// Turn of this loop since the iteration began.
    pub generation: u64,
    /// Genomes that were judged.
    pub evaluations: u64,
    /// Offspring that were not judged.
    pub spared: u64,
    /// Generations that ended with an archive above its cap.
    pub capped_generations: u64,
    /// The individuals.
    pub population: Vec<Arc<G>>,
    /// A row for each individual.
    pub objectives: Objectives,
    /// Members of the non-dominated set, in the order in which they were offered.
    pub members: Vec<Arc<G>>,
    /// A row for each member.
    pub points: Objectives,
}

impl<G> Search<G> {
    /// A counter beyond this is none of a search that ever ran.
    const MOST_COUNTED: u64 = 1 << 62;

    /// The search that a snapshot was taken of.
    ///
    /// # Errors
    /// When the numbers of rows do not fit, or when a member is dominated by another.
    pub fn restored(snapshot: Snapshot<G>, variation: &Variation, workers: &Workers) -> Result<Self> {
        let counters = [
            snapshot.iteration,
            snapshot.generation,
            snapshot.evaluations,
            snapshot.spared,
            snapshot.capped_generations,
        ];
        if counters.into_iter().any(|counter| counter > Self::MOST_COUNTED) {
            return invalid(format!(
                "search: expected counters of at most {}, found {counters:?}",
                Self::MOST_COUNTED
            ));
        }
        let Snapshot { population, objectives, members, points, .. } = snapshot;
        let sizes = [population.len(), objectives.len(), members.len(), points.len()];
        let expected = [variation.population, variation.population, sizes[3].max(1), sizes[2].max(1)];
        if sizes != expected || objectives.columns() != points.columns() {
            return invalid(format!(
                "search: expected {} individuals and at least one member, each with a row of as many objectives, found \
                 {} individuals with {} rows of {}, and {} members with {} rows of {}",
                variation.population,
                sizes[0],
                sizes[1],
                objectives.columns(),
                sizes[2],
                sizes[3],
                points.columns()
            ));
        }
        let mut archive = Archive::new(points.columns(), workers.width());
        archive.offer_all(points.rows().zip(members).map(|(point, member)| (point, move || member)));
        if archive.len() != points.len() {
            return invalid(
                "search: expected members that no other dominates, found some that are dominated",
            );
        }
        Ok(Self {
            seed: snapshot.seed,
            iteration: snapshot.iteration,
            generation: snapshot.generation,
            population,
            ranking: Ranking::new(&objectives),
            objectives,
            archive,
            evaluations: snapshot.evaluations,
            spared: snapshot.spared,
            capped_generations: snapshot.capped_generations,
        })
    }

    /// Of all random numbers.
    pub fn seed(&self) -> u64 {
        self.seed
    }
}
