"""What readings alone give away: sensors that froze, commands that never changed, nothing but noise."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.texts import in_unit
from twinloop.campaign.data.reports import Derived, derived, is_rate, repeats
from twinloop.remarks import Remark, note, serious
from twinloop.signals import Signals
from twinloop.trajectory import Trajectory

FROZEN = 0.1
"""Share of a run over which a sensor that moved before must give one number to be taken for frozen."""
FEWEST = 10
"""Readings of such a stretch at least."""
AT_ONCE = 0.1
"""Times its usual step that a sensor moved last before it froze: what comes to rest by itself moves less and less."""
COUNTS = 1.5
"""Counts of a rounded sensor that it moved last before it froze: by one of them it also comes to rest by itself."""
WHITE = 1.5
"""Von Neumann's ratio, 2 for white noise and near 0 for what moves smoothly, above which nothing else is seen."""
SPIKES = 0.01
"""Share of the readings, and one more, that may be wrong at each end."""
ONLY_NOISE = "only-noise"
"""Code of the remark that readings contain nothing else."""
SOME = 20
"""Readings of a run at least that tell noise from motion."""


def suspicious(runs: Sequence[Trajectory], signals: Signals) -> Iterator[Remark]:
    """Remarks on readings that no machine gives.

    Args:
        runs: that were recorded.
        signals: of the system.
    """
    # What is made of readings has no sensor of its own.
    sensors = [(i, signals.states[i]) for i in signals.measured]
    for i, state in sensors:
        frozen = sum(froze(run.states[:, i]) for run in runs)
        if frozen:
            yield serious(
                "frozen",
                f"{state.name} is constant over a tenth or more of {frozen} of {len(runs)} runs, although it"
                " was moving before: its sensor froze, the log repeats its last value, or it hit a"
                " stop; remove these rows.",
            )
    records = [run.states for run in runs]
    for i, state in sensors:
        held = repeats([states[:, i] for states in records])
        if held is not None:
            yield note(
                "repeated-readings",
                f"{state.name} repeats every reading: it gives a new one each {held.every} periods"
                f" ({held.every * signals.dt:.3g} s). So it does on the twin, which learns from new ones alone"
                " (option reports). If an estimator makes more of it, log that.",
            )
    names = signals.state_names
    for one in (one for one in derived(records) if one.rate not in signals.unmeasured):
        yield note(
            "derived-rate",
            f"{names[one.rate]} is computed from the readings of {names[one.of]}, as a filtered difference of them, and"
            f" {_taken(one, signals)}. Log what a sensor of its own reads, if there is one.",
        )
    for j, command in enumerate(signals.commands):
        sent = [run.commands[:, j] for run in runs]
        if min(map(np.min, sent)) == max(map(np.max, sent)):
            yield note(
                "constant-command",
                f"{command.name} is {in_unit(f'{sent[0][0]:g}', command.unit)} in every row: its effect cannot be"
                " learnt; check that the command that was sent was logged.",
            )
    moved = [i for i in range(signals.n_x) if any(np.ptp(run.states[:, i]) > 0.0 for run in runs)]
    enough = any(len(run.states) >= SOME for run in runs)
    if moved and enough and all(ratio([_clipped(run.states[:, i]) for run in runs]) > WHITE for i in moved):
        yield serious(
            ONLY_NOISE,
            "Readings change from row to row as much as over whole runs: they contain only noise; check"
            " the sensors, their units, and that the period is not far too long.",
        )


def _taken(one: Derived, signals: Signals) -> str:
    """What a twin makes of a rate that is computed."""
    if is_rate(one, signals):
        return "so it is on the twin, which learns from those readings alone (option reports)"
    name, of = signals.state_names[one.rate], signals.state_names[one.of]
    return (
        "has their noise, which a law can take for motion: declare it"
        f" (State({name!r}, …, derivative_of={of!r})), in the unit of {of} a second, and the twin computes it, too"
    )


def still(run: Trajectory) -> bool:
    """Whether no reading of a run differs from its first.

    Args:
        run: that was recorded.
    """
    return bool((run.states == run.states[0]).all())


def at_rest(run: Trajectory) -> bool:
    """Whether neither readings nor commands of a run move: a model that stays where it is follows it.

    Args:
        run: that was recorded.
    """
    return still(run) and bool((run.commands == run.commands[:1]).all())


def froze(readings: Floats) -> bool:
    """Whether a sensor that moved gives one number over a stretch of a run, at once.

    Args:
        readings: of one state (n + 1,).
    """
    steps = np.abs(np.diff(readings))
    ends = np.flatnonzero(np.concatenate([[True], steps != 0.0, [True]]))
    lengths = np.diff(ends)
    longest = int(np.argmax(lengths))
    first, last = int(ends[longest]), int(ends[longest + 1])
    others = np.concatenate([steps[:first], steps[last - 1 :]])
    if lengths[longest] < max(FEWEST, FROZEN * len(readings)) or not len(others):
        return False
    usual = float(np.median(others))
    # A reading that is rounded stands still now and then; one of a system at rest moves less and less before.
    beside = [steps[k] for k in (first - 1, last - 1) if 0 <= k < len(steps)]
    at_once = max(AT_ONCE * usual, COUNTS * float(np.diff(np.unique(readings)).min()))
    return bool(usual > 0.0 and beside and min(beside) > at_once)


def _clipped(readings: Floats) -> Floats:
    """Readings (n + 1,) without the few that are furthest out: a single wrong one would look like noise alone."""
    ordered = np.sort(readings)
    few = 1 + int(SPIKES * len(readings))
    return np.clip(readings, ordered[few], ordered[-1 - few]) if len(readings) > 2 * few else readings


def ratio(records: Sequence[Floats]) -> float:
    """Von Neumann's ratio: mean square of successive differences over the variance; 2 for white noise.

    Args:
        records: of one state, a run each (n + 1,).
    """
    differences = sum(float(np.square(np.diff(values)).mean()) for values in records)
    variance = sum(float(values.var()) for values in records)
    return differences / variance if variance > 0.0 else 0.0
