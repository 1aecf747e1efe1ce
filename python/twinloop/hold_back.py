"""Holding back: less of a test's excitation is sent, the more of the room that its task leaves the states have used."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from twinloop import _core
from twinloop.arrays import Floats
from twinloop.errors import InvalidInput, engine_input
from twinloop.records import Recorded
from twinloop.signals import Signals

BEGINS, ENDS = 0.4, 0.6
"""Shares of the room between a task and the envelope at which an excitation begins to be held back, and is nothing."""


@dataclass(frozen=True, eq=False)
class HoldBack(Recorded, kind="hold_back"):
    """How much of an excitation is sent in a period, by the reading before it.

    All of it while every state is within its inner range, nothing once one is at an end of its outer range or beyond,
    and in between in proportion to what is left; the state with the least decides.

    Args:
        full: inner range of each state (n_x, 2), in its unit.
        none: outer range of each state (n_x, 2), likewise; infinite in both where a state holds nothing back.

    Raises:
        InvalidInput: other shapes, or an inner range that does not lie within the outer one.
    """

    full: Floats
    none: Floats

    def __post_init__(self) -> None:
        for name in ("full", "none"):
            ranges = np.array(getattr(self, name), dtype=np.float64)
            if ranges.ndim != 2 or ranges.shape[1] != 2:
                raise InvalidInput(f"HoldBack.{name}: expected shape (states, 2), found {ranges.shape}.")
            object.__setattr__(self, name, ranges)
        with engine_input():
            _ = self.engine  # the engine refuses now rather than at the first flight

    @cached_property
    def engine(self) -> _core.HoldBack:
        """The same for the native engine."""
        return _core.HoldBack(self.full, self.none)

    def ranges(self, signals: Signals) -> dict[str, dict[str, list[float | None]]]:
        """Inner range ("full") and outer range ("none") of each state that holds anything back, for a sheet.

        Args:
            signals: that it is for.

        Returns:
            By the state's name, low and high end in its unit; None for an end that is open.
        """
        return {
            name: {"full": _ends(self.full[i]), "none": _ends(self.none[i])}
            for i, name in enumerate(signals.state_names)
            if np.isfinite(self.none[i]).any()
        }

    @classmethod
    def between(cls, signals: Signals, initial_state: ArrayLike, target_state: ArrayLike) -> HoldBack | None:
        """What keeps an excitation out of the margins of the envelope that its task does not need.

        The room of a state, on each side, reaches from the farthest point of its task (the start and all targets) to
        the end of its envelope. An excitation is held back from 0.4 of that room on, and is nothing at 0.6.

        Args:
            signals: of the system; a state without an envelope, or one that is periodic, holds nothing back.
            initial_state: where the flight starts (n_x,), SI units, radians.
            target_state: where it leads (n_x,), or a row for each state (n + 1, n_x), the same units.

        Returns:
            What holds it back; None where no state does.
        """
        points = np.vstack([np.atleast_2d(initial_state), np.atleast_2d(target_state)])
        full = np.tile([-np.inf, np.inf], (signals.n_x, 1))
        none = full.copy()
        for i, state in enumerate(signals.states):
            if state.envelope is None or state.periodic:
                continue
            for end, (farthest, bound) in enumerate(
                zip((points[:, i].min(), points[:, i].max()), state.envelope, strict=True)
            ):
                room = bound - farthest
                # A task that leads to the end of the envelope leaves no room to speak of.
                if (room > 0.0) == bool(end) and room != 0.0:
                    full[i, end], none[i, end] = farthest + BEGINS * room, farthest + ENDS * room
        return cls(full, none) if np.isfinite(none).any() else None


def _ends(row: Floats) -> list[float | None]:
    return [value if np.isfinite(value) else None for value in row.tolist()]
