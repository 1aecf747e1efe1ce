"""Terms that nearly cancel have to pay for their size; a balance and a large term that is right do not."""

import numpy as np
import pytest

import twinloop as tl
from twinloop import _core
from twinloop._ground.streams import Unit
from twinloop.campaign.presets import options_of
from twinloop.identification.context import Context
from twinloop.identification.records import Run
from twinloop.identification.search.moderation import TIMES, precisions
from twinloop.identification.search.problem import Problem
from twinloop.identification.search.selection import from_both_sides
from twinloop.identification.starts import ANEW, begun

DT = 0.02
SIGNALS = tl.Signals(
    [tl.State("angle", "rad", 1.0), tl.State("rate", "rad/s", 4.0, derivative_of="angle")],
    [tl.Command("torque", "N m", (-4.0, 4.0), scale=2.0)],
    DT,
)


def swinging(seed, noise, steps=150, moved=0.3):
    """A pendulum that swings gently: on it an angle and its sine are hardly two."""
    stream = np.random.default_rng(seed)
    commands = np.repeat(moved * stream.normal(size=(steps // 10, 1)), 10, axis=0)
    state, states = np.array([0.2, 0.0]), []
    for command in commands[:, 0]:
        states.append(state)
        for _ in range(10):  # Euler's steps of 2 ms are fine enough
            rate = -9.0 * np.sin(state[0]) - 0.3 * state[1] + 2.0 * command
            state = state + 0.1 * DT * np.array([state[1] + 0.05 * DT * rate, rate])
    readings = np.array([*states, state]) + noise * np.array([0.1, 1.0]) * stream.normal(size=(steps + 1, 2))
    return Run.of(readings, commands)


def hypothesis(runs, **options):
    context = Context(
        runs, SIGNALS, options_of("default", {"moves": 4000, **options}), Unit(0), _core.Workers(1)
    )
    return context, begun(context, "acceleration", context.first_pool(), ANEW)


def test_the_prior_is_as_wide_as_what_moves_the_chain_in_units_of_what_a_term_moves():
    run = swinging(0, 1e-4)
    context, first = hypothesis([run])
    problem, (chain,) = Problem(context, first), first.driven
    terms = problem.usable([first.pool.one, 0, 1])
    found = precisions(problem, chain, terms)
    assert found[0] == 0.0  # a constant moves nothing to and fro
    slopes = np.diff(run.states[:, 1]) / DT
    expected = [run.states[:, place].var() / (TIMES**2 * slopes.var()) for place in (0, 1)]
    np.testing.assert_allclose(found[1:], expected, rtol=0.02)  # terms are taken in the middle of periods
    context, plain = hypothesis([run], moderation=False)
    assert not precisions(problem, plain.driven[0], terms).any()


@pytest.mark.parametrize("seed", range(4))
def test_no_term_is_many_times_what_moves_the_chain(seed):
    run = swinging(seed, 0.02)
    context, first = hypothesis([run])
    found = from_both_sides(context, first)
    problem = Problem(context, found)
    (sum_,) = found.sums
    parts = problem.values(problem.usable(list(sum_.weights)))[1] * np.array(list(sum_.weights.values()))
    together = parts.sum(axis=1).std()
    assert (parts.std(axis=0) < 5.0 * together).all()


def test_a_reading_that_jumps_does_not_widen_the_prior():
    run = swinging(3, 1e-3)
    spoilt = run.states.copy()
    spoilt[40, 1] += 40.0
    chains = [hypothesis([Run.of(states, run.commands)])[1].driven[0] for states in (run.states, spoilt)]
    assert chains[1].moved == pytest.approx(chains[0].moved, rel=0.5)


def test_a_large_term_that_is_right_is_found():
    # 30 g held by a thrust of 30 g: each is a thousand times what is left of both, and they do not cancel by chance.
    stream = np.random.default_rng(3)
    signals = tl.Signals([tl.State("speed", "m/s", 1.0)], [tl.Command("thrust", "N", (0.0, 2.0))], DT)
    commands = 1.0 + 1e-3 * np.repeat(stream.normal(size=(30, 1)), 10, axis=0)
    slopes = 300.0 * commands[:, 0] ** 2 - 300.0
    states = np.concatenate([[0.0], np.cumsum(DT * slopes)])[:, np.newaxis]
    run = Run.of(states + 1e-4 * stream.normal(size=states.shape), commands)
    context = Context([run], signals, options_of("default", {"moves": 4000}), Unit(0), _core.Workers(1))
    found = from_both_sides(context, begun(context, "acceleration", context.first_pool(), ANEW))
    (sum_,) = found.sums
    problem = Problem(context, found)
    values = problem.values(problem.usable(list(sum_.weights)))[1]
    predicted = (values * np.array(list(sum_.weights.values()))).sum(axis=1)
    assert np.abs(predicted - slopes).max() < 0.05 * np.abs(slopes).max()


def test_a_command_that_is_switched_to_and_fro_is_one_term_and_not_two_halves():
    # Of such a command u and |u| u are the same, and two halves of a term would be cheaper than the whole.
    stream = np.random.default_rng(4)
    signals = tl.Signals([tl.State("speed", "m/s", 1.0)], [tl.Command("push", "N", (-1.0, 1.0))], DT)
    commands = np.where(np.arange(300) % 2 == 0, 1.0, -1.0)[:, np.newaxis] * np.sign(
        np.repeat(stream.normal(size=(30, 1)), 10, axis=0)
    )
    speeds = [0.0]
    for push in commands[:, 0]:
        speeds.append(speeds[-1] + DT * (9.0 * push - 0.5 * speeds[-1]))
    readings = np.array(speeds)[:, np.newaxis] + 0.01 * stream.normal(size=(301, 1))
    context = Context(
        [Run.of(readings, commands)],
        signals,
        options_of("default", {"moves": 4000}),
        Unit(0),
        _core.Workers(1),
    )
    found = from_both_sides(context, begun(context, "acceleration", context.first_pool(), ANEW))
    terms = {found.pool.text(node, ["v", "u"]) for node in found.sums[0].weights}
    assert "u" in terms and not any("abs" in term for term in terms)
