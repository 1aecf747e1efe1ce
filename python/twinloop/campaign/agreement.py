"""Agreement: whether a campaign file still says what the campaign of a store was begun with."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from twinloop._ground.arrays import Floats
from twinloop.campaign.campaign import Campaign
from twinloop.campaign.campaign_file import SIGNALS, WHOLE, read_file, read_signals, said_in
from twinloop.campaign.keeping import as_begun, check_setup
from twinloop.controllers import UnboundFamily
from twinloop.errors import InvalidInput
from twinloop.signals import Signals
from twinloop.test import Test
from twinloop.trajectory import Trajectory


def check_agreement(path: Path, known: Campaign, store: str, name: str) -> None:
    """Refuses a campaign file that says something else than the campaign was begun with, as `ask` does.

    A system of the file is not made, for that may run code and open a port: what the file leaves to its system is what
    the store has. Of a file that is no whole campaign file, such as one of an autopilot alone, only signals are
    compared.

    Args:
        path: of the file.
        known: the campaign as its store has it.
        store: what messages call the store.
        name: of the campaign in its store.

    Raises:
        InvalidInput: they differ, or the file cannot be read.
    """
    said = said_in(path)
    if "system" in said or said >= set(WHOLE):
        task = known.setup
        begun = Begun(
            known.signals,
            task.controller,
            task.initial_state,
            task.target_state,
            task.steps * known.signals.dt,
        )
        read_file(path, begun).check(known, store, name)
    elif said >= set(SIGNALS):
        signals, _ = read_signals(path)
        check_setup(known.setup, dataclasses.replace(known.setup, signals=signals), as_begun(store, name))


@dataclass(frozen=True, eq=False)
class Begun:
    """Stands in for the system of a file: what it said when the campaign was begun.

    Args:
        signals: of the system.
        controller: family of its controllers.
        initial_state: where every test starts (n_x,).
        target_state: where every test should end (n_x,), or a row for each state (steps + 1, n_x).
        duration: of a test, s.
        default_gains: of its first test; none, for nobody typed them.
    """

    signals: Signals
    controller: UnboundFamily
    initial_state: Floats
    target_state: Floats
    duration: float
    default_gains: Mapping[str, float] = field(default_factory=dict)

    def run(self, test: Test) -> Trajectory:
        """Flies nothing.

        Raises:
            InvalidInput: always.
        """
        raise InvalidInput("A system that is only compared: expected no test to fly, found one.")
