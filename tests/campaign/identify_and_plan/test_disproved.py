"""Disproved: flights that the committee promised, that came out worse, and that it still does not explain."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from committees import STEPS, TUNED, committee_of, member, planner_of, signals
from twinloop.campaign import standing
from twinloop.campaign.identify_and_plan.disproved import disproved
from twinloop.planning.gusts import Moved


def found_of(monkeypatch, qualities, good, predicted=None, on_task=True, committee=None, flown=None):
    """Numbers of the tests that are found disproved, all of the same gains."""
    known = signals()
    planner = planner_of(known, draws=8)
    genes = [TUNED * (1.0 + 1e-9 * number) for number in range(len(qualities))]
    told = predicted or [1.0] * len(qualities)
    tests = [
        replace(planner.test(of, *ends_of(planner)), number=number, predicted=told[number])
        for number, of in enumerate(genes)
    ]
    flights = flown or tests
    runs = [[SimpleNamespace(test=test)] for test in flights]
    book = SimpleNamespace(flown=dict.fromkeys(range(len(tests))), tests=tests, experiments=[])
    monkeypatch.setattr(standing, "complete", lambda book, number: runs[number])
    monkeypatch.setattr(standing, "measured", lambda book, number: qualities[number])
    monkeypatch.setattr(standing, "on_task", lambda book, test: on_task)
    found = disproved(planner, committee or committee_of(known), book, good)
    return [
        number for number, of in enumerate(genes) if any(of.tobytes() == other.tobytes() for other in found)
    ]


def ends_of(planner):
    return planner.task.initial_state, planner.task.target_state


@pytest.fixture(name="expected")
def _expected():
    known = signals()
    planner, committee = planner_of(known, draws=8), committee_of(known)
    judged = planner.judge(committee.members, TUNED[None], committee.sds, 8, measured=True).qualities
    return float(judged.mean()), float(judged.std())


def test_a_flight_that_was_clearly_worse_than_the_best_and_than_the_twin_makes_it_is_one(
    expected, monkeypatch
):
    mean, sd = expected
    worse = [mean + 5.0 * sd, 2.0 * mean, None, 1.01 * mean]
    assert 5.0 * sd > 0.1 * mean
    assert found_of(monkeypatch, worse, good=mean) == [0, 1]
    # Nor is one that nobody had promised, nor one of another task, nor one in which the twin sees nothing good.
    assert found_of(monkeypatch, worse, good=mean, predicted=[None, 1.0, 1.0, 1.0]) == [1]
    assert found_of(monkeypatch, worse, good=mean, on_task=False) == []
    assert found_of(monkeypatch, worse, good=0.5 * mean) == []
    assert found_of(monkeypatch, worse, good=float("inf")) == []


def test_what_noise_and_known_disturbances_explain_disproves_nothing(expected, monkeypatch):
    mean, sd = expected
    within = [mean + 1.5 * sd]
    assert found_of(monkeypatch, within, good=0.98 * mean) == []
    gusty = replace(committee_of(signals()), gusts=SimpleNamespace(on=lambda test: Moved(0.0, mean)))
    assert found_of(monkeypatch, [2.0 * mean], good=mean, committee=gusty) == []
    assert found_of(monkeypatch, [4.0 * mean], good=mean, committee=gusty) == [0]


def test_a_flight_is_held_against_what_was_flown_not_against_what_was_asked(monkeypatch):
    known = signals()
    planner, committee = planner_of(known, draws=8), committee_of(known)
    asked = replace(planner.test(TUNED, *ends_of(planner)), number=0, predicted=1.0)
    pulses = np.zeros((asked.steps, known.n_u))
    pulses[: asked.steps // 2] = 0.5 * np.array([command.bounds[1] for command in known.commands])
    flown = replace(asked, excitation=pulses)
    judged = planner.judge(committee.members, TUNED[None], committee.sds, 8, pulses[None], measured=True)
    cost = float(judged.qualities.mean())
    good = 0.99 * cost / (1.0 + planner.options.worse)
    # Without the pulses, which somebody has added, it would have been far better.
    assert found_of(monkeypatch, [cost], good=good) == [0]
    assert found_of(monkeypatch, [cost], good=good, flown=[flown]) == []
    assert found_of(monkeypatch, [cost], good=good, flown=[replace(asked, predicted=None)]) == []


def left_of(monkeypatch, runs, members=None):
    """Numbers of flights that are found disproved, where none was measured to be worse."""
    known = signals()
    planner, committee = planner_of(known, draws=8), committee_of(known)
    committee = committee if members is None else replace(committee, members=members)
    flights = [
        SimpleNamespace(
            **{"off_start": (), "left_envelope": True, "quality": None, **run}, trajectory=ended(run)
        )
        for run in runs
    ]
    for number, flight in enumerate(flights):
        genes = TUNED * (1.0 + 1e-9 * number)
        flight.test = replace(
            planner.test(genes, *ends_of(planner)),
            number=number,
            predicted=runs[number].get("told", 1.0),
            spread=0.1,
        )
    monkeypatch.setattr(standing, "on_task", lambda book, test: test.number != 9)
    book = SimpleNamespace(flown={}, tests=[flight.test for flight in flights], experiments=flights)
    found = disproved(planner, committee, book, 1.0)
    return [
        flight.test.number
        for flight in flights
        if any(flight.test.genes.tobytes() == other.tobytes() for other in found)
    ]


def ended(run):
    return SimpleNamespace(ended=run.pop("ended", "completed"), steps=STEPS)


def test_a_flight_that_left_against_what_was_promised_is_one_until_the_twin_is_proven_and_foresees_it(
    monkeypatch,
):
    kept = {"left_envelope": False}
    assert left_of(monkeypatch, [{}, kept, {**kept, "ended": "diverged"}]) == [0, 2]
    # Nor one that nobody predicted, that was to diverge, or that began elsewhere.
    assert left_of(monkeypatch, [{"told": None}, {"told": float("inf")}, {"off_start": (0,)}]) == []
    # Once a flight of other gains has come out as predicted, only one that the committee does not see leave.
    true = {**kept, "quality": 1.0}
    assert left_of(monkeypatch, [{}, true]) == [0]
    runaway = [member(signals(), 1.0, damping=-60.0)] * 3
    assert left_of(monkeypatch, [{}, true], members=runaway) == []
    assert left_of(monkeypatch, [true, {}], members=runaway) == [1]
