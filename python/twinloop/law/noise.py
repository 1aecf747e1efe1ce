"""What a twin does not predict: noise of sensors, and disturbances, white and correlated."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np

from twinloop import _core
from twinloop._ground.arrays import Floats, at_least_zero, number
from twinloop._ground.elementary import exp
from twinloop.law.reports import Reports, given
from twinloop.records import Record, Recorded


class CorrelatedDisturbance(NamedTuple):
    """A disturbance that is forgotten slowly, such as a gust: a Gauss-Markov process of the first order.

    Args:
        states: that it drives: the first one, then its integral, and so on.
        form: what it is: as an output of a law of this form, a derivative of the first one, or what is added to it in a
            period.
        sd: its standard deviation, in the unit of the first state, a second where it is a derivative.
        correlation_time: after which 1/e of it is left, s.
    """

    states: tuple[int, ...]
    form: str
    sd: float
    correlation_time: float


@dataclass(frozen=True, eq=False)
class Noise(Recorded, kind="noise"):
    """The noise that a twin does not predict.

    Args:
        sensors: standard deviation of each state's sensor (n_x,), in its unit.
        moves: standard deviation of the white disturbance of each state per period (n_x,), in its unit.
        correlated: correlated disturbances.
        dt: period, s.
    """

    sensors: Floats
    moves: Floats
    correlated: tuple[CorrelatedDisturbance, ...] = ()
    dt: float = 1.0

    VERSION = 3
    RENAMED: ClassVar[Mapping[str, str]] = {"lasting": "correlated"}

    @classmethod
    def _read(cls, record: object, where: str, given: tuple[object, ...]) -> Noise:
        found = super()._read(record, where, given)
        for name in ("sensors", "moves"):
            for size in getattr(found, name).ravel().tolist():
                at_least_zero(f"Record {where}.{name}", size)
        for i, each in enumerate(found.correlated):
            at_least_zero(f"Record {where}.correlated[{i}].sd", each.sd)
            number(f"Record {where}.correlated[{i}].correlation_time", each.correlation_time, above=0.0)
        number(f"Record {where}.dt", found.dt, above=0.0)
        return found

    @classmethod
    def renewed(cls, record: Record) -> Record:
        """A record of the first version, which called a correlation time a memory, or of one that knew two forms."""
        found = super().renewed(record)
        if isinstance(found.get("correlated"), list):
            found["correlated"] = [
                _renewed_disturbance(each) if isinstance(each, dict) else each for each in found["correlated"]
            ]
        return found

    @staticmethod
    def of_sensors(sensors: Floats) -> Noise:
        """Of sensors alone (n_x,); nothing disturbs the system."""
        return Noise(sensors, np.zeros_like(sensors))

    def without(self, states: Collection[int]) -> Noise:
        """The same without the correlated disturbances that drive some states."""
        return replace(
            self, correlated=tuple(each for each in self.correlated if each.states[0] not in states)
        )

    def calmer(self, states: Collection[int]) -> Noise:
        """The same without the white disturbances of some states."""
        return replace(
            self, moves=np.where(np.isin(np.arange(len(self.moves)), list(states)), 0.0, self.moves)
        )

    def drawn(self, draws: int, steps: int, stream: _core.Stream, reports: Reports) -> tuple[Floats, Floats]:
        """Draws of sensor noise, as it is given (draws, steps + 1, n_x), and of disturbances (draws, steps, n_x)."""
        noise = given(reports, self.sensors * stream.normals(draws, steps + 1, len(self.sensors)))
        return noise, self.disturbance(draws, steps, stream)

    def disturbance(self, draws: int, steps: int, stream: _core.Stream) -> Floats:
        """Draws of disturbances of the states (draws, steps, n_x)."""
        added = self.moves * stream.normals(draws, steps, len(self.moves))
        for states, form, size, time in self.correlated:
            kept = float(exp(-self.dt / time))
            fresh = stream.normals(draws, steps)
            gust = np.empty((draws, steps))
            gust[:, 0] = fresh[:, 0]
            for k in range(1, steps):
                gust[:, k] = kept * gust[:, k - 1] + np.sqrt(1.0 - kept * kept) * fresh[:, k]
            for state, reach in zip(states, reaches(form, self.dt, len(states)), strict=True):
                added[:, :, state] += reach * size * gust
        return added


def reaches(form: str, dt: float, count: int) -> list[float]:
    """How far each state of a chain is moved by what drives it, at 1 for a period.

    Args:
        form: what drives it means.
        dt: period, s.
        count: number of states, the driven one first, then its integral, and so on.
    """
    found, reach = [], 1.0
    for i in range(count):
        if form == "acceleration":
            reach *= dt / (i + 1)
        elif form == "semi-implicit-euler":
            reach *= dt
        else:
            # Only the driven one goes on by it within the period.
            reach = (dt if form == "explicit-euler" else 1.0) if i == 0 else 0.0
        found.append(reach)
    return found


def renewed_form(integrated: bool) -> str:
    """What a record means that says only whether something is a derivative.

    Args:
        integrated: what it says.
    """
    return "acceleration" if integrated else "increment"


def _renewed_disturbance(record: Record) -> Record:
    found = {"correlation_time" if key == "memory" else key: value for key, value in record.items()}
    integrated = found.pop("integrated", None)
    return {**found, "form": renewed_form(integrated)} if isinstance(integrated, bool) else found
