"""Times for a person: in the unit that suits them, with as many digits as asked for."""

import math

import pytest

from twinloop._ground.times import moment, shown_time, time_unit


@pytest.mark.parametrize(
    ("seconds", "said"),
    [
        (0.0, "0 ms"),
        (0.0125, "12.5 ms"),
        (-0.0125, "-12.5 ms"),
        (0.1274, "127 ms"),
        (0.9996, "1000 ms"),
        (1.0, "1 s"),
        (2.4, "2.4 s"),
        (599.0, "599 s"),
        (1500.0, "25 min"),
        (9000.0, "2.5 h"),
    ],
)
def test_a_time_is_shown_in_a_unit_that_suits_it(seconds, said):
    assert shown_time(seconds) == said


def test_digits_are_as_many_as_asked_for_and_never_a_power_of_ten():
    assert shown_time(0.01234, 2) == "12 ms"
    assert shown_time(0.0997, 2) == "100 ms"
    assert shown_time(0.0123456, 4) == "12.35 ms"


@pytest.mark.parametrize(
    ("column", "unit"),
    [
        ([], (1e3, "ms")),
        ([0.002, -0.5, math.inf], (1e3, "ms")),
        ([0.002, -2.5], (1.0, "s")),
        ([900.0, 1.0], (1 / 60, "min")),
        ([math.nan, 7200.0], (1 / 3600, "h")),
    ],
)
def test_a_column_has_the_unit_of_its_longest_time(column, unit):
    assert time_unit(column) == unit


@pytest.mark.parametrize(
    ("t", "apart", "said"),
    [
        (1.45, 0.05, "1.45"),
        (0.1 + 0.2, 0.0, "0.3"),
        (2000000.0, 0.02, "2000000"),
        (1700000000.02, 0.02, "1700000000.02"),
        (1700000000.02, 100.0, "1700000000"),
        (1700000000.02, 0.0, "1700000000.02"),
        (86400.000001, 1e-6, "86400.000001"),
        (-1.0, 1e-9, "-1"),
        (math.nan, 0.1, "nan"),
        (1e200, 1.0, "1e+200"),
    ],
)
def test_the_time_of_a_row_has_digits_enough_to_find_it(t, apart, said):
    assert moment(t, apart) == said
