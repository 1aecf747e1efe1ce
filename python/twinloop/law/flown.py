"""Where a law was learnt: how far its flights went, and whether a simulated run goes far beyond."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from twinloop._ground.texts import in_unit
from twinloop.remarks import Remark, serious
from twinloop.signals import Signals
from twinloop.trajectory import Trajectory

FAR = 1.0
"""Share of the flown range by which a run must leave it before that is said."""


@dataclass(frozen=True)
class Span:
    """Between which values flights have shown a state.

    Args:
        state: its name.
        unit: of it.
        low: least reading of all flights.
        high: largest one.
    """

    state: str
    unit: str
    low: float
    high: float

    def __str__(self) -> str:
        return in_unit(f"{self.state} from {self.low:.3g} to {self.high:.3g}", self.unit)


def spans(signals: Signals, flights: Sequence[Trajectory]) -> tuple[Span, ...]:
    """How far flights went, state by state; nothing of states that wrap, which have no ends.

    Args:
        signals: of the system.
        flights: that a law was learnt from; without any there are no spans.
    """
    if not flights:
        return ()
    low = np.min([flight.states.min(axis=0) for flight in flights], axis=0).tolist()
    high = np.max([flight.states.max(axis=0) for flight in flights], axis=0).tolist()
    return tuple(
        Span(state.name, state.unit, low[place], high[place])
        for place, state in enumerate(signals.states)
        if state.period is None
    )


def far_beyond(found: Sequence[Span], run: Trajectory, signals: Signals) -> Iterator[Remark]:
    """What is to be said of a simulated run that goes where no flight went near.

    Args:
        found: how far the flights went.
        run: simulated.
        signals: of both.
    """
    for span in found:
        values = run.states[:, signals.state_names.index(span.state)]
        room = FAR * (span.high - span.low)
        furthest = max((float(values.min()), float(values.max())), key=lambda end: _beyond(span, end))
        if _beyond(span, furthest) > room:
            yield serious(
                "beyond-flown",
                f"The simulated run takes {span.state} to {in_unit(f'{furthest:.3g}', span.unit)}, and the flights"
                f" went from {span.low:.3g} to {span.high:.3g}: the twin was not learnt there, and its band does not"
                " know how wrong it may be. Fly nearer first.",
            )


def _beyond(span: Span, value: float) -> float:
    return max(span.low - value, value - span.high)
