"""Numbers in words."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from twinloop._ground.texts import two_digits


@pytest.mark.parametrize(
    ("value", "shown"),
    [(0.0123456, "0.012"), (9.96, "10"), (99.7, "100"), (12345.0, "12000"), (-250.0, "-250"), (0.0, "0")],
)
def test_two_digits_count_and_none_is_a_power_of_ten(value, shown):
    assert two_digits(value) == shown


@given(st.floats(1e-4, 9e5))
def test_what_is_shown_is_within_a_twentieth_and_reads_as_a_person_writes(value):
    shown = two_digits(value)
    assert "e" not in shown and abs(float(shown) - value) <= 0.0501 * value
