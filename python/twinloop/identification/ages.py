"""Ages: how old the readings of slow sensors are when they are given, searched before anything else is learnt.

A position from satellites, or from a camera, is that of a while ago. What drives the state is read in time, so the
description of the readings is shortest at the true age.
"""

from __future__ import annotations

from collections.abc import Sequence

from twinloop.identification.context import Context
from twinloop.identification.description import shorter
from twinloop.identification.forms import briefly_described
from twinloop.identification.records import Run
from twinloop.identification.sensors.reported import as_sensed
from twinloop.law.reports import Held, Reports, reports_of

LONGEST = 2.0
"""Periods of the sensor that a reading is old at most."""
COARSE = 0.25
"""Step of the first ages that are tried, in such periods."""
PRICE = 12.0
"""What an age must gain in χ²: its number, and the choice of having one."""
AGING = 500
"""Number of the first trial, by which what it draws is told from what others draw."""
RECEIVERS = 100_000
"""How far the numbers of each further receiver's trials are from those of the one before."""


def aged(context: Context, logged: Sequence[Run]) -> Reports:
    """What is given of readings, with how old it is.

    Sensors that are as slow as one another are one receiver's, and give readings of the same age.

    Args:
        context: of the identification, with what is given of readings.
        logged: runs as they were logged.
    """
    reports, earlier = context.reports, context.earlier
    before = reports_of(earlier.model, context.signals.n_x) if earlier is not None and context.settled else ()
    known = {report.every: report.age for report in before if isinstance(report, Held)}
    receivers = dict.fromkeys(report.every for report in reports if isinstance(report, Held))
    for number, every in enumerate(receivers):
        if every in known:
            reports = with_age(reports, every, known[every])
        else:
            reports = _of_one(context, logged, reports, every, AGING + RECEIVERS * number)
    return reports


def _of_one(context: Context, logged: Sequence[Run], reports: Reports, every: int, first: int) -> Reports:
    """The same with the age of what gives a reading in so many periods; its trials are numbered from the first on."""
    longest, step = int(LONGEST * every), max(1, round(COARSE * every))
    lengths: dict[int, float] = {}

    def length(age: int) -> float:
        if age not in lengths:
            tried = with_age(reports, every, age)
            # The same readings count at any age.
            runs = [as_sensed(run, tried, context.signals, ignored=longest) for run in logged]
            price = PRICE if age else 0.0
            lengths[age] = price + briefly_described(context, runs, first + age)
        return lengths[age]

    best = 0
    for age in range(step, longest + 1, step):
        if shorter(length(age), length(best)):
            best = age
        elif age - best >= 2 * step and best:
            break
    while best and step > 1:
        step = (step + 1) // 2
        for age in (best - step, best + step):
            if 0 < age <= longest and shorter(length(age), length(best)):
                best = age
    return with_age(reports, every, best)


def with_age(reports: Reports, every: int, age: int) -> Reports:
    """The same with an age of what gives a reading in so many periods."""
    return tuple(
        report._replace(age=age) if isinstance(report, Held) and report.every == every else report
        for report in reports
    )
