"""Taking a twin away: as what was asked for, checked on the flights that it was learnt from."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from twinloop._experiment.limits import Limits
from twinloop._ground.arrays import Floats
from twinloop.errors import NotTrusted
from twinloop.law.exports.augmented import augmented, begun
from twinloop.law.exports.export import Source, asked, delivered, exported
from twinloop.law.exports.gymnasium_source import Episode
from twinloop.law.exports.simulations import Simulation
from twinloop.law.law import Law
from twinloop.records import to_text
from twinloop.trajectory import Trajectory

if TYPE_CHECKING:
    from twinloop.law.twin import Twin

STEPPED = ("python", "c", "fmu3", "fmu2", "casadi", "control")
"""Kinds in which what motion fills is a state like others."""


def taken_twin(
    twin: Twin, to: str | Path, kind: str | None, precision: str, force: bool, episode: Episode | None
) -> str | tuple[Path, ...]:
    """The twin as `Twin.export` describes it."""
    chosen, path = asked(to, kind)
    if not force and not twin.follows:
        raise NotTrusted(
            "Export: expected a twin that follows the flights that it was learnt from, found one that does not"
            " follow half of them; learn from more tests, or pass --force (force=True in Python)."
        )
    law, flights = twin.law, list(twin.flights)
    if law.actuation.stored and law.form == "acceleration" and chosen in STEPPED:
        law, flights = augmented(law), [_with_stored(law, flight) for flight in flights]
    source = Source(
        law,
        _free_run(twin, law),
        flights,
        to_text(twin.to_record()) if chosen == "json" else "",
        not force,
        _first_flown(twin) if episode is None else episode,
    )
    name = "twin" if path is None else path.stem
    return delivered(exported(source, chosen, name, precision), name, path)


def _free_run(twin: Twin, law: Law) -> Simulation:
    """What an export is compared with: free runs of the twin, with what is stored if the law has that as states."""
    # Under recorded commands an unstable system goes far beyond its flights, which does not matter here.
    quiet = twin.without_flights
    if law is twin.law:
        return lambda state, commands: compared(law, quiet.simulate_commands(state, commands))
    n_x = twin.signals.n_x
    whole = type(twin)(law.model(), law.signals, limits=Limits(law.signals, twin.divergence_factor))

    def simulated(state: Floats, commands: Floats) -> Floats:
        found = compared(law, whole.simulate_commands(state, commands)).copy()
        own = compared(twin.law, quiet.simulate_commands(state[:n_x], commands))[: len(found), :n_x]
        found[: len(own), :n_x] = own
        return found[: len(own)]

    return simulated


def _with_stored(law: Law, flight: Trajectory) -> Trajectory:
    """A flight whose states begin with what a law stores at its start, and have nothing of it after that."""
    states = np.pad(flight.states, ((0, 0), (0, len(law.actuation.stored))))
    states[0] = begun(law, flight.states[0])
    return Trajectory(flight.t, states, flight.commands)


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
