"""Regression on whitened features beside dense matrices, and the search over subsets beside all of them."""

import itertools
from functools import cached_property

import numpy as np
import pytest
from scipy.linalg import block_diag, expm
from scipy.stats import multivariate_normal

from oracles import same_bits
from twinloop import _core

DT = 0.05
QUIET = (0.0, 0.0, 1.0)


class Dense:
    """A chain of states written as one big normal distribution: what reading after reading of a filter should give."""

    def __init__(self, states, form, dt=DT):
        self.states, self.form, self.dt = states, form, dt
        self.drift = np.diag(np.ones(states - 1), -1) if form != "increment" else np.zeros((states, states))
        self.transition = expm(self.drift * dt)
        if form == "explicit-euler":
            self.transition = np.eye(states) + dt * self.drift
        if form == "semi-implicit-euler":
            # Of x⁺ = x + dt v⁺, one state after another.
            self.transition = np.linalg.inv(np.eye(states) - dt * self.drift)

    def disturbance(self, variance):
        """Covariance of what white noise adds in a period, by quadrature."""
        if self.form != "acceleration":
            push = variance if self.form == "increment" else variance / self.dt
            return push * np.outer(self.reach, self.reach)
        places, weights = np.polynomial.legendre.leggauss(8)
        columns = [expm(self.drift * 0.5 * self.dt * (1 + s))[:, 0] for s in places]
        return (
            variance * 0.5 * self.dt * sum(w * np.outer(c, c) for w, c in zip(weights, columns, strict=True))
        )

    @cached_property
    def reach(self):
        """What a held disturbance of 1 adds in a period, by quadrature."""
        if self.form != "acceleration":
            first = np.eye(self.states)[0] * (1.0 if self.form == "increment" else self.dt)
            return self.transition @ first if self.form == "semi-implicit-euler" else first
        places, weights = np.polynomial.legendre.leggauss(8)
        columns = [expm(self.drift * 0.5 * self.dt * (1 + s))[:, 0] for s in places]
        return 0.5 * self.dt * sum(w * c for w, c in zip(weights, columns, strict=True))

    def covariance(self, steps, spread, sensors, motion):
        """Of all readings ((steps + 1) states)², from the map of every independent disturbance to them."""
        white, gust, memory = motion
        d, kept = self.states, np.exp(-self.dt / memory)
        sources = [np.diag(np.square(spread))] + [self.disturbance(white)] * steps
        columns = []
        for k in range(steps + 1):  # a move of the states that comes with row k
            block = np.zeros(((steps + 1) * d, d))
            moved = np.eye(d)
            for row in range(k, steps + 1):
                block[row * d : (row + 1) * d] = moved
                moved = self.transition @ moved
            columns.append(block)
        ways = np.hstack(columns)
        total = ways @ block_diag(*sources) @ ways.T + np.diag(np.tile(sensors, steps + 1))
        if gust > 0.0:
            place = np.arange(steps)
            lasting = gust * kept ** np.abs(place[:, None] - place[None, :])
            pushes = np.stack([columns[k + 1] @ self.reach for k in range(steps)], axis=1)
            total += pushes @ lasting @ pushes.T
        return total

    def responses(self, start, middle, end):
        """What each feature alone does to the states ((steps + 1) states, p), by Simpson's rule in each period."""
        steps, p = start.shape
        state, rows = np.zeros((self.states, p)), [np.zeros((self.states, p))]
        for k in range(steps):
            state = self.transition @ state
            for m in range(self.states):
                if self.form == "acceleration":
                    kernel = [(self.dt - s) ** m / max(1, m * (m - 1)) for s in (0, self.dt / 2, self.dt)]
                    simpson = kernel[0] * start[k] + 4 * kernel[1] * middle[k] + kernel[2] * end[k]
                    state[m] += self.dt / 6 * simpson
                else:
                    state[m] += self.reach[m] * start[k]
            rows.append(state.copy())
        return np.concatenate(rows)


def drawn(dense, seed, steps=30, p=3, runs=2, sensors=1e-3, ignored=0):
    """Records of smooth features and the readings that they and noise give, with their coefficients."""
    stream = np.random.default_rng(seed)
    truth = stream.normal(size=p)
    records = []
    for _ in range(runs):
        waves = stream.uniform(0.5, 6.0, p), stream.uniform(0.0, 6.0, p)
        t = dense.dt * np.arange(steps)[:, None]
        stages = [np.sin(waves[0] * (t + h) + waves[1]) for h in (0.0, dense.dt / 2, dense.dt)]
        measured = (dense.responses(*stages) @ truth).reshape(steps + 1, dense.states)
        measured = measured + sensors * stream.normal(size=measured.shape) + stream.normal(size=dense.states)
        weights = np.ones_like(measured)
        weights.flat[stream.choice(measured.size, ignored, replace=False)] = 0.0
        records.append((measured, weights, *stages))
    return records, truth


CASES = [(1, "increment"), *((n, "acceleration") for n in (1, 2, 3))]
CASES += [(n, form) for n in (1, 3) for form in ("explicit-euler", "semi-implicit-euler")]
MOTIONS = [QUIET, (1e-3, 0.0, 1.0), (1e-4, 0.05, 0.2)]


def dense_problem(dense, records, sensors, motion):
    """Readings, responses and Cholesky factors of the covariance of each record, rows that count only."""
    parts = []
    spread = np.max([np.abs(measured).max(axis=0) for measured, *_ in records], axis=0)
    for measured, weights, *stages in records:
        covariance = dense.covariance(len(measured) - 1, spread, sensors, motion)
        rows = np.flatnonzero(weights.ravel())
        parts.append((measured.ravel()[rows], dense.responses(*stages)[rows], covariance[np.ix_(rows, rows)]))
    return parts


@pytest.mark.parametrize("motion", MOTIONS, ids=["quiet", "white", "gusts"])
@pytest.mark.parametrize(("states", "form"), CASES)
@pytest.mark.parametrize("ignored", [0, 5])
def test_least_squares_are_those_of_the_whole_covariance(states, form, motion, ignored):
    dense = Dense(states, form)
    records, _ = drawn(dense, 3, ignored=ignored)
    sensors = np.array([1e-3, 4e-3, 2e-3])[:states]
    regression = _core.Regression(states, DT, form, records)
    gram = regression.gram(sensors, motion)
    assert gram.features == 3 and gram.readings == sum(int(r[1].sum()) for r in records)
    left, right = [], []
    for z, f, covariance in dense_problem(dense, records, sensors, motion):
        factor = np.linalg.cholesky(covariance)
        left.append(np.linalg.solve(factor, f))
        right.append(np.linalg.solve(factor, z))
    matrix, target = np.concatenate(left), np.concatenate(right)
    assert gram.total == pytest.approx(target @ target, rel=1e-6)
    for subset in ([0], [2, 0], [0, 1, 2]):
        expected, rest, *_ = np.linalg.lstsq(matrix[:, subset], target, rcond=None)
        coefficients, covariance, chi = gram.solve(subset)
        np.testing.assert_allclose(coefficients, expected, rtol=1e-5, atol=1e-7)
        assert chi == pytest.approx(rest[0], rel=1e-5)
        inner = matrix[:, subset].T @ matrix[:, subset]
        np.testing.assert_allclose(covariance, np.linalg.inv(inner), rtol=1e-5, atol=1e-9)


def test_more_rows_are_more_rows():
    gram, _ = problem(1)
    stream = np.random.default_rng(7)
    rows, readings = stream.normal(size=(30, 8)), stream.normal(size=30)
    more = gram.with_rows(np.column_stack([rows, readings]))
    subset = [0, 3, 5]
    # What the Gram matrix knows of its own rows: their inner products, from its solution and its total.
    before, covariance, left = gram.solve(subset)
    inner = np.linalg.inv(covariance)
    expected = np.linalg.solve(
        inner + rows[:, subset].T @ rows[:, subset], inner @ before + rows[:, subset].T @ readings
    )
    found, _, chi = more.solve(subset)
    np.testing.assert_allclose(found, expected, rtol=1e-8)
    change = expected - before
    rest = readings - rows[:, subset] @ expected
    assert chi == pytest.approx(left + change @ inner @ change + rest @ rest, rel=1e-8)
    assert (more.readings, more.features) == (gram.readings + 30, 8)
    assert gram.solve(subset)[2] == left
    for wrong in (rows, np.full((2, 9), np.nan)):
        with pytest.raises(ValueError, match="rows: expected"):
            gram.with_rows(wrong)


def test_a_part_knows_what_its_features_alone_would_tell():
    gram, _ = problem(1)
    chosen = [6, 0, 3]
    part = gram.part(chosen)
    assert (part.features, part.readings, part.total) == (3, gram.readings, gram.total)
    for subset in ([0], [2, 1], [0, 1, 2]):
        expected = gram.solve([chosen[j] for j in subset])
        for found, known in zip(part.solve(subset), expected, strict=True):
            np.testing.assert_array_equal(found, known)
    with pytest.raises(ValueError, match="part: expected features below 8, found 8"):
        gram.part([0, 8])


def test_a_normal_prior_is_a_row_for_each_coefficient_that_reads_0():
    gram, _ = problem(1)
    precisions = np.array([3.0, 0.0, 1e4, 0.5, 2.0, 0.0, 7.0, 1e-3])
    rows = np.column_stack([np.diag(np.sqrt(precisions)), np.zeros(8)])
    for subset in ([2], [0, 2, 6]):
        for found, expected in zip(
            gram.with_prior(precisions).solve(subset), gram.with_rows(rows).solve(subset), strict=True
        ):
            np.testing.assert_allclose(found, expected, rtol=1e-9)
    assert gram.with_prior(precisions).readings == gram.readings
    for wrong in (precisions[:-1], -precisions, np.full(8, np.nan)):
        with pytest.raises(ValueError, match="precisions: expected"):
            gram.with_prior(wrong)


@pytest.mark.parametrize("motion", MOTIONS, ids=["quiet", "white", "gusts"])
@pytest.mark.parametrize(("states", "form"), CASES)
@pytest.mark.parametrize("ignored", [0, 5])
def test_the_likelihood_is_that_of_one_big_normal_distribution(states, form, motion, ignored):
    dense = Dense(states, form)
    records, truth = drawn(dense, 4, ignored=ignored)
    sensors = np.array([1e-3, 4e-3, 2e-3])[:states]
    regression = _core.Regression(states, DT, form, records)
    expected = 0.0
    for z, f, covariance in dense_problem(dense, records, sensors, motion):
        density = multivariate_normal(cov=covariance, allow_singular=False).logpdf(z - f @ truth)
        expected += -2.0 * density - len(z) * np.log(2.0 * np.pi)
    assert regression.likelihood(truth, sensors, motion) == pytest.approx(expected, rel=1e-6)
    for found, (measured, _, *stages) in zip(regression.residuals(truth), records, strict=True):
        np.testing.assert_allclose(
            found.ravel(), measured.ravel() - dense.responses(*stages) @ truth, atol=1e-10
        )


@pytest.mark.parametrize(("states", "form"), CASES)
@pytest.mark.parametrize("motion", [(2.0, 0.0, 1.0), (0.5, 20.0, 0.2)], ids=["white", "gusts"])
def test_many_records_are_as_likely_together_as_one_after_the_other(states, form, motion):
    dense = Dense(states, form)
    # Records that share a filter and are looked at together, one between them that does not, and shorter ones; so much
    # moves them that what is known of a state settles, and once more after each reading that is ignored.
    records, truth = drawn(dense, 4, steps=120, runs=6)
    records += drawn(dense, 5, steps=120, runs=1, ignored=4)[0] + drawn(dense, 6, steps=90, runs=3)[0]
    sensors = np.array([1e-3, 4e-3, 2e-3])[:states]
    expected = 0.0
    for z, f, covariance in dense_problem(dense, records, sensors, motion):
        density = multivariate_normal(cov=covariance, allow_singular=False).logpdf(z - f @ truth)
        expected += -2.0 * density - len(z) * np.log(2.0 * np.pi)
    regression = _core.Regression(states, DT, form, records)
    assert regression.likelihood(truth, sensors, motion) == pytest.approx(expected, rel=1e-6)


def wandering(dense, sensors, motion, steps, seed):
    """A record without features, drawn from the noise alone."""
    white, gust, memory = motion
    stream = np.random.default_rng(seed)
    moves = stream.multivariate_normal(np.zeros(dense.states), dense.disturbance(white), size=steps)
    kept, push = np.exp(-dense.dt / memory), np.sqrt(gust) * stream.normal()
    state, states = np.zeros(dense.states), []
    for k in range(steps + 1):
        states.append(state)
        if k < steps:
            state = dense.transition @ state + moves[k] + dense.reach * push
            push = kept * push + np.sqrt(gust * (1.0 - kept**2)) * stream.normal()
    measured = np.array(states) + np.sqrt(sensors) * stream.normal(size=(steps + 1, dense.states))
    nothing = np.zeros((steps, 1))
    return measured, np.ones_like(measured), nothing, nothing, nothing


@pytest.mark.parametrize(
    ("states", "form", "sensors", "white"),
    [
        (1, "increment", [1e-2], 1e-3),
        (1, "acceleration", [1e-3], 1e-2),
        (2, "acceleration", [1e-2, 1e-4], 0.05),
    ],
)
def test_the_noise_that_made_a_record_is_found(states, form, sensors, white):
    dense = Dense(states, form)
    record = wandering(dense, np.array(sensors), (white, 0.0, 1.0), 1500, 5)
    regression = _core.Regression(states, DT, form, [record])
    low, none = np.full(states, 1e-12), (1e-12, 0.0, 1.0)
    start = (30.0 * white, 0.0, 1.0)
    problem = (regression, [0.0], np.full(states, 1e-3), start, low, none)
    ((found, motion, score),) = _core.most_likely_noises([problem])
    np.testing.assert_allclose(found, sensors, rtol=0.25)
    assert motion[0] == pytest.approx(white, rel=0.35)
    assert score == pytest.approx(regression.likelihood([0.0], found, motion), rel=1e-12)
    assert score <= regression.likelihood([0.0], sensors, (white, 0.0, 1.0)) + 1.0


def test_what_a_record_sees_as_a_constant_is_no_correlated_disturbance():
    """Each record drifts its own way; a disturbance is forgotten four times within one at least."""
    dense, steps = Dense(1, "acceleration"), 200
    nothing, drift = np.zeros((steps, 1)), DT * np.arange(steps + 1.0)
    noise = 1e-3 * np.random.default_rng(0).standard_normal((2, steps + 1))
    records = [
        ((sign * drift + noise[i])[:, np.newaxis], np.ones((steps + 1, 1)), nothing, nothing, nothing)
        for i, sign in enumerate((1.0, -2.0))
    ]
    regression = _core.Regression(dense.states, DT, dense.form, records)
    problem = (regression, [0.0], [1e-6], (1e-9, 1.0, 10.0 * DT), [1e-12], (1e-12, 1e-12, DT))
    ((_, motion, _),) = _core.most_likely_noises([problem])
    assert motion[1] > 0.01 and motion[2] == pytest.approx(0.25 * DT * (steps + 1))


def test_no_variance_falls_below_its_floor():
    dense = Dense(1, "acceleration")
    record = wandering(dense, np.array([1e-4]), (1e-2, 0.0, 1.0), 300, 6)
    regression = _core.Regression(1, DT, "acceleration", [record])
    problem = (regression, [0.0], [1.0], (1.0, 0.0, 1.0), [0.5], (0.25, 0.0, 1.0))
    ((found, motion, _),) = _core.most_likely_noises([problem])
    assert found[0] == 0.5 and motion[0] == 0.25


@pytest.mark.parametrize(
    "wrong",
    [
        lambda r: _core.Regression(0, DT, "acceleration", [r]),
        lambda r: _core.Regression(5, DT, "acceleration", [r]),
        lambda r: _core.Regression(1, 0.0, "acceleration", [r]),
        lambda r: _core.Regression(1, DT, "acceleration", [(r[0][:-1], *r[1:])]),
        lambda r: _core.Regression(1, DT, "acceleration", [(np.full_like(r[0], np.nan), *r[1:])]),
        lambda r: _core.Regression(1, DT, "acceleration", [r]).gram([0.0], QUIET),
        lambda r: _core.Regression(1, DT, "acceleration", [r]).gram([1.0, 1.0], QUIET),
        lambda r: _core.Regression(1, DT, "acceleration", [r]).gram([1.0], (-1.0, 0.0, 1.0)),
        lambda r: _core.Regression(1, DT, "acceleration", [r]).gram([1.0], QUIET).solve([7]),
        lambda r: _core.Regression(1, DT, "acceleration", [r]).likelihood([1.0, 2.0], [1.0], QUIET),
    ],
)
def test_what_no_regression_can_be_made_of_is_refused(wrong):
    records, _ = drawn(Dense(1, "acceleration"), 0, runs=1)
    with pytest.raises(ValueError, match="expected"):
        wrong(records[0])


# Subsets


def problem(seed, p=8, twins=False, zero=False):
    """A Gram matrix of correlated features of which three act, and what each costs."""
    stream = np.random.default_rng(seed)
    steps = 60
    features = stream.normal(size=(steps, p)) @ (np.eye(p) + 0.5 * stream.normal(size=(p, p)))
    if twins:
        features[:, 1] = -3.0 * features[:, 0]
    if zero:
        features[:, 2] = 0.0
    measured = np.zeros((steps + 1, 1))
    measured[1:, 0] = np.cumsum(features[:, :3] @ stream.normal(size=3) + 0.3 * stream.normal(size=steps))
    record = (measured, np.ones_like(measured), features, features, features)
    gram = _core.Regression(1, 1.0, "increment", [record]).gram([1e-3], (0.1, 0.0, 1.0))
    return gram, stream.uniform(1.0, 12.0, p)


def energies(gram, prices, largest):
    """Energy of every subset that has one."""
    found = {}
    for k in range(largest + 1):
        for subset in itertools.combinations(range(gram.features), k):
            solved = gram.solve(list(subset))
            if solved is not None and np.isfinite(prices[list(subset)]).all():
                found[subset] = solved[2] + prices[list(subset)].sum()
    return found


def searched(grams, prices, threads=1, **changes):
    settings = {"moves": 3000, "largest": 8, "starts": 2, "unit": (1, "subsets", [0]), **changes}
    return _core.search_subsets(grams, prices, workers=_core.Workers(threads=threads), **settings)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("largest", [2, 8])
def test_the_best_subset_is_the_best_of_all(seed, largest):
    gram, prices = problem(seed)
    known = energies(gram, prices, largest)
    best = min(known, key=known.get)
    found = searched([gram], [prices], largest=largest)[0]
    assert tuple(found[0][0]) == best
    values = [energy for _, energy in found]
    assert values == sorted(values)
    assert len({tuple(subset) for subset, _ in found}) == len(found)
    for subset, energy in found:
        assert len(subset) <= largest and subset == sorted(subset)
        assert energy == pytest.approx(known[tuple(subset)], rel=1e-9)


def test_a_term_that_is_forbidden_is_never_chosen():
    gram, prices = problem(0)
    free = searched([gram], [prices])[0]
    out = free[0][0][0]
    prices[out] = np.inf
    found = searched([gram], [prices])[0]
    assert found and all(out not in subset and np.isfinite(energy) for subset, energy in found)
    known = energies(gram, prices, 8)
    assert tuple(found[0][0]) == min(known, key=known.get)
    nothing = searched([gram], [np.full(8, np.inf)])[0]
    assert nothing == [([], pytest.approx(gram.total))]


def test_collinear_and_empty_columns_are_handled():
    gram, prices = problem(1, twins=True, zero=True)
    assert gram.solve([0, 1]) is None and gram.solve([2]) is None
    found = searched([gram], [prices])[0]
    assert all(not {0, 1} <= set(subset) and 2 not in subset for subset, _ in found)
    known = energies(gram, prices, 8)
    assert tuple(found[0][0]) == min(known, key=known.get)
    assert found[0][1] == pytest.approx(min(known.values()))


def test_a_search_gives_the_same_bits_for_any_number_of_threads():
    grams, prices = zip(*(problem(seed) for seed in range(3)), strict=True)
    one, two = (searched(grams, prices, threads=threads, moves=400, starts=3) for threads in (1, 2))
    assert [[s for s, _ in walk] for walk in one] == [[s for s, _ in walk] for walk in two]
    for a, b in zip(one, two, strict=True):
        assert same_bits([e for _, e in a], [e for _, e in b])
    grown = [problem(seed)[0] for seed in range(3)]
    assert all(same_bits([a.total], [b.total]) for a, b in zip(grams, grown, strict=True))
    records, _ = drawn(Dense(2, "acceleration"), 1, runs=5)
    regression = _core.Regression(2, DT, "acceleration", records)
    parts = [
        regression.gram([1e-3, 1e-3], (1e-3, 0.0, 1.0), _core.Workers(threads=threads)).solve([0, 1, 2])
        for threads in (1, 2)
    ]
    assert same_bits(parts[0][0], parts[1][0]) and same_bits(parts[0][1], parts[1][1])


def test_a_search_without_terms_or_with_prices_for_others_says_so():
    gram, prices = problem(2)
    with pytest.raises(ValueError, match="a price for each feature"):
        searched([gram], [prices[:-1]])
    with pytest.raises(ValueError, match="1 to 1000000 starts"):
        searched([gram], [prices], starts=0)
    assert searched([gram], [prices], moves=0)[0] == [([], pytest.approx(gram.total))]
