"""Where a simulated run counts as diverged, made once and handed on to whatever flies."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats
from twinloop._ground.values import Value
from twinloop.signals import Signals

DIVERGENCE_FACTOR = 10.0
"""Multiple of a state's scale beyond which a run counts as diverged, where nobody says another one."""


@dataclass(frozen=True, eq=False)
class Limits(Value):
    """Signals, and how far from 0 their states may get in a simulated run.

    Args:
        signals: of the system.
        divergence_factor: multiple of a state's scale beyond which a run counts as diverged, above 0.

    Raises:
        InvalidInput: a factor that is no number above 0.
    """

    signals: Signals
    divergence_factor: float = DIVERGENCE_FACTOR

    def __post_init__(self) -> None:
        _ = self.engine  # the engine refuses now rather than at the first flight

    @cached_property
    def engine(self) -> _core.Limits:
        """The same for the native engine."""
        return _core.Limits(self.signals.engine, self.divergence_factor)

    @cached_property
    def states(self) -> Floats:
        """Magnitude of each state (n_x,), SI units, radians; infinite for a periodic one."""
        scales = [np.inf if state.periodic else state.scale for state in self.signals.states]
        return self.divergence_factor * np.array(scales)

    @cached_property
    def readings(self) -> Floats:
        """Magnitude (n_x,) beyond which no reading is recorded; infinite for a periodic one.

        Twice that of the states: noise may carry the last reading of a run that was stopped in time past the limit.
        """
        return 2.0 * self.states

    def setting(self, family: _core.Family) -> _core.Setting:
        """What the native engine flies controllers in.

        Args:
            family: of the controllers, as the engine knows it.

        Raises:
            InvalidInput: it is for other signals.
        """
        return _core.Setting(self.engine, family)
