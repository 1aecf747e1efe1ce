"""Denominators: what is a term over one, and what only looks like it."""

from twinloop.identification.terms.denominators import over, quotient
from twinloop.identification.terms.joints import solution
from twinloop.identification.terms.pool import Pool


def test_a_term_over_a_denominator_is_taken_apart_as_it_was_made() -> None:
    pool = Pool(3)
    square = pool.product(0, 0)
    made = over(pool, 1, ((2, 0.5), (square, -0.25)))
    assert quotient(pool, made) == (1, tuple(sorted(((2, 0.5), (square, -0.25)))))


def test_one_over_a_denominator_is_a_quotient_and_so_is_a_quotient_over_another() -> None:
    pool = Pool(3)
    one = over(pool, pool.one, ((2, 0.5),))
    assert quotient(pool, one) == (pool.one, ((2, 0.5),))
    assert quotient(pool, over(pool, one, ((0, -0.25),))) == (one, ((0, -0.25),))


def test_accelerations_that_equations_of_joints_are_solved_to_are_no_quotients() -> None:
    """They are over 1 + Σ w φ as well; priced as such, each cost the whole length of its numerator."""
    pool = Pool(4)
    matrix = [[{2: 0.3}, {3: 0.2}], [{3: 0.7}, {}]]
    for node in solution(pool, matrix, [{0: 1.5, 1: -2.0}, {1: 4.0}]):
        assert node is not None
        assert pool[node[0]].operation == "/"
        assert quotient(pool, node[0]) is None
