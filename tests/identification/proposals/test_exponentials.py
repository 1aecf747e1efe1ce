"""What grows by a factor: a reaction with its temperature, a flow with the lift of a valve."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import twinloop as tl
from twinloop.identification.terms.exponentials import (
    RISES,
    WORTH,
    Exponential,
    entered,
    exponentials,
    origins,
)
from twinloop.identification.terms.pool import Pool

DT = 0.05
ENERGY = 8750.0
TANK = tl.Signals(
    [tl.State("substance", "mol/l", 0.5), tl.State("temperature", "K", 340.0)],
    [tl.Command("coolant", "K", (280.0, 350.0))],
    DT,
)
VALVE = tl.Signals([tl.State("level", "m", 1.0)], [tl.Command("lift", "1", (0.0, 1.0))], 0.5)


def reaction(temperature):
    """1/min."""
    return 7.2e10 * np.exp(-ENERGY / temperature)


def reacting(x, u):
    substance, temperature = x
    gone = reaction(temperature) * substance
    return [1.0 - substance - gone, 350.0 - temperature + 60.0 * gone + 2.0 * (u - temperature)]


def filling(x, u):
    return [0.04 * np.exp(3.9 * (u - 0.5)) - 0.12 * np.sqrt(max(x[0], 0.0))]


def flown(law, start, commands, signals, noise, seed):
    """A run that SciPy has integrated, read by noisy sensors."""
    states = [np.array(start)]
    for u in commands:
        states.append(
            solve_ivp(lambda t, x, u=u: law(x, u), (0.0, signals.dt), states[-1], rtol=1e-9, atol=1e-11).y[
                :, -1
            ]
        )
    noisy = np.array(states) + noise * np.random.default_rng(seed).standard_normal((len(states), len(start)))
    return tl.Trajectory(signals.dt * np.arange(len(states)), noisy, np.array(commands)[:, None])


def stepped(low, high, seed, count=80):
    """Commands that change every eighth period."""
    levels = np.random.default_rng(seed).uniform(low, high, count // 8)
    return np.repeat(levels, 8)


def missed(twin, law, start, commands, signals):
    """Error of a free run over how far the states move."""
    test = flown(law, start, commands, signals, [0.0] * len(start), 0)
    run = twin.simulate_commands(test.states[0], test.commands)
    return float(np.max(np.abs(run.states - test.states).max(axis=0) / np.ptp(test.states, axis=0)))


@pytest.fixture(scope="module")
def tank():
    runs = [
        flown(reacting, (0.8, 330.0), stepped(300.0, 345.0, seed), TANK, [1e-3, 0.03], seed)
        for seed in (1, 2)
    ]
    return runs, tl.identify(runs, TANK, seed=0)


def test_a_reaction_grows_with_its_temperature(tank):
    _, twin = tank

    law = twin.equations(5)

    # One exponential in both equations, exp(a - E / T): the share is in units of a temperature that was near.
    assert law.count("substance*t1") == 2 and law.count("exp(") == 1
    energies = [
        float(over) / float(share)
        for over, share in re.findall(r"exp\(-([0-9.]+)/\(([0-9.]+)\*temperature\)", law)
    ]
    assert energies == [pytest.approx(ENERGY, rel=0.03)]


def test_its_twin_follows_what_it_has_not_learnt(tank):
    runs, twin = tank
    commands = stepped(300.0, 345.0, 9)
    without = tl.identify(runs, TANK, seed=0, options={"exponentials": False})

    error = missed(twin, reacting, (0.8, 330.0), commands, TANK)

    assert error < 0.02
    assert error < 0.3 * missed(without, reacting, (0.8, 330.0), commands, TANK)


def test_a_valve_of_equal_percentage():
    runs = [flown(filling, (0.3,), stepped(0.1, 0.9, seed), VALVE, [1e-3], seed) for seed in (1, 2)]

    twin = tl.identify(runs, VALVE, seed=0)

    (rise,) = re.findall(r"exp\(([0-9.]+)\*lift", twin.equations(5))
    assert float(rise) == pytest.approx(3.9, rel=0.1)
    assert missed(twin, filling, (0.3,), stepped(0.1, 0.9, 9), VALVE) < 0.02


def test_what_does_not_grow_gets_none():
    def warming(x, u):
        return [0.9 - x[0] - 0.001 * x[0] * x[1], 350.0 - x[1] + 2.0 * (u - x[1]) - 20.0 * x[0]]

    runs = [
        flown(warming, (0.5, 330.0), stepped(300.0, 345.0, seed), TANK, [1e-3, 0.03], seed) for seed in (1, 2)
    ]

    assert "exp(" not in tl.identify(runs, TANK, seed=0).equations(4)


@pytest.mark.parametrize("unit", ["K", "degC"])
@pytest.mark.parametrize("beside", [None, 0, 2])
def test_an_exponential_is_what_it_says(unit, beside):
    signals = replace(TANK, states=(TANK.states[0], replace(TANK.states[1], unit=unit)))
    pool = Pool(3)
    rows = np.column_stack([np.linspace(0.2, 0.9, 7), np.linspace(320.0, 350.0, 7), np.linspace(0.9, 1.0, 7)])
    every = [one for one in exponentials(pool, signals, rows) if one.input == 1 and one.beside == beside]

    assert len(every) == len(RISES)
    for one, rise in zip(every, RISES, strict=True):
        values = pool.values([entered(pool, one, 1)], rows)[:, 0]
        along = one.at / rows[:, 1] - 1.0 if unit == "K" else (rows[:, 1] - one.at) / one.size
        expected = np.exp(one.rise * along) * (1.0 if beside is None else rows[:, beside])
        np.testing.assert_allclose(values, expected, rtol=1e-12)
        # Over the runs the exponent changes by as much as is asked, with the inverse of a temperature or with it.
        assert one.rise * (along.max() - along.min()) == pytest.approx(rise)
        assert one.at == pytest.approx(335.0)


def test_those_who_use_it_pay_for_it_together():
    one = Exponential(1, 2.0, 335.0, 335.0, True, beside=0)

    def costs(asked, tried, uses):
        pool = Pool(3)
        return pool.length(entered(pool, asked, tried, uses))

    beside = Pool(3).length(0) + np.log(2.0)
    assert costs(one.alone, 1, 1) == pytest.approx(WORTH)
    assert costs(one, 100, 1) == pytest.approx(beside + WORTH + np.log(100.0))
    assert costs(one, 100, 2) == pytest.approx(beside + 0.5 * (WORTH + np.log(100.0)))


def test_there_are_none_of_angles_rates_and_commands_of_two_signs():
    lever = tl.Signals(
        [tl.State("angle", "rad", 1.0), tl.State("rate", "rad/s", 1.0, derivative_of="angle")],
        [tl.Command("torque", "N m", (-1.0, 1.0))],
        DT,
    )

    assert exponentials(Pool(3), lever, np.random.default_rng(0).normal(size=(9, 3))) == []


def test_there_are_none_of_what_stood_still():
    rows = np.column_stack([np.full(5, 0.5), np.full(5, 330.0), np.full(5, 0.9)])

    assert exponentials(Pool(3), TANK, rows) == []


def test_where_it_is_one_is_no_constant_to_tune():
    pool = Pool(3)
    for inverse in (True, False):
        grown = entered(pool, Exponential(1, 2.0, 335.0, 335.0, inverse, beside=0), 1)
        (origin,) = origins(pool, [grown])
        assert pool[origin].operation == "+"
    # A sum that an exponential is not taken from is none of these.
    other = pool.add("exp", pool.product(pool.add("+", 0, 1.0), 1))
    assert origins(pool, [other]) == set()
    assert origins(pool, [pool.add("+", 0, 1.0)]) == set()
