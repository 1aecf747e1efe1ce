"""Lags and delays that actuators have are found, and those that act at once are believed to after few trials."""

import numpy as np
import pytest

import twinloop as tl
from twinloop import _core
from twinloop._ground.streams import Unit
from twinloop.campaign.presets import options_of
from twinloop.identification.context import Context
from twinloop.identification.proposals import lags as module
from twinloop.identification.records import Run
from twinloop.identification.search.selection import from_both_sides
from twinloop.identification.starts import ANEW, begun

DT = 0.05
SIGNALS = tl.Signals(
    [tl.State("speed", "m/s", 1.0)],
    [tl.Command("valve", "1", (-1.0, 1.0))],
    DT,
)
REST = np.array([-0.6])


def driven(lag, delay, seed, rest=None, steps=160):
    """A mass with d speed / dt = 2 effect - 0.7 speed; ten exact steps a period."""
    stream = np.random.default_rng(seed)
    commands = np.repeat(stream.uniform(-1.0, 1.0, steps // 8), 8)
    before = commands[0] if rest is None else rest
    sent = np.concatenate([np.full(delay, before), commands])
    speed, effect, rows, step = 0.0, before, [0.0], DT / 10.0
    for k in range(steps):
        for _ in range(10):
            last = effect
            effect = sent[k] if lag == 0.0 else sent[k] + (last - sent[k]) * np.exp(-step / lag)
            middle = 0.5 * (last + effect) if lag else effect
            settled = 2.0 * middle / 0.7
            speed = settled + (speed - settled) * np.exp(-0.7 * step)
        rows.append(speed)
    readings = np.array(rows)[:, np.newaxis] + 2e-3 * stream.normal(size=(steps + 1, 1))
    return Run.of(readings, commands[:, np.newaxis])


def proposed(runs, rests=(), **changes):
    """What lags gives of a law that was found behind commands which act at once, and how often it searched."""
    options = options_of("default", {"generations": 0, "moves": 2000, "libraries": ("linear",), **changes})
    context = Context(runs, SIGNALS, options, Unit(0), _core.Workers(1), rests=rests)
    first = from_both_sides(context, begun(context, "acceleration", context.first_pool(), ANEW))
    return list(module.lags(context, first))


@pytest.fixture
def searched(monkeypatch):
    """Searches that lags makes: the sums that each one knew."""
    known = []
    search = module.search

    def counted(problem, chains, terms, sums, walks):
        known.append(list(sums))
        return search(problem, chains, terms, sums, walks)

    monkeypatch.setattr(module, "search", counted)
    return known


@pytest.mark.parametrize("rest", [None, -0.6])
@pytest.mark.parametrize(("lag", "delay"), [(0.15, 0), (0.04, 0), (0.0, 2), (0.12, 3)])
def test_an_actuator_is_found_with_where_it_rests(lag, delay, rest):
    runs = [driven(lag, delay, seed, rest) for seed in range(2)]
    (found,) = proposed(runs, [REST])
    (actuator,) = found.actuation.actuators
    # Lags are of a grid here; they are tuned later.
    assert actuator.delay * DT + actuator.lag == pytest.approx(delay * DT + lag, rel=0.25)
    assert actuator.delay == delay or lag
    assert actuator.rest == rest


def test_commands_that_act_at_once_are_believed_to_after_few_trials(searched):
    assert proposed([driven(0.0, 0, seed) for seed in range(2)], [REST]) == []
    # At once, once more beside that, one lag, each delay, and the fastest limit of the rate, from both rests.
    assert len(searched) <= 2 + 2 * (1 + 2) + 2


def test_a_trial_knows_what_was_found_before(searched):
    proposed([driven(0.15, 0, seed) for seed in range(2)])
    first, *others = searched
    assert first == [None] and all(known != [None] for known in others)
