"""What alike commands do together: read off a model, written as terms, and chosen where it is the shorter law."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import twinloop as tl
from oracles import same_bits
from twinloop import _core
from twinloop.campaign.presets import options_of
from twinloop.identification.identify import identify_runs
from twinloop.identification.records import Run
from twinloop.identification.search.directions import directions
from twinloop.identification.search.structure import Sum
from twinloop.identification.sensors.chains import chains
from twinloop.identification.terms.candidates import Candidates
from twinloop.identification.terms.directions import of_mixer, terms_of, together, unequal
from twinloop.identification.terms.pool import Pool

WORKERS = _core.Workers()
FAST = {
    "moves": 2000, "starts": 2, "generations": 0, "lags": False, "committee_size": 3, "tuning_steps": 8,
}  # fmt: skip
ROTOR = {"unit": "1", "bounds": (0.0, 2.0), "scale": 1.0}
RUDDER = {"unit": "rad", "bounds": (-1.0, 1.0), "scale": 1.0}


def machine(count, outputs=1):
    """Signals of speeds under rotors that are alike and a rudder that is not."""
    states = [tl.State(f"speed_{i}", "rad/s", 5.0) for i in range(outputs)]
    rotors = [tl.Command(f"rotor_{i}", **ROTOR) for i in range(count)]
    return tl.Signals(states, [*rotors, tl.Command("rudder", **RUDDER)], 0.02)


def problem_of(pool, rows, fixed=None):
    """As much of a problem as directions are read from."""
    stages = SimpleNamespace(start=rows)
    return SimpleNamespace(pool=pool, stages=stages, priors=SimpleNamespace(fixed=fixed or {}, bounds={}))


def driven(signals, count):
    return chains(signals, "acceleration", np.ones(signals.n_x))[:count]


# Read off a model


@given(st.lists(st.floats(-10.0, 10.0), min_size=3, max_size=3), st.floats(0.1, 1.9))
def test_a_direction_is_the_rounded_gradient_of_a_sum(weights, level):
    signals, pool = machine(3), Pool(5)
    rows = np.tile([0.3, level, level, level, 0.2], (4, 1))
    law = {pool.product(i, i): weight for i, weight in zip((1, 2, 3), weights, strict=True)}
    law[pool.product(0, 4)] = 7.0
    [chain] = driven(signals, 1)
    found = directions(problem_of(pool, rows), [Sum(law, 0.0, chain)], signals)
    # All alike is there in any case, and the rudder nowhere.
    assert ((1, 1.0), (2, 1.0), (3, 1.0)) in found
    gradient = 2.0 * level * np.array(weights)
    largest = np.abs(gradient).max()
    shares = gradient / largest if largest > 0.0 else np.zeros(3)
    near = np.abs(np.abs(shares)[:, None] - [0.1, 0.8]).min()
    if near < 1e-6 or (np.abs(shares) >= 0.1).sum() < 2:
        assert len(found) <= 2
        return
    [read] = [d for d in found if d != ((1, 1.0), (2, 1.0), (3, 1.0))] or found
    assert [place for place, _ in read] == [i + 1 for i in range(3) if abs(shares[i]) >= 0.1]
    assert read[0][1] > 0.0
    sign = np.sign(shares[read[0][0] - 1])
    for place, share in read:
        exact = sign * shares[place - 1]
        assert abs(share - exact) <= (0.2 if abs(exact) >= 0.8 else 0.05) + 1e-9


def test_what_is_fixed_counts_and_what_is_not_finite_gives_no_direction():
    signals, pool = machine(2), Pool(4)
    rows = np.tile([0.3, 1.0, 1.0, 0.2], (4, 1))
    [chain] = driven(signals, 1)
    difference = pool.add("-", 1, 2)
    both = ((1, 1.0), (2, 1.0))
    fixed = {chain.states[0]: [difference]}
    assert directions(problem_of(pool, rows), [Sum({0: 1.0}, 0.0, chain)], signals) == [both]
    assert directions(problem_of(pool, rows, fixed), [Sum({0: 1.0}, 0.0, chain)], signals) == [
        ((1, 1.0), (2, -1.0)),
        both,
    ]
    endless = pool.add("exp", pool.add("*", 1, 1e6))
    assert directions(problem_of(pool, rows), [Sum({endless: 1.0}, 0.0, chain)], signals) == [both]
    assert directions(problem_of(pool, rows), [], machine(1)) == []


@given(st.lists(st.sampled_from([-1.0, -0.3, 0.5, 1.0]), min_size=2, max_size=4))
def test_terms_of_a_direction_are_it_its_squares_and_it_times_each_state(shares):
    signals = machine(len(shares), outputs=2)
    pool = Pool(signals.n_x + signals.n_u)
    direction = ((2, 1.0), *((3 + i, share) for i, share in enumerate(shares[1:])))
    rows = np.random.default_rng(1).normal(size=(20, pool.inputs))
    linear = sum(share * rows[:, place] for place, share in direction)
    squares = sum(share * rows[:, place] ** 2 for place, share in direction)
    terms = terms_of(pool, direction, range(signals.n_x))
    values = pool.values(list(terms), rows)
    expected = np.stack([linear, squares, rows[:, 0] * linear, rows[:, 1] * linear], axis=1)
    np.testing.assert_allclose(values, expected, rtol=1e-12, atol=1e-12)
    for term, plain in terms.items():
        # What a bound of a plain term must keep out: all that a term is made of.
        parts = pool.values(plain, rows) @ np.array([share for _, share in direction])
        np.testing.assert_allclose(parts, pool.values([term], rows)[:, 0], rtol=1e-12, atol=1e-12)
    assert together(pool, direction) == next(iter(terms))


def test_a_direction_is_written_as_a_person_would():
    pool, symbols = Pool(5), ["x", *(f"u{i}" for i in range(1, 5))]
    yaw = together(pool, ((1, 1.0), (2, -1.0), (3, 1.0), (4, -0.5)))
    assert pool.text(yaw, symbols) == "u1 - u2 + u3 - 0.5*u4"
    assert pool.text(pool.product(0, yaw), symbols) == "x*u1 - x*u2 + x*u3 - 0.5*x*u4"
    assert pool.text(pool.add("-", 0, yaw), symbols) == "x - u1 + u2 - u3 + 0.5*u4"


# Said by a mixer


def test_axes_that_move_alike_commands_are_directions():
    signals = machine(4)
    x = [[1, -1, 1, 0, 1], [1, -1, -1, 0, 0], [1, 1, 1, 0, 0], [1, 1, -1, 0, 0], [0, 0, 0, 1, 1]]
    # The rudder alone is a plain command, and with a rotor no direction of alike ones; an axis turned is the same.
    columns = np.column_stack([np.array(x, dtype=float), [3.0, 3.0, -3.0, -3.0, 0.0]])
    both, roll, pitch = of_mixer(columns, signals)
    assert both == ((1, 1.0), (2, 1.0), (3, 1.0), (4, 1.0))
    assert roll == ((1, 1.0), (2, 1.0), (3, -1.0), (4, -1.0))
    assert pitch == ((1, 1.0), (2, -1.0), (3, 1.0), (4, -1.0))


def test_shares_of_a_mixer_are_exact_and_cost_nothing():
    signals, pool = machine(2), Pool(4)
    [own] = of_mixer(np.array([[-0.5], [1.5], [0.0]]), signals)
    assert own == ((1, 1.0 / 3.0), (2, -1.0))
    bare = Candidates.of(pool, signals, options_of("default", FAST), "acceleration")
    told, read = bare.with_directions([own], exact=True), bare.with_directions([own])
    node = together(told.pool, own)
    assert node in told.ladder[0] and node not in bare.ladder[0]
    assert read.pool.found[node] - told.pool.found[node] == pytest.approx(pool.further)
    # Itself and its squares.
    assert len(told.ladder[0]) == len(bare.ladder[0]) + 2


# Chosen


def flown(gains, runs=2, noise=1e-3, cross=0.0, seed=3):
    """Rotors turn a body against each other, and what they do together acts on a second speed, too."""
    signals, stream, found = machine(len(gains), outputs=2), np.random.default_rng(seed), []
    gains = np.array(gains)
    for _ in range(runs):
        rotors = np.repeat(stream.uniform(0.2, 1.8, (15, len(gains))), 10, axis=0)
        rudder = np.repeat(stream.uniform(-1.0, 1.0, (30, 1)), 5, axis=0)
        speed, other, states = 0.0, 0.0, [[0.0, 0.0]]
        for u, d in zip(rotors, rudder[:, 0], strict=True):
            for _ in range(50):
                turned = float(np.sign(gains) @ u)
                speed, other = (
                    speed + 0.02 / 50 * (float(gains @ u**2) - 1.5 * speed),
                    other + 0.02 / 50 * (4.0 * d - 2.0 * other + cross * speed * turned),
                )
            states.append([speed, other])
        readings = np.array(states)
        commands = np.hstack([rotors, rudder])
        found.append(Run.of(readings + noise * stream.normal(size=readings.shape), commands))
    return signals, found


def learnt(flights, axes=(), **changes):
    signals, runs = flights
    options = options_of("default", {**FAST, "form": "acceleration", **changes})
    return identify_runs(runs, signals, options, rests=[np.ones(signals.n_u)], axes=axes, workers=WORKERS)


def slopes(found, gains, speed=0.4):
    """Half the slope of the first output in each rotor at 1, by differences."""
    n = len(gains)
    row = np.concatenate([[speed, 0.1], np.ones(n), [0.1]])
    rows = np.repeat(row[None], 2 * n, axis=0)
    for i in range(n):
        rows[2 * i, 2 + i] += 1e-3
        rows[2 * i + 1, 2 + i] -= 1e-3
    out = found.model.program.run(rows)[:, 0]
    return (out[::2] - out[1::2]) / 4e-3


GYRO = (6.0, -6.0, 6.0, -6.0)


def test_what_rotors_do_together_is_one_term_in_squares_and_times_a_speed():
    flights = flown(GYRO, cross=0.3)
    found, plain = learnt(flights), learnt(flights, directions=False)
    assert [len(s.weights) for s in found.sums] == [2, 3]
    assert found.description_length < plain.description_length - 40.0
    np.testing.assert_allclose(slopes(found, GYRO), GYRO, rtol=0.01)
    assert found.terms <= plain.terms


@pytest.mark.parametrize("gains", [(6.0, -5.4), (6.0, -4.5), (6.0, -5.4, 6.6, -6.0)])
def test_rotors_that_are_not_equal_are_told_apart(gains):
    found = learnt(flown(gains))
    np.testing.assert_allclose(slopes(found, gains), gains, rtol=0.02)
    plain = learnt(flown(gains), directions=False)
    assert found.description_length <= plain.description_length + 1e-6 and found.terms == plain.terms


def test_what_a_mixer_says_shows_in_readings_that_single_commands_leave_open():
    weak = np.array(GYRO) / 60.0
    flights = flown(weak, runs=1, noise=0.016, seed=9)
    axes = of_mixer(np.sign([*weak, 0.0])[:, None], flights[0])
    alone, told = learnt(flights), learnt(flights, axes)
    assert together(told.pool, axes[0], squared=True) in told.sums[0].weights
    assert not slopes(alone, weak).any()
    assert told.description_length < alone.description_length - 10.0
    np.testing.assert_allclose(slopes(told, weak), weak, rtol=0.1)


def test_a_mixer_that_is_wrong_misleads_nobody():
    flights = flown(GYRO, cross=0.3)
    found = learnt(flights, of_mixer(np.array([[1.0], [1.0], [-1.0], [-1.0], [0.0]]), flights[0]))
    np.testing.assert_allclose(slopes(found, GYRO), GYRO, rtol=0.01)
    assert [len(s.weights) for s in found.sums] == [2, 3]


def test_a_share_of_its_own_costs_a_constant():
    found = learnt(flown((6.0, -3.0)))
    pool, own = found.pool, ((2, 1.0), (3, -0.5))
    assert unequal(own) == 1 and unequal(((2, 1.0), (3, -1.0))) == 0
    costs = {direction: pool.found[together(pool, direction)] for direction in (own, ((2, 1.0), (3, 1.0)))}
    assert costs[own] - costs[(2, 1.0), (3, 1.0)] == pytest.approx(pool.further)
    # As much as with a plain command, and the choice among two directions and none.
    assert costs[(2, 1.0), (3, 1.0)] == pytest.approx(pool.length(2) + np.log(3.0))


def test_bounds_of_a_plain_term_keep_out_what_would_evade_them():
    flights = flown(GYRO, cross=0.3)
    text = "speed_0: rotor_1 * rotor_1 in -5.5 .. 0"
    found = learnt(flights, bounded_terms=(text,))
    squares, used = found.pool.product(3, 3), found.sums[0].weights
    assert all(number == squares or found.pool.leaves(number).count(3) < 2 for number in used)
    assert used[squares] == -5.5


def test_directions_are_the_same_bits_for_any_number_of_threads():
    flights = flown(GYRO, cross=0.3)
    one, many = (
        identify_runs(
            flights[1], flights[0], options_of("default", {**FAST, "form": "acceleration"}),
            rests=[np.ones(5)], workers=_core.Workers(threads),
        )
        for threads in (1, 2)
    )  # fmt: skip
    assert same_bits(one.model.constants, many.model.constants)
