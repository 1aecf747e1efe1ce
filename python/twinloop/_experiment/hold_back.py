"""Holding back: less of a test's excitation is sent, the more of the room that its task leaves the states have used."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop.errors import InvalidInput, engine_input
from twinloop.records import Recorded
from twinloop.signals import Signals

BEGINS, ENDS = 0.4, 0.6
"""Shares of the room between a task and the envelope at which an excitation begins to be held back, and is nothing."""


@dataclass(frozen=True, eq=False)
class HoldBack(Recorded, kind="hold_back"):
    """The share of an excitation that is sent in a period, from the reading before it.

    The share is 1 while every state is within its inner range. It is 0 once a state has reached an end of its outer
    range. In between it is linear; the smallest share of all states counts.

    Args:
        full: inner range of each state (n_x, 2), in its unit.
        none: outer range of each state (n_x, 2), likewise; infinite in both if a state does not count.

    Raises:
        InvalidInput: other shapes, or an inner range that is not within the outer one.
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
        """Inner range ("full") and outer range ("none") of each state that counts, for a test sheet.

        Args:
            signals: of the system.

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
        """Keeps an excitation away from the ends of the envelope.

        The room of a state, on each side, reaches from the farthest point of its task (the start and all targets) to
        the end of its envelope. An excitation is held back from 0.4 of that room on, and is zero at 0.6.

        Args:
            signals: of the system; a periodic state, or one without an envelope, does not count.
            initial_state: of the flight (n_x,), SI units, radians.
            target_state: of the flight (n_x,), or a row for each state (n + 1, n_x), the same units.

        Returns:
            The ranges; None if no state counts.
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
