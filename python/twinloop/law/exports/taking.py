"""Taking a twin away: as what was asked for, checked on the flights that it was learnt from."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from twinloop._ground.arrays import Floats
from twinloop.errors import NotAvailable
from twinloop.law.exports.export import Source, asked, delivered, exported
from twinloop.law.exports.gymnasium_source import Episode
from twinloop.law.law import Law
from twinloop.records import to_text
from twinloop.trajectory import Trajectory

if TYPE_CHECKING:
    from twinloop.law.twin import Twin


def taken_twin(
    twin: Twin, to: str | Path, kind: str | None, precision: str, force: bool, episode: Episode | None
) -> str | tuple[Path, ...]:
    """The twin as `Twin.export` describes it."""
    chosen, path = asked(to, kind)
    if not force and not twin.follows:
        raise NotAvailable(
            "Export: expected a twin that follows the flights that it was learnt from, found one that does not"
            " follow half of them; learn from more tests, or pass force=True (--force)."
        )
    # Under recorded commands an unstable system goes far beyond its flights, which does not matter here.
    quiet = twin.without_flights
    source = Source(
        twin.law,
        lambda state, commands: compared(twin.law, quiet.simulate_commands(state, commands)),
        twin.flights,
        to_text(twin.to_record()) if chosen == "json" else "",
        not force,
        _first_flown(twin) if episode is None else episode,
    )
    name = "twin" if path is None else path.stem
    return delivered(exported(source, chosen, name, precision), name, path)


def compared(law: Law, run: Trajectory) -> Floats:
    """What an export is compared with: true states, and beside them what is read where a sensor is late.

    Args:
        law: of the twin.
        run: of it.
    """
    states = run.states if run.true_states is None else run.true_states
    return np.hstack([states, run.states]) if any(law.offsets) else states


def _first_flown(twin: Twin) -> Episode:
    """What an environment of Gymnasium begins with where nobody says it."""
    rest = np.zeros(twin.signals.n_x)
    if not twin.flights:
        return Episode(rest, rest, 100, twin.limits)
    first = twin.flights[0]
    return Episode(twin.began(first), rest, max(1, first.steps), twin.limits)
