//! The model loop: a value that can be cut anywhere, an archive that forgets nothing that is not dominated.

use std::sync::Arc;

use proptest::prelude::*;
use twinloop_core::pareto::{Archive, Distance, dominates, select};
use twinloop_core::{
    Experiment, Form, Grammar, Learnt, Model, ModelSearch, Outcome, Problem, Purpose, Search, SelectedTests,
    Stream, Variation, Width, Workers, closed_loops, open_loops,
};

use crate::oracle::{Pids, run};
use crate::worlds::{GAINS, World, grammar, one_worker};

const FORM: Form = Form::Acceleration;

fn variation() -> Variation {
    Variation {
        population: 40,
        mutation_share: 0.6,
        crossover_share: 0.3,
        reproduction_share: 0.1,
        elite_share: 0.1,
        ranking_pressure: 1.8,
        archive_cap: 10_000,
        distance: Distance::Raw,
    }
}

fn world_grammar() -> Grammar {
    grammar(World::new().shape(FORM))
}

/// So many experiments on a pendulum with a lag beside it.
fn selected(count: usize) -> SelectedTests {
    let world = World::new();
    let step = |x: &[f64], c: &[f64]| {
        let v = x[1] + 0.05 * (c[0] - 2.0 * x[0].sin() - 0.3 * x[1]);
        vec![x[0] + 0.05 * v, v, x[2] + 0.05 * (0.5 * c[1] - x[2])]
    };
    let experiment = |i: usize| {
        let gains: Vec<f64> = (0..GAINS).map(|j| 0.3 + 0.1 * ((i + j) % 4) as f64).collect();
        let target = vec![0.4, 0.0, -0.3];
        let steps = 15 + 5 * (i % 3);
        let run = run(step, Pids::new(&world, &gains), [&[0.0; 3], &target], steps, &[1e9; 3], &[]);
        let (states, commands) = (run.states.concat(), run.commands.concat());
        Experiment { states, commands, parameters: gains, target, excitation: vec![], hold_back: None }
    };
    world.selected(&(0..count).map(experiment).collect::<Vec<_>>())
}

fn start(seed: u64, selected: &SelectedTests, workers: &Workers) -> ModelSearch {
    ModelSearch::start(world_grammar(), FORM, variation(), seed, selected, workers).unwrap()
}

/// Objectives of genomes, judged afresh.
fn judged(genomes: &[Arc<Learnt>], search: &ModelSearch, selected: &SelectedTests) -> Vec<Vec<f64>> {
    let models: Vec<Model<'_>> =
        genomes.iter().map(|learnt| Model { code: &learnt.code, frame: search.frame() }).collect();
    let (open, closed) =
        (open_loops(&models, selected, &one_worker()), closed_loops(&models, selected, &one_worker()));
    // The specification's numbers for what diverges.
    let ranked = |outcome: &Outcome| match *outcome {
        Outcome::Followed(error) => error,
        Outcome::Diverged { lasted, of } => 1e6 * (2.0 - lasted as f64 / of as f64),
    };
    let interleaved = |(open, closed): (&Vec<f64>, &Vec<Outcome>)| {
        open.iter().zip(closed).flat_map(|(open, closed)| [open.min(2e6), ranked(closed)]).collect()
    };
    open.iter().zip(&closed).map(interleaved).collect()
}

fn rows<G>(archive: &Archive<G>) -> Vec<Vec<f64>> {
    (0..archive.len()).map(|i| archive.objectives_of(i)).collect()
}

fn population_rows<G: Send + Sync>(search: &Search<G>) -> Vec<Vec<f64>> {
    search.objectives().rows().map(<[f64]>::to_vec).collect()
}

/// Everything that can be seen of a search.
fn seen(search: &ModelSearch) -> impl PartialEq + std::fmt::Debug + use<> {
    let programs =
        |genomes: &[Arc<Learnt>]| genomes.iter().map(|one| one.program.clone()).collect::<Vec<_>>();
    let inner = search.search();
    (
        (programs(inner.population()), population_rows(inner)),
        (programs(inner.archive().members()), rows(inner.archive())),
        [
            inner.iteration(),
            inner.generation(),
            inner.evaluations(),
            inner.spared(),
            inner.capped_generations(),
        ],
        (search.best(), search.committee(7)),
    )
}

/// The points that no other dominates, each once, in ascending order.
fn non_dominated(points: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut front: Vec<Vec<f64>> =
        points.iter().filter(|a| !points.iter().any(|b| dominates(b, a))).cloned().collect();
    front.sort_by(|a, b| a.partial_cmp(b).unwrap());
    front.dedup();
    front
}

fn sorted(mut points: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    points.sort_by(|a, b| a.partial_cmp(b).unwrap());
    points
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn a_search_cut_into_calls_and_shared_by_threads_is_the_same_search(
        seed in any::<u64>(),
        first in 0..6_u64,
        second in 0..6_u64,
    ) {
        let (one, two) = (selected(1), selected(2));
        let threads = |threads| Workers::new(threads, Width::widest()).unwrap();
        let whole = |workers: &Workers| {
            let search = start(seed, &one, workers).advance(&one, first + second, workers).unwrap();
            search.learn(&two, workers).unwrap().advance(&two, first + second, workers).unwrap()
        };
        let cut = |workers: &Workers| {
            let search = start(seed, &one, workers).advance(&one, first, workers).unwrap();
            let search = search.advance(&one, second, workers).unwrap().learn(&two, workers).unwrap();
            search.advance(&two, second, workers).unwrap().advance(&two, first, workers).unwrap()
        };
        let expected = seen(&whole(&threads(1)));
        prop_assert_eq!(&seen(&whole(&threads(3))), &expected);
        prop_assert_eq!(&seen(&cut(&threads(1))), &expected);
        prop_assert_eq!(&seen(&cut(&threads(3))), &expected);
    }

    #[test]
    fn every_individual_has_the_objectives_of_a_fresh_judgement_spared_or_not(seed in any::<u64>()) {
        let tests = selected(2);
        let search = start(seed, &tests, &one_worker()).advance(&tests, 12, &one_worker()).unwrap();
        let inner = search.search();
        prop_assert!(inner.spared() > 0);
        prop_assert_eq!(judged(inner.population(), &search, &tests), population_rows(inner));
        prop_assert_eq!(judged(inner.archive().members(), &search, &tests), rows(inner.archive()));
        // Each of the 40 slots of a generation is elite, judged or spared.
        prop_assert_eq!(inner.evaluations() + inner.spared() + 12 * 4, 13 * 40);
    }

    #[test]
    fn the_archive_is_what_nothing_that_was_ever_seen_dominates(seed in any::<u64>()) {
        let tests = selected(3);
        let mut search = start(seed, &tests, &one_worker());
        let mut all = population_rows(search.search());
        for generation in 0..=45 {
            if generation % 15 == 0 {
                prop_assert_eq!(sorted(rows(search.search().archive())), non_dominated(&all));
            }
            search = search.advance(&tests, 1, &one_worker()).unwrap();
            all.extend(population_rows(search.search()));
        }
    }

    #[test]
    fn the_elite_of_a_generation_lives_on_in_the_next(seed in any::<u64>()) {
        let tests = selected(2);
        let before = start(seed, &tests, &one_worker()).advance(&tests, 4, &one_worker()).unwrap();
        let after = before.clone().advance(&tests, 1, &one_worker()).unwrap();
        let elite = select(before.search().objectives(), 4);
        for (slot, best) in elite.into_iter().enumerate() {
            prop_assert!(Arc::ptr_eq(&after.search().population()[slot], &before.search().population()[best]));
            prop_assert_eq!(after.search().objectives().row(slot), before.search().objectives().row(best));
        }
    }

    #[test]
    fn what_was_learnt_is_judged_again_on_the_tests_there_are_now(seed in any::<u64>()) {
        let (one, three) = (selected(1), selected(3));
        let before = start(seed, &one, &one_worker()).advance(&one, 8, &one_worker()).unwrap();
        let after = before.clone().learn(&three, &one_worker()).unwrap();
        let inner = after.search();
        prop_assert_eq!((inner.iteration(), inner.generation()), (2, 0));
        // The same population, judged on all three; the non-dominated of it and of the old archive together.
        for (a, b) in inner.population().iter().zip(before.search().population()) {
            prop_assert!(Arc::ptr_eq(a, b));
        }
        prop_assert_eq!(population_rows(inner), judged(inner.population(), &after, &three));
        prop_assert_eq!(rows(inner.archive()), judged(inner.archive().members(), &after, &three));
        let mut all = judged(before.search().archive().members(), &before, &three);
        all.extend(population_rows(inner));
        prop_assert_eq!(sorted(rows(inner.archive())), non_dominated(&all));
        let judged_again = before.search().archive().len() as u64 + 40;
        prop_assert_eq!(inner.evaluations(), before.search().evaluations() + judged_again);
    }

    #[test]
    fn a_committee_is_the_best_and_others_without_doubles(seed in any::<u64>(), size in 0..60_usize) {
        let tests = selected(3);
        let search = start(seed, &tests, &one_worker()).advance(&tests, 45, &one_worker()).unwrap();
        let members = search.search().archive().len();
        let mut committee = search.committee(size);
        prop_assert_eq!(committee[0], search.best());
        prop_assert_eq!(committee.len(), size.clamp(1, members));
        committee.sort();
        committee.dedup();
        prop_assert!(committee.len() == size.clamp(1, members) && committee.iter().all(|&i| i < members));
    }

    #[test]
    fn the_best_is_nearest_to_the_ideal_point(seed in any::<u64>()) {
        let tests = selected(1);
        let search = start(seed, &tests, &one_worker()).advance(&tests, 10, &one_worker()).unwrap();
        let rows = rows(search.search().archive());
        let ideal: Vec<f64> = (0..2).map(|j| rows.iter().map(|row| row[j]).fold(f64::INFINITY, f64::min)).collect();
        let distance = |row: &Vec<f64>| (row[0] - ideal[0]).hypot(row[1] - ideal[1]);
        let least = rows.iter().map(distance).fold(f64::INFINITY, f64::min);
        prop_assert!(distance(&rows[search.best()]) <= least * (1.0 + 1e-12));
    }
}

#[test]
fn seeds_and_iterations_have_chances_of_their_own() {
    let (one, two) = (selected(1), selected(2));
    let search = |seed| start(seed, &one, &one_worker()).advance(&one, 2, &one_worker()).unwrap();
    assert_eq!(seen(&search(1)), seen(&search(1)));
    assert_ne!(seen(&search(1)), seen(&search(2)));
    // The same population in the same generation of another iteration has other children.
    let learnt = search(1).learn(&two, &one_worker()).unwrap();
    let again = learnt.clone().learn(&two, &one_worker()).unwrap();
    let child = |search: ModelSearch| seen(&search.advance(&two, 1, &one_worker()).unwrap());
    assert_ne!(child(learnt), child(again));
}

#[test]
fn learning_gets_better() {
    let tests = selected(1);
    let before = start(5, &tests, &one_worker());
    let closed = |search: &ModelSearch| {
        rows(search.search().archive()).iter().map(|row| row[1]).fold(f64::INFINITY, f64::min)
    };
    let after = before.clone().advance(&tests, 150, &one_worker()).unwrap();
    assert!(closed(&after) < 0.25 * closed(&before), "{} to {}", closed(&before), closed(&after));
    assert!((0.0..1.0).contains(&after.intron_share()));
}

#[test]
fn a_full_archive_is_pruned_and_counted() {
    let tests = selected(3);
    let variation = Variation { archive_cap: 12, ..variation() };
    let search = ModelSearch::start(world_grammar(), FORM, variation, 1, &tests, &one_worker()).unwrap();
    let search = search.advance(&tests, 60, &one_worker()).unwrap();
    assert!(search.search().archive().len() <= 12);
    assert!((1..=60).contains(&search.search().capped_generations()));
    let rows = rows(search.search().archive());
    assert_eq!(sorted(rows.clone()), non_dominated(&rows));
}

#[test]
fn misuse_is_refused_with_advice() {
    let (none, one, two) = (World::new().no_tests(), selected(1), selected(2));
    let start = |grammar, form, variation, tests: &SelectedTests| {
        ModelSearch::start(grammar, form, variation, 1, tests, &one_worker())
    };
    let refusal = |result: twinloop_core::Result<ModelSearch>| result.err().unwrap().to_string();
    assert!(refusal(start(world_grammar(), FORM, variation(), &none)).contains("found none; tell one first"));
    assert!(refusal(start(world_grammar(), Form::Absolute, variation(), &one)).contains("form absolute"));
    let grammar = Grammar { pages: 0, ..world_grammar() };
    assert!(refusal(start(grammar, FORM, variation(), &one)).contains("at least one page"));
    let search = start(world_grammar(), FORM, variation(), &one).unwrap();
    assert!(refusal(search.clone().learn(&none, &one_worker())).contains("found none; tell one first"));
    let error = refusal(search.advance(&two, 1, &one_worker()));
    assert!(
        error.contains("the 1 tests") && error.contains("found 2, or others; call learn first"),
        "{error}"
    );
}

#[test]
fn variations_that_make_no_generation_are_refused() {
    assert!(variation().validated().is_ok());
    type Spoil = fn(&mut Variation);
    let table: [(Spoil, &str); 11] = [
        (|v| v.population = 1, "population of 2 to 10000000"),
        (|v| v.archive_cap = 0, "archive of 1 or more"),
        (|v| v.mutation_share = -0.1, "between 0 and 1 that sum to 1"),
        (|v| v.mutation_share = f64::NAN, "between 0 and 1 that sum to 1"),
        (|v| v.crossover_share = 0.5, "between 0 and 1 that sum to 1"),
        (|v| v.elite_share = 1.5, "smaller than the population"),
        (|v| v.elite_share = f64::NAN, "smaller than the population"),
        (|v| v.elite_share = 1.0, "smaller than the population"),
        (|v| v.ranking_pressure = 0.9, "pressure"),
        (|v| v.ranking_pressure = 2.5, "pressure"),
        (|v| v.ranking_pressure = f64::NAN, "pressure"),
    ];
    for (spoil, expected) in table {
        let mut variation = variation();
        spoil(&mut variation);
        let error = variation.validated().unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}

/// Numbers that want to be small and large at once, and are judged with a different chance in each generation.
struct Resampled;

impl Problem for Resampled {
    type Genome = f64;
    const PURPOSES: (Purpose, Purpose) = (Purpose::FirstTests, Purpose::Tests);
    const RESAMPLED: bool = true;

    fn objectives(&self) -> usize {
        2
    }
    fn random(&self, stream: &mut Stream) -> f64 {
        stream.uniform()
    }
    fn mutate(&self, parent: &f64, stream: &mut Stream) -> f64 {
        parent + 0.1 * stream.gaussian()
    }
    fn crossover(&self, first: &f64, second: &f64, _stream: &mut Stream) -> f64 {
        (first + second) / 2.0
    }
    fn same(&self, child: &f64, parent: &f64) -> bool {
        child == parent
    }
    fn judge(&self, genomes: &[Arc<f64>], generation: u64, _workers: &Workers) -> Vec<Vec<f64>> {
        genomes.iter().map(|x| vec![x.powi(2), (**x - 1.0).powi(2) + generation as f64]).collect()
    }
}

#[test]
fn where_chance_has_a_part_everybody_is_judged_in_every_generation() {
    let search = Search::start(&Resampled, &variation(), 3, 1, &one_worker());
    let search = search.advance(&Resampled, &variation(), 9, &one_worker());
    assert_eq!((search.evaluations(), search.spared()), (10 * 40, 0));
    let expected = Resampled.judge(search.population(), 9, &one_worker());
    assert_eq!(population_rows(&search), expected);
}
