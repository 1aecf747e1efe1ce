"""Each check on both sides of its limit; the limits are written out, so that one that moves is seen."""

import copy
import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

import lives
import twinloop as tl
from conftest import pendulum_step
from twinloop.campaign.examination import examination
from twinloop.campaign.examination.checking import checks
from twinloop.campaign.examination.delay_borne import MOST, periods_borne
from twinloop.campaign.examination.examination import Examination
from twinloop.campaign.examination.unseen import followed
from twinloop.law.actuation import delayed
from twinloop.remarks import serious


@pytest.fixture(scope="module")
def good():
    return lives.learnt(pendulum_step, 4)


@pytest.fixture
def found(good):
    return good.examine()


def check_of(found, name):
    (check,) = (check for check in checks(found) if check.name == name)
    return check


def refusing(found):
    return {check.name for check in checks(found).failed}


def last_unseen(found, **changes):
    found.unseen = (dataclasses.replace(found.unseen[-1], **changes),)


def correlated(name):
    def change(found, outside):
        setattr(found, name, SimpleNamespace(outside=outside))

    return change


def margins(**names):
    """A change of the worst margins of the only loop."""

    def change(found, value):
        (loop,) = found.margins.worst
        worst = dataclasses.replace(loop, **{name: value * unit for name, unit in names.items()})
        found.margins = dataclasses.replace(found.margins, worst=(worst,))

    return change


def periods_of_the_flight(found, periods):
    margins(delay=1.0)(found, math.inf)
    found.delay_borne = periods


def risky(found, risk):
    found.best = dataclasses.replace(found.best, risk=risk)


def diverging(found, risk):
    bare = [dataclasses.replace(state, envelope=None) for state in found.signals.states]
    found.signals = tl.Signals(bare, found.signals.commands, found.signals.dt)
    risky(found, risk)


LIMITS = [
    ("movement", lambda found, most: setattr(found, "movement", ("rate", most)), 10.0, 9.99, "look"),
    ("unseen-flight", lambda found, error: last_unseen(found, error=error), 0.1, 0.101, "failed"),
    ("unseen-flight", lambda found, error: last_unseen(found, error=error), 0.0, math.inf, "failed"),
    ("band", lambda found, inside: last_unseen(found, inside=inside), 0.75, 0.749, "failed"),
    ("whiteness", correlated("autocorrelation"), 0.1, 0.101, "failed"),
    ("commands", correlated("crosscorrelation"), 0.1, 0.101, "failed"),
    ("stable", margins(stable=1), True, False, "failed"),
    ("sensitivity", margins(sensitivity=1.0), 2.0, 2.01, "look"),
    ("sensitivity", margins(sensitivity=1.0), 1.0, 4.01, "failed"),
    ("delay", margins(delay=lives.SIGNALS.dt), 1.0, 0.99, "failed"),
    ("delay", periods_of_the_flight, 1, 0, "failed"),
    ("envelope", risky, 0.05, 0.051, "failed"),
    ("divergence", diverging, 0.05, 0.051, "failed"),
]


@pytest.mark.parametrize(
    ("name", "change", "inside", "beyond", "verdict"), LIMITS, ids=[f"{each[0]} {each[3]}" for each in LIMITS]
)
def test_a_check_passes_up_to_its_limit_and_not_beyond(found, name, change, inside, beyond, verdict):
    change(found, inside)
    assert check_of(found, name).verdict == "passed" and name not in refusing(found)
    change(found, beyond)
    assert check_of(found, name).verdict == verdict
    assert (name in refusing(found)) == (verdict == "failed")


@pytest.mark.parametrize(
    ("miss", "verdict"),
    [(4.0, "passed"), (-4.0, "passed"), (4.01, "failed"), (-4.01, "failed"), (math.inf, "failed")],
)
def test_the_last_quality_may_miss_by_four_spreads_to_either_side(found, monkeypatch, miss, verdict):
    monkeypatch.setattr(Examination, "last_miss", property(lambda found: miss))
    assert check_of(found, "quality").verdict == verdict
    assert ("quality" in refusing(found)) == (verdict == "failed")


def test_a_twin_that_does_not_follow_and_a_serious_remark_each_forbid(found):
    found.twin = copy.copy(found.twin)
    found.twin.remarks = (serious("free-run", "It misses angle."),)
    assert check_of(found, "remarks").verdict == "failed" and "remarks" in refusing(found)
    assert "It misses angle." in check_of(found, "remarks").sentence
    found.twin.follows = False
    assert check_of(found, "follows").verdict == "failed" and "follows" in refusing(found)


def test_the_delay_that_a_flight_bears_is_what_each_member_bears_that_flies_it_at_all(good):
    twin, test = good.twin, good.best_test.quiet()
    alone = periods_borne([twin.model], test, twin.limits)
    assert 1 < alone < MOST
    late = delayed(twin.model, test.signals, 1)
    assert periods_borne([twin.model, late], test, twin.limits) == alone - 1


def test_the_whole_committee_is_asked_which_delay_it_bears(found, monkeypatch):
    asked = []
    monkeypatch.setattr(examination, "periods_borne", lambda models, test, limits: asked.append(models) or 7)
    assert found.delay_borne == 7
    assert asked == [[found.twin.model, *found.twin.members]] and len(found.twin.members) > 1


def test_readings_of_a_flight_that_the_twin_did_not_live_to_see_are_outside_its_band(good):
    flown, twin = good.experiments[-1].trajectory, good.twin
    rows = flown.steps // 2 + 1
    wide = np.stack([flown.states[:rows] - 1.0, flown.states[:rows] + 1.0])
    short = tl.Trajectory(flown.t[:rows], flown.states[:rows], flown.commands[: rows - 1], band=wide)
    rmse, _, inside = followed(twin, flown, short)
    assert np.isinf(rmse).all() and inside == pytest.approx((rows - 1) / flown.steps)
