"""Halfway: gains that stay away from where flights have shown that the twin is wrong."""

import numpy as np
import pytest

from committees import TUNED, committee_of, family_of, planner_of, signals
from twinloop.planning.halfway import beyond_halfway
from twinloop.planning.proposal import Flown

BEST = np.array([1.0, 0.1, 0.5])


def at(family, place):
    return family.from_unit(np.array(place))


def test_gains_may_go_half_of_the_shortest_way_to_those_that_disappointed():
    family = family_of(signals())
    best = at(family, [0.5, 0.5, 0.5])
    genes = np.stack([at(family, [0.5 + step, 0.5, 0.5]) for step in (0.0, 0.1, 0.2, 0.3)])
    far, near = at(family, [0.5, 0.5, 0.1]), at(family, [0.74, 0.5, 0.82])
    assert not beyond_halfway(family, genes, best, []).any()
    np.testing.assert_allclose(beyond_halfway(family, genes, best, [far]), [0.0, 0.0, 0.0, 0.5], atol=1e-9)
    # The way to the other is the hypotenuse of 0.24 and 0.32.
    np.testing.assert_allclose(
        beyond_halfway(family, genes, best, [near, far]), [0.0, 0.0, 0.0, 0.5], atol=1e-9
    )
    closer = at(family, [0.5, 0.6, 0.5])
    expected = [0.0, 1.0, 3.0, 5.0]
    np.testing.assert_allclose(beyond_halfway(family, genes, best, [closer, far]), expected, atol=1e-9)
    # That the best gains themselves were worse once leaves no way.
    assert not beyond_halfway(family, genes, best, [best]).any()


@pytest.mark.parametrize("exploit", [False, True])
def test_a_proposal_stays_halfway_and_says_so(exploit):
    known = signals()
    planner, committee = planner_of(known, candidates=128), committee_of(known)
    good = float(planner.judge(committee.members, BEST[None], committee.sds, 1).mean[0])

    def proposed(*disproved):
        flown = Flown(best=BEST, flies=True, usages=[0.5, 0.5], good=good, disproved=disproved)
        return planner.propose(committee, TUNED, flown, "both", 3, exploit)

    free, kept = proposed(), proposed(TUNED)
    assert beyond_halfway(planner.family, free.genes[None], BEST, [TUNED])[0] > 0.2
    assert beyond_halfway(planner.family, kept.genes[None], BEST, [TUNED])[0] == 0.0
    # It still goes on, and the twin is still asked how far.
    assert kept.predicted < 0.95 * good
    assert "halfway" in kept.reason and "halfway" not in free.reason
    # The best gains themselves were worse once: that leads nowhere, and holds nothing back.
    again = proposed(BEST)
    assert again.reason == free.reason and again.genes.tobytes() == free.genes.tobytes()
