//! Evolution: one generation after another of any genome that can be varied and judged (paper, section IV.A).
//!
//! A search is a value. `advance` makes a new one out of an old one and its data, with the same bits for any number of
//! threads and however its generations are cut into calls.

mod snapshot;

use std::sync::Arc;

pub use snapshot::Snapshot;

use crate::error::{Result, invalid};
use crate::pareto::{Archive, Distance, LinearRanking, Objectives, Ranking, best_tradeoff};
use crate::rng::{Purpose, Stream};
use crate::workers::Workers;

/// What is evolved, and what it is judged by.
pub trait Problem: Sync {
    /// What is varied.
    type Genome: Send + Sync;

    /// Purpose of the streams of the first population, and of those of offspring.
    const PURPOSES: (Purpose, Purpose);

    /// Whether objectives hold for one generation only, because chance has a part in them.
    const RESAMPLED: bool;

    /// Number of objectives.
    fn objectives(&self) -> usize;

    /// A random genome.
    fn random(&self, stream: &mut Stream) -> Self::Genome;

    /// A varied copy.
    fn mutate(&self, parent: &Self::Genome, stream: &mut Stream) -> Self::Genome;

    /// A child of two parents.
    fn crossover(&self, first: &Self::Genome, second: &Self::Genome, stream: &mut Stream) -> Self::Genome;

    /// Whether a child is certain to be judged as its parent is.
    fn same(&self, child: &Self::Genome, parent: &Self::Genome) -> bool;

    /// A row of finite objectives for each genome.
    fn judge(&self, genomes: &[Arc<Self::Genome>], generation: u64, workers: &Workers) -> Vec<Vec<f64>>;
}

/// How a generation is made out of the last.
#[derive(Clone, Debug, PartialEq)]
pub struct Variation {
    /// Individuals of a generation.
    pub population: usize,
    /// Share of offspring made by mutation.
    pub mutation_share: f64,
    /// Share of offspring made by crossover.
    pub crossover_share: f64,
    /// Share of offspring that are copies.
    pub reproduction_share: f64,
    /// Share of the best that are copied before anything else.
    pub elite_share: f64,
    /// Expected offspring of the best over that of the mean, 1 to 2.
    pub ranking_pressure: f64,
    /// Members beyond which the non-dominated set is pruned.
    pub archive_cap: usize,
    /// How the distance to the ideal point is measured.
    pub distance: Distance,
}

impl Variation {
    /// More individuals than this are refused.
    pub const MOST_INDIVIDUALS: usize = 10_000_000;

    /// Refuses what makes no generation.
    pub fn validated(self) -> Result<Self> {
        let Self { population, mutation_share, crossover_share, reproduction_share, elite_share, .. } = self;
        let shares = [mutation_share, crossover_share, reproduction_share];
        if !(2..=Self::MOST_INDIVIDUALS).contains(&population) || self.archive_cap == 0 {
            return invalid(format!(
                "variation: expected a population of 2 to {} and an archive of 1 or more, found {population} and {}",
                Self::MOST_INDIVIDUALS,
                self.archive_cap
            ));
        }
        let sum: f64 = shares.iter().sum();
        if !shares.iter().all(|share| (0.0..=1.0).contains(share)) || (sum - 1.0).abs() > 1e-9 {
            return invalid(format!(
                "variation: expected shares of the operators between 0 and 1 that sum to 1, found {shares:?}"
            ));
        }
        if !(0.0..1.0).contains(&elite_share) {
            return invalid(format!(
                "variation: expected an elite smaller than the population, found an elite share of {elite_share}"
            ));
        }
        LinearRanking::new(population, self.ranking_pressure)?;
        Ok(self)
    }

    fn elite(&self) -> usize {
        ((self.elite_share * self.population as f64).round() as usize).min(self.population - 1)
    }
}

/// A search between two generations.
pub struct Search<G> {
    seed: u64,
    iteration: u64,
    generation: u64,
    population: Vec<Arc<G>>,
    objectives: Objectives,
    ranking: Ranking,
    archive: Archive<Arc<G>>,
    evaluations: u64,
    spared: u64,
    capped_generations: u64,
}

impl<G> Clone for Search<G> {
    fn clone(&self) -> Self {
        Self {
            population: self.population.clone(),
            objectives: self.objectives.clone(),
            ranking: self.ranking.clone(),
            archive: self.archive.clone(),
            ..*self
        }
    }
}

/// A genome, and where it is a copy in all but name, the parent that it is a copy of.
struct Offspring<G> {
    genome: Arc<G>,
    judged_as: Option<usize>,
}

impl<G: Send + Sync> Search<G> {
    /// A random population and its non-dominated set.
    pub fn start<P: Problem<Genome = G>>(
        problem: &P,
        variation: &Variation,
        seed: u64,
        iteration: u64,
        workers: &Workers,
    ) -> Self {
        let population = workers.map(variation.population, |unit| {
            Arc::new(problem.random(&mut Stream::new(seed, P::PURPOSES.0, iteration, 0, unit as u64)))
        });
        let objectives = matrix(problem, problem.judge(&population, 0, workers));
        let mut search = Self {
            seed,
            iteration,
            generation: 0,
            evaluations: population.len() as u64,
            population,
            ranking: Ranking::new(&objectives),
            objectives,
            archive: Archive::new(problem.objectives(), workers.width()),
            spared: 0,
            capped_generations: 0,
        };
        search.offer_front(|_| true);
        search.prune(variation.archive_cap);
        search
    }

    /// The same population and non-dominated set under a problem whose objectives have changed: a new iteration.
    ///
    /// With ties a non-dominated member need not stay one when an objective is added, so the set is filtered again.
    pub fn judged_again<P: Problem<Genome = G>>(
        self,
        problem: &P,
        variation: &Variation,
        workers: &Workers,
    ) -> Self {
        let mut genomes = self.archive.members().to_vec();
        let archived = genomes.len();
        genomes.extend(self.population.iter().cloned());
        let mut rows = problem.judge(&genomes, 0, workers);
        let objectives = matrix(problem, rows.split_off(archived));
        let archive = self.archive.replace_objectives(matrix(problem, rows)).expect("a row for each member");
        let mut search = Self {
            iteration: self.iteration + 1,
            generation: 0,
            ranking: Ranking::new(&objectives),
            objectives,
            evaluations: self.evaluations + genomes.len() as u64,
            archive,
            ..self
        };
        search.offer_front(|_| true);
        search.prune(variation.archive_cap);
        search
    }

    /// The search some generations later.
    pub fn advance<P: Problem<Genome = G>>(
        mut self,
        problem: &P,
        variation: &Variation,
        generations: u64,
        workers: &Workers,
    ) -> Self {
        for _ in 0..generations {
            self.next_generation(problem, variation, workers);
        }
        self
    }

    fn next_generation<P: Problem<Genome = G>>(
        &mut self,
        problem: &P,
        variation: &Variation,
        workers: &Workers,
    ) {
        self.generation += 1;
        let offspring = self.offspring(problem, variation, &self.ranking.best_first(), workers);

        let keep = |child: &Offspring<G>| if P::RESAMPLED { None } else { child.judged_as };
        let fresh: Vec<_> =
            offspring.iter().filter(|child| keep(child).is_none()).map(|c| c.genome.clone()).collect();
        let mut judged = problem.judge(&fresh, self.generation, workers).into_iter();
        let rows = offspring.iter().map(|child| match keep(child) {
            Some(parent) => self.objectives.row(parent).to_vec(),
            None => judged.next().expect("a row for each fresh genome"),
        });
        self.objectives = matrix(problem, rows.collect());
        self.ranking = Ranking::new(&self.objectives);
        self.evaluations += fresh.len() as u64;
        self.spared +=
            (offspring.len() - fresh.len() - if P::RESAMPLED { 0 } else { variation.elite() }) as u64;
        // What was judged before was offered then; offering it again could not change the archive.
        let is_new: Vec<bool> = offspring.iter().map(|child| keep(child).is_none()).collect();
        self.population = offspring.into_iter().map(|child| child.genome).collect();
        self.offer_front(|i| is_new[i]);
        self.capped_generations += u64::from(self.prune(variation.archive_cap));
    }

    /// The elite, then children of parents drawn by linear ranking, each from a stream of its own.
    fn offspring<P: Problem<Genome = G>>(
        &self,
        problem: &P,
        variation: &Variation,
        best_first: &[usize],
        workers: &Workers,
    ) -> Vec<Offspring<G>> {
        let elite = variation.elite();
        let ranking =
            LinearRanking::new(best_first.len(), variation.ranking_pressure).expect("validated settings");
        let copy =
            |parent: usize| Offspring { genome: self.population[parent].clone(), judged_as: Some(parent) };
        workers.map(variation.population, |slot| {
            if slot < elite {
                return copy(best_first[slot]);
            }
            let mut stream =
                Stream::new(self.seed, P::PURPOSES.1, self.iteration, self.generation, slot as u64);
            let operator = stream.uniform();
            let mut draw = || best_first[ranking.draw(stream.uniform())];
            let first = draw();
            let parent = &self.population[first];
            if operator < variation.mutation_share {
                let genome = problem.mutate(parent, &mut stream);
                let judged_as = problem.same(&genome, parent).then_some(first);
                Offspring { genome: Arc::new(genome), judged_as }
            } else if operator < variation.mutation_share + variation.crossover_share {
                let second = draw();
                let genome = problem.crossover(parent, &self.population[second], &mut stream);
                let judged_as =
                    [first, second].into_iter().find(|&p| problem.same(&genome, &self.population[p]));
                Offspring { genome: Arc::new(genome), judged_as }
            } else {
                copy(first)
            }
        })
    }

    /// Offers the non-dominated individuals of the population that `is_new` names to the archive.
    fn offer_front(&mut self, is_new: impl Fn(usize) -> bool) {
        let (objectives, population, archive) = (&self.objectives, &self.population, &mut self.archive);
        let front = self.ranking.ranks.iter().enumerate().filter(|&(i, &rank)| rank == 0 && is_new(i));
        archive.offer_all(front.map(|(i, _)| (objectives.row(i), move || population[i].clone())));
    }

    /// Whether the archive was above its cap.
    fn prune(&mut self, cap: usize) -> bool {
        self.archive.len() > cap && self.archive.prune(cap)
    }

    /// Turn of the double loop.
    pub fn iteration(&self) -> u64 {
        self.iteration
    }

    /// Turn of this loop since the iteration began.
    pub fn generation(&self) -> u64 {
        self.generation
    }

    /// The individuals.
    pub fn population(&self) -> &[Arc<G>] {
        &self.population
    }

    /// A row for each individual.
    pub fn objectives(&self) -> &Objectives {
        &self.objectives
    }

    /// The non-dominated set S.
    pub fn archive(&self) -> &Archive<Arc<G>> {
        &self.archive
    }

    /// Member of S nearest to the ideal point.
    pub fn best(&self, distance: Distance) -> usize {
        best_tradeoff(&self.archive.objectives(), distance).expect("a population has a non-dominated member")
    }

    /// Genomes that were judged since the search began.
    pub fn evaluations(&self) -> u64 {
        self.evaluations
    }

    /// Offspring that were not judged, because they were their parent in all but name.
    pub fn spared(&self) -> u64 {
        self.spared
    }

    /// Generations that ended with an archive above its cap.
    pub fn capped_generations(&self) -> u64 {
        self.capped_generations
    }
}

fn matrix<P: Problem>(problem: &P, rows: Vec<Vec<f64>>) -> Objectives {
    Objectives::new(problem.objectives(), rows.concat()).expect("a problem gives finite objectives")
}
