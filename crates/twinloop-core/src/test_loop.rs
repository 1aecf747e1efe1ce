//! The test loop: evolution of controllers on which the models disagree, away from instability (paper, section IV.C).

use std::sync::Arc;

use crate::controller::Parameters;
use crate::error::{Result, invalid};
use crate::evolution::{Problem, Search, Snapshot, Variation};
use crate::model::OwnedModel;
use crate::objective::{discrimination, final_distances, instability};
use crate::rng::{Purpose, Stream};
use crate::setting::Setting;
use crate::task::Task;
use crate::workers::Workers;

/// What the test loop optimises, and by what chance.
#[derive(Clone, Debug, PartialEq)]
pub struct TestSettings {
    /// Whether the final distance on the best model is a third objective.
    pub control_quality: bool,
    /// Final distances are capped at this times the distance from start to target.
    pub distance_cap: f64,
    /// Mutants of a candidate whose spread is its instability.
    pub mutants: usize,
    /// Standard deviation of a mutant's one gain, as a share of its range.
    pub mutant_step: f64,
    /// Standard deviation of a mutation of a candidate, as a share of the gene's range.
    pub mutation_step: f64,
}

impl TestSettings {
    /// More mutants than this are refused.
    pub const MOST_MUTANTS: usize = 1_000_000;

    /// Refuses what no test can be judged with.
    pub fn validated(self) -> Result<Self> {
        let positive = |x: f64| x.is_finite() && x > 0.0;
        let numbers = [self.distance_cap, self.mutant_step, self.mutation_step];
        if !(1..=Self::MOST_MUTANTS).contains(&self.mutants) || !numbers.into_iter().all(positive) {
            return invalid(format!(
                "test settings: expected numbers above 0 and at most {} mutants, found {self:?}",
                Self::MOST_MUTANTS
            ));
        }
        Ok(self)
    }
}

/// What candidates are judged with: the committee, whose first member is the best trade-off M*.
struct Tests {
    committee: Vec<OwnedModel>,
    setting: Arc<Setting>,
    task: Task,
    settings: TestSettings,
    seed: u64,
    iteration: u64,
}

impl Tests {
    fn new(
        committee: Vec<OwnedModel>,
        setting: Arc<Setting>,
        task: Task,
        settings: TestSettings,
        seed: u64,
        iteration: u64,
    ) -> Result<Self> {
        let settings = settings.validated()?;
        let signals = setting.signals();
        committee.iter().try_for_each(|model| model.check_for(signals))?;
        if committee.is_empty() || committee.iter().any(|model| model.frame() != committee[0].frame()) {
            return invalid("committee: expected one model or more, all of one form and one set of signals");
        }
        if task.initial.len() != signals.states() {
            let (expected, found) = (signals.states(), task.initial.len());
            return invalid(format!("test search: expected a task of {expected} states, found {found}"));
        }
        let distance = task.distance(&signals.periods);
        let cap = settings.distance_cap * distance;
        if distance == 0.0 || !(cap * cap * TestSettings::MOST_MUTANTS as f64).is_finite() {
            return invalid(format!(
                "test search: expected a target away from the initial state, at a finite distance, found one of {distance}"
            ));
        }
        Ok(Self { committee, setting, task, settings, seed, iteration })
    }

    /// The box of the candidates.
    fn parameters(&self) -> &Parameters {
        self.setting.family().parameters()
    }

    /// Final distances (models × candidates) on the first `models` members of the committee.
    fn distances(&self, models: usize, candidates: &[&[f64]], workers: &Workers) -> Vec<Vec<f64>> {
        let models: Vec<_> = self.committee[..models].iter().map(OwnedModel::view).collect();
        final_distances(&models, &self.setting, candidates, &self.task, workers)
    }

    /// The steps of one gain that make the mutants of every candidate of a generation.
    fn mutations(&self, generation: u64) -> Vec<(usize, f64)> {
        let mut stream = Stream::new(self.seed, Purpose::Mutants, self.iteration, generation, 0);
        let genes = self.parameters().len();
        let step = self.settings.mutant_step;
        (0..self.settings.mutants).map(|_| (stream.below(genes), step * stream.gaussian())).collect()
    }
}

/// Worse in every objective than a candidate that ends its run on M* can be: 1 / Var is guarded to 1e9.
const DIVERGED: f64 = 1e12;

impl Problem for Tests {
    type Genome = Vec<f64>;
    const PURPOSES: (Purpose, Purpose) = (Purpose::FirstTests, Purpose::Tests);
    const RESAMPLED: bool = true;

    fn objectives(&self) -> usize {
        2 + usize::from(self.settings.control_quality)
    }

    fn random(&self, stream: &mut Stream) -> Vec<f64> {
        self.parameters().uniform(stream)
    }

    fn mutate(&self, parent: &Vec<f64>, stream: &mut Stream) -> Vec<f64> {
        let gene = stream.below(parent.len());
        self.parameters().moved(parent, gene, self.settings.mutation_step * stream.gaussian())
    }

    fn crossover(&self, first: &Vec<f64>, second: &Vec<f64>, stream: &mut Stream) -> Vec<f64> {
        first.iter().zip(second).map(|(&a, &b)| if stream.chance(0.5) { a } else { b }).collect()
    }

    fn same(&self, _child: &Vec<f64>, _parent: &Vec<f64>) -> bool {
        false
    }

    fn judge(&self, genomes: &[Arc<Vec<f64>>], generation: u64, workers: &Workers) -> Vec<Vec<f64>> {
        let candidates: Vec<&[f64]> = genomes.iter().map(|genome| &genome[..]).collect();
        let by_model = self.distances(self.committee.len(), &candidates, workers);
        let mutations = self.mutations(generation);
        let parameters = self.parameters();
        let mutants: Vec<_> = candidates
            .iter()
            .flat_map(|candidate| {
                mutations.iter().map(|&(gene, step)| parameters.moved(candidate, gene, step))
            })
            .collect();
        let mutants: Vec<&[f64]> = mutants.iter().map(|mutant| &mutant[..]).collect();
        let of_mutants = self.distances(1, &mutants, workers).concat();
        let cap = self.settings.distance_cap * self.task.distance(&self.setting.signals().periods);
        let row = |(i, of_mutants): (usize, &[f64])| {
            let on_best = by_model[0][i];
            if on_best.is_infinite() {
                return vec![DIVERGED; self.objectives()];
            }
            let mut row = vec![
                discrimination(by_model.iter().map(|of_model| of_model[i]), cap),
                instability(of_mutants.iter().copied(), cap),
            ];
            row.extend(self.settings.control_quality.then_some(on_best));
            row
        };
        of_mutants.chunks_exact(mutations.len()).enumerate().map(row).collect()
    }
}

/// The test loop as a value.
#[derive(Clone)]
pub struct TestSearch {
    search: Search<Vec<f64>>,
    tests: Arc<Tests>,
    variation: Variation,
    flat: bool,
}

impl TestSearch {
    /// A random population of tests over a committee whose first member is the best trade-off M*.
    #[allow(clippy::too_many_arguments)]
    pub fn start(
        committee: Vec<OwnedModel>,
        setting: Arc<Setting>,
        task: Task,
        settings: TestSettings,
        variation: Variation,
        seed: u64,
        iteration: u64,
        workers: &Workers,
    ) -> Result<Self> {
        let variation = variation.validated()?;
        let tests = Tests::new(committee, setting, task, settings, seed, iteration)?;
        let search = Search::start(&tests, &variation, seed, iteration, workers);
        let candidates: Vec<&[f64]> = search.population().iter().map(|genome| &genome[..]).collect();
        let on_best = tests.distances(1, &candidates, workers).concat();
        let flat = on_best.iter().all(|distance| *distance == on_best[0]);
        Ok(Self { search, tests: Arc::new(tests), variation, flat })
    }

    /// The search that a snapshot was taken of, over the same committee; `flat` as it was found at its start.
    #[allow(clippy::too_many_arguments)]
    pub fn restored(
        committee: Vec<OwnedModel>,
        setting: Arc<Setting>,
        task: Task,
        settings: TestSettings,
        variation: Variation,
        snapshot: Snapshot<Vec<f64>>,
        flat: bool,
        workers: &Workers,
    ) -> Result<Self> {
        let variation = variation.validated()?;
        let (seed, iteration) = (snapshot.seed, snapshot.iteration);
        let tests = Tests::new(committee, setting, task, settings, seed, iteration)?;
        let parameters = tests.parameters();
        if !snapshot.population.iter().chain(&snapshot.members).all(|genes| parameters.hold(genes)) {
            return invalid("test search: expected genes within the bounds of the family, found others");
        }
        if snapshot.objectives.columns() != tests.objectives() {
            let (expected, found) = (tests.objectives(), snapshot.objectives.columns());
            return invalid(format!("test search: expected {expected} objectives, found {found}"));
        }
        let search = Search::restored(snapshot, &variation, workers)?;
        Ok(Self { search, tests: Arc::new(tests), variation, flat })
    }

    /// The search some generations later.
    pub fn advance(self, generations: u64, workers: &Workers) -> Self {
        let search = self.search.advance(&*self.tests, &self.variation, generations, workers);
        Self { search, ..self }
    }

    /// Population, archive and counters.
    pub fn search(&self) -> &Search<Vec<f64>> {
        &self.search
    }

    /// The member that is the best trade-off Υ*.
    pub fn best(&self) -> usize {
        self.search.best(self.variation.distance)
    }

    /// Whether every test of the random population ended at the same distance on M*: it ignores the commands.
    pub fn flat(&self) -> bool {
        self.flat
    }
}
