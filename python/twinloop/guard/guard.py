"""A controller that is watched while it flies, and replaced by a fallback before it does harm."""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twinloop._experiment.envelope import outside, usages_of
from twinloop._experiment.limits import Limits
from twinloop._ground.arrays import Floats, at_least_zero, floats, number
from twinloop._ground.texts import in_unit
from twinloop.controllers import Controller
from twinloop.errors import InvalidInput
from twinloop.guard.ahead import Ahead
from twinloop.guard.band import BandWatch
from twinloop.guard.rounded import RoundedWatch
from twinloop.guard.sensors import SensorWatch
from twinloop.guard.standby import Standby, safe
from twinloop.law.twin import Twin
from twinloop.test import Test
from twinloop.trajectory import Trajectory
from twinloop.unmeasured import Differences, completed_state, or_measured, sources

HORIZON = 0.2
"""Share of a test's length that is looked ahead where no horizon is given."""
CERTAIN = 2
"""Periods in a row in which the committee must see the flight leave: noise of one reading ends no flight."""


class Guard:
    """A test's controller with supervision: `reset()`, then `command(state, target)` once per period.

    Each period it checks, in this order: the reading is one that can be, and not frozen; the period is not too long;
    the reading is inside the envelope; the readings agree with the twin's band; no member of the committee, under the
    test's own controller and excitation, leaves the envelope within the horizon. At the first failed check, or if a
    check or the controller raises an error, it has *tripped*: from then on it sends the fallback's commands, and
    `trajectory` has the flight up to there.

    For the fallback, a reading that cannot be trusted is replaced by the twin's prediction from the previous reading,
    as long as that is so: sensors are watched after the trip, too, and one that reads again is believed again.
    Until the guard trips a fallback with a memory runs along on the readings that can be trusted, with its answers
    discarded, so that it takes over a steady load. With `reset()` it begins from rest.

    Args:
        test: to fly.
        fallback: a controller for the same signals, whose `command` is called in each period, before the guard trips,
            too; or a command that is safe to hold (n_u,), in its units and within its bounds.
        twin: for the prediction and the band; None: only readings, envelope and clock are checked.
        flown: flights so far with their tests, on which the band is checked, and which say, where there is no twin, how
            long a sensor repeats itself.
        horizon: of the prediction, s, rounded up to whole periods; 0: none of the flight's leaving, of missing readings
            alone. None: a fifth of the test.
        false_alarms: share of flights that the check of the band ends without cause, by the committee's own
            prediction.
        overrun: share of the period by which a period may be late.
        clock: gives the time in s; None: time is not checked, as in a simulation.
        limits: of runs; a reading that they let nobody record is none. None: the usual ones.

    Raises:
        InvalidInput: arguments that do not fit each other.
        NotAvailable: a law in Python, whose memory cannot be predicted; pass horizon=0.
    """

    def __init__(
        self,
        test: Test,
        fallback: Controller | ArrayLike,
        *,
        twin: Twin | None = None,
        flown: Sequence[tuple[Test, Trajectory]] = (),
        horizon: float | None = None,
        false_alarms: float = 0.01,
        overrun: float = 0.5,
        clock: Callable[[], float] | None = time.monotonic,
        limits: Limits | None = None,
    ) -> None:
        self.test = test
        self.signals = test.family.signals
        n_x, n_u = self.signals.n_x, self.signals.n_u
        self.fallback = fallback
        dt = self.signals.dt
        length = HORIZON * test.steps * dt if horizon is None else horizon
        self.horizon = _periods(at_least_zero("Guard, horizon (s)", length), dt)
        self.overrun = at_least_zero("Guard, overrun (share of the period)", overrun)
        share = number("Guard, false_alarms (share of flights)", false_alarms, above=0.0)
        if share >= 1.0:
            raise InvalidInput(f"Guard, false_alarms: expected a share below 1, found {share:g}.")
        self.clock = clock
        bounds = [
            (-np.inf, np.inf) if state.envelope is None else state.envelope for state in self.signals.states
        ]
        # A periodic state turns up at any number of turns; those around the middle are those that the bounds mean.
        self._middle = np.array([0.0 if np.isinf(low) else 0.5 * (low + high) for low, high in bounds])
        self._half = np.array([0.5 * (high - low) for low, high in bounds])
        self._ahead = Ahead.of(test, twin, bounds, leaving=self.horizon > 0)
        drawn = twin is not None and twin.members and twin.noise is not None
        self._band = BandWatch(twin, test, share, flown) if twin is not None and drawn else None
        limits = Limits(self.signals) if limits is None else limits
        known = [flight for _, flight in flown] if twin is None else twin.flights
        noise = None if twin is None or twin.noise is None else twin.noise.sensors
        banded = self._band is not None
        self._sensors = SensorWatch(limits.readings, known, self.signals.measured, banded, noise)
        self._rounded: RoundedWatch | None = None
        if twin is not None and self._sensors.limit is not None and self._sensors.pitches.any():
            self._rounded = RoundedWatch(twin, self._sensors.pitches, self._sensors.limit)
        self._controller = test.controller()
        self._differences, self._rates = Differences(self.signals), sources(self.signals)
        self._states = np.empty((test.steps + 1, n_x))
        self._commands = np.empty((test.steps, n_u))
        self.reset()

    @property
    def fallback(self) -> Controller | Floats:
        """What commands once the guard has tripped; another one may be given before a flight."""
        return self._fallback

    @fallback.setter
    def fallback(self, fallback: Controller | ArrayLike) -> None:
        self._fallback = found = safe(fallback, self.signals)
        self._standby = Standby(found, self.test) if isinstance(found, Controller) else None

    def reset(self) -> None:
        """Clears the memory; call it at the start of every flight."""
        self.period = 0
        self.tripped = False
        self.reason = ""
        self.tripped_at: int | None = None
        self._leaving = 0
        self._read: Floats | None = None
        self._time: float | None = None
        self._broken = np.zeros(self.signals.n_x, bool)
        self._estimate: Floats | None = None
        self._controller.reset()
        self._differences.reset()
        self._sensors.reset()
        if self._standby is not None:
            self._standby.reset()
        self._ahead.reset()
        if self._band is not None:
            self._band.reset()

    def command(self, state: ArrayLike, target: ArrayLike) -> Floats:
        """The command for the coming period.

        Args:
            state: reading (n_x,), SI units, radians; NaN for a missing value. Or of those states alone that are
                measured.
            target: target state (n_x,), the same units; one that is not finite trips, and that of the test counts.

        Returns:
            Command (n_u,), within its bounds: the test's, or the fallback's once the guard has tripped.

        Raises:
            InvalidInput: other shapes; and what the fallback raises, if it is a controller in Python.
        """
        try:
            # What a mask hides is missing.
            reading = np.array(np.ma.filled(np.ma.asarray(state, dtype=np.float64), np.nan))
        except (TypeError, ValueError) as reason:
            raise InvalidInput(
                f"Guard.command, state: expected numbers, found {reason}; pass NaN for a missing one."
            ) from reason
        reading = self._differences.completed(reading)
        if reading.shape != (self.signals.n_x,):
            raise InvalidInput(
                f"Guard.command, state: expected {self.signals.n_x} numbers{or_measured(self.signals)}, found shape"
                f" {reading.shape}."
            )
        if not self.tripped:
            # Whatever it trips on, the record ends with what was read then.
            self._read = reading.copy()
        goal = self._goal(target)
        own = None
        if not self.tripped:
            with self._tripping("a check"):
                self._watch(reading)
        else:
            self._untrusted(reading)
        reading = self._believed(reading)
        if not self.tripped:
            with self._tripping("the controller"):
                own = self._controller.command(reading, goal)
        if own is not None:
            command = own
            if self.period <= self.test.steps:
                self._states[self.period] = reading
            if self.period < self.test.steps:
                self._commands[self.period] = command
            if self._standby is not None:
                self._standby.follow(reading, goal)
        elif self._standby is not None:
            command = self._standby.command(reading, goal, self._broken)
        else:
            command = np.array(self.fallback, dtype=np.float64)
        next_one = self._ahead.following(reading, command)
        # Flown blind for long a twin may diverge: then the last reading that was believed is the better guess.
        self._estimate = (
            reading
            if next_one is None
            else np.where(np.abs(next_one) <= self._sensors.farthest, next_one, reading)
        )
        self._ahead.sent(reading, goal, command)
        self.period += 1
        return command

    @property
    def recorded(self) -> int:
        """Periods of the flight so far that a record can hold, up to where it has tripped.

        What it tripped on may be no reading: then the flight ends a period sooner.
        """
        if self.tripped_at is None or self.tripped_at > self.test.steps:
            return min(self.period, self.test.steps)
        return self.tripped_at if self._last is not None else max(0, self.tripped_at - 1)

    def trajectory(self, last: ArrayLike | None = None) -> Trajectory:
        """The flight: complete, or until the guard tripped, with the reason.

        If not even the first reading could be used, it has no period, and its only state is the start of the test.

        Args:
            last: the reading after the last command of the test (n_x,); needed unless the guard has tripped, or has
                seen it because it was asked for further commands.

        Returns:
            A run of even periods; `ended` is "aborted" if the guard tripped in the test, or if the loop ended before
            the test did.

        Raises:
            InvalidInput: `last` is missing; or it is given though the test ended periods ago.
        """
        dt, steps = self.signals.dt, self.test.steps
        ended_at = self.tripped_at if self.tripped_at is not None and self.tripped_at <= steps else None
        n = self.recorded
        if ended_at is not None and self._last is not None:
            last = self._last
        elif ended_at is not None:
            last = self._states[n] if ended_at else self.test.initial_state
        elif self.period > steps:
            if last is not None and not self.tripped:
                raise InvalidInput(
                    f"Guard.trajectory: expected no reading, for the test of {steps} periods ended"
                    f" {self.period - steps} periods ago, found one; leave it out, and call reset() before each flight."
                )
            last = self._states[steps]
        elif last is None:
            raise InvalidInput(
                "Guard.trajectory: expected the reading after the last command, found none; pass it, or end the flight"
                " first."
            )
        states = self._states[: n + 1].copy()
        # Whoever asks again is told the same: the memory of the flight does not move on.
        reading = copy.copy(self._differences).completed(np.asarray(last, dtype=np.float64))
        states[n] = floats("Guard, last reading", reading, (self.signals.n_x,))
        if ended_at is not None:
            ended, reason = "aborted", self.reason
        elif n < steps:
            ended, reason = "aborted", f"the loop ended after {n} of {steps} periods"
        else:
            ended, reason = "completed", ""
        return Trajectory(
            dt * np.arange(n + 1, dtype=np.float64), states, self._commands[:n].copy(), ended, reason
        )

    # Inside

    @property
    def _last(self) -> Floats | None:
        """What was read last before it tripped; None where that is no reading."""
        return None if self._read is None or self._sensors.missing(self._read).any() else self._read

    def _watch(self, reading: Floats) -> None:
        """Trips on the first thing that is wrong."""
        states = self.signals.states
        missing, wrong = self._sensors.missing(reading), self._untrusted(reading)
        if wrong.any():
            i = int(np.argmax(wrong))
            if not missing[i]:
                what = "has not changed in its last bit for too long"
            elif not np.isfinite(reading[i]):
                what = "is not a finite number"
            else:
                what = f"cannot be: {in_unit(f'{reading[i]:.4g}', states[i].unit)}"
            return self._trip(f"the reading of {states[i].name} {what}")
        took = self._took()
        if took is not None and took < 0.0:
            return self._trip(
                f"the clock went back by {-took:.3g} s, and nobody knows how long the period took"
            )
        if took is not None and not took <= (1.0 + self.overrun) * self.signals.dt:
            return self._trip(f"a period took {took:.3g} s instead of {self.signals.dt:g} s")
        if outside(usages_of(self.signals, reading[np.newaxis])).any():
            used = np.abs(self.signals.difference(reading, self._middle)) / self._half
            i = int(np.argmax(used))
            return self._trip(
                f"{states[i].name} has left its envelope: {in_unit(f'{reading[i]:.4g}', states[i].unit)}"
            )
        if self._band is not None and self._band.alarms(reading):
            count = self._band.outside
            return self._trip(
                f"readings were outside of the twin's band for too long, {count} periods in a row now"
            )
        if self._rounded is not None and self._band is not None and self.period <= self.test.steps:
            # Outside of its band a reading is the band's affair.
            self._states[self.period] = reading
            flown = self._states[: self.period + 1], self._commands[: self.period]
            still = self._rounded.frozen(*flown, self._sensors.repeated)
            if still.any() and not self._band.outside:
                self._broken = self._with_rates(still)
                name = states[int(np.argmax(still))].name
                return self._trip(
                    f"the reading of {name} has not changed for too long, though by the twin it should have moved"
                )
        if self._ahead.committee is not None and self.period < self.test.steps:
            near = self.signals.continued(reading[np.newaxis], self._middle)[0]
            found = self._ahead.leaves(near, self.horizon)
            self._leaving = 0 if found is None else self._leaving + 1
            if found is not None and (self._leaving >= CERTAIN or found[0] < CERTAIN):
                seconds = found[0] * self.signals.dt
                return self._trip(f"{states[found[1]].name} would leave its envelope in {seconds:.3g} s")
        return None

    def _untrusted(self, reading: Floats) -> NDArray[np.bool_]:
        """States (n_x,) whose sensor gives nothing, what cannot be, or nothing new.

        One that was found frozen is so until it moves, and rates that are made of such readings are none either.
        """
        wrong = self._sensors.missing(reading) | self._sensors.frozen(reading)
        self._broken = self._with_rates(wrong | (self._broken & (self._sensors.repeated > 0)), self._broken)
        return wrong

    def _with_rates(
        self, broken: NDArray[np.bool_], before: NDArray[np.bool_] | None = None
    ) -> NDArray[np.bool_]:
        """The same with the rates that are computed of such readings, of this period or of the one before."""
        found = broken.copy()
        for rate, of in self._rates:
            found[rate] |= broken[of] or (before is not None and before[of])
        return found

    @contextmanager
    def _tripping(self, what: str) -> Iterator[None]:
        """Trips where a part fails, such as a law or a clock in Python: in the air an error helps nobody."""
        try:
            yield
        except Exception as failure:
            self._trip(f"{what} failed: {type(failure).__name__}: {failure}")

    def _goal(self, target: ArrayLike) -> Floats:
        """The target of a period; that of the test where what computes it in flight has failed."""
        values = np.asarray(target)
        if values.dtype.kind == "f" and values.ndim == 1 and not np.isfinite(values).all():
            if not self.tripped:
                self._trip("the target is not finite")
            target = np.where(np.isfinite(values), values, 0.0)
            completed_state("Guard.command, target", target, self.signals)  # refuses another number of them
            target = self.test.target(min(self.period, self.test.steps))
        return completed_state("Guard.command, target", target, self.signals)

    def _trip(self, why: str) -> None:
        self.tripped, self.tripped_at = True, self.period
        self.reason = f"guard, {self.period * self.signals.dt:.3g} s after the start: {why}"

    def _took(self) -> float | None:
        """How long the last period took, s; None where time is not checked, and before the first one."""
        if self.clock is None:
            return None
        now, before = self.clock(), self._time
        self._time = now
        return None if before is None else now - before

    def _believed(self, reading: Floats) -> Floats:
        """The reading, with the twin's prediction from the one before instead of readings that cannot be trusted."""
        if not self._broken.any():
            return reading
        before = self.test.initial_state if self._estimate is None else self._estimate
        return np.where(self._broken, before, reading)


def _periods(seconds: float, dt: float) -> int:
    """Periods that cover a time: one of any length that is not 0 has one."""
    periods = seconds / dt
    # 0.3 s are six periods of 0.05 s, whatever rounding adds to them.
    whole = round(periods)
    return whole if math.isclose(periods, whole, rel_tol=1e-9) else math.ceil(periods)
