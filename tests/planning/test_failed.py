"""Gains that stand for a failure, beside a loop over gains, failures and members."""

from types import SimpleNamespace

import numpy as np
import pytest

from committees import planner_of, signals
from twinloop.planning.failed import ALIKE, stand_for_failed
from twinloop.planning.gains import nearby
from twinloop.planning.judging import Judged

KNOWN = signals()
FAMILY = planner_of(KNOWN).family
FAILED = np.array([4.0, 0.1, 2.0])


def judge_of(quality, usage):
    """What flies some gains (K, 3) on two members, without noise."""

    def quiet(members, genes):
        shape = (2, 1, len(genes))
        return Judged(
            np.reshape([quality(genes), 2.0 * quality(genes)], shape), np.reshape([usage(genes)] * 2, shape)
        )

    return SimpleNamespace(family=FAMILY, signals=KNOWN, quiet=quiet)


def test_a_gain_without_effect_may_be_anywhere_and_one_with_an_effect_may_not():
    without = judge_of(lambda genes: genes[:, 0] + genes[:, 2], lambda genes: 0.1 * genes[:, 0])
    genes = FAILED * np.array([[1.0, 1.0, 1.0], [1.0, 19.0, 1.0], [1.5, 1.0, 1.0], [1.0, 19.0, 1.3]])
    assert stand_for_failed(without, [], genes, [FAILED]).tolist() == [True, True, False, False]
    # The same quality by another use of the envelope is another flight.
    other = judge_of(lambda genes: genes[:, 0] * genes[:, 2], lambda genes: 0.1 * genes[:, 0])
    assert stand_for_failed(other, [], FAILED * np.array([[2.0, 1.0, 0.5]]), [FAILED]).tolist() == [False]


@pytest.mark.parametrize("seed", range(5))
def test_without_a_flight_that_lasts_only_gains_close_to_a_failure_stand_for_it(seed):
    draw = np.random.default_rng(seed)
    genes = FAMILY.from_unit(FAMILY.to_unit(FAILED) + 0.02 * draw.standard_normal((40, 3)))
    ends = judge_of(lambda genes: np.full(len(genes), np.inf), lambda genes: np.full(len(genes), np.inf))
    close = nearby(FAMILY, genes, [FAILED])
    assert stand_for_failed(ends, [], genes, [FAILED]).tolist() == close.tolist() and 0 < close.sum() < 40
    assert not stand_for_failed(ends, [], genes, []).any()


def test_flights_are_alike_on_every_member_beside_a_loop():
    draw = np.random.default_rng(1)
    qualities = 1.0 + ALIKE * draw.integers(-3, 4, (2, 1, 31)) / 2.0
    usages = np.where(draw.random((2, 1, 31)) < 0.1, np.inf, 0.5)
    usages[:, 0, 30] = [0.5, np.inf]
    qualities[np.isinf(usages)] = np.inf
    qualities[:, 0, :3], usages[:, 0, :3] = qualities[:, 0, [30]], usages[:, 0, [30]]
    flights = SimpleNamespace(family=FAMILY, signals=KNOWN, quiet=lambda *given: Judged(qualities, usages))
    genes = FAMILY.from_unit(draw.random((30, 3)))
    found = stand_for_failed(flights, [], genes, [FAILED]).tolist()

    def alike(own, failed):
        return own == failed if np.isinf(failed) else abs(own - failed) <= ALIKE * failed

    looped = [
        all(alike(each[m, 0, k], each[m, 0, 30]) for each in (qualities, usages) for m in range(2))
        for k in range(30)
    ]
    close = nearby(FAMILY, genes, [FAILED])
    assert found == [a or bool(b) for a, b in zip(looped, close, strict=True)]
    assert all(looped[:3]) and not all(looped)
