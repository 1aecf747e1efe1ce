"""What is given of readings, around a point: a computed rate is a state, a slow sensor a delay of its mean age.

A slow sensor is no linear system that stays the same from period to period; half its period is what its held readings
are behind on average.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from twinloop.law.linear.state_space import Linear
from twinloop.law.reports import Computed, Held, Reports


def as_given(reports: Reports, read: Linear, dt: float) -> Linear:
    """A linear law with what is given of its readings.

    Args:
        reports: of the law.
        read: the law around a point, with what its sensors read.
        dt: period, s.

    Returns:
        The same; in continuous time with the delays that held and filtered readings have at low frequencies.
    """
    if not any(reports):
        return read
    if read.dt is None:
        late = [_delay(report, reports, dt) for report in reports]
        return replace(read, offsets=read.offsets + np.array([*late, *[0.0] * (len(read.A) - len(late))]))
    for state, report in enumerate(reports):
        if isinstance(report, Held):
            read = _delayed(read, state, _behind(report))
    for state, report in enumerate(reports):
        if isinstance(report, Computed):
            read = _computed(read, state, report)
    return read


def _behind(held: Held) -> int:
    """Periods that what a slow sensor gives is behind on average, rounded up."""
    return held.age + held.every // 2


def _delay(report: Held | Computed | None, reports: Reports, dt: float) -> float:
    """What is given is later by so many s than what is read, at low frequencies."""
    if isinstance(report, Held):
        return _behind(report) * dt
    if isinstance(report, Computed):
        # Half a period of the difference, and the mean age of what the filter keeps.
        return (0.5 + report.kept / (1.0 - report.kept)) * dt + _delay(reports[report.of], reports, dt)
    return 0.0


def _delayed(read: Linear, state: int, periods: int) -> Linear:
    """With a reading of some periods before in the place of a state's."""
    size = len(read.A)
    names = [f"{read.states[state]}_read_{back}_before" for back in range(1, periods + 1)]
    whole = _with(read, names, [state] * periods)
    for back in range(periods):
        row = np.zeros(size + periods)
        if back == 0:
            row[:size] = read.C[state]
        else:
            row[size + back - 1] = 1.0
        whole.A[size + back] = row
    whole.C[state] = 0.0
    whole.C[state, size + periods - 1] = 1.0
    return whole


def _computed(read: Linear, state: int, report: Computed) -> Linear:
    """With a filtered difference of another's readings in the place of a state's."""
    size = len(read.A)
    names = [f"{read.states[state]}_before", f"{read.states[report.of]}_read_before"]
    whole = _with(read, names, [state, report.of])
    given = np.zeros(size + 2)
    given[:size] = report.share * read.C[report.of]
    given[size:] = report.kept, -report.share
    whole.A[size] = given
    whole.A[size + 1, :size] = read.C[report.of]
    whole.C[state] = given
    return whole


def _with(read: Linear, names: Sequence[str], of: Sequence[int]) -> Linear:
    """The same with a memory of some states behind the others, which nothing fills yet."""
    size, more = len(read.A), len(names)
    A, C = np.zeros((size + more, size + more)), np.eye(size + more)
    A[:size, :size], C[:size, :size] = read.A, read.C
    nothing = np.zeros(more)
    return replace(
        read,
        A=A,
        B=np.vstack([read.B, np.zeros((more, read.B.shape[1]))]),
        C=C,
        states=(*read.states, *names),
        state=np.concatenate([read.state, read.state[list(of)]]),
        drift=np.concatenate([read.drift, nothing]),
        offsets=np.zeros(size + more),
    )
