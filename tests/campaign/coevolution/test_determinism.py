"""Same bits for any number of threads, any vector width, and however the work is cut into calls."""

import numpy as np
import pytest

from oracles import same_bits
from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop.campaign.coevolution.search import start_models, start_tests
from twinloop.campaign.presets import options_of

WORKERS = [_core.Workers(threads=threads) for threads in (1, 2, 16)]
WORKERS += [_core.Workers(threads=2, width=width) for width in _core.vector_widths()]
NAMES = [f"{workers.threads} threads, {workers.width}" for workers in WORKERS]
OPTIONS = options_of(
    "paper",
    {
        "model_population": 24,
        "test_population": 12,
        "committee_size": 5,
        "mutants": 3,
        "operations": ["+", "-", "*", "/", "sin", "tanh", "exp", "sqrt"],
    },
)


@pytest.fixture(scope="module")
def told(quadrotor_family):
    """Υ0 alone, then with a second test."""
    import twinloop as tl
    from twinloop.objectives import selected_tests

    system = tl.systems.Quadrotor()
    genes = quadrotor_family.genes(system.default_gains)
    tests = [
        tl.Test(quadrotor_family, g, system.initial_state, system.target_state, 20)
        for g in (genes, 0.8 * genes)
    ]
    runs = [system.run(test) for test in tests]
    return quadrotor_family, tests[0].task, selected_tests(tests[:1], runs[:1]), selected_tests(tests, runs)


def learnt(told, workers, form="absolute", seed=7, cuts=(17,)):
    family, _, one, two = told
    options = options_of("paper", {**OPTIONS.__dict__, "form": form})
    search = start_models(options, family.signals, seed, one, workers)
    for generations in cuts:
        search = search.advance(one, generations, workers)
    search = search.learn(two, workers)
    for generations in cuts:
        search = search.advance(two, generations, workers)
    return search


def asked(told, models, workers, seed=7, iteration=1, cuts=(7,)):
    family, task, _, _ = told
    setting = Limits(family.signals).setting(family.engine)
    search = start_tests(models, setting, task, OPTIONS, seed=seed, iteration=iteration, workers=workers)
    for generations in cuts:
        search = search.advance(generations, workers)
    return search


def equal_models(a, b):
    return (
        [str(p) for p in a.population] == [str(p) for p in b.population]
        and [str(m.program) for m in a.archive] == [str(m.program) for m in b.archive]
        and same_bits(a.population_objectives, b.population_objectives)
        and same_bits(a.archive_objectives, b.archive_objectives)
        and (a.iteration, a.generation, a.evaluations, a.spared, a.best)
        == (b.iteration, b.generation, b.evaluations, b.spared, b.best)
    )


def equal_tests(a, b):
    return (
        same_bits(a.archive_genes, b.archive_genes)
        and same_bits(a.archive_objectives, b.archive_objectives)
        and (a.generation, a.evaluations, a.best, a.flat) == (b.generation, b.evaluations, b.best, b.flat)
    )


@pytest.mark.parametrize("workers", WORKERS, ids=NAMES)
@pytest.mark.parametrize("form", ["absolute", "acceleration"])
def test_the_model_loop_gives_the_same_bits_for_any_workers(told, form, workers):
    assert equal_models(learnt(told, workers, form), learnt(told, WORKERS[0], form))


@pytest.mark.parametrize("workers", WORKERS, ids=NAMES)
def test_the_test_loop_gives_the_same_bits_for_any_workers(told, workers):
    models = learnt(told, WORKERS[0])
    assert equal_tests(asked(told, models, workers), asked(told, models, WORKERS[0]))


@pytest.mark.parametrize("cuts", [(10, 7), (1,) * 17, (0, 17, 0)])
def test_the_model_loop_gives_the_same_bits_however_it_is_cut(told, cuts):
    assert equal_models(learnt(told, WORKERS[1], cuts=cuts), learnt(told, WORKERS[1]))


@pytest.mark.parametrize("cuts", [(4, 3), (1,) * 7])
def test_the_test_loop_gives_the_same_bits_however_it_is_cut(told, cuts):
    models = learnt(told, WORKERS[0])
    assert equal_tests(asked(told, models, WORKERS[1], cuts=cuts), asked(told, models, WORKERS[1]))


def test_another_seed_gives_another_search(told):
    models = learnt(told, WORKERS[0])
    other = learnt(told, WORKERS[0], seed=8)
    assert not equal_models(models, other)
    first = asked(told, models, WORKERS[0])
    assert not same_bits(first.best_genes, asked(told, models, WORKERS[0], seed=8).best_genes)
    assert not same_bits(first.best_genes, asked(told, models, WORKERS[0], iteration=2).best_genes)


def test_seeds_are_told_apart_by_every_bit(told):
    family, _, one, _ = told
    firsts = [
        str(start_models(OPTIONS, family.signals, seed, one, WORKERS[0]).population[0])
        for seed in (0, 1, 2**32, 2**63, 2**64 - 1)
    ]
    assert len(set(firsts)) == 5


def outcome(campaign):
    """Everything that a campaign found, as one comparable value."""
    return (
        [run.test.genes.tobytes() for run in campaign.experiments],
        [run.trajectory.states.tobytes() for run in campaign.experiments],
        campaign.history,
        str(campaign.models.best_model.program),
        campaign.models.archive_objectives.tobytes(),
        campaign.best_test.genes.tobytes(),
        campaign.best_test.predicted,
    )


@pytest.mark.parametrize("threads", [2, 16])
def test_a_whole_campaign_gives_the_same_bits_for_any_number_of_threads(new_campaign, pendulum, threads):
    many = outcome(new_campaign(threads=threads).run(pendulum, 3))
    assert many == outcome(new_campaign(threads=1).run(pendulum, 3))


def test_a_whole_campaign_depends_on_its_seed(new_campaign, pendulum):
    assert outcome(new_campaign(seed=1).run(pendulum, 2)) != outcome(new_campaign(seed=2).run(pendulum, 2))


@pytest.mark.parametrize("seconds", [0.0, 1e9])
def test_how_progress_is_cut_into_chunks_changes_no_bit(monkeypatch, new_campaign, pendulum, seconds):
    expected = outcome(new_campaign().run(pendulum, 3))
    monkeypatch.setattr("twinloop.campaign.coevolution.search.CHUNK_SECONDS", seconds)
    seen = []
    campaign = new_campaign(progress=seen.append).run(pendulum, 3)
    assert outcome(campaign) == expected
    generations = [p.generation for p in seen if p.phase == "models" and p.iteration == 1]
    assert generations == ([1, 2, 3, 4, 5, 6, 7, 8] if seconds == 0.0 else [1, 5, 8])


@pytest.mark.parametrize("wrong", [{"threads": 0}, {"width": "avx1024"}, {"width": ""}])
def test_workers_that_there_are_none_of_are_refused(wrong):
    with pytest.raises((ValueError, OverflowError), match="expected"):
        _core.Workers(**wrong)


def test_nothing_depends_on_numpys_global_random_state(new_campaign, pendulum):
    np.random.seed(1)
    one = outcome(new_campaign().run(pendulum, 2))
    np.random.seed(2)
    assert outcome(new_campaign().run(pendulum, 2)) == one
