"""Chirps that an autopilot makes by itself: what they are on a command, and the settings that ask for them.

ArduPilot (System ID mode, `Chirp::update`) and Betaflight (chirp mode, `chirpUpdate`, from 2025.12 on) sweep one axis
at a time, from one frequency to another in equal ratios. They differ in how they begin and end.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from twinloop._ground.arrays import Floats, number
from twinloop._ground.elementary import cos, exp, log, sin
from twinloop._ground.texts import text
from twinloop.autopilots.files import EVERY_NODE, FORMATS, Set
from twinloop.errors import InvalidInput, NotAvailable, unknown
from twinloop.signals import Signals
from twinloop.test import Test

SHORTEST = 8.0
"""Periods of a cycle at least: a command that is held cannot follow faster ones."""
DWELL = 2.0
"""Cycles that ArduPilot stays at the first frequency."""
CLOSE = 1e-9
"""Share of the amplitude by which an excitation may differ from a sweep."""
UNFILTERED = 30
"""Hz at which Betaflight's filter of the chirp leads and lags: where both are equal it does nothing."""
AXES: dict[str, dict[str, int]] = {
    "ardupilot": {
        **{f"angle {axis}": 1 + i for i, axis in enumerate(("roll", "pitch", "yaw"))},
        **{f"rate {axis}": 7 + i for i, axis in enumerate(("roll", "pitch", "yaw"))},
        **{f"mixer {axis}": 10 + i for i, axis in enumerate(("roll", "pitch", "yaw", "thrust"))},
    },
    "betaflight": {f"rate {axis}": i for i, axis in enumerate(("roll", "pitch", "yaw"))},
}
"""Where an autopilot adds its chirp, with the number that it knows the place by."""


@dataclass(frozen=True)
class Sweep:
    """A chirp on one command.

    Args:
        command: name of the command to which it is added.
        axis: input of the autopilot to which it is added: "rate roll", "mixer pitch", "angle yaw", …; the command
            must be that input.
        amplitude: in the unit of the command.
        first: frequency at the start, Hz.
        last: at the end, Hz, above the first.
        duration: s.
        fade_in: time over which it grows, s.
        fade_out: time over which it shrinks, s.
        scale: units of the autopilot for one of the command, such as 57.29578 for degrees.

    Raises:
        InvalidInput: numbers that are not finite or not in order.
    """

    command: str
    axis: str
    amplitude: float
    first: float
    last: float
    duration: float
    fade_in: float = 0.0
    fade_out: float = 0.0
    scale: float = 1.0

    def __post_init__(self) -> None:
        for name in ("command", "axis"):
            text(f"Sweep, {name}", getattr(self, name))
        for name in ("amplitude", "first", "duration", "scale"):
            object.__setattr__(self, name, number(f"Sweep, {name}", getattr(self, name), above=0.0))
        for name in ("last", "fade_in", "fade_out"):
            object.__setattr__(self, name, number(f"Sweep, {name}", getattr(self, name)))
        if not self.first < self.last or min(self.fade_in, self.fade_out) < 0.0:
            raise InvalidInput(
                f"Sweep: expected a last frequency above the first and no fading below 0 s, found {self.first:g} to"
                f" {self.last:g} Hz, {self.fade_in:g} and {self.fade_out:g} s; change them."
            )
        if self.fade_in + self.fade_out > self.duration:
            raise InvalidInput(
                f"Sweep: expected fading within {self.duration:g} s, found {self.fade_in:g} and {self.fade_out:g} s."
            )

    def excitation(self, kind: str, signals: Signals, steps: int) -> Floats:
        """The signal that the autopilot adds to the commands, at the start of each period; zero after its end.

        Args:
            kind: of the autopilot, "ardupilot" or "betaflight".
            signals: of the system.
            steps: of the test.

        Returns:
            (steps, n_u), in the commands' units, for `campaign.test(gains, excitation=…)`.

        Raises:
            InvalidInput: another autopilot or command, a flight that ends before the sweep, or one too fast for it.
        """
        self._settings(kind)  # what it cannot do it does not make
        if self.command not in signals.command_names:
            raise unknown("command of the sweep", self.command, signals.command_names)
        if steps * signals.dt < self.duration * (1.0 - 1e-12):
            raise InvalidInput(
                f"Sweep: expected a flight of at least {self.duration:g} s, found {steps * signals.dt:g} s; shorten the"
                " sweep."
            )
        if self.last > 1.0 / (SHORTEST * signals.dt):
            raise InvalidInput(
                f"Sweep, last: expected at most {1.0 / (SHORTEST * signals.dt):g} Hz, an eighth of the commands' rate,"
                f" found {self.last:g} Hz; lower it."
            )
        t = signals.dt * np.arange(steps, dtype=np.float64)
        added = np.zeros((steps, signals.n_u))
        made = {"ardupilot": self._ardupilot, "betaflight": self._betaflight}[kind](t)
        added[:, signals.command_names.index(self.command)] = np.where(
            t < self.duration, self.amplitude * made, 0.0
        )
        return added

    def settings(self, kind: str, test: Test) -> str:
        """The file of settings with which the autopilot generates the excitation of a test.

        Args:
            kind: of the autopilot.
            test: its excitation must be this sweep.

        Raises:
            InvalidInput: a sweep that the autopilot cannot make.
            NotAvailable: the test asks for another excitation.
        """
        signals = test.family.signals
        expected = self.excitation(kind, signals, test.steps)
        if (
            test.excitation is None
            or not (np.abs(test.excitation - expected) <= CLOSE * self.amplitude).all()
        ):
            raise NotAvailable(
                f"Chirp settings: expected a test that is excited by the declared sweep of {self.command} alone, found"
                f" {'none' if test.excitation is None else 'another excitation'}. {kind} sweeps one axis, in equal"
                " ratios of frequency; the planner's own chirps act on all commands at once. Send those from the table"
                " of commands, or make the test of the sweep: campaign.test(gains, excitation=sweep.excitation(…))."
            )
        heading = f"# A sweep of {self.axis} for test {test.number}.\n"
        return heading + FORMATS[kind].written(self._settings(kind), EVERY_NODE)

    # Inside

    def _ardupilot(self, t: Floats) -> Floats:
        """`Chirp::update`: it stays at the first frequency for two cycles, then sweeps, under a window."""
        dwell = DWELL / self.first
        slow, ratio = 2.0 * math.pi * self.first, _log(self.last / self.first)
        left = self.duration - dwell
        swept = np.where(
            t <= dwell, slow * (t - dwell), slow * left / ratio * (exp(ratio * (t - dwell) / left) - 1.0)
        )
        ending = self.duration - self.fade_out
        window = np.ones(len(t))
        if self.fade_out > 0.0:
            window = np.where(
                t > ending, 0.5 - 0.5 * cos(math.pi * (t - ending) / self.fade_out + math.pi), window
            )
        if self.fade_in > 0.0:
            window = np.where(t <= self.fade_in, 0.5 - 0.5 * cos(math.pi * t / self.fade_in), window)
        return np.asarray(np.where(t > 0.0, window * sin(swept), 0.0), dtype=np.float64)

    def _betaflight(self, t: Floats) -> Floats:
        """`chirpUpdate`: a cosine from the start, smaller below 1 Hz."""
        growth = _log(self.last / self.first) / self.duration
        frequency = self.first * exp(growth * t)
        phase = 2.0 * math.pi / growth * (frequency - self.first)
        return np.asarray(np.minimum(frequency, 1.0) * cos(phase), dtype=np.float64)

    def _settings(self, kind: str) -> Set:
        """Settings by name, with whether each is a whole number."""
        if kind not in AXES:
            raise InvalidInput(
                f"Chirp settings: expected an autopilot that makes chirps ({', '.join(AXES)}), found {kind!r}; send the"
                " table of commands."
            )
        if self.axis not in AXES[kind]:
            raise unknown(f"axis of {kind}", self.axis, AXES[kind])
        made: dict[str, Callable[[], Set]] = {
            "ardupilot": self._of_ardupilot,
            "betaflight": self._of_betaflight,
        }
        return made[kind]()

    def _of_ardupilot(self) -> Set:
        if self.duration <= DWELL / self.first:
            raise InvalidInput(
                f"Sweep, duration: expected more than {DWELL / self.first:g} s, the two cycles that ArduPilot stays at"
                f" the first frequency, found {self.duration:g} s; lengthen it."
            )
        rows = {
            "SID_MAGNITUDE": (self.amplitude * self.scale, 0.0, 1e6),
            "SID_F_START_HZ": (self.first, 0.01, 100.0),
            "SID_F_STOP_HZ": (self.last, 0.01, 100.0),
            "SID_T_FADE_IN": (self.fade_in, 0.0, 20.0),
            "SID_T_REC": (self.duration, 0.0, 255.0),
            "SID_T_FADE_OUT": (self.fade_out, 0.0, 5.0),
        }
        found: Set = {"SID_AXIS": (AXES["ardupilot"][self.axis], True)}
        return found | {name: (_within(name, *row), False) for name, row in rows.items()}

    def _of_betaflight(self) -> Set:
        if self.fade_in or self.fade_out:
            raise InvalidInput(
                f"Sweep, fading: expected none, because Betaflight's chirp has none, found {self.fade_in:g} and"
                f" {self.fade_out:g} s; set them to 0."
            )
        rows = {
            "chirp_frequency_start_deci_hz": (10.0 * self.first, 1, 10_000),
            "chirp_frequency_end_deci_hz": (10.0 * self.last, 1, 10_000),
            "chirp_time_seconds": (self.duration, 1, 255),
        }
        own = f"chirp_amplitude_{self.axis.split()[1]}"
        found: Set = {f"chirp_amplitude_{axis}": (0, True) for axis in ("roll", "pitch", "yaw")}
        found[own] = _whole(own, self.amplitude * self.scale, 1, 500), True
        found |= {name: (_whole(name, *row), True) for name, row in rows.items()}
        return found | {f"chirp_{which}_freq_hz": (UNFILTERED, True) for which in ("lag", "lead")}


def _log(value: float) -> float:
    return float(np.asarray(log(np.array([value])))[0])


def _within(name: str, value: float, low: float, high: float) -> float:
    if not low <= value <= high:
        raise InvalidInput(
            f"Setting {name}: expected {low:g} to {high:g}, found {value:g}; change the sweep."
        )
    return value


def _whole(name: str, value: float, low: int, high: int) -> int:
    found = round(value)
    if abs(found - value) > 1e-6 or not low <= found <= high:
        raise InvalidInput(
            f"Setting {name}: expected a whole number from {low} to {high}, found {value:g}; change the sweep."
        )
    return found
