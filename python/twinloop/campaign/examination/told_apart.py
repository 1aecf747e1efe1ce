"""Commands whose effects a log cannot tell apart: from those of other commands, or from those of the states."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop._ground.texts import enumerated
from twinloop.remarks import Remark, note
from twinloop.signals import Signals

LEAST = 0.01
"""Share of a command's motion that must be its own, beside all that follows linearly from others."""
PART = 0.05
"""Share of a command's motion that another command accounts for at least if it is named beside it."""
ROWS = 10
"""Rows for each column, below which a regression says nothing."""


def alike(states: Floats, commands: Floats, signals: Signals) -> Iterator[Remark]:
    """Notes on commands that follow linearly from other commands, or from these and the states.

    Args:
        states: readings at the commands (n, n_x).
        commands: as sent (n, n_u).
        signals: of the system.
    """
    known, sent = _standard(states), _standard(commands)
    moving = np.flatnonzero(sent.any(axis=0)).tolist()
    if len(commands) < ROWS * (1 + signals.n_x + len(moving)):
        return
    together: set[int] = set()
    fed_back = []
    for j in moving:
        others = [i for i in moving if i != j]
        weights, own = _regression(sent[:, j], sent[:, others])
        if own <= LEAST:
            together |= {j, *(i for i, weight in zip(others, weights, strict=True) if abs(weight) > PART)}
        elif _regression(sent[:, j], np.hstack([known, sent[:, others]]))[1] <= LEAST:
            fed_back.append(j)
    if together:
        yield note(
            "alike-commands",
            f"{_names(signals, sorted(together))} move together: each follows from the others to {100.0 * LEAST:g} %,"
            " so their effects cannot be told apart. Excite each by a signal of its own.",
        )
    if fed_back:
        several = len(fed_back) > 1
        yield note(
            "fed-back",
            f"{_names(signals, fed_back)} follow{'' if several else 's'} from the states to {100.0 * LEAST:g} %, as"
            f" under a feedback alone: {'their effects' if several else 'its effect'} can hardly be told from theirs."
            " Fly with an excitation, or also with other gains.",
        )


def _names(signals: Signals, commands: Sequence[int]) -> str:
    return enumerated([signals.command_names[j] for j in commands])


def _standard(columns: Floats) -> Floats:
    """Columns less their means, each of root mean square 1; 0 where one does not move."""
    moved = columns - columns.mean(axis=0)
    sizes = np.sqrt(np.square(moved).mean(axis=0))
    standard: Floats = moved / np.where(
        sizes > 1e-9 * np.abs(columns).max(axis=0, initial=0.0), sizes, np.inf
    )
    return standard


def _regression(wanted: Floats, columns: Floats) -> tuple[Floats, float]:
    """Weights of columns that account for another one, and the root mean square of what they leave."""
    weights: Floats = np.asarray(np.linalg.lstsq(columns, wanted, rcond=None)[0], dtype=np.float64)
    return weights, float(np.sqrt(np.square(wanted - columns @ weights).mean()))
