"""Recorded commands: a twin flies them for the comparison with an attached run."""

from __future__ import annotations

from dataclasses import dataclass

from twinloop._ground.arrays import Floats, floats
from twinloop._ground.values import Value
from twinloop.errors import InvalidInput
from twinloop.signals import Signals
from twinloop.unmeasured import completed_state


@dataclass(frozen=True, eq=False)
class Replay(Value):
    """Recorded commands, sent without a controller.

    Args:
        signals: of the system.
        initial_state: of the run (n_x,), SI units, radians; at rest where it is not given of what is not measured.
        commands: at least one row (n, n_u), in their units, each held for a period and not clipped.
        anchors: states from which a run begins again (n + 1, n_x), NaN where it goes on; None: it never does. They come
            from readings, so what is drawn of the sensors' noise is added to them.

    Raises:
        InvalidInput: shapes that do not fit the signals, or numbers that are not finite.
    """

    signals: Signals
    initial_state: Floats
    commands: Floats
    anchors: Floats | None = None

    def __post_init__(self) -> None:
        state = completed_state("Replay.initial_state", self.initial_state, self.signals)
        commands = floats("Replay.commands", self.commands, (None, self.signals.n_u))
        if len(commands) == 0:
            raise InvalidInput("Replay.commands: expected at least one row, found none; give one a period.")
        object.__setattr__(self, "initial_state", state)
        object.__setattr__(self, "commands", commands)

    @property
    def steps(self) -> int:
        """Number of commands, n."""
        return len(self.commands)
