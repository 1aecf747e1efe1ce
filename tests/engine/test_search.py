"""The two loops: what they archive, what it was judged by, and what a generation costs."""

import numpy as np
import pytest

from conftest import setting_of
from oracles import dominates, non_dominated, same_bits
from strategies import program_text
from twinloop import InvalidInput, _core, pareto

START, TARGET = [0.3, -0.2], [0.8, 0.1]
GRAMMAR = _core.Grammar(4, 2, pages=3, page_length=5)
WORKERS = _core.Workers()


@pytest.fixture(scope="module")
def selected(rig_setting):
    """One to three tests, flown on a plain linear system."""
    sets = [_core.SelectedTests(rig_setting)]
    stream = np.random.default_rng(0)
    for genes in stream.uniform(0.0, 2.0, (3, 6)):
        runs = _core.rollout(
            lambda x, u: np.array([x[0] + 0.1 * x[1], 0.9 * x[1] + 0.1 * u[0] - 0.02 * u[1]]),
            rig_setting, genes[None], _core.Task(START, TARGET, 15),
        )  # fmt: skip
        assert runs.lasted[0] == 15
        sets.append(sets[-1].with_test(genes, TARGET, runs.states[0], runs.commands[0]))
    return sets[1:]


def started(selected, seed=3, **variation):
    variation = _core.Variation(40, **{"elite_share": 0.1, **variation})
    return _core.ModelSearch.start(GRAMMAR, "absolute", variation, seed, selected, WORKERS)


def judged(models, selected):
    """Open and closed loop of each test of 15 steps in turn, with the specification's numbers for what diverges."""
    errors, lasted = _core.closed_loop(models, selected)
    closed = np.where(np.isfinite(errors), errors, 1e6 * (2.0 - lasted / 15))
    both = np.stack([np.minimum(_core.open_loop(models, selected), 2e6), closed], axis=2)
    return both.reshape(len(models), -1)


def mutually_non_dominated(rows):
    return non_dominated(rows) == list(range(len(rows)))


def test_the_population_is_judged_by_both_errors_of_every_test(rig, selected):
    search = started(selected[2])
    models = [_core.Model(program, "absolute", rig) for program in search.population]
    assert search.population_objectives.shape == (40, 6)
    assert same_bits(search.population_objectives, judged(models, selected[2]))


def test_iteration_0_is_the_non_dominated_set_of_the_random_population(selected):
    search = started(selected[0])
    rows = search.population_objectives
    assert (search.iteration, search.generation, search.evaluations, search.spared) == (1, 0, 40, 0)
    assert same_bits(search.archive_objectives, rows[non_dominated(rows)])


def test_the_first_population_is_random_programs_of_the_grammar(selected):
    population = started(selected[0]).population
    assert len({str(program) for program in population}) == 40
    assert all(program.page_lengths == [5, 5, 5] for program in population)


def test_the_archive_is_the_non_dominated_set_of_all_that_was_ever_in_the_population(selected):
    search, seen = started(selected[0]), []
    for _ in range(12):
        seen.append(search.population_objectives)
        search = search.advance(selected[0], 1, WORKERS)
    seen = np.concatenate([*seen, search.population_objectives])
    expected = np.unique(seen[non_dominated(seen)], axis=0)
    assert np.array_equal(np.unique(search.archive_objectives, axis=0), expected)
    assert mutually_non_dominated(search.archive_objectives)


def test_a_member_of_the_archive_has_the_objectives_that_it_is_archived_under(selected):
    search = started(selected[1]).advance(selected[1], 8, WORKERS)
    assert same_bits(search.archive_objectives, judged(search.archive, selected[1]))


def test_the_ideal_point_never_gets_worse_within_an_iteration(selected):
    search = started(selected[0])
    before = pareto.ideal_point(search.archive_objectives)
    for _ in range(10):
        search = search.advance(selected[0], 2, WORKERS)
        now = pareto.ideal_point(search.archive_objectives)
        assert (now <= before).all()
        before = now
    assert (before < pareto.ideal_point(started(selected[0]).archive_objectives)).any()


def test_the_best_is_the_trade_off_nearest_to_the_ideal_point(selected):
    for normalised in (False, True):
        search = started(selected[0], normalised_tradeoff=normalised).advance(selected[0], 8, WORKERS)
        assert search.best == pareto.best_tradeoff(search.archive_objectives, normalised)
        assert same_bits(search.best_objectives, search.archive_objectives[search.best])
        assert search.best_model.program == search.archive[search.best].program


def test_the_elite_survives_as_it_is(selected):
    search = started(selected[0], elite_share=0.25)
    best = pareto.select(search.population_objectives, 10)
    elite = [str(search.population[i]) for i in best]
    after = search.advance(selected[0], 1, WORKERS)
    assert [str(program) for program in after.population[:10]] == elite


def test_pure_reproduction_makes_nothing_new(selected):
    shares = {"mutation_share": 0.0, "crossover_share": 0.0, "reproduction_share": 1.0}
    search = started(selected[0], **shares)
    after = search.advance(selected[0], 5, WORKERS)
    assert {str(p) for p in after.population} <= {str(p) for p in search.population}
    assert same_bits(after.archive_objectives, search.archive_objectives)
    assert after.evaluations == search.evaluations


def test_every_offspring_is_judged_or_spared_or_of_the_elite(selected):
    search = started(selected[0]).advance(selected[0], 9, WORKERS)
    assert search.evaluations + search.spared + 9 * 4 == 40 * 10
    assert search.spared > 0


def test_what_is_spared_would_have_been_judged_the_same(rig, selected):
    search = started(selected[0]).advance(selected[0], 9, WORKERS)
    models = [_core.Model(program, "absolute", rig) for program in search.population]
    assert same_bits(search.population_objectives, judged(models, selected[0]))


def test_learning_judges_the_same_population_and_archive_on_more_tests(selected):
    old = started(selected[0]).advance(selected[0], 8, WORKERS)
    new = old.learn(selected[1], WORKERS)
    assert (new.iteration, new.generation) == (2, 0)
    assert [str(p) for p in new.population] == [str(p) for p in old.population]
    kept = {str(model.program) for model in new.archive}
    assert kept <= {str(m.program) for m in old.archive} | {str(p) for p in old.population}
    assert new.archive_objectives.shape[1] == 4


def test_the_archive_is_filtered_again_when_a_test_is_added(selected):
    search = started(selected[0]).advance(selected[0], 8, WORKERS)
    for tests in (selected[1], selected[2]):
        offered = judged([*search.archive], tests)
        search = search.learn(tests, WORKERS)
        rows = search.archive_objectives
        assert mutually_non_dominated(rows)
        assert same_bits(rows, judged(search.archive, tests))
        offered = np.concatenate([offered, search.population_objectives])
        expected = np.unique(offered[non_dominated(offered)], axis=0)
        assert np.array_equal(np.unique(rows, axis=0), expected)


def test_moving_on_without_learning_the_new_test_is_refused(selected):
    search = started(selected[0])
    with pytest.raises(InvalidInput, match="call learn first"):
        search.advance(selected[1], 1, WORKERS)


def test_a_search_without_tests_is_refused(rig_setting):
    with pytest.raises(InvalidInput, match="at least one selected test"):
        started(_core.SelectedTests(rig_setting))


def test_a_search_is_a_value_that_moving_on_leaves_as_it_was(selected):
    search = started(selected[0])
    before = search.archive_objectives
    search.advance(selected[0], 5, WORKERS)
    assert search.generation == 0 and same_bits(search.archive_objectives, before)


def test_the_cap_of_the_archive_is_kept_and_its_use_is_counted(selected):
    search = started(selected[2], archive_cap=12)
    for _ in range(6):
        search = search.advance(selected[2], 2, WORKERS)
        assert search.archive_size <= 12
    assert 0 < search.capped_generations <= 12
    assert started(selected[0]).capped_generations == 0


def test_a_committee_has_the_best_first_and_nobody_twice(selected):
    search = started(selected[2]).advance(selected[2], 10, WORKERS)
    assert search.archive_size > 6
    for size in (1, 5, 10_000):
        members = search.committee(size)
        assert members[0] == search.best
        assert len(set(members)) == len(members) == min(size, search.archive_size)


def test_the_intron_share_is_the_mean_over_the_population(selected):
    search = started(selected[0]).advance(selected[0], 3, WORKERS)
    expected = np.mean([program.intron_share for program in search.population])
    assert search.intron_share == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    "wrong",
    [
        {"population": 1},
        {"archive_cap": 0},
        {"elite_share": 1.0},
        {"mutation_share": 0.9},
        {"ranking_pressure": 2.5},
        {"ranking_pressure": float("nan")},
        {"crossover_share": -0.3, "mutation_share": 1.2},
    ],
)
def test_a_variation_that_makes_no_generation_is_refused(wrong):
    with pytest.raises(InvalidInput, match="expected"):
        _core.Variation(**{"population": 10, **wrong})


# The test loop


def model(rig, *instructions):
    return _core.Model(_core.Program.parse(program_text(4, 2, 8, [list(instructions)])), "absolute", rig)


@pytest.fixture
def committee(selected):
    search = started(selected[1]).advance(selected[1], 10, WORKERS)
    archive = search.archive
    return [archive[i] for i in search.committee(8)]


def search_of(committee, rig_setting, task=None, seed=1, iteration=1, population=30, **settings):
    task = task or _core.Task(START, TARGET, 12)
    chosen, variation = _core.TestSettings(**{"mutants": 4, **settings}), _core.Variation(population)
    return _core.TestSearch.start(committee, rig_setting, task, chosen, variation, seed, iteration, WORKERS)


def linear(rig, gain):
    """A model that moves under the first command, differently for each gain."""
    return model(
        rig, "r6 = r1 * 0.1", "r4 = r0 + r6", "r6 = r2 * " + repr(gain), "r7 = r1 * 0.9", "r5 = r7 + r6"
    )


def test_discrimination_of_a_test_is_that_of_its_final_distances_on_the_committee(rig, rig_setting):
    committee = [linear(rig, gain) for gain in (0.1, 0.15, 0.2, 0.4)]
    task = _core.Task(START, TARGET, 12)
    cap = 3.0 * np.linalg.norm(np.subtract(TARGET, START))
    search = search_of(committee, rig_setting, task, control_quality=True).advance(6, WORKERS)
    found = _core.final_distances(committee, rig_setting, search.archive_genes, task)
    expected = 1.0 / (np.minimum(found, cap).var(axis=0) + 1e-9)
    rows = search.archive_objectives
    np.testing.assert_allclose(rows[:, 0], expected, rtol=1e-9)
    assert same_bits(rows[:, 2], found[0])
    assert mutually_non_dominated(rows)
    assert (rows[:, 1] >= 0.0).all() and (rows[:, 1] <= cap**2).all()
    assert search.best == pareto.best_tradeoff(rows)
    assert same_bits(search.best_genes, search.archive_genes[search.best])


def test_a_model_that_runs_away_counts_as_the_cap(rig, rig_setting):
    wild = model(rig, "r4 = r0 * 30.0", "r5 = r1 + 0.0")
    committee = [linear(rig, 0.1), wild]
    task = _core.Task(START, TARGET, 12)
    cap = 2.0 * np.linalg.norm(np.subtract(TARGET, START))
    search = search_of(committee, rig_setting, task, distance_cap=2.0)
    found = _core.final_distances(committee, rig_setting, search.archive_genes, task)
    assert np.isinf(found[1]).all()
    expected = 1.0 / (np.array([np.minimum(found[0], cap), np.full(found.shape[1], cap)]).var(axis=0) + 1e-9)
    np.testing.assert_allclose(search.archive_objectives[:, 0], expected, rtol=1e-9)


def test_instability_vanishes_with_the_step_of_the_mutants_and_grows_with_it(rig, rig_setting):
    committee = [linear(rig, 0.2), linear(rig, 0.3)]
    steady = search_of(committee, rig_setting, mutants=6, mutant_step=1e-9)
    shaken = search_of(committee, rig_setting, mutants=6, mutant_step=0.2)
    assert (steady.archive_objectives[:, 1] < 1e-12).all()
    assert shaken.archive_objectives[:, 1].max() > 1e-6


def runaway_above(rig):
    """It runs away where the command is large, which depends on the gains."""
    return model(rig, "r6 = r2 * 2.0", "r6 = exp(r6)", "r6 = r6 * r6", "r4 = r0 + r6", "r5 = r1 * 0.5")


def test_a_candidate_that_diverges_on_the_best_model_is_dominated_by_one_that_does_not(rig, rig_setting):
    task = _core.Task([0.0, 0.0], [0.4, 0.0], 6)
    best = runaway_above(rig)
    committee = [best, linear(rig, 0.2)]
    genes = np.random.default_rng(0).uniform(0.0, 2.0, (200, 6))
    share = np.isinf(_core.final_distances([best], rig_setting, genes, task)).mean()
    assert 0.05 < share < 0.95  # some do, some do not
    search = search_of(committee, rig_setting, task).advance(3, WORKERS)
    found = _core.final_distances([best], rig_setting, search.archive_genes, task)
    assert np.isfinite(found).all()


def test_where_every_candidate_diverges_none_looks_stable_or_discriminating(rig, rig_setting):
    wild = model(rig, "r4 = r0 * 30.0", "r5 = r1 + 0.0")
    search = search_of([wild, linear(rig, 0.2)], rig_setting, control_quality=True)
    assert search.archive_objectives.shape == (1, 3)
    assert (search.archive_objectives > 1e9).all()


def test_a_best_model_that_ignores_the_commands_is_called_flat(rig, rig_setting):
    deaf = model(rig, "r4 = r0 * 0.9", "r5 = r1 * 0.9")
    assert search_of([deaf, linear(rig, 0.2)], rig_setting).flat
    assert not search_of([linear(rig, 0.2), deaf], rig_setting).flat


def test_genes_stay_in_their_box(rig):
    low, high = np.array([0.1, 0.0, 1e-3, -1.0, 0.0, 1.0]), np.array([0.2, 1.0, 1e3, 1.0, 5.0, 2.0])
    logarithmic = [False, False, True, False, False, True]
    family = _core.Family.pid(rig, [(0, 1), (1, None)], list(zip(low, high, logarithmic, strict=True)))
    committee = [linear(rig, 0.1), linear(rig, 0.3)]
    genes = (
        search_of(committee, setting_of(rig, family), population=60, mutation_step=1.0)
        .advance(5, WORKERS)
        .archive_genes
    )
    assert (genes >= low).all() and (genes <= high).all()


def test_every_asking_starts_from_another_random_population(committee, rig_setting):
    one = search_of(committee, rig_setting, iteration=1)
    two = search_of(committee, rig_setting, iteration=2)
    assert not same_bits(one.best_genes, two.best_genes)
    assert one.evaluations == 30
    assert one.advance(3, WORKERS).evaluations > 30


def test_a_committee_of_two_kinds_is_refused(rig, rig_setting):
    other = _core.Model(linear(rig, 0.1).program, "increment", rig)
    with pytest.raises(InvalidInput, match="all of one form"):
        search_of([linear(rig, 0.1), other], rig_setting)
    with pytest.raises(InvalidInput, match="one model or more"):
        search_of([], rig_setting)


def test_a_task_that_starts_at_its_target_is_refused(rig, rig_setting):
    with pytest.raises(InvalidInput, match="away from the initial state"):
        search_of([linear(rig, 0.1)], rig_setting, _core.Task(START, START, 5))


def test_dominance_is_what_the_oracle_says():
    assert dominates(np.array([1.0, 2.0]), np.array([1.0, 3.0]))
    assert not dominates(np.array([1.0, 2.0]), np.array([1.0, 2.0]))
