"""Seeds as they are typed: a range, one of them, or a sentence."""

import pytest

import twinloop as tl
from twinloop.sweep.seeds import seeds_of


@pytest.mark.parametrize(("text", "found"), [("0:5", [0, 1, 2, 3, 4]), ("7", [7]), ("3:4", [3])])
def test_seeds_are_a_range_or_one(text, found):
    assert list(seeds_of(text)) == found


@pytest.mark.parametrize("text", ["", "x", "5:", ":5", "1:x", "5:1", "3:3", "-1", "1:2:3", "1.5"])
def test_what_holds_no_seed_is_refused(text):
    with pytest.raises(tl.InvalidInput, match="FIRST:LAST"):
        seeds_of(text)
