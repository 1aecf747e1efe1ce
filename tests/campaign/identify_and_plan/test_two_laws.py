"""Of two laws that explain nothing the one is believed that foretells flights, and gains have to be good on both."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import twinloop as tl
from named_answers import answer, identified_as
from strategies import program_text
from twinloop import _core
from twinloop._experiment.limits import Limits
from twinloop._experiment.replay import Replay
from twinloop.campaign.identify_and_plan.learning import (
    better_of,
    stands_in,
)
from twinloop.campaign.identify_and_plan.two_laws import TwoLaws, better_foretold, compared
from twinloop.law.actuation import Actuator

INF = float("inf")
WORKERS = _core.Workers(1)
SIGNALS = tl.Signals([tl.State("speed", "m/s", 1.0)], [tl.Command("force", "N", (-1.0, 1.0))], 0.1)
LIMITS = Limits(SIGNALS)


def law(drag):
    """speed' = force - drag speed."""
    lines = [f"r2 = r0 * {-drag!r}", "r2 = r2 + r1"]
    return _core.Model(_core.Program.parse(program_text(2, 1, 5, [lines])), "acceleration", SIGNALS.engine)


def flight(drag, steps=40):
    """Of a system with such a drag, which a constant force drives from rest."""
    t = 0.1 * np.arange(steps + 1)
    speed = (1.0 - np.exp(-drag * t)) / drag
    commands = np.ones((steps, 1))
    run = tl.Trajectory(t, speed[:, np.newaxis], commands)
    return SimpleNamespace(replayed=Replay(SIGNALS, [0.0], commands), trajectory=run, number=None, test=None)


RATIOS = arrays(
    float, st.tuples(st.just(2), st.integers(1, 5)), elements=st.one_of(st.floats(1e-6, 1e6), st.just(INF))
)


@given(RATIOS)
def test_one_that_diverges_on_fewer_flights_foretells_better_whatever_its_errors(ratios):
    lost = np.isinf(ratios).sum(axis=1)
    if lost[0] != lost[1]:
        assert compared(ratios) == ("nonlinear" if lost[0] < lost[1] else "linear")


@given(RATIOS)
def test_no_law_is_preferred_by_its_place(ratios):
    kinds = compared(ratios), compared(ratios[::-1])
    assert kinds[0] != kinds[1] or kinds == ("nonlinear", "nonlinear")  # of equal ones it is the first


def test_it_is_the_one_with_the_smaller_errors_over_all_flights():
    assert compared(np.array([[0.1, 0.1, 0.1], [0.2, 0.2, 0.01]])) == "linear"
    assert compared(np.array([[0.1, 0.1, 0.1], [0.2, 0.2, 0.09]])) == "nonlinear"


def test_flights_that_laws_were_learnt_from_say_nothing():
    flights = [flight(1.0), flight(3.0)]
    right_before, right_after = law(1.0), law(3.0)
    both = TwoLaws(1, nonlinear=right_before, linear=right_after)
    assert better_foretold([both], flights[:1], LIMITS, WORKERS) is None
    assert better_foretold([both], flights, LIMITS, WORKERS) == "linear"


def test_each_pair_of_laws_is_held_against_the_flights_before_the_next_pair():
    flights = [flight(1.0), flight(2.0), flight(3.0)]
    first = TwoLaws(1, nonlinear=law(2.0), linear=law(3.0))
    second = TwoLaws(2, nonlinear=law(3.0), linear=law(2.0))
    # Each nonlinear law was right of its own next flight, and each linear one of the other's.
    assert better_foretold([first, second], flights, LIMITS, WORKERS) == "nonlinear"


def test_what_was_foretold_decides_before_what_is_missed_of_flights_that_are_known():
    nonlinear, rough = answer([[0.1, 0.2]], name="n"), answer([[0.3, 0.4]], name="r")
    assert better_of(nonlinear, rough, None).identified.model == "n"
    assert better_of(nonlinear, rough, "linear").identified.model == "r"
    assert better_of(nonlinear, rough, "nonlinear").identified.model == "n"


@pytest.mark.parametrize(("terms", "believed"), [(3, "r"), (4, "r"), (5, "n")])
def test_a_linear_law_that_misses_less_with_more_terms_is_not_believed_for_that(terms, believed):
    nonlinear, rough = answer([[0.3, 0.4]], name="n"), answer([[0.1, 0.2]], name="r")
    nonlinear, rough = (
        replace(one, identified=replace(one.identified, terms=count))
        for one, count in ((nonlinear, 4), (rough, terms))
    )
    assert better_of(nonlinear, rough, None).identified.model == believed
    assert better_of(nonlinear, rough, "linear").identified.model == "r"


@pytest.mark.parametrize("foretold", [None, "linear", "nonlinear"])
def test_one_that_diverges_where_a_flight_did_not_is_neither_believed_nor_beside(foretold):
    lasts, diverges = answer([[0.3, 0.4]], name="lasts"), answer([[0.1, INF]], name="diverges")
    for found in (better_of(lasts, diverges, foretold), better_of(diverges, lasts, foretold)):
        assert found.identified.model == "lasts" and list(found.believed) == [found.identified.model]


@pytest.mark.parametrize("foretold", [None, "linear", "nonlinear"])
def test_a_linear_one_sits_beside_even_if_it_follows_badly_and_a_nonlinear_one_does_not(foretold):
    follows, lost = answer([[0.3, 0.4]], name="follows"), answer([[0.8, 0.9]], follows=False, name="lost")
    found = better_of(follows, lost, foretold)
    assert found.identified.model == "follows" and list(found.believed) == ["follows", "lost"]
    found = better_of(lost, follows, foretold)
    assert found.identified.model == "follows" and list(found.believed) == [found.identified.model]


def test_the_one_beside_is_second_in_the_committee():
    found = better_of(answer([[0.1]], name="n"), answer([[0.3]], name="r"), "linear")
    assert found.believed == ["r", "n"]


@pytest.mark.parametrize("foretold", [None, "linear", "nonlinear"])
def test_one_that_diverges_under_most_controllers_is_neither_believed_nor_beside(foretold):
    nonlinear, rough = answer([[0.1, 0.2]], name="n"), answer([[0.3, 0.4]], name="r")
    found = better_of(nonlinear, rough, foretold, (False, True))
    assert found.identified.model == "r" and list(found.believed) == ["r"]
    assert better_of(nonlinear, rough, foretold, (True, False)).identified.model == "n"
    # One that does not follow the flights is not believed for that.
    lost = answer([[0.8, 0.9]], follows=False, name="lost")
    assert better_of(nonlinear, lost, foretold, (False, True)).identified.model == "n"


def test_two_laws_survive_their_record():
    both = TwoLaws(3, law(1.0), law(2.0))
    again = TwoLaws.from_record(both.to_record(), SIGNALS)
    assert again.to_record() == both.to_record() and again.experiments == 3


@given(free=st.floats(0.01, 0.5), less=st.floats(0.01, 0.5))
def test_a_nonlinear_law_that_misses_more_than_a_linear_one_sits_nowhere(free, less):
    nonlinear, rough = answer([[max(free, less)]], name="n"), answer([[min(free, less)]], name="r")
    if nonlinear.worst > rough.worst:
        found = better_of(nonlinear, rough, "linear")
        assert found.identified.model == "r" and list(found.believed) == [found.identified.model]


@pytest.mark.parametrize("late", [Actuator(0.02, 0), Actuator(0.0, 1)])
def test_only_a_linear_law_that_is_late_stands_in_for_what_no_law_explains(late):
    assert stands_in(identified_as("r", late))
    assert not stands_in(identified_as("r"))
    assert not stands_in(identified_as("n", late, remarks=()))
