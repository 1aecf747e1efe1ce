"""Quotients: slopes of readings, nodes over a denominator, their constants, and what a search finds among them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

import twinloop as tl
from oracles import solved
from problems import problem_of as one_run
from twinloop import _core
from twinloop._ground.slopes import slopes
from twinloop._ground.streams import Unit
from twinloop.identification.identify import identify_runs
from twinloop.identification.records import Run, guessed_noise
from twinloop.identification.search.implicit import Quotient, implicit
from twinloop.identification.search.newton import refined
from twinloop.identification.search.quotients import renewed, with_quotients
from twinloop.identification.search.saturation import saturations
from twinloop.identification.search.structure import Sum, search
from twinloop.identification.search.walks import Walks
from twinloop.identification.sensors.chains import chains
from twinloop.identification.settings import IdentificationOptions
from twinloop.identification.terms.denominators import Denominator, alone, denominators, over, quotient
from twinloop.identification.terms.pool import Pool

WORKERS = _core.Workers(1)
STEPS = 150


def flown(slope, start, length, noise=0.0, seed=0):
    """Readings of an autonomous law, integrated to rounding by somebody else."""
    times = np.linspace(0.0, length, STEPS)
    states = solved(slope, start, times)
    return states + noise * states.std(axis=0) * np.random.default_rng(seed).standard_normal(states.shape)


def signals_of(names, length):
    return tl.Signals(
        states=[tl.State(name, "1", 3.0) for name in names],
        commands=[tl.Command("idle", "1", (0.0, 1.0))],
        dt=length / (STEPS - 1),
    )


def problem_of(readings, signals):
    """A problem, and its chains with the noise that readings seem to have."""
    run = Run.of(readings, np.zeros((len(readings) - 1, 1)))
    noise = guessed_noise([run], np.ones(signals.n_x))
    return one_run(signals, run), chains(signals, "acceleration", noise)


def saturating(s, p):
    return [-1.5 * s / (0.8 + s), 1.5 * s / (0.8 + s) - 0.3 * p]


@given(st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3), st.integers(5, 60))
def test_slopes_of_a_parabola_are_its_own(coefficients, count):
    times = np.arange(count)
    parabola = np.polynomial.Polynomial(coefficients)
    found = slopes(parabola(times))
    tolerance = 1e-8 * (1.0 + np.abs(parabola(times)).max())
    assert np.allclose(found.at, parabola.deriv()(times), atol=tolerance)
    assert np.allclose(found.between, parabola.deriv()(times[:-1] + 0.5), atol=tolerance)


def test_slopes_of_noisy_readings_are_those_of_the_polynomial_that_foretells_them_best():
    times = np.arange(80)
    readings = np.sin(0.1 * times) + 0.03 * np.random.default_rng(1).standard_normal(80)
    missed, slope = [], {}
    for degree in (2, 4, 6):
        for width in (w for w in (5, 7, 9, 13, 19, 27, 39) if w > degree + 1):
            errors, slope[degree, width] = [], np.empty(80)
            for i in times:
                window = np.clip(i - width // 2, 0, 80 - width) + np.arange(width)
                fit = np.polynomial.Polynomial.fit(window, readings[window], degree)
                slope[degree, width][i] = fit.deriv()(i)
                others = window[window != i]
                errors.append(readings[i] - np.polynomial.Polynomial.fit(others, readings[others], degree)(i))
            missed.append((np.mean(np.square(errors)), degree, width))
    least, degree, width = min(missed)
    found = slopes(readings)
    assert found.missed == pytest.approx(least, rel=1e-6)
    assert np.allclose(found.at, slope[degree, width], atol=1e-9)


def test_too_few_readings_have_no_slope():
    assert slopes(np.zeros(4)) is None


WEIGHTS = st.floats(-3.0, 3.0).filter(lambda weight: abs(weight) > 1e-3)


@given(
    st.lists(st.tuples(st.integers(0, 4), WEIGHTS), min_size=1, max_size=4, unique_by=lambda part: part[0])
)
def test_a_term_over_a_denominator_has_its_value_and_is_known_again(parts):
    pool = Pool(2)
    terms = [0, 1, pool.product(0, 0), pool.product(0, 1), pool.add("cos", 1)]
    denominator = Denominator(tuple((terms[place], weight) for place, weight in parts))
    node = over(pool, terms[3], denominator)
    x, y = rows = np.random.default_rng(0).uniform(-1.0, 1.0, (2, 30))
    of_terms = [x, y, x * x, x * y, np.cos(y)]
    below = 1.0 + sum(weight * of_terms[place] for place, weight in parts)
    with np.errstate(all="ignore"):
        expected = np.where(np.abs(below) > 1e-6, x * y / below, x * y)
    assert np.allclose(pool.values([node], rows.T)[:, 0], expected, rtol=1e-9)
    assert quotient(pool, node) == (terms[3], Denominator(tuple(sorted(denominator.parts))))


def test_other_nodes_are_no_quotients():
    pool = Pool(2)
    nodes = [0, pool.add("/", 0, 1), pool.add("/", 0, pool.add("-", pool.one, 1)), pool.product(0, 1)]
    assert all(quotient(pool, node) is None for node in nodes)
    assert denominators(pool, nodes) == []


def test_constants_below_the_line_are_those_of_least_squares():
    signals = signals_of("sp", 8.0)
    readings = flown(saturating, (5.0, 0.2), 8.0, noise=0.01)
    problem, (chain, _) = problem_of(readings, signals)
    # A sensor with noise and nothing that disturbs: what is left is the sum of squares of the readings' errors.
    chain = chain.with_noise(chain.sensors, (1e-12, 0.0, 1.0))
    ((_, found),) = refined(problem, chain, Quotient((), (0,), Denominator(((0, 0.3),)))).parts
    start, middle, end = (problem.stages.start[:, 0], problem.stages.middle[:, 0], problem.stages.end[:, 0])

    def errors(parameters):
        first, weight, constant = parameters
        steps = [s / (1.0 + constant * s) for s in (start, middle, end)]
        moves = signals.dt / 6.0 * (steps[0] + 4.0 * steps[1] + steps[2])
        return readings[:, 0] - first - weight * np.concatenate([[0.0], np.cumsum(moves)])

    expected = least_squares(errors, [5.0, -1.0, 0.3], xtol=1e-12, ftol=1e-12).x[2]
    assert found == pytest.approx(expected, rel=1e-3)


def test_a_denominator_that_two_chains_share_is_found_and_paid_for_once():
    signals = signals_of("sp", 8.0)
    problem, both = problem_of(flown(saturating, (5.0, 0.2), 8.0), signals)
    pool = problem.pool
    terms = [pool.one, 0, 1, pool.product(0, 0), pool.product(1, 1), pool.product(0, 1)]
    problem.usable(terms)
    known = [_fitted(problem, chain, terms) for chain in both]
    found = with_quotients(problem, signals, known, (), Walks(12_500, 16, Unit(0, (1,))))
    shared = denominators(pool, [term for sum_ in found for term in sum_.weights])
    assert len(shared) == 1
    ((term, constant),) = shared[0].parts
    assert term == 0
    assert constant == pytest.approx(1.25, rel=1e-4)
    assert all(new.description_length < old.description_length for new, old in zip(found, known, strict=True))
    quotients = [term for sum_ in found for term in sum_.weights if quotient(pool, term) is not None]
    bare = pool.length(0)
    assert all(bare < pool.length(term) for term in quotients)
    # What the constant and its term cost, shared out to all that use them.
    share = (0.5 * np.log(problem.readings(both[0])) + bare) / len(set(quotients))
    for term in quotients:
        over_it = pool.length(quotient(pool, term)[0])
        assert pool.length(term) == pytest.approx(over_it + np.log(2.0) + share)


def _fitted(problem, chain, terms):
    """All of some terms, by least squares."""
    gram = problem.regression(chain, problem.values(terms)).gram(chain.sensors, chain.motion, WORKERS)
    weights, _, left = gram.solve(list(range(len(terms))), 1e-9)
    return Sum(dict(zip(terms, weights.tolist(), strict=True)), left + 200.0, chain)


def test_a_denominator_whose_terms_are_dropped_while_another_one_is_refined_is_gone():
    signals = signals_of("sp", 8.0)
    problem, (chain, _) = problem_of(flown(saturating, (5.0, 0.2), 8.0), signals)
    pool = problem.pool
    both = [
        over(pool, 0, Denominator(((0, 1.2),))),
        over(pool, pool.product(1, 1), Denominator(((pool.product(1, 1), 0.1),))),
    ]
    problem.usable(both)
    (found,) = renewed(problem, signals, [_fitted(problem, chain, both)], Walks(12_500, 16, Unit(0, (1,))))
    ((term, constant),) = denominators(pool, found.weights)[0].parts
    assert term == 0
    assert constant == pytest.approx(1.25, rel=1e-4)
    assert len(found.weights) == 1


def inhibited(s, p):
    """A substrate that slows its own reaction."""
    reaction = 2.0 * s / (0.6 + s + 0.5 * s * s)
    return [0.5 - reaction, reaction - 0.3 * p]


def test_two_chains_pay_together_for_a_denominator_that_is_too_dear_for_each():
    signals = signals_of("sp", 5.0)
    problem, both = problem_of(flown(inhibited, (1.6, 0.5), 5.0, noise=0.01, seed=7), signals)
    pool = problem.pool
    terms = [pool.one, 0, 1, pool.product(0, 0), pool.product(1, 1), pool.product(0, 1)]
    problem.usable(terms)
    walks = Walks(12_500, 16, Unit(1, (1,)))
    known = search(problem, both, terms, [None, None], walks)
    found = with_quotients(problem, signals, known, (), walks)
    (shared,) = denominators(pool, [term for sum_ in found for term in sum_.weights])
    # Searched with s alone below the line, and lengthened by its square.
    assert [term for term, _ in shared.parts] == [0, pool.product(0, 0)]
    assert [weight for _, weight in shared.parts] == pytest.approx([1.0 / 0.6, 0.5 / 0.6], rel=0.1)
    assert all(over(pool, 0, shared) in sum_.weights for sum_ in found)
    # Alone neither gains as much as a denominator must.
    for new, old in zip(found, known, strict=True):
        assert new.description_length < old.description_length
    (loss,) = with_quotients(problem, signals, known[:1], (), walks)
    assert denominators(pool, loss.weights) == []


def test_a_denominator_stays_one_where_two_chains_share_it_and_it_is_refined():
    signals = signals_of("sp", 8.0)
    problem, both = problem_of(flown(saturating, (5.0, 0.2), 8.0, noise=0.01), signals)
    ratio = over(problem.pool, 0, Denominator(((0, 1.0),)))
    problem.usable([ratio, 1])
    known = [_fitted(problem, chain, [ratio, 1][: i + 1]) for i, chain in enumerate(both)]
    found = renewed(problem, signals, known, Walks(12_500, 16, Unit(0, (1,))))
    (shared,) = denominators(problem.pool, [term for sum_ in found for term in sum_.weights])
    ((term, constant),) = shared.parts
    assert term == 0
    assert constant == pytest.approx(1.25, rel=0.1)


def test_where_no_quotient_is_worth_its_price_sums_stay_the_very_same():
    signals = signals_of("xy", 10.0)
    readings = flown(
        lambda x, y: [1.2 * x - 0.4 * x * y, 0.1 * x * y - 0.8 * y], (5.0, 2.0), 10.0, noise=0.01
    )
    problem, both = problem_of(readings, signals)
    pool = problem.pool
    product = pool.product(0, 1)
    problem.usable([0, 1, product])
    known = [_fitted(problem, chain, [i, product]) for i, chain in enumerate(both)]
    found = with_quotients(problem, signals, known, (), Walks(12_500, 16, Unit(0, (1,))))
    assert all(new is old for new, old in zip(found, known, strict=True))


def ring(x, y, z):
    return [4.0 / (1.0 + z**4) - x, 4.0 / (1.0 + x**4) - y, 4.0 / (1.0 + y**4) - z]


def test_which_state_saturates_shows_behind_noise():
    signals = signals_of("xyz", 15.0)
    problem, every = problem_of(flown(ring, (0.2, 1.0, 2.0), 15.0, noise=0.01), signals)
    terms = [problem.pool.one, 0, 1, 2, *(problem.pool.product(i, j) for i, j in ((0, 0), (1, 1), (2, 2)))]
    problem.usable(terms)
    known = [_fitted(problem, chain.with_noise(chain.sensors, (1e-2, 0.0, 1.0)), terms) for chain in every]
    found = saturations(problem, signals, known, Walks(12_500, 16, Unit(0, (1,))))
    for repressor, quotients in zip((2, 0, 1), found, strict=True):
        steep = {problem.pool.product(*[repressor] * power) for power in (2, 4)}
        assert steep & {candidate.denominator.parts[0][0] for candidate in quotients}


def pulled(gap, rate, current, slope, fall):
    """What a magnet pulls as its squared current, the less the further it is; neither is ever near 0."""
    return [
        rate,
        6.0 * (8.0 - gap),
        slope,
        30.0 * (2.0 - current),
        9.8 - 200.0 * (current / (1.0 + gap)) ** 2,
    ]


def test_a_denominator_that_vanishes_where_the_runs_were_is_no_answer():
    signals = signals_of("abcde", 4.0)
    problem, every = problem_of(flown(pulled, (10.0, 0.0, 2.8, 0.0, 0.0), 4.0, noise=1e-3), signals)
    pool = problem.pool
    gap, current = ([pool.product(*[i] * power) for power in (1, 2)] for i in (0, 2))
    terms = [pool.one, *gap, *current, pool.product(0, 2)]
    problem.usable(terms)
    fall = _fitted(problem, every[4].with_noise(every[4].sensors, (1e-2, 0.0, 1.0)), terms)
    ((first, *_),) = implicit(problem, signals, [fall], Walks(12_500, 16, Unit(0, (1,))))
    assert current[1] in first.above
    assert {term for term, _ in first.denominator.parts} <= {
        pool.product(*[0] * power) for power in (1, 2, 3, 4)
    }
    ends = np.zeros((2, pool.inputs))
    ends[:, 0] = 6.0, 10.0
    values = pool.values([term for term, _ in first.denominator.parts], ends)
    near, far = 1.0 + (values * np.array([weight for _, weight in first.denominator.parts])).sum(axis=1)
    # As the true one it grows, by about as much.
    assert near > 0.0
    assert far / near == pytest.approx((11.0 / 7.0) ** 2, rel=0.2)


def test_a_twin_of_noisy_readings_has_the_quotient_and_no_other_one():
    signals = signals_of("s", 6.0)
    readings = flown(lambda s: [-1.5 * s / (0.8 + s)], (5.0,), 6.0, noise=0.01)
    run = Run.of(readings, np.zeros((STEPS - 1, 1)))
    options = IdentificationOptions(form="acceleration", committee_size=2, parts=False)
    found = identify_runs([run], signals, options, workers=WORKERS)
    (sum_,) = found.sums
    (term,) = sum_.weights
    over_it, below = quotient(found.pool, term)
    ((under, _),) = below.parts
    assert (over_it, under) == (0, 0)
    states = np.array([0.1, 1.0, 4.0, 9.0])
    slope = found.model.program.run(np.column_stack([states, np.zeros(4)]))[:, 0]
    assert np.allclose(slope, -1.5 * states / (0.8 + states), rtol=0.03)
    bare = identify_runs([run], signals, replace(options, implicit=False), workers=WORKERS)
    assert denominators(bare.pool, [term for sum_ in bare.sums for term in sum_.weights]) == []


def test_a_pendulum_on_a_rope_that_is_hoisted_has_its_length_below_the_line():
    """Masses that a cart shares with its load can stand in for a length that varies little."""
    duration, steps = 8.0, 200
    names = {"rope": "m", "sway": "rad", "rate": "rad/s"}
    signals = tl.Signals(
        [
            tl.State(name, unit, 1.0, derivative_of="sway" if name == "rate" else None)
            for name, unit in names.items()
        ],
        [tl.Command("hoist", "m/s", (-1.0, 1.0))],
        dt=duration / steps,
    )
    runs = []
    for seed, start in enumerate(((1.0, 0.5, 0.0), (2.6, 0.8, 0.5))):
        hoist = np.repeat([0.3, -0.1, 0.4, 0.2] if seed == 0 else [-0.4, -0.2, 0.2, -0.3], steps // 4)
        states = [np.array(start)]
        for u in hoist:

            def slope(t, z, u=u):
                return [u, z[2], (-9.81 * np.sin(z[1]) - 2.0 * u * z[2]) / z[0] - 0.1 * z[2]]

            states.append(solve_ivp(slope, (0.0, signals.dt), states[-1], rtol=1e-9, atol=1e-11).y[:, -1])
        noise = [1e-3, 1e-3, 3e-3] * np.random.default_rng(seed).standard_normal((steps + 1, 3))
        runs.append(Run.of(np.array(states) + noise, hoist[:, np.newaxis]))
    options = IdentificationOptions(form="acceleration", committee_size=2, parts=False)
    found = identify_runs(runs, signals, options, workers=WORKERS)
    (rate,) = (sum_ for sum_ in found.sums if signals.state_names.index("rate") in sum_.chain.states)
    assert denominators(found.pool, rate.weights) == alone(found.pool, 0, 1.0)[:1]
    inputs = np.array([[1.5, 0.4, 0.7, 0.2], [3.5, -1.2, 0.3, -0.5]])
    rope, sway, turning, u = inputs.T
    expected = (-9.81 * np.sin(sway) - 2.0 * u * turning) / rope - 0.1 * turning
    outputs = found.model.program.run(inputs)
    np.testing.assert_allclose(outputs[:, -1], expected, rtol=0.02)
