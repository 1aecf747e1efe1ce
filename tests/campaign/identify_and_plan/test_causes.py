"""An error of the law comes again in flight after flight; gusts do not; what may be either is said to be."""

from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest

from twinloop.campaign.identify_and_plan import causes
from twinloop.campaign.identify_and_plan.causes import acts_in_motion, cause, causes_of
from twinloop.identification.sensors.chains import Chain, Motion
from twinloop.identification.settings import IdentificationOptions
from twinloop.signals import State

STEPS = 300


def gusts(seed, correlation_time, steps=STEPS):
    """A Gauss-Markov process of variance 1."""
    random, kept = np.random.default_rng(seed), np.exp(-1.0 / correlation_time)
    series = [random.standard_normal()]
    for _ in range(steps - 1):
        series.append(kept * series[-1] + np.sqrt(1.0 - kept * kept) * random.standard_normal())
    return np.array(series)


def rubbing(stroke=40):
    """Friction of a motor that moves to and fro, then rests."""
    times = np.arange(STEPS)
    return np.where(times < 200, np.where(times // stroke % 2 == 0, 1.0, -1.0), 0.0)


@pytest.mark.parametrize(("correlation_time", "known"), [(3.0, 1.0), (20.0, 1.0), (75.0, 0.8)])
def test_gusts_do_not_know_when_a_flight_begins(correlation_time, known):
    found = [
        cause([[gusts(100 * trial + flight, correlation_time) for flight in range(4)]]) for trial in range(60)
    ]
    assert found.count("law") <= 1
    # The slower they are, the more flights it takes to see that they have nothing to do with each other.
    assert found.count("disturbance") >= known * len(found)


def wandering(seed):
    """What a law is wrong about by, over a flight: slow, of mean square 1."""
    found = np.cumsum(gusts(seed, 20.0))
    return found / np.sqrt(np.square(found).mean())


@pytest.mark.parametrize("flights", [2, 4, 8])
def test_an_error_of_the_law_is_seldom_taken_for_a_disturbance(flights):
    found = [
        cause([[wandering(seed) + 0.5 * gusts(1000 * seed + flight, 3.0) for flight in range(flights)]])
        for seed in range(40)
    ]
    assert found.count("disturbance") == 0
    # It takes more than two flights to be certain, for it changes slowly.
    assert flights == 2 or found.count("law") >= 36


def test_an_error_of_the_law_comes_again_in_every_flight():
    noisy = [rubbing() + 0.5 * gusts(flight, 5.0) for flight in range(3)]
    assert cause([noisy]) == "law"
    assert cause([[3.0 * rubbing(), 5.0 * rubbing(41)[: STEPS // 2], rubbing(39)]]) == "law"


def test_one_flight_of_a_task_tells_nothing():
    one, other = rubbing(), -rubbing()
    assert cause([]) == cause([[one]]) == cause([[one], [one]]) == "undecided"
    assert cause([[one, one, one], [other, other, other]]) == "law"
    assert cause([[one, one, other, other]]) != "law"


def test_two_flights_that_are_alike_by_luck_tell_nothing():
    """Of two constants the signs alone can be compared, and these are alike in every second case."""
    assert cause([[np.ones(STEPS), 2.0 * np.ones(STEPS)]]) == "undecided"
    assert cause([[np.ones(STEPS), -2.0 * np.ones(STEPS)]]) == "disturbance"
    slow = [cause([[gusts(seed, 300.0), gusts(100 + seed, 300.0)]]) for seed in range(40)]
    assert slow.count("law") == 0


def test_a_trace_of_it_is_not_enough():
    """With many flights a share of a tenth is certain, and still a small part of what disturbs."""
    flights = [0.3 * rubbing() + gusts(flight, 3.0) for flight in range(12)]
    assert cause([flights]) == "disturbance"


def test_many_readings_are_taken_in_pieces():
    long = np.repeat(rubbing(), 40)
    assert cause([[long, 2.0 * long, long]]) == "law"
    assert cause([[gusts(1, 900.0, 12000), gusts(2, 900.0, 12000)]]) != "law"


def fast(seed=0):
    """How fast a system moves that goes to its target and rests there."""
    return np.exp(-np.arange(STEPS) / 60.0) * (1.0 + 0.2 * np.sin(0.3 * np.arange(STEPS) + seed))


@pytest.mark.parametrize("correlation_time", [3.0, 10.0, 30.0])
@pytest.mark.parametrize("flights", [1, 3])
def test_gusts_act_at_rest_as_well(correlation_time, flights):
    falsely = sum(
        acts_in_motion(
            [
                (np.abs(gusts(100 * trial + flight, correlation_time)), fast(flight))
                for flight in range(flights)
            ]
        )
        for trial in range(60)
    )
    assert falsely <= 4


@pytest.mark.parametrize("flights", [2, 4])
def test_what_acts_in_motion_alone_is_found_though_each_flight_has_another(flights):
    found = sum(
        acts_in_motion(
            [
                (np.abs(gusts(100 * trial + flight, 5.0) * fast(flight) + 0.05 * gusts(trial, 3.0)), fast(flight))
                for flight in range(flights)
            ]
        )
        for trial in range(60)
    )  # fmt: skip
    assert found >= 55
    # By their products these are unrelated.
    assert cause([[gusts(flight, 5.0) * fast(flight) for flight in range(6)]]) == "disturbance"


# What is switched off


def causes_of_gusts(flights, size, options):
    """The cause of gusts of such a size on a chain of a law that drives motions of variance 1, in some flights."""
    signals = SimpleNamespace(
        n_x=1, difference=lambda one, other: one - other, states=[State("x", "m", 1.0)], commands=[]
    )
    chain = Chain((0,), 0, "acceleration", np.full(1, 1e-8), np.full(1, 1e-8), Motion(0.0, size**2, 0.1))
    told = [
        SimpleNamespace(
            test=SimpleNamespace(target_state=np.zeros(1)),
            trajectory=SimpleNamespace(states=free, commands=np.zeros((STEPS, 0))),
        )
        for free in (np.linspace(0.0, 1.0, STEPS + 1)[:, np.newaxis] for _ in range(flights))
    ]

    def alone(model, run, *_):
        return run.trajectory.states + 0.1, np.zeros((STEPS, 0))

    white = np.random.default_rng(0).normal(size=(flights, STEPS + 1, 1))
    seen = [(white[seed], None, size * gusts(seed, 3.0, STEPS + 1)[:, np.newaxis]) for seed in range(flights)]
    with mock.patch.multiple(
        causes, observed=lambda *_: seen, runs_of=lambda *_: [], driven=lambda *_: np.ones(1),
        distinct=lambda runs: runs, alone=alone,
    ):  # fmt: skip
        identified = SimpleNamespace(chains=[chain], members=[None], model=None)
        return causes_of(identified, told, signals, SimpleNamespace(signals=signals), options, None)


def test_without_causes_all_that_disturbs_comes_from_outside():
    assert causes_of_gusts(1, 1.0, IdentificationOptions()) == {0: "undecided"}
    assert causes_of_gusts(1, 1.0, IdentificationOptions(causes=False)) == {0: "disturbance"}


def test_without_exactness_the_smallest_gusts_come_from_outside_too():
    assert causes_of_gusts(6, 1.0, IdentificationOptions()) == {0: "disturbance"}
    assert causes_of_gusts(6, 0.01, IdentificationOptions()) == {0: "undecided"}
    assert causes_of_gusts(6, 0.01, IdentificationOptions(exactness=False)) == {0: "disturbance"}
