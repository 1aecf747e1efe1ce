"""Evolved terms: a law that no library holds is grown, nothing gets worse, and no sum is paid for by another."""

from dataclasses import replace

import numpy as np
import pytest

import twinloop as tl
from twinloop import _core
from twinloop._ground.elementary import log
from twinloop._ground.streams import Unit
from twinloop.identification.identify import identify_runs
from twinloop.identification.records import Run
from twinloop.identification.search import selection
from twinloop.identification.search.evolution import _drawn, _grown, _whole
from twinloop.identification.settings import IdentificationOptions
from twinloop.identification.terms.pool import Pool

SIGNALS = tl.Signals(
    states=[tl.State("angle", "rad", 1.0), tl.State("rate", "rad/s", 3.0, derivative_of="angle")],
    commands=[tl.Command("torque", "N m", bounds=(-2, 2))],
    dt=0.05,
)
NAMES = ["angle", "rate", "torque"]


def flown():
    """rate' = torque − 2 angle − 3 rate · angle², by small steps, read with noise."""
    stream, x = np.random.default_rng(3), np.array([0.5, 0.0])
    states, commands = [x], []
    for k in range(120):
        u = 1.5 * np.sin(0.2 * k) * np.cos(0.05 * k)
        for _ in range(200):
            x = x + 0.00025 * np.array([x[1], u - 2.0 * x[0] - 3.0 * x[1] * x[0] ** 2])
        states.append(x)
        commands.append([u])
    return Run.of(np.array(states) + 1e-4 * stream.standard_normal((121, 2)), np.array(commands))


def learnt(monkeypatch, **options):
    """What is identified, and description lengths before and after each evolution."""
    lengths, grow = [], selection.evolve

    def spy(problem, known, *rest, **how):
        found = grow(problem, known, *rest, **how)
        lengths.append(
            [
                (before.description_length, after.description_length)
                for before, after in zip(known, found, strict=True)
            ]
        )
        return found

    monkeypatch.setattr(selection, "evolve", spy)
    few = {
        "libraries": ("linear",),
        "moves": 2000,
        "committee_size": 2,
        "lags": False,
        "contacts": False,
        "friction": False,
        "form": "acceleration",
    }
    settings = IdentificationOptions(**{**few, **options})
    return identify_runs([flown()], SIGNALS, settings, workers=_core.Workers(1)), lengths


def force(found, angle, rate):
    """d rate / dt without a command."""
    pool, weights = found.pool, found.sums[0].weights
    values = pool.values(list(weights), np.array([[angle, rate, 0.0]]))[0]
    return float(values @ list(weights.values()))


def test_a_law_that_no_library_holds_is_grown_and_nothing_gets_worse(monkeypatch):
    grown, lengths = learnt(monkeypatch, generations=8, operators=("+", "-", "*"))
    assert lengths and all(after <= before for pairs in lengths for before, after in pairs)
    for angle, rate in ((0.4, 0.8), (-0.5, 1.0), (0.6, -0.5)):
        expected = -2.0 * angle - 3.0 * rate * angle**2
        assert force(grown, angle, rate) == pytest.approx(expected, abs=0.1)
    plain, none = learnt(monkeypatch, generations=0)
    assert none == lengths[:0] and abs(force(plain, -0.5, 1.0) - 0.25) > 0.2


@pytest.mark.parametrize("seed", range(5))
def test_new_nodes_use_the_operators_that_are_allowed(seed):
    pool, stream = Pool(3), Unit(seed, (0,)).stream("terms")
    drawn = {_drawn(pool, [0, 1, 2, pool.one], ("min",), stream, SIGNALS) for _ in range(300)} - {None}
    texts = {pool.text(node, NAMES) for node in drawn}
    assert texts and not any(word in text for text in texts for word in ("/", "sin", "Max", "exp"))
    assert any("Min(" in text for text in texts)


@pytest.mark.parametrize("seed", range(3))
def test_no_new_quotient_is_infinite_in_the_room_of_its_inputs(seed):
    pool, stream, within = Pool(3), Unit(seed, (0,)).stream("terms"), ((0.0, 1.2), (-4.0, 4.0), (-1.0, 1.0))
    options = IdentificationOptions(operators=("+", "-", "/", "abs", "cos"), population=150)
    parents = [0, 1, 2, pool.one]
    for k in range(1, 4):
        parents = _grown(pool, parents, replace(options, population=150 * k), stream, SIGNALS, within)
    below = {pool[node].operands[1] for node in pool.needed(parents) if pool[node].operation == "/"}
    # The corners, and anywhere between them; a state may come near 0, a command may be 0.
    rows = np.random.default_rng(seed).uniform(*np.array(within).T, (2000, 3))
    corners = np.array(np.meshgrid((2e-3, 1.2), (-4.0, 0.0, 4.0), (-1.0, 0.0, 1.0))).reshape(3, -1).T
    values = pool.values(sorted(below), np.vstack([rows, corners]))
    assert len(below) > 5 and ((values > 0.0).all(axis=0) | (values < 0.0).all(axis=0)).all()
    # What was there before stays, such as the root of a level with its sign.
    root = pool.add("/", 1, pool.add("sqrt", 1))
    assert root in _grown(pool, [0, root], replace(options, population=20), stream, SIGNALS, within)


class Found:
    def __init__(self, **weights):
        self.weights = {int(node[1:]): weight for node, weight in weights.items()}


def test_a_whole_sum_is_one_node_at_the_price_of_one_choice_and_none_that_uses_such_a_node():
    pool, taken = Pool(3), set()
    ((node, price),) = _whole(pool, Found(n0=2.0, n2=-0.5), taken).items()
    assert price == float(log(4)) and taken == {node}
    rows = np.random.default_rng(0).normal(size=(9, 3))
    np.testing.assert_allclose(
        pool.values([node], rows)[:, 0], 2.0 * rows[:, 0] - 0.5 * rows[:, 2], rtol=1e-13
    )
    user = pool.product(node, 1)
    assert _whole(pool, Found(**{f"n{user}": 1.0, "n1": 1.0}), taken) == {}
    assert _whole(pool, Found(n1=1.0), taken) == {} and taken == {node}
