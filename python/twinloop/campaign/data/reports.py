"""Reports: which sensors of a log are slow, and which rates are computed of other states' readings."""

from __future__ import annotations

from collections.abc import Sequence

from twinloop.campaign.data.readings import derived, is_rate, repeats
from twinloop.law.reports import Computed, Held, Reports
from twinloop.signals import Signals
from twinloop.trajectory import Trajectory


def reports_in(runs: Sequence[Trajectory], signals: Signals) -> Reports:
    """What is given of readings: repeated ones, and filtered differences of those whose derivatives they should be.

    Args:
        runs: that were recorded.
        signals: of the system.
    """
    records = [run.states for run in runs]
    found: list[Held | Computed | None] = [
        repeats([states[:, i] for states in records]) for i in range(signals.n_x)
    ]
    for one in derived(records):
        if found[one.rate] is None and is_rate(one, signals):
            found[one.rate] = Computed(one.of, one.kept, one.share)
    return tuple(found) if any(found) else ()
