"""Remarks: which other law the runs allow, in words that a reader can use."""

import numpy as np
import pytest

import twinloop as tl
from twinloop.identification.records import Run
from twinloop.identification.remarks import identities, remarks
from twinloop.identification.search.structure import Other, Sum
from twinloop.identification.sensors.chains import chains
from twinloop.identification.terms.libraries import LIBRARIES, rungs
from twinloop.identification.terms.pool import Pool

SIGNALS = tl.Signals([tl.State("level", "m", 1.0)], [tl.Command("pump", "1", (0.0, 1.0))], 0.1)


def said(*others):
    pool = Pool(2, 10)
    rungs(pool, SIGNALS, LIBRARIES, 100)
    nodes = {
        "1": pool.one,
        "square": pool.product(0, 0),
        "evolved": pool.add("Max", 0, pool.add("*", 1, 0.3)),
    }
    (chain,) = chains(SIGNALS, "acceleration", np.ones(1))
    named = [Other((1, nodes[name]), above) for name, above in others]
    return [each.sentence for each in identities(Sum({0: -0.5, 1: 2.0}, 0.0, chain, named), pool, SIGNALS)]


def test_a_law_of_library_terms_that_is_as_good_is_named():
    assert said(("square", 1.0)) == [
        "On these runs level is described equally well with level**2 in place of level."
    ]
    assert said(("1", 1.0)) == [
        "On these runs level is described equally well with a constant in place of level."
    ]


@pytest.mark.parametrize("others", [[("square", 9.0)], [("evolved", 1.0)], []])
def test_a_worse_law_is_not_named_nor_one_that_evolved(others):
    assert said(*others) == []


def test_behind_an_evolved_law_the_next_one_is_named():
    assert "level**2" in said(("evolved", 0.5), ("square", 1.0))[0]


def of_still(level, pump):
    """What is said of whether the level moved, of a run of 30 periods."""
    run = Run.of(np.full((31, 1), 0.3) + level, pump)
    said = remarks([run], Pool(2, 10), SIGNALS, [], 30.0, 30, 0)
    return [(remark.code, remark.severity) for remark in said]


def test_commands_that_nothing_answers_are_a_serious_remark_and_a_system_at_rest_is_a_note():
    rest, moves = np.zeros((30, 1)), np.linspace(0.0, 1.0, 30)[:, np.newaxis]
    assert of_still(0.0, moves) == [("never-moved", "serious")]
    assert of_still(0.0, rest) == [("never-moved", "note")]
    assert of_still(np.linspace(0.0, 1.0, 31)[:, np.newaxis], moves) == []
