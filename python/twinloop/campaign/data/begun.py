"""Begun: flights that began elsewhere than their tests do, or ended before; nothing compares with their quality."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from twinloop._ground.texts import in_unit
from twinloop.identification.records import Run, guessed_noise
from twinloop.remarks import Remark, note, serious
from twinloop.test import Test
from twinloop.trajectory import Trajectory

if TYPE_CHECKING:
    from twinloop.campaign.history import Experiment

SHARE = 0.1
"""Share of a state's way from start to target, or of its scale where it has none, by which a start may be off."""
NOISE = 5.0
"""Standard deviations of its sensor by which it may be in any case."""


def off_start(test: Test, run: Trajectory) -> tuple[int, ...]:
    """States whose first reading is not where a test starts, more than noise and a tenth of their way from it.

    Args:
        test: that was flown.
        run: the flight.
    """
    signals, start = test.signals, np.asarray(test.initial_state)
    target = np.atleast_2d(test.target_state)[-1]
    scales = np.array([state.scale for state in signals.states])
    way = np.abs(signals.difference(target, start))
    allowed = SHARE * np.where(way > 0.0, way, scales)
    noise = np.sqrt(guessed_noise([Run.of(run.states, run.commands).continued(signals)], scales))
    off = np.abs(signals.difference(run.states[0], start))
    return tuple(np.flatnonzero(off > np.maximum(allowed, NOISE * noise)).tolist())


def from_other_starts(
    experiments: Sequence[Experiment], say: Callable[[str, str], Remark] = note
) -> Iterator[Remark]:
    """That flights began elsewhere than their tests.

    Args:
        experiments: as they count, in the order of `tell`.
        say: makes a remark of a code and a sentence.
    """
    for run in experiments:
        if run.test is None or not run.off_start:
            continue
        signals, began, start = run.test.signals, run.trajectory.states[0], run.test.initial_state
        places = ", ".join(
            f"{signals.states[i].name} at {in_unit(f'{began[i]:.4g}', signals.states[i].unit)}"
            f" instead of {in_unit(f'{start[i]:.4g}', signals.states[i].unit)}"
            for i in run.off_start
        )
        yield say(
            "other-start",
            f"The flight of test {run.test.number} began elsewhere than its test: {places}. It is learnt. But"
            " the prediction was for another start, and its quality is not compared with that of other flights. Begin"
            " where the sheet says, or declare where flights begin.",
        )


def ended_early(flight: Experiment) -> Iterator[Remark]:
    """That a flight is shorter than its test although nobody says that it was stopped.

    Args:
        flight: that was recorded.
    """
    steps = flight.trajectory.steps
    if flight.test is not None and flight.trajectory.ended == "completed" and steps < flight.test.steps:
        yield serious(
            "short-flight",
            f"The flight of test {flight.test.number} has {steps} of its {flight.test.steps} periods: it is learnt, and"
            " has no quality. Tell the whole record, or that it was aborted, and why.",
        )
