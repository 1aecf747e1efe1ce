"""Denominators: what is a term over one, and what only looks like it."""

import numpy as np

from twinloop.identification.terms.denominators import FIRST_RUNG, Denominator, alone, over, quotient
from twinloop.identification.terms.joints import solution
from twinloop.identification.terms.pool import Pool


def test_a_term_over_a_denominator_is_taken_apart_as_it_was_made() -> None:
    pool = Pool(3)
    square = pool.product(0, 0)
    made = over(pool, 1, Denominator(((2, 0.5), (square, -0.25))))
    assert quotient(pool, made) == (1, Denominator(tuple(sorted(((2, 0.5), (square, -0.25))))))


def test_one_over_a_denominator_is_a_quotient_and_so_is_a_quotient_over_another() -> None:
    pool = Pool(3)
    one = over(pool, pool.one, Denominator(((2, 0.5),)))
    assert quotient(pool, one) == (pool.one, Denominator(((2, 0.5),)))
    assert quotient(pool, over(pool, one, Denominator(((0, -0.25),)))) == (one, Denominator(((0, -0.25),)))


def test_accelerations_that_equations_of_joints_are_solved_to_are_no_quotients() -> None:
    """They are over 1 + Σ w φ as well; priced as such, each cost the whole length of its numerator."""
    pool = Pool(4)
    matrix = [[{2: 0.3}, {3: 0.2}], [{3: 0.7}, {}]]
    nodes = solution(pool, matrix, [{0: 1.5, 1: -2.0}, {1: 4.0}])
    assert len(nodes) == 2
    for node in nodes:
        assert node is not None
        assert pool[node[0]].operation == "/"
        assert quotient(pool, node[0]) is None


def test_a_term_over_a_state_alone_is_one_where_it_was_made_as_such_not_where_the_ladder_divides() -> None:
    pool = Pool(3)
    for single, power in zip(alone(pool, 0, 2.0), (1, 2), strict=True):
        node = over(pool, 1, single)
        assert pool.values([node], np.array([[3.0, 5.0, 0.0]])) == 5.0 / 1.5**power
        assert quotient(pool, node) is None
        pool.rungs[node] = FIRST_RUNG
        assert quotient(pool, node) == (1, single)
        pool.rungs[node] = FIRST_RUNG + 1
        assert quotient(pool, node) is None
