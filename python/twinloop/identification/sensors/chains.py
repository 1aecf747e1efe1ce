"""Which states an output of a model drives: a state, its integral, the integral of that."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from twinloop._ground.arrays import Floats, at_least_zero
from twinloop.errors import unknown
from twinloop.law.forms import DERIVATIVES, FORMS
from twinloop.law.noise import renewed_form
from twinloop.records import Record, Recorded
from twinloop.signals import Signals


class Motion(NamedTuple):
    """What disturbs a chain.

    Args:
        white: variance of a white disturbance, per second (per period for increments).
        correlated: variance of a correlated one, such as gusts.
        correlation_time: after which that is forgotten to 1/e, s.
    """

    white: float
    correlated: float
    correlation_time: float


QUIET = Motion(0.0, 0.0, 1.0)
"""Nothing disturbs."""


@dataclass(frozen=True, eq=False)
class Chain(Recorded, kind="chain"):
    """The states behind one output, and the noise of their sensors and of their motion.

    Args:
        states: the driven one first, then its integral, and so on.
        output: number of the output of the program that drives them; None where other states do (an angle of a
            rigid body).
        form: what the output means, and with it how the states move one another.
        sensors: variance of each state's sensor, in its unit squared.
        rough: variance of each state's readings about a polynomial through neighbours: the sensor's or more.
        motion: what disturbs the driven one.
        moved: variance of all that moves the driven one, by which large coefficients are priced; infinite: they are
            not.
    """

    states: tuple[int, ...]
    output: int | None
    form: str
    sensors: Floats
    rough: Floats
    motion: Motion = QUIET
    moved: float = math.inf

    VERSION = 3

    @classmethod
    def _read(cls, record: object, where: str, given: tuple[object, ...]) -> Chain:
        found = super()._read(record, where, given)
        if found.form not in FORMS:
            raise unknown(f"form in the record {where}", found.form[:60], FORMS)
        for name in ("sensors", "motion"):
            for size in getattr(found, name):
                at_least_zero(f"Record {where}.{name}", size)
        return found

    @classmethod
    def renewed(cls, record: Record) -> Record:
        """A record of the first version, in which disturbances had no names, or of the second, which knew two forms."""
        found, motion = dict(record), record.get("motion")
        if isinstance(motion, list) and len(motion) == len(Motion._fields):
            found["motion"] = dict(zip(Motion._fields, motion, strict=True))
        integrated = found.pop("integrated", None)
        if isinstance(integrated, bool):
            found["form"] = renewed_form(integrated)
        return found

    @property
    def integrated(self) -> bool:
        """Whether the output is a derivative, not an increment."""
        return self.form in DERIVATIVES

    def with_noise(self, sensors: Floats, motion: tuple[float, float, float]) -> Chain:
        """The same states with other noise."""
        return replace(self, sensors=np.asarray(sensors, dtype=np.float64), motion=Motion(*motion))

    @property
    def engine(self) -> tuple[list[int], list[float], Motion, str]:
        """The same for the native engine."""
        return list(self.states), self.sensors.tolist(), self.motion, self.form


def chains(signals: Signals, form: str, sensors: Floats) -> list[Chain]:
    """Chains of a form, those without an output last.

    Args:
        signals: of the system.
        form: one of those of a law.
        sensors: a first guess of each sensor's variance (n_x,).

    Returns:
        Every state is in one of them.
    """
    if form not in DERIVATIVES:
        return [Chain((i,), i, form, sensors[[i]], sensors[[i]]) for i in range(signals.n_x)]
    driven, given = [], []
    names = signals.state_names
    seen: set[int] = set()
    for output, first in enumerate(signals.driven):
        states = [first]
        parent = signals.states[first].derivative_of
        while parent is not None and len(states) < 4:
            states.append(names.index(parent))
            parent = signals.states[states[-1]].derivative_of
        seen.update(states)
        driven.append(Chain(tuple(states), output, form, sensors[states], sensors[states]))
    for i in range(signals.n_x):
        if i not in seen:
            given.append(Chain((i,), None, form, sensors[[i]], sensors[[i]]))
    return [*driven, *given]


def stirred(given: Sequence[Chain], driven: Sequence[Chain], signals: Signals) -> list[Chain]:
    """Angles that body rates turn, moved by what disturbs their rates within a period.

    A rate that a disturbance changes by Δω in a period has turned its angle by half of that more than the rate at the
    beginning says. An observer that took the angle for certain would let it drift from its readings, and constants that
    are tuned on its predictions would take the blame. A slow disturbance adds up over the periods: it counts by its
    spectral density at rest.

    Args:
        given: chains of angles that other states drive.
        driven: chains with outputs, with what disturbs them.
        signals: of the system.

    Returns:
        The angles' chains, for an observer alone: what disturbs rates moves their angles in a simulation by itself.
    """
    body, names = signals.kinematics, signals.state_names
    if body is None:
        return list(given)
    motions = {names[chain.states[0]]: chain.motion for chain in driven}
    of = {names.index(angle): motions.get(rate) for angle, rate in zip(body.angles, body.rates, strict=True)}
    found = []
    for chain in given:
        motion = of.get(chain.states[0])
        if motion is not None:
            density = motion.white / 3.0 + motion.correlated * motion.correlation_time / 2.0
            white = max(chain.motion.white, signals.dt * signals.dt * density)
            chain = replace(chain, motion=chain.motion._replace(white=white))
        found.append(chain)
    return found
