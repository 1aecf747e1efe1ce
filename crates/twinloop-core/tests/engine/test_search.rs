//! The test loop: controllers on which models disagree, and none that breaks the best of them.

use std::sync::Arc;

use proptest::prelude::*;
use twinloop_core::pareto::{Distance, dominates};
use twinloop_core::{
    Form, Learnt, OwnedModel, Search, Task, TestSearch, TestSettings, Variation, Width, Workers,
    final_distances,
};

use crate::worlds::{GAINS, World, one_worker};

/// Adds so much of each command to the first and the third state.
fn pushed(first: f64, third: f64) -> Arc<Learnt> {
    let text =
        format!("program inputs=5 outputs=3 registers=8\npage 1\nr5 = r3 * {first:?}\nr7 = r4 * {third:?}\n");
    Arc::new(Learnt::new(text.parse().unwrap()))
}

/// Multiplies the first state by its command and more: loops that push hard leave the limits.
fn fragile() -> Arc<Learnt> {
    let text =
        "program inputs=5 outputs=3 registers=8\npage 1\nr5 = r3 * r3\nr5 = r5 * 0.16\nr7 = r4 * 0.1\n";
    Arc::new(Learnt::new(text.parse().unwrap()))
}

fn settings() -> TestSettings {
    TestSettings {
        control_quality: true,
        distance_cap: 3.0,
        mutants: 6,
        mutant_step: 0.05,
        mutation_step: 0.1,
    }
}

fn variation() -> Variation {
    Variation {
        population: 30,
        mutation_share: 0.6,
        crossover_share: 0.3,
        reproduction_share: 0.1,
        elite_share: 0.1,
        ranking_pressure: 1.8,
        archive_cap: 10_000,
        distance: Distance::Normalised,
    }
}

fn task() -> Task {
    Task::new(vec![0.0; 3], vec![0.6, 0.0, -0.4], 20).unwrap()
}

struct Setup {
    world: World,
    committee: Vec<Arc<Learnt>>,
    settings: TestSettings,
    variation: Variation,
    task: Task,
}

impl Setup {
    fn of(committee: Vec<Arc<Learnt>>) -> Self {
        let (settings, variation, task) = (settings(), variation(), task());
        Self { world: World::new(), committee, settings, variation, task }
    }

    fn models(&self) -> Vec<OwnedModel> {
        let model = |learnt: &Arc<Learnt>| {
            OwnedModel::new(learnt.clone(), Form::Increment, self.world.signals.clone(), None).unwrap()
        };
        self.committee.iter().map(model).collect()
    }

    fn try_start(self, seed: u64, workers: &Workers) -> twinloop_core::Result<TestSearch> {
        let (committee, setting) = (self.models(), self.world.setting(10.0));
        let Self { settings, variation, task, .. } = self;
        TestSearch::start(committee, setting, task, settings, variation, seed, 1, workers)
    }

    fn start(self, seed: u64, workers: &Workers) -> TestSearch {
        self.try_start(seed, workers).unwrap()
    }

    fn refusal(self) -> String {
        self.try_start(1, &one_worker()).err().unwrap().to_string()
    }

    /// Final distances (models × candidates) of a population.
    fn distances(&self, population: &[Arc<Vec<f64>>]) -> Vec<Vec<f64>> {
        let owned = self.models();
        let models: Vec<_> = owned.iter().map(OwnedModel::view).collect();
        let candidates: Vec<&[f64]> = population.iter().map(|genome| &genome[..]).collect();
        final_distances(&models, &self.world.setting(10.0), &candidates, &self.task, &one_worker())
    }
}

fn rows(search: &Search<Vec<f64>>) -> Vec<Vec<f64>> {
    search.objectives().rows().map(<[f64]>::to_vec).collect()
}

fn seen(search: &TestSearch) -> impl PartialEq + std::fmt::Debug + use<> {
    let inner = search.search();
    let archive = inner.archive();
    (
        (inner.population().to_vec(), rows(inner)),
        (
            archive.members().to_vec(),
            (0..archive.len()).map(|i| archive.objectives_of(i)).collect::<Vec<_>>(),
        ),
        [inner.generation(), inner.evaluations(), inner.spared(), inner.capped_generations()],
        (search.best(), search.flat()),
    )
}

fn disagreeing() -> Vec<Arc<Learnt>> {
    vec![pushed(0.2, 0.1), pushed(0.25, 0.1), pushed(0.1, 0.3)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn a_search_cut_into_calls_and_shared_by_threads_is_the_same_search(
        seed in any::<u64>(),
        first in 0..6_u64,
        second in 0..6_u64,
    ) {
        let threads = |threads| Workers::new(threads, Width::widest()).unwrap();
        let start = |workers: &Workers| Setup::of(disagreeing()).start(seed, workers);
        let expected = seen(&start(&threads(1)).advance(first + second, &threads(1)));
        prop_assert_eq!(&seen(&start(&threads(3)).advance(first + second, &threads(3))), &expected);
        for workers in [threads(1), threads(3)] {
            let cut = start(&workers).advance(first, &workers).advance(second, &workers);
            prop_assert_eq!(&seen(&cut), &expected);
        }
    }

    #[test]
    fn discrimination_is_the_inverse_variance_of_the_capped_final_distances(seed in any::<u64>()) {
        let committee = vec![pushed(0.2, 0.1), pushed(0.25, 0.1), fragile()];
        let search = Setup::of(committee.clone()).start(seed, &one_worker()).advance(3, &one_worker());
        let distances = Setup::of(committee).distances(search.search().population());
        let cap = 3.0 * 0.6_f64.hypot(0.4);
        for (i, row) in rows(search.search()).iter().enumerate() {
            let capped: Vec<f64> = distances.iter().map(|of_model| of_model[i].min(cap)).collect();
            let mean = capped.iter().sum::<f64>() / 3.0;
            let variance = capped.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / 3.0;
            prop_assert!((row[0] * (variance + 1e-9) - 1.0).abs() < 1e-6);
            prop_assert!((0.0..=cap * cap).contains(&row[1]));
            prop_assert_eq!(row[2], distances[0][i]);
        }
    }

    #[test]
    fn a_candidate_that_breaks_the_best_model_is_dominated_by_any_that_does_not(
        seed in any::<u64>(),
        control_quality in any::<bool>(),
    ) {
        let committee = vec![fragile(), pushed(0.25, 0.1)];
        let mut setup = Setup::of(committee.clone());
        setup.settings.control_quality = control_quality;
        // So long a run that some break it and some do not.
        setup.task = Task { steps: 60, ..task() };
        let on_best = {
            let search = Setup { task: setup.task.clone(), ..Setup::of(committee.clone()) };
            move |population: &[Arc<Vec<f64>>]| search.distances(population).remove(0)
        };
        let search = setup.start(seed, &one_worker());
        let (rows, distances) = (rows(search.search()), on_best(search.search().population()));
        let broken = |i: &usize| distances[*i].is_infinite();
        let (broken, sound): (Vec<usize>, Vec<usize>) = (0..rows.len()).partition(broken);
        prop_assume!(!broken.is_empty() && !sound.is_empty());
        for &sound in &sound {
            prop_assert!(broken.iter().all(|&broken| dominates(&rows[sound], &rows[broken])));
        }
        for (member, _) in search.search().archive().members().iter().zip(0..) {
            prop_assert!(on_best(std::slice::from_ref(member))[0].is_finite());
        }
    }

    #[test]
    fn candidates_stay_in_their_box(seed in any::<u64>()) {
        let search = Setup::of(disagreeing()).start(seed, &one_worker()).advance(10, &one_worker());
        for genome in search.search().population() {
            let high = [4.0, 2.0, 1.0, 4.0, 2.0, 1.0];
            prop_assert!(genome.len() == GAINS && genome.iter().zip(high).all(|(x, high)| (0.0..=high).contains(x)));
        }
    }

    #[test]
    fn equal_candidates_of_a_generation_meet_equal_mutants(seed in any::<u64>()) {
        // Copies only: after a few generations many are equal.
        let mut setup = Setup::of(disagreeing());
        setup.variation = Variation { mutation_share: 0.0, crossover_share: 0.0, reproduction_share: 1.0, ..variation() };
        let search = setup.start(seed, &one_worker()).advance(3, &one_worker());
        let (population, rows) = (search.search().population(), rows(search.search()));
        let mut pairs = 0;
        for i in 0..rows.len() {
            for j in (0..i).filter(|&j| population[i] == population[j]) {
                prop_assert_eq!(&rows[i], &rows[j]);
                pairs += 1;
            }
        }
        prop_assert!(pairs > 0);
    }
}

#[test]
fn another_generation_has_other_mutants_but_the_same_discrimination() {
    // Copies only, so the elite is judged again and again as it is.
    let mut setup = Setup::of(disagreeing());
    setup.variation = Variation {
        mutation_share: 0.0,
        crossover_share: 0.0,
        reproduction_share: 1.0,
        elite_share: 0.5,
        ..variation()
    };
    let before = setup.start(4, &one_worker());
    let after = before.clone().advance(1, &one_worker());
    let row_of = |search: &TestSearch, genome: &Arc<Vec<f64>>| {
        let place = search.search().population().iter().position(|one| Arc::ptr_eq(one, genome));
        rows(search.search()).swap_remove(place.unwrap())
    };
    let survivor = &after.search().population()[0];
    let (old, new) = (row_of(&before, survivor), row_of(&after, survivor));
    assert_eq!((old[0], old[2]), (new[0], new[2]));
    assert_ne!(old[1], new[1]);
}

#[test]
fn everybody_is_judged_in_every_generation() {
    let search = Setup::of(disagreeing()).start(1, &one_worker()).advance(5, &one_worker());
    assert_eq!((search.search().evaluations(), search.search().spared()), (6 * 30, 0));
}

#[test]
fn models_that_agree_make_every_test_equally_useless() {
    let search = Setup::of(vec![pushed(0.2, 0.1); 3]).start(1, &one_worker());
    assert!(rows(search.search()).iter().all(|row| (row[0] - 1e9).abs() < 1.0));
}

#[test]
fn a_best_model_that_ignores_the_commands_is_called_flat() {
    let ignoring = "program inputs=5 outputs=3 registers=8\npage 1\nr5 = r0 * -0.1\nr6 = r6 + 0.01\n";
    let ignoring = Arc::new(Learnt::new(ignoring.parse().unwrap()));
    assert!(Setup::of(vec![ignoring.clone(), pushed(0.2, 0.1)]).start(1, &one_worker()).flat());
    assert!(!Setup::of(vec![pushed(0.2, 0.1), ignoring]).start(1, &one_worker()).flat());
}

#[test]
fn misuse_is_refused_with_a_reason() {
    assert!(Setup::of(vec![]).refusal().contains("committee: expected one model or more"));
    let at_target =
        Setup { task: Task::new(vec![0.5; 3], vec![0.5; 3], 5).unwrap(), ..Setup::of(disagreeing()) };
    assert!(at_target.refusal().contains("target away from the initial state"));
    let other_states =
        Setup { task: Task::new(vec![0.0; 2], vec![0.5; 2], 5).unwrap(), ..Setup::of(disagreeing()) };
    assert!(other_states.refusal().contains("task of 3 states, found 2"));
    let variation = Variation { population: 0, ..variation() };
    assert!(Setup { variation, ..Setup::of(disagreeing()) }.refusal().contains("population of 2"));
    type Spoil = fn(&mut TestSettings);
    let table: [Spoil; 5] = [
        |s| s.mutants = 0,
        |s| s.distance_cap = 0.0,
        |s| s.distance_cap = f64::INFINITY,
        |s| s.mutant_step = -1.0,
        |s| s.mutation_step = f64::NAN,
    ];
    for spoil in table {
        let mut setup = Setup::of(disagreeing());
        spoil(&mut setup.settings);
        assert!(setup.refusal().contains("test settings: expected numbers above 0"));
    }
}
