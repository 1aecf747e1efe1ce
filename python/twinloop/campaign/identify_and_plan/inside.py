"""Inside: of a flight that has left its envelope for good only what came before is learnt, where no law explains all.

A machine that is out there may have fallen, stalled or hit something. A law that has to describe that, too, describes
worse what was before, and no controller is to lead there again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from twinloop.campaign.history import Experiment
from twinloop.remarks import Remark, note
from twinloop.trajectory import Trajectory

LEAST = 10
"""Readings of a flight that are kept in any case."""
ENOUGH = 0.5
"""Share of all readings that must be inside for what is learnt of them alone to be believed without an explanation."""
INSIDE = "inside"
"""Code of the remark that says that flights were learnt only as far as they were inside."""


def inside(experiments: Sequence[Experiment]) -> list[Experiment]:
    """Flights as far as they were inside their envelope; the very same where they did not leave it for good.

    Args:
        experiments: as they were told.
    """
    return [_inside(run) for run in experiments]


def enough_inside(experiments: Sequence[Experiment], kept: Sequence[Experiment]) -> bool:
    """Whether so much is left of flights that it tells at least as much as what was taken away.

    Args:
        experiments: as they were told.
        kept: what is left of each.
    """
    return _readings(kept) >= ENOUGH * _readings(experiments)


def said_inside(experiments: Sequence[Experiment], kept: Sequence[Experiment], dt: float) -> list[Remark]:
    """From when on which flights were not learnt; nothing where all were.

    Args:
        experiments: as they were told.
        kept: what was learnt of each.
        dt: period, s.
    """
    cut = [
        f"{_name(run, place)} from {part.trajectory.steps * dt:.4g} s on"
        for place, (run, part) in enumerate(zip(experiments, kept, strict=True), start=1)
        if part.trajectory.steps < run.trajectory.steps
    ]
    if not cut:
        return []
    return [
        note(
            INSIDE,
            "Outside the envelope no law explains what was recorded together with what came before, so it is not"
            f" learnt: {', '.join(cut)}. The twin knows nothing of what happens there, such as a fall or a stall.",
        )
    ]


def _inside(run: Experiment) -> Experiment:
    gone = run.gone_from
    flown = run.trajectory
    last = flown.steps if gone is None else min(flown.steps, max(LEAST, gone) - 1)
    if last == flown.steps:
        return run
    part = Trajectory(flown.t[: last + 1], flown.states[: last + 1], flown.commands[:last])
    return replace(run, trajectory=part)


def _readings(experiments: Sequence[Experiment]) -> int:
    return sum(run.trajectory.steps + 1 for run in experiments)


def _name(run: Experiment, place: int) -> str:
    return f"run {place}" if run.number is None else f"test {run.number}"
