"""Names of parts of expressions: none is that of a signal, and whatever is long and written twice has one."""

import pytest

from law_twins import twin_of
from twinloop.law.writing import free_prefix


@pytest.mark.parametrize(
    ("symbols", "prefix"),
    [
        ((), "t"),
        (("t", "tank", "t_1", "xt1"), "t"),
        (("angle", "t12"), "t_"),
        (("t0", "t_3"), "t__"),
        (("t0", "t__3"), "t_"),
    ],
)
def test_names_of_parts_begin_with_what_no_symbol_does_that_goes_on_in_digits(symbols, prefix):
    assert free_prefix(symbols) == prefix


@pytest.mark.parametrize("doubled", [["r4 = r4 * r4"], ["r5 = r4 / r0", "r4 = r4 * r5"]])
def test_what_is_multiplied_by_itself_again_and_again_is_written_briefly(doubled):
    """A program of a hundred lines from somebody else would else be written with 2^50 factors."""
    twin = twin_of(["r4 = r0 + r1", "r4 = r4 * 0.1", *50 * doubled])
    assert len(twin.equations()) < 10_000
