"""Alternatives in the order in which they are worth flying."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from twinloop.campaign.history import Planned
from twinloop.test import Test


def ranked(tests: Iterable[Test], plans: Mapping[int, Planned], goal: str) -> tuple[Test, ...]:
    """Tests by worth: those that keep the envelope first, then by what a campaign is for.

    Args:
        tests: that wait to be flown.
        plans: what was expected of each, by its number; tests of which nothing was come last, in their order.
        goal: "control": the best predicted quality first; else the most bits that a flight tells first.

    Returns:
        They, the best first.
    """

    def worth(test: Test) -> tuple[bool, bool, float, int]:
        plan = plans.get(test.number)
        if plan is None or plan.predicted is None or plan.bits is None:
            return True, True, 0.0, test.number
        return False, not plan.safe, plan.predicted if goal == "control" else -plan.bits, test.number

    return tuple(sorted(tests, key=worth))
