"""Fitting drops outliers, weak terms and terms of too few readings, each unless it is switched off."""

from dataclasses import replace

import numpy as np
import pytest

import twinloop as tl
from twinloop import _core
from twinloop._ground.streams import Unit
from twinloop.identification.context import Context
from twinloop.identification.fit import fitting
from twinloop.identification.fit.fitting import fitted
from twinloop.identification.records import Run
from twinloop.identification.search.selection import from_both_sides
from twinloop.identification.settings import IdentificationOptions
from twinloop.identification.starts import ANEW, begun

DT, NOISE, WRONG = 0.05, 0.01, 70
SIGNALS = tl.Signals([tl.State("speed", "m/s", 2.0)], [tl.Command("u", "1", (-1.0, 1.0), scale=1.0)], DT)
OPTIONS = IdentificationOptions(libraries=("linear",), generations=0, moves=2000, support=False)


@pytest.fixture(scope="module")
def run():
    """Of d speed / dt = −0.8 speed + 3 u: read with noise, and once wrongly by thirty times that."""
    stream = np.random.default_rng(1)
    commands = np.repeat(stream.uniform(-1.0, 1.0, (25, 1)), 8, axis=0)
    keeps, states = np.exp(-0.8 * DT), [0.0]
    for (u,) in commands:
        states.append(keeps * states[-1] + (1.0 - keeps) / 0.8 * 3.0 * u)
    readings = np.array(states)[:, np.newaxis] + NOISE * stream.standard_normal((201, 1))
    readings[WRONG] += 30.0 * NOISE
    return tl.Trajectory(DT * np.arange(201), readings, commands)


def hypothesis_of(run, **options):
    """A fitted hypothesis of a run that has a term too many, the constant."""
    given = replace(OPTIONS, **options)
    context = Context(
        [Run.of(run.states, run.commands).continued(SIGNALS)], SIGNALS, given, Unit(0), _core.Workers(1)
    )
    found = from_both_sides(context, begun(context, "acceleration", context.first_pool(), ANEW))
    (sum_,) = found.sums
    return fitted(
        context, replace(found, sums=(replace(sum_, weights={found.pool.one: 0.0, **sum_.weights}),))
    )


@pytest.mark.parametrize("drops", [True, False])
def test_a_reading_that_predictions_miss_is_ignored(run, drops):
    (found,) = hypothesis_of(run, outliers=drops).runs
    assert np.flatnonzero(found.weights[:, 0] == 0.0).tolist() == ([WRONG] if drops else [])


@pytest.mark.parametrize("drops", [True, False])
def test_a_term_that_does_not_pay_is_dropped(run, drops):
    found = hypothesis_of(run, pruning=drops)
    assert (found.pool.one in found.sums[0].weights) is not drops
    assert len(found.sums[0].weights) == (2 if drops else 3)


@pytest.mark.parametrize("drops", [True, False])
def test_terms_are_held_against_the_readings_that_they_share(run, monkeypatch, drops):
    asked = []

    def supported(context, hypothesis):
        asked.append(hypothesis)
        return hypothesis

    monkeypatch.setattr(fitting, "supported", supported)
    hypothesis_of(run, support=drops)
    assert bool(asked) is drops
