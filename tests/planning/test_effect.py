"""Whether gains make a difference on a twin at all, and what is flown where they make none."""

from dataclasses import replace

import numpy as np
import pytest

from committees import TUNED, committee_of, member, planner_of, signals
from oracles import same_bits
from twinloop.planning.effect import gains_count
from twinloop.planning.proposal import Flown

KNOWN = signals()
IDLE, MOVED, WILD = member(KNOWN, 0.0), member(KNOWN, 1.0), member(KNOWN, 1.0, damping=-400.0)
"""Motors whose torque does nothing, whose torque turns them, and one that diverges under all gains."""


@pytest.mark.parametrize(
    ("members", "counted"),
    [([MOVED], True), ([IDLE], False), ([IDLE, IDLE], False), ([IDLE, MOVED], True), ([WILD], True)],
    ids=["acts", "idle", "all-idle", "acts-on-one", "diverges"],
)
def test_gains_count_where_flights_differ_by_them_or_diverge(members, counted):
    assert gains_count(planner_of(KNOWN), members) == counted


def test_where_gains_make_no_difference_the_best_ones_fly_again_as_strongly_excited_as_where_no_law_is_known():
    planner = planner_of(KNOWN)
    idle = replace(committee_of(KNOWN), members=[IDLE, IDLE], gains_count=False)
    flown = Flown(TUNED, True, [1.0], 100.0)
    amplitudes = []
    for committee in (idle, replace(idle, gains_count=True), replace(committee_of(KNOWN), trusted=False)):
        found = planner.propose(committee, TUNED, flown, "both", 3, exploit=False)
        assert found.excitation is not None
        amplitudes.append(float(np.abs(found.excitation).max()))
        if committee is idle:
            assert same_bits(found.genes, TUNED)
            assert "does not know yet what the commands do" in found.reason
    most = planner.options.excitation_unknown
    assert amplitudes[0] == pytest.approx(most, rel=0.05) and amplitudes[2] == pytest.approx(most, rel=0.05)
    assert amplitudes[1] <= planner.options.excitation_most
