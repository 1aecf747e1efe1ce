"""Rows: by how many of them recorded commands come after, or before, the readings that they were computed from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.texts import enumerated
from twinloop.campaign.data.excited import NEARER, SEEN, as_excited, given_in_spans, hows, span_of
from twinloop.remarks import Remark, serious
from twinloop.test import Test
from twinloop.trajectory import Trajectory

if TYPE_CHECKING:
    from twinloop.campaign.history import Experiment

MOST = 5
"""Rows by which commands are looked for on either side of theirs."""
FEWEST = 20
"""Rows at least that are compared."""
FEW = 5
"""Of these at least that have to be off as they stand: a command that changes once tells nothing of its rows."""


class Shifted(NamedTuple):
    """Commands in other rows than those of their readings.

    Args:
        rows: by which they are late; negative where they are early.
        commands: their names.
        tests: numbers of the tests in which they are.
    """

    rows: int
    commands: tuple[str, ...]
    tests: tuple[int, ...]


def late_commands(test: Test, run: Trajectory) -> tuple[int, ...]:
    """By how many rows each command is recorded late, negative where it is early; 0 where that does not show.

    A controller's commands follow from its readings almost exactly, so in the rows of these nothing is left of them.
    Where they were computed from readings that the log does not show, none fits, and nothing is said.

    Args:
        test: as it was asked for.
        run: that was recorded of it.
    """
    late = np.zeros(run.commands.shape[1], dtype=int)
    if len(run.commands) < FEWEST + MOST:
        return tuple(late.tolist())
    sent = run.commands / span_of(test)
    asked = [given_in_spans(as_excited(test, how), run.states) for how in hows(test)]
    least = np.full(sent.shape[1], np.inf)
    for shift in (shift for rows in range(1, MOST + 1) for shift in (rows, -rows)):
        left = np.min([_off(sent, each, shift) for each in asked], axis=0)
        # In the same rows: one that is off by itself is out of both.
        used = slice(shift, None) if shift > 0 else slice(None, shift)
        off = np.min([_off(sent[used], each[used], 0) for each in asked], axis=0)
        several = (
            np.min([(np.abs(sent[used] - each[used]) > SEEN).sum(axis=0) for each in asked], axis=0) >= FEW
        )
        better = several & (off > SEEN * SEEN) & (NEARER * left <= off) & (left < least)
        late[better], least[better] = shift, left[better]
    return tuple(late.tolist())


def in_other_rows(experiments: Sequence[Experiment]) -> list[Shifted]:
    """Commands that were recorded in the rows of later or earlier readings than they were computed from.

    Args:
        experiments: as they count.
    """
    found: dict[tuple[int, tuple[str, ...]], list[int]] = {}
    for run in experiments:
        if run.test is None:
            continue
        names, late = run.test.signals.command_names, late_commands(run.test, run.trajectory)
        for rows in sorted(set(late) - {0}):
            of = tuple(name for name, each in zip(names, late, strict=True) if each == rows)
            tests = found.setdefault((rows, of), [])
            tests += [run.test.number] if run.test.number not in tests else []
    return [Shifted(rows, of, tuple(tests)) for (rows, of), tests in found.items()]


def from_late_commands(found: Sequence[Shifted]) -> Iterator[Remark]:
    """That commands were recorded in other rows than those of the readings that they were computed from.

    A program that sends each command a period after its reading logs the same. What to do is the same, too: with the
    command in the row of its reading the law has the delay, and a simulated controller meets it as the real one does.

    Args:
        found: which, and in which tests.
    """
    return map(_said, found)


def _said(found: Shifted) -> Remark:
    shift, names, tests = found.rows, found.commands, found.tests
    rows = f"{abs(shift)} row{'s' * (abs(shift) > 1)}"
    late, other, to = ("late", "−", "up") if shift > 0 else ("early", "+", "down")
    several = len(names) > 1
    cause = (
        " Either the log has it there by mistake, or the program sends it that much later; in both cases"
        if shift > 0
        else " So the log has readings and commands in different rows:"
    )
    return serious(
        f"commands-{late}",
        f"{enumerated(names)} of test{'s' * (len(tests) > 1)} {', '.join(map(str, tests))}"
        f" {'are' if several else 'is'} recorded {rows} {late}: row k has what the controller gives for the readings of"
        f" row k {other} {abs(shift)}.{cause} move the column{'s' * several} {to} by {rows}, withdraw the"
        f" {'flights, and tell them' if len(tests) > 1 else 'flight, and tell it'} again. Each row has the"
        " command that was computed from its readings; what takes effect later is then learnt as a delay.",
    )


def _off(sent: Floats, asked: Floats, shift: int) -> Floats:
    """Mean squares by which commands are off from those asked for so many rows before (n_u,)."""
    if shift < 0:
        sent, asked, shift = asked, sent, -shift
    return np.asarray(np.square(sent[shift:] - asked[: len(asked) - shift]).mean(axis=0))
