"""Holding back: less of a test's excitation is sent, the more of the room that its task leaves the states have used."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from twinloop import _core
from twinloop._experiment.rates import rates_of
from twinloop._ground.arrays import Floats
from twinloop._ground.values import Value
from twinloop.errors import InvalidInput
from twinloop.records import Recorded
from twinloop.signals import Signals, State

BEGINS, ENDS = 0.2, 0.4
"""Shares of the room between a task and the envelope at which an excitation begins to be held back, and is nothing."""
LEFT = 0.2
"""Share of that room that remains room at least, wherever a controller leads by itself."""


@dataclass(frozen=True, eq=False)
class HoldBack(Value, Recorded, kind="hold_back"):
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

    def overrun(self, signals: Signals, states: ArrayLike) -> float:
        """How far readings went on after the excitation was held back to nothing.

        Args:
            signals: of the system.
            states: readings (n, n_x), SI units, radians.

        Returns:
            As a share of the way from the outer range to the envelope: 0 or less if no reading was outside the outer
            range, 1 if one reached the end of the envelope.
        """
        read = np.asarray(states, dtype=np.float64)
        most = -np.inf
        for i, state in enumerate(signals.states):
            if state.envelope is None or state.periodic:
                continue
            far = np.array([self.none[i, 0] - read[:, i].min(), read[:, i].max() - self.none[i, 1]])
            way = np.array([self.none[i, 0] - state.envelope[0], state.envelope[1] - self.none[i, 1]])
            counts = np.isfinite(far) & (way > 0.0)
            most = max(most, float((far[counts] / way[counts]).max(initial=-np.inf)))
        return most

    @classmethod
    def between(
        cls,
        signals: Signals,
        initial_state: ArrayLike,
        target_state: ArrayLike,
        swing: float | None = None,
        reached: ArrayLike | None = None,
        by: Sequence[int] | None = None,
    ) -> HoldBack | None:
        """Keeps an excitation away from the ends of the envelope.

        The room of a state, on each side, reaches from the farthest point of its task (the start and all targets) to
        the end of its envelope. A derivative, or a body rate, has no more room than its state divided by `swing`: how
        far a rate may go is seldom known as well as how far an angle may. An excitation is held back from 0.2 of that
        room on, and is zero at 0.4.

        Args:
            signals: of the system; a periodic state, or one without an envelope, does not count.
            initial_state: of the flight (n_x,), SI units, radians.
            target_state: of the flight (n_x,), or a row for each state (n + 1, n_x), the same units.
            swing: time in which a state may use up its room, s; None: derivatives have the room of their envelopes.
            reached: smallest and largest value of each state that every flight of the same controller has reached that
                kept the envelope (2, n_x); None: there were none. Where the controller leads anyway, an excitation may
                lead, too, and no further: its outer range then ends there, but at least a fifth of the room before the
                envelope.
            by: places of the states that count; None: all.

        Returns:
            The ranges; None if no state counts.
        """
        points = np.vstack([np.atleast_2d(initial_state), np.atleast_2d(target_state)])
        farthest = np.stack([points.min(axis=0), points.max(axis=0)], axis=1)
        rooms = np.array([_rooms(state, ends) for state, ends in zip(signals.states, farthest, strict=True)])
        outwards = np.array([-1.0, 1.0])
        others = [] if by is None else [i for i in range(len(rooms)) if i not in by]
        most = (1.0 - LEFT) * rooms
        if swing is not None:
            place = signals.state_names.index
            # The room of a rate depends on that of what it is the rate of.
            for rate, of in rates_of(signals).items():
                rooms[place(rate)] = np.minimum(rooms[place(rate)], rooms[place(of)] / swing)
        rooms[others] = np.inf
        # From the task's farthest points outwards: where the excitation is nothing, and where it begins to be less.
        ends = ENDS * rooms
        if reached is not None:
            beyond = outwards * (np.asarray(reached, dtype=np.float64).T - farthest)
            ends = np.maximum(ends, np.clip(beyond, 0.0, most))
        counts = np.isfinite(rooms)
        begins = np.where(counts, ends - (ENDS - BEGINS) * np.where(counts, rooms, 0.0), np.inf)
        full, none = (farthest + outwards * share for share in (begins, ends))
        return cls(full, none) if np.isfinite(none).any() else None


def _rooms(state: State, farthest: Floats) -> Floats:
    """From the farthest points of a task to the ends of a state's envelope (2,); infinite where an end has no say."""
    if state.envelope is None or state.periodic:
        return np.full(2, np.inf)
    rooms = np.array([farthest[0] - state.envelope[0], state.envelope[1] - farthest[1]])
    # A task that leads to the end of the envelope leaves no room to speak of.
    return np.where(rooms > 0.0, rooms, np.inf)


def _ends(row: Floats) -> list[float | None]:
    return [value if np.isfinite(value) else None for value in row.tolist()]
