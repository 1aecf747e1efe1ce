"""Names of parts of expressions: none is that of a signal."""

import pytest

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
