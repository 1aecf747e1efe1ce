"""Reports: what logs and controllers are given of readings: a slow sensor's last one, a rate computed of others'.

Both are linear in the readings, so what noise adds to these passes in the same way, by itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop._ground.slopes import slopes
from twinloop.signals import Signals


class Held(NamedTuple):
    """A slow sensor, whose last reading is given until there is a new one, or a late one.

    Args:
        every: periods from one new reading to the next; 1 where there is a new one in each.
        first: period of the first one after the start of a run, 1 to `every`.
        age: periods that a reading is old when it is given.
    """

    every: int
    first: int
    age: int = 0


class Computed(NamedTuple):
    """A rate without a sensor of its own: r[k] = kept r[k-1] + share (x[k] - x[k-1]), of readings x of another state.

    Args:
        of: place of that state.
        kept: 0 for a plain difference; below 1.
        share: above 0.
    """

    of: int
    kept: float
    share: float


Reports = tuple[Held | Computed | None, ...]
"""Of each state; None of one that is given as it is read. Empty where all are."""


def reports_of(model: _core.Model, states: int) -> Reports:
    """Those of a model of so many states."""
    held, computed = model.reports
    found: dict[int, Held | Computed] = {state: Held(every, first, age) for state, every, first, age in held}
    found |= {state: Computed(of, kept, share) for state, of, kept, share in computed}
    return tuple(found.get(state) for state in range(states)) if found else ()


def with_reports(model: _core.Model, reports: Reports) -> _core.Model:
    """The same model, of whose readings so much is given."""
    if not reports:
        return model
    held = [(i, *report) for i, report in enumerate(reports) if isinstance(report, Held)]
    computed = [(i, *report) for i, report in enumerate(reports) if isinstance(report, Computed)]
    return model.with_reports(held, computed)


def sensed(model: _core.Model) -> _core.Model:
    """The same model with sensors for the rates that are computed of readings."""
    held, computed_ = model.reports
    return model.with_reports(held, []) if computed_ else model


def given(reports: Reports, readings: Floats) -> Floats:
    """What is given of readings, or of the noise in them.

    Args:
        reports: of the system.
        readings: of each period in turn (…, n + 1, n_x).

    Returns:
        As many; the readings themselves where all are given as they are.
    """
    if not any(reports):
        return readings
    found = readings.copy()
    # A rate that is computed of a slow sensor's readings is computed of what it repeats.
    for i, report in enumerate(reports):
        if isinstance(report, Held):
            rows = np.arange(readings.shape[-2])
            fresh = rows - (rows - report.first) % report.every - report.age
            found[..., i] = readings[..., np.where(rows < report.first, 0, np.maximum(fresh, 0)), i]
    for i, report in enumerate(reports):
        if isinstance(report, Computed):
            for k in range(1, readings.shape[-2]):
                change = found[..., k, report.of] - found[..., k - 1, report.of]
                found[..., k, i] = report.kept * found[..., k - 1, i] + report.share * change
    return found


def unread(reports: Reports, signals: Signals) -> Reports:
    """Those alone of states that are not measured."""
    kept = tuple(report if i in signals.unmeasured else None for i, report in enumerate(reports))
    return kept if any(kept) else ()


def old(reports: Reports, ages: Sequence[int]) -> Reports:
    """The same with readings of slow sensors that are so many periods old when they are given (n_x)."""
    return tuple(
        report._replace(age=age) if isinstance(report, Held) else report
        for report, age in zip(reports, ages, strict=True)
    )


def with_late(reports: Reports, ages: Sequence[int]) -> Reports:
    """The same in which readings that are given as they are read are late by so many periods (n_x)."""
    if not any(ages):
        return reports
    return tuple(
        report or (Held(1, 1, age) if age else None)
        for report, age in zip(reports or (None,) * len(ages), ages, strict=True)
    )


def late_in(reports: Reports, states: int) -> tuple[int, ...]:
    """Periods by which readings are late that are given in every period (n_x); 0 of all others."""
    known = reports or (None,) * states
    return tuple(one.age if isinstance(one, Held) and one.every == 1 else 0 for one in known)


def in_words(reports: Reports, signals: Signals) -> list[str]:
    """What is said of each state that is not given as it is read.

    Args:
        reports: of a law.
        signals: of the system.
    """
    lines, names = [], signals.state_names
    for name, report in zip(names, reports, strict=False):
        if isinstance(report, Held):
            late = f"given {report.age * signals.dt:.6g} s later"
            slow = f"read once in {report.every} periods ({report.every * signals.dt:.6g} s)"
            said = late if report.every == 1 else f"{slow}, and {late}" if report.age else slow
            lines.append(f"{name} is {said}")
        elif isinstance(report, Computed):
            of = names[report.of]
            kept = f"{report.kept:.6g} times its last value and " if report.kept else ""
            lines.append(
                f"{name} is computed: {kept}{report.share:.6g} times what {of} has changed by as it is read"
            )
    return lines


def slopes_of(states: Floats, reports: Reports, signals: Signals) -> dict[int, Floats]:
    """Rates that are computed of readings, by place, as slopes (n + 1,) of what they are computed of.

    Args:
        states: of a record (n + 1, n_x).
        reports: what is given of readings.
        signals: of the system.

    Returns:
        Those that the record is long enough for.
    """
    continued = signals.continued(states, states[0])
    found = {i: slopes(continued[:, report.of]) for i, report in computed(reports).items()}
    return {i: each.at / signals.dt for i, each in found.items() if each is not None}


def variance(report: Computed, of: float) -> float:
    """Variance of a computed rate's noise, of that of the state that it is computed of: the rate's own adds nothing."""
    return 2.0 * report.share * report.share * of / (1.0 + report.kept)


def computed(reports: Sequence[Held | Computed | None]) -> dict[int, Computed]:
    """The computed ones by the place of the state."""
    return {i: report for i, report in enumerate(reports) if isinstance(report, Computed)}
