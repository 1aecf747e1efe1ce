"""A law that diverges more often gives way to the one known before, tuned again, that follows nearly as well."""

from types import SimpleNamespace

import numpy as np

import twinloop as tl
from twinloop import _core
from twinloop.campaign.identify_and_plan.answer import Answer
from twinloop.campaign.identify_and_plan.tame import Lasting, follows_nearly, is_wilder
from twinloop.identification.identify import identify_runs
from twinloop.identification.records import Run
from twinloop.identification.settings import IdentificationOptions

SIGNALS = tl.Signals(
    [tl.State("speed", "m/s", 1.0)], [tl.Command("force", "N", (-10.0, 10.0), scale=1.0)], 0.05
)
WORKERS = _core.Workers(1)


def held(worst=0.01, believable=True, explained=True):
    return SimpleNamespace(worst=worst, believable=believable, explained=explained)


def test_a_law_is_wild_that_lasts_under_less_than_half_as_many_controllers():
    assert Lasting(3, 20).wild and Lasting(9, 20).wild and not Lasting(10, 20).wild
    # Where the known one does not last under most of them that says little.
    assert not Lasting(0, 16).wild and Lasting(0, 17).wild


def test_a_law_of_more_terms_is_wilder_where_it_lasts_under_one_controller_less():
    known = SimpleNamespace(terms=5)

    def wilder(terms, lasting, doubted=False):
        return is_wilder(SimpleNamespace(terms=terms), known, Lasting(*lasting), doubted)

    assert wilder(6, (30, 31)) and wilder(9, (2, 3)) and not wilder(6, (31, 31))
    # With no more terms, or where it is doubted, it has to be wild.
    for terms, doubted in ((5, False), (4, False), (6, True)):
        assert not wilder(terms, (20, 31), doubted) and wilder(terms, (15, 31), doubted)


def test_a_tame_law_follows_nearly_as_well_up_to_twice_the_squares():
    hardly = Lasting(30, 31)
    assert follows_nearly(held(0.02), held(0.01), hardly) and not follows_nearly(
        held(0.0201), held(0.01), hardly
    )
    assert follows_nearly(held(0.4), held(float("inf")), hardly)
    assert not follows_nearly(held(0.01, believable=False), held(0.01), hardly)


def test_beside_a_wild_law_it_is_enough_to_explain_the_flights():
    wild = Lasting(3, 31)
    assert follows_nearly(held(0.5), held(0.01), wild)
    assert not follows_nearly(held(0.5, explained=False), held(0.01), wild)
    assert not follows_nearly(held(0.5, believable=False), held(0.01), wild)


def test_all_that_disturbs_a_law_may_be_what_more_terms_describe():
    def chain(state, white, output=0):
        return SimpleNamespace(states=(state,), output=output, motion=SimpleNamespace(white=white))

    chains = [chain(3, 0.2), chain(1, 0.1), chain(0, 0.0), chain(2, 0.1, output=None)]
    known = Answer(
        SimpleNamespace(chains=chains),
        None,
        True,
        {1: "disturbance", 2: "law", 3: "undecided"},
        (),
        False,
        [],
    )
    found = known.with_doubtful_disturbances()
    assert found.causes == {1: "undecided", 2: "law", 3: "undecided"}
    assert list(found.suspects) == [1, 3] and found.explained and not known.suspects


def run(drag, seed, steps=80):
    """Of a system with such a drag under commands that step at random."""
    random = np.random.default_rng(seed)
    force = np.repeat(random.uniform(-1.0, 1.0, steps // 10), 10)[:, np.newaxis]
    speed = np.zeros((steps + 1, 1))
    kept = np.exp(-drag * SIGNALS.dt)
    for k, pushed in enumerate(force):
        speed[k + 1] = kept * speed[k] + (1.0 - kept) / drag * pushed
    return Run.of(speed + 1e-3 * random.standard_normal(speed.shape), force)


def test_a_law_known_before_is_tuned_on_all_runs_and_nothing_is_searched():
    options = IdentificationOptions(form="acceleration", generations=0)
    before = identify_runs([run(2.0, 1)], SIGNALS, options, workers=WORKERS)
    runs = [run(2.0, 1), run(3.0, 2), run(3.0, 3)]
    steps = []
    again = identify_runs(
        runs, SIGNALS, options.as_known, earlier=before, workers=WORKERS, iteration=1, watch=steps.append
    )
    assert {"terms", "actuators", "hidden"}.isdisjoint(steps)
    # Of the known terms none that is needed is lost and none comes, and their constants are those of all runs.
    (was,), (now,) = (found.sums for found in (before, again))
    assert set(now.weights) <= set(was.weights) and now.weights != was.weights
