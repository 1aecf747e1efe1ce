"""Evidence puts hypotheses in an order, and what they hold beside terms has to pay."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twinloop.identification import searches
from twinloop.identification.description import TIE
from twinloop.identification.evidence import (
    HIDING,
    LAGGING,
    STANDING_IN,
    STEPPING,
    STORING,
    Evidence,
    by_evidence,
    price,
)
from twinloop.identification.searches import Found, decided, explored, lead
from twinloop.law.actuation import Actuation, Actuator, HiddenState

LENGTHS = st.one_of(st.floats(-1e4, 1e4), st.sampled_from([0.0, 0.5 * TIE, 2.0 * TIE, -0.5 * TIE]))
EVIDENCE = st.builds(Evidence, st.booleans(), st.booleans(), st.booleans(), LENGTHS)
AT_ONCE, LATE = Actuation((Actuator(), Actuator())), Actuation((Actuator(), Actuator(0.1, 0, None)))
BOTH_LATE = Actuation((Actuator(0.1), Actuator(0.1)))
APART, TOGETHER = ((0,), (1,)), ((0, 1),)
CLIMB = (HiddenState((0, 1), True, None, 2.0),)
TWIST = HiddenState((), False, 0.0, 2.0, (1,))
PUSHED = (HiddenState((0,), False, 0.0, 2.0), TWIST)
STATES = 3


@given(EVIDENCE, EVIDENCE, EVIDENCE)
def test_to_beat_is_a_strict_order(one, two, three):
    assert not one > one
    assert not (one > two and two > one)
    if one > two and two > three:
        assert one > three


class Named:
    def __init__(self, name, evidence):
        self.name, self.evidence = name, evidence


@given(st.lists(EVIDENCE, min_size=1, max_size=6))
def test_nobody_beats_the_strongest_and_it_is_the_first_of_its_kind(several):
    named = [Named(i, evidence) for i, evidence in enumerate(several)]
    best = max(named, key=by_evidence)
    assert not any(other.evidence > best.evidence for other in named)
    assert best.name == 0 or best.evidence > named[0].evidence
    # What does not beat it may as well not have been proposed, wherever it stood behind.
    assert max([best, *(other for other in named if other is not best)], key=by_evidence) is best


def evidence(length=0.0, **changes):
    known = {"fitted": True, "stable": True, "smoothed": False, "length": length}
    return Evidence(**{**known, **changes})


def test_what_runs_away_beats_nothing_that_was_fitted_and_what_lasts_beats_it():
    away = evidence(-1e9, stable=False)
    assert evidence(1e9) > away and not away > evidence(1e9)
    assert not away > evidence(0.0, stable=False) and not evidence(0.0, stable=False) > away
    assert not evidence(-1e9, stable=False, smoothed=True) > away


def test_lengths_of_smoothed_states_and_of_readings_do_not_compare():
    assert evidence(5.0, smoothed=True) > evidence(0.0)
    assert evidence(-1.0, smoothed=True) > evidence(0.0, smoothed=True)
    assert not evidence(1.0, smoothed=True) > evidence(0.0, smoothed=True)


@dataclass(frozen=True)
class Started:
    evidence: Evidence
    start: int
    searches: int = 1
    terms: int = 1
    fit: None = None


def test_a_law_that_has_to_be_ahead_is_believed_only_where_it_is():
    def hypothesis(length, start, **changes):
        return Started(evidence(length, **changes), start)

    known = [hypothesis(0.0, 10), hypothesis(40.0, 10)]
    for length, ahead, believed in ((-25.0, 0.0, 0), (-25.0, 30.0, 10), (-35.0, 30.0, 0), (5.0, 0.0, 10)):
        anew = hypothesis(length, 0)
        found = decided(Found(anew), known, ahead=ahead)
        assert found.best.start == believed
        assert list(found.rivals) == (known if believed == 0 else known[1:])
    # Each term more than the known law has needs its own lead; what has as many terms, or fewer, needs none.
    for more, ahead in ((3, 36.0), (1, 12.0), (0, 0.0), (-2, 0.0)):
        weaker, stronger = Started(evidence(9.0), 10, terms=40), Started(evidence(1.0), 10, terms=5)
        assert lead(Started(evidence(), 0, terms=5 + more), [weaker, stronger]) == ahead
    assert lead(hypothesis(0.0, 0), []) == 0.0
    # One that runs away is worth nothing, however far it is ahead.
    assert decided(Found(hypothesis(-1e6, 0, stable=False)), known, ahead=30.0).best.start == 10


@pytest.mark.parametrize(("length", "made"), [(120.0, 2), (80.0, 4)])
def test_nothing_further_is_proposed_of_readings_whose_first_fit_is_clearly_behind(length, made, monkeypatch):
    def proposing(one):
        return lambda context, best: [Started(one, 0)]

    fits = [evidence(length), evidence(length - 1e3), evidence(length - 2e3)]
    unfitted = replace(evidence(-1e6), fitted=False)
    monkeypatch.setattr(searches, "PROPOSALS", tuple(proposing(one) for one in (unfitted, *fits)))
    context, kept = SimpleNamespace(earlier=None, watch=lambda step: None), []
    start = Started(replace(evidence(0.0), fitted=False), 0)

    def found(other, before=()):
        kept.clear()
        (one,) = explored(context, [lambda: start], before, lambda so_far: kept.append(tuple(so_far)), other)
        return one

    whole = found(None)
    assert (whole.made, whole.first) == (4, length) and whole.best.evidence == fits[-1]
    # What is compared is the first fit of each, whatever has been found since.
    other = Found(Started(evidence(-1e9), 0), first=15.0)
    assert found(replace(other, first=None)).made == 4 and found(other).made == made
    # Where it was cut, it ends in the same place.
    for before in kept[:]:
        assert found(other, before).made == made


@pytest.mark.parametrize(
    ("form", "actuation", "expected"),
    [
        ("acceleration", AT_ONCE, 0.0),
        ("absolute", AT_ONCE, 0.0),
        ("increment", AT_ONCE, STEPPING),
        ("acceleration", LATE, LAGGING),
        ("acceleration", Actuation(LATE.actuators, CLIMB), LAGGING + HIDING),
        ("increment", Actuation(AT_ONCE.actuators, CLIMB), STEPPING + HIDING),
        # Two ways to begin, three states, two groups of commands or none beside them.
        ("acceleration", Actuation(AT_ONCE.actuators, (TWIST,)), HIDING + STORING + 2.0 * np.log(18.0)),
        ("acceleration", Actuation(AT_ONCE.actuators, PUSHED), HIDING + 2.0 * STORING + 2.0 * np.log(18.0)),
    ],
)
def test_what_is_there_beside_terms_is_paid_for(form, actuation, expected):
    assert price(form, actuation, APART, STATES) == pytest.approx(expected)


def test_a_tuned_hidden_state_that_commands_alone_fill_pays_for_standing_in():
    for hidden, paid in ((CLIMB, STANDING_IN), ((TWIST,), 0.0), (PUSHED, 0.0), ((), 0.0)):
        searched, tuned = (
            price("acceleration", Actuation(AT_ONCE.actuators, hidden), APART, STATES, tuned=tuned)
            for tuned in (False, True)
        )
        assert tuned - searched == pytest.approx(paid)


def test_such_a_state_pays_for_each_reading_and_one_that_motion_fills_does_not():
    # What a law that is not quite right leaves on every reading grows with them, and so does a part of it.
    for hidden, each in ((CLIMB, 0.02), ((TWIST,), 0.0), (PUSHED, 0.0), ((), 0.0)):
        actuation = Actuation(AT_ONCE.actuators, hidden)
        few, many = (
            price("acceleration", actuation, APART, STATES, tuned=True, readings=readings)
            for readings in (1000, 5000)
        )
        assert many - few == pytest.approx(each * 4000)
        assert price("acceleration", actuation, APART, STATES, readings=5000) == price(
            "acceleration", actuation, APART, STATES
        )


def test_each_group_of_commands_that_lags_pays_and_commands_of_one_group_pay_once():
    assert price("acceleration", BOTH_LATE, APART, STATES) == 2 * LAGGING
    assert price("acceleration", BOTH_LATE, TOGETHER, STATES) == LAGGING
    assert price("acceleration", LATE, TOGETHER, STATES) == LAGGING


def test_rounding_alone_decides_nothing():
    lengths = -1e5 + TIE * np.linspace(-0.4, 0.4, 5)
    named = [Named(i, evidence(length)) for i, length in enumerate(lengths)]
    assert max(named, key=by_evidence).name == 0
